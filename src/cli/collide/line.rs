//! One event as one line of JSON.

use kinora::{
    collide::{ContactEvent, ContactPhase},
    glam::DVec3,
};
use serde::Serialize;

use crate::cli::error::CliError;

/// An event and what names it.
pub(super) struct Line<'a> {
    pub(super) frame: u64,
    pub(super) time_s: f64,
    pub(super) event: &'a ContactEvent,
    /// Node path, part of the mesh and copy of every part.
    pub(super) paths: &'a [(String, u32, Option<u32>)],
    /// Only with `--continuous`; `None` for the end of a contact.
    #[expect(clippy::option_option, reason = "left out, or null")]
    pub(super) toi_s: Option<Option<f64>>,
}

#[derive(Serialize)]
struct Place<'a> {
    node: &'a str,
    part: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    copy: Option<u32>,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Triangles {
    Count(usize),
    Pair([u32; 2]),
}

#[derive(Serialize)]
struct Json<'a> {
    frame: u64,
    time_s: f64,
    kind: &'static str,
    a: Place<'a>,
    b: Place<'a>,
    triangles: Triangles,
    point: [f64; 3],
    normal: [f64; 3],
    depth: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[expect(clippy::option_option, reason = "left out, or null")]
    toi_s: Option<Option<f64>>,
}

impl Line<'_> {
    /// Appends the line.
    pub(super) fn write(&self, out: &mut Vec<u8>) -> Result<(), CliError> {
        let event = self.event;
        let place = |i: usize| {
            let (node, part, copy) = &self.paths[event.parts[i].index()];
            Place { node, part: *part, copy: *copy }
        };
        let json = Json {
            frame: self.frame,
            time_s: self.time_s,
            kind: match event.phase {
                ContactPhase::Begin => "begin",
                ContactPhase::Persist => "persist",
                ContactPhase::End => "end",
            },
            a: place(0),
            b: place(1),
            triangles: event.triangles.map_or(Triangles::Count(event.count), Triangles::Pair),
            point: numbers(event.point),
            normal: numbers(event.normal),
            depth: event.depth,
            toi_s: self.toi_s,
        };
        serde_json::to_writer(&mut *out, &json).map_err(|e| CliError::failed(format!("JSON: {e}")))?;
        out.push(b'\n');
        Ok(())
    }
}

/// Without negative zeros.
fn numbers(v: DVec3) -> [f64; 3] {
    (v + DVec3::ZERO).to_array()
}
