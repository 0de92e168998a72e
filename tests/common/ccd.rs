//! The shared queries of continuous detection with exact truth.
#![allow(dead_code, reason = "each user takes its share")]

use std::{fs, path::Path};

use kinora::{
    collide::{Continuous, Impact},
    glam::DVec3,
};
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::ToPrimitive;
use serde_json::Value;

/// One query: corners at the start and at the end, and whether the two meet in between.
#[derive(Clone, Debug)]
pub(crate) struct Query {
    pub(crate) name: String,
    pub(crate) is_face: bool,
    pub(crate) start: [DVec3; 4],
    pub(crate) end: [DVec3; 4],
    pub(crate) meets: bool,
}

impl Query {
    pub(crate) fn ask(&self, settings: &Continuous) -> Option<Impact> {
        if self.is_face {
            settings.vertex_face(&self.start, &self.end)
        } else {
            settings.edge_edge(&self.start, &self.end)
        }
    }
}

fn coordinate(fields: &[&str]) -> f64 {
    let integer = |text: &str| text.trim().parse::<BigInt>().expect("an integer");
    let exact = BigRational::new(integer(fields[0]), integer(fields[1]));
    let value = exact.to_f64().expect("in range");
    assert_eq!(BigRational::from_float(value), Some(exact), "queries are exact in f64");
    value
}

/// Reads 8 rows a query; the truth is in column 7, or in `truth`.
fn read(file: &Path, is_face: bool, truth: Option<&[bool]>, out: &mut Vec<Query>) {
    let text = fs::read_to_string(file).expect("a readable file");
    let rows: Vec<(DVec3, Option<bool>)> = text
        .lines()
        .map(|line| {
            let fields: Vec<_> = line.split(',').collect();
            let [x, y, z] = [0, 2, 4].map(|i| coordinate(&fields[i..i + 2]));
            (DVec3::new(x, y, z), fields.get(6).map(|f| f.trim() == "1"))
        })
        .collect();
    assert!(!rows.is_empty() && rows.len().is_multiple_of(8), "{}: {} rows", file.display(), rows.len());
    for (i, rows) in rows.chunks_exact(8).enumerate() {
        let corner = |k: usize| rows[k].0;
        out.push(Query {
            name: format!("{} {i}", file.display()),
            is_face,
            start: std::array::from_fn(corner),
            end: std::array::from_fn(|k| corner(k + 4)),
            meets: truth.map_or_else(|| rows[0].1.expect("the truth"), |t| t[i]),
        });
    }
}

fn sorted(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut entries: Vec<_> = fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    entries.sort();
    entries
}

/// Every query under `assets/ccd`.
pub(crate) fn queries(shared: &Path) -> Vec<Query> {
    let ccd = shared.join("assets/ccd");
    let mut out = Vec::new();
    for scene in sorted(&ccd.join("sample-queries")).into_iter().filter(|p| p.is_dir()) {
        for (kind, is_face) in [("vertex-face", true), ("edge-edge", false)] {
            for file in sorted(&scene.join(kind)) {
                read(&file, is_face, None, &mut out);
            }
        }
    }
    for scene in sorted(&ccd.join("scalable")).into_iter().filter(|p| p.is_dir()) {
        for file in sorted(&scene.join("queries")) {
            let stem = file.file_stem().and_then(|s| s.to_str()).expect("a name").to_owned();
            let truth = fs::read_to_string(scene.join("mma_bool").join(format!("{stem}_mma_bool.json")));
            let truth: Value = serde_json::from_str(&truth.expect("the truth")).expect("JSON");
            let truth: Vec<bool> = truth.as_array().expect("a list").iter().map(|v| v == true).collect();
            read(&file, stem.ends_with("vf"), Some(&truth), &mut out);
        }
    }
    out
}
