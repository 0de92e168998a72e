//! The tables' columns, and typed rows that become cells.

use crate::{
    accel::AccelStats,
    report::{
        Cell, Column, RayClass, Role, Table,
        measure::{Counts, Samples},
    },
};

const BUILD: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("triangles", "triangles", Role::Note, 0),
    Column::new("build_ms", "build [ms]", Role::Sooner, 2),
    Column::new("build_spread", "± [%]", Role::Note, 0),
    Column::new("node_bytes_per_triangle", "node bytes a triangle", Role::Less, 1),
    Column::new("bytes_per_triangle", "bytes a triangle", Role::Less, 1),
    Column::new("nodes", "nodes", Role::Less, 0),
    Column::new("leaves", "leaves", Role::Note, 0),
    Column::new("depth", "depth", Role::Less, 0),
    Column::new("sah_cost", "SAH cost", Role::Less, 1),
    Column::new("refit_ms", "refit [ms]", Role::Sooner, 3),
    Column::new("refit_spread", "± [%]", Role::Note, 0),
    Column::new("motion", "motion", Role::Note, 0),
    Column::new("decay", "decay", Role::Note, 3),
    Column::new("refit_differences", "differences after refit", Role::Less, 0),
    Column::new("note", "note", Role::Note, 0),
];

const RAYS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("rays", "rays", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("count", "rays cast", Role::Note, 0),
    Column::new("single_mrays_per_s", "single [Mrays/s]", Role::Faster, 3),
    Column::new("single_spread", "± [%]", Role::Note, 0),
    Column::new("packet_mrays_per_s", "packet [Mrays/s]", Role::Faster, 3),
    Column::new("packet_spread", "± [%]", Role::Note, 0),
    Column::new("nodes_per_ray", "nodes a ray", Role::Less, 2),
    Column::new("tests_per_ray", "triangles a ray", Role::Less, 2),
    Column::new("blocks_per_ray", "blocks a ray", Role::Less, 2),
    Column::new("steps_per_ray", "cells a ray", Role::Less, 2),
    Column::new("events_per_ray", "events a ray", Role::Less, 2),
    Column::new("skips_per_ray", "events skipped a ray", Role::Less, 2),
    Column::new("differences", "differences", Role::Less, 0),
];

const GROWTH: &[Column] = &[
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("triangles", "triangles", Role::Id, 0),
    Column::new("build_ms", "build [ms]", Role::Sooner, 2),
    Column::new("node_bytes_per_triangle", "node bytes a triangle", Role::Less, 1),
    Column::new("bytes_per_triangle", "bytes a triangle", Role::Less, 1),
    Column::new("total_bytes", "bytes", Role::Less, 0),
    Column::new("refit_ms", "refit [ms]", Role::Sooner, 3),
    Column::new("count", "rays cast", Role::Note, 0),
    Column::new("primary_ns", "primary ray [ns]", Role::Sooner, 0),
    Column::new("diffuse_ns", "diffuse ray [ns]", Role::Sooner, 0),
    Column::new("work_per_primary_ray", "work a primary ray", Role::Less, 1),
    Column::new("differences", "differences", Role::Less, 0),
    Column::new("peak_bytes", "peak of the process [bytes]", Role::Note, 0),
    Column::new("note", "note", Role::Note, 0),
];

/// A structure over one scene.
#[derive(Clone, Debug, Default)]
pub(super) struct BuildRow {
    pub(super) scene: String,
    pub(super) structure: String,
    pub(super) triangles: usize,
    pub(super) build: Samples,
    pub(super) stats: Option<AccelStats>,
    pub(super) refit: Samples,
    pub(super) motion: &'static str,
    pub(super) decay: Option<f64>,
    pub(super) refit_differences: Option<usize>,
    /// Broken invariants after build and refit.
    pub(super) violations: Vec<String>,
    pub(super) note: Option<String>,
}

/// A structure, a scene and a class of rays.
#[derive(Clone, Debug)]
pub(super) struct RayRow {
    pub(super) scene: String,
    pub(super) structure: String,
    pub(super) class: RayClass,
    pub(super) count: usize,
    pub(super) single: Samples,
    pub(super) packet: Samples,
    pub(super) counts: Counts,
    pub(super) differences: usize,
}

/// A structure at one size.
#[derive(Clone, Debug, Default)]
pub(super) struct GrowthRow {
    pub(super) structure: String,
    pub(super) triangles: usize,
    pub(super) build: Samples,
    pub(super) stats: Option<AccelStats>,
    pub(super) refit: Samples,
    pub(super) count: Option<usize>,
    pub(super) primary: Samples,
    pub(super) diffuse: Samples,
    pub(super) counts: Counts,
    pub(super) differences: Option<usize>,
    pub(super) violations: Vec<String>,
    pub(super) peak: Option<u64>,
    pub(super) note: Option<String>,
}

fn scaled(samples: &Samples, factor: f64) -> Cell {
    samples.median().map(|m| m * factor).into()
}

/// `bytes` over `triangles`; absent without triangles.
fn per_triangle(bytes: usize, triangles: usize) -> Cell {
    (triangles > 0).then(|| bytes as f64 / triangles as f64).into()
}

/// A count over its rays; absent when the structure does not do such a thing.
fn per_ray(counts: &Counts, count: u64) -> Cell {
    (count > 0).then(|| counts.per_ray(count)).into()
}

impl RayRow {
    /// Median rate in million rays a second.
    pub(super) fn rate(&self, samples: &Samples) -> Option<f64> {
        samples.median().filter(|&s| s > 0.0).map(|s| self.count as f64 / s / 1e6)
    }

    fn cells(&self) -> Vec<Cell> {
        let c = &self.counts;
        vec![
            self.scene.clone().into(),
            self.class.name().into(),
            self.structure.clone().into(),
            self.count.into(),
            self.rate(&self.single).into(),
            self.single.spread().into(),
            self.rate(&self.packet).into(),
            self.packet.spread().into(),
            per_ray(c, c.nodes),
            per_ray(c, c.prims),
            per_ray(c, c.blocks),
            per_ray(c, c.steps),
            per_ray(c, c.events),
            per_ray(c, c.skips),
            self.differences.into(),
        ]
    }
}

/// The note, with broken invariants.
fn note(note: Option<&String>, violations: &[String]) -> Cell {
    let words: Vec<&str> = note.into_iter().chain(violations).map(String::as_str).collect();
    if words.is_empty() { Cell::Absent } else { words.join("; ").into() }
}

impl BuildRow {
    fn cells(&self) -> Vec<Cell> {
        let stats = |f: fn(&AccelStats) -> Cell| self.stats.as_ref().map_or(Cell::Absent, f);
        let bytes = |f: fn(&AccelStats) -> usize| {
            self.stats.as_ref().map_or(Cell::Absent, |s| per_triangle(f(s), self.triangles))
        };
        vec![
            self.scene.clone().into(),
            self.structure.clone().into(),
            self.triangles.into(),
            scaled(&self.build, 1e3),
            self.build.spread().into(),
            bytes(|s| s.node_bytes),
            bytes(|s| s.total_bytes),
            stats(|s| s.nodes.into()),
            stats(|s| s.leaves.into()),
            stats(|s| s.depth.into()),
            stats(|s| s.sah_cost.into()),
            scaled(&self.refit, 1e3),
            self.refit.spread().into(),
            self.motion.into(),
            self.decay.into(),
            self.refit_differences.into(),
            note(self.note.as_ref(), &self.violations),
        ]
    }
}

impl GrowthRow {
    /// Median nanoseconds a ray.
    pub(super) fn ns(&self, samples: &Samples) -> Option<f64> {
        Some(samples.median()? * 1e9 / self.count.filter(|&n| n > 0)? as f64)
    }

    fn cells(&self) -> Vec<Cell> {
        let bytes = |f: fn(&AccelStats) -> usize| {
            self.stats.as_ref().map_or(Cell::Absent, |s| per_triangle(f(s), self.triangles))
        };
        vec![
            self.structure.clone().into(),
            self.triangles.into(),
            scaled(&self.build, 1e3),
            bytes(|s| s.node_bytes),
            bytes(|s| s.total_bytes),
            self.stats.map(|s| s.total_bytes).into(),
            scaled(&self.refit, 1e3),
            self.count.into(),
            self.ns(&self.primary).into(),
            self.ns(&self.diffuse).into(),
            per_ray(&self.counts, self.counts.work()),
            self.differences.into(),
            self.peak.into(),
            note(self.note.as_ref(), &self.violations),
        ]
    }
}

/// All rows so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Tables {
    pub(super) builds: Vec<BuildRow>,
    pub(super) rays: Vec<RayRow>,
    pub(super) growth: Vec<GrowthRow>,
}

impl Tables {
    pub(super) fn new() -> Self {
        Self::default()
    }

    /// The tables as they are written.
    pub(super) fn finish(&self) -> Vec<Table> {
        let mut builds = Table::new("build", "Build, memory and refit", BUILD).with_note(
            "Times of one thread are processor time where the system tells it, those of several threads wall-clock time; medians, and half the \
             distance of the extremes in percent. Bytes a triangle count everything that the structure owns; node bytes the nodes alone. Decay is how much dearer rays are \
             expected to be after the refit than after the build.",
        );
        let mut rays = Table::new("rays", "Rays", RAYS).with_note(
            "Rates are of one thread. Packets are of 16 consecutive rays: tiles of 4 x 4 pixels for primary rays. Counts are of single rays; a block holds up to \
             four triangles tested at once. Differences compare every answer, bit for bit, with that of `bvh2`.",
        );
        let mut growth = Table::new("growth", "Growth on a dented sphere", GROWTH).with_note(
            "Single rays. Work adds up what a ray does: nodes, cells and events skipped once, triangles, blocks and events handled twice.",
        );
        self.builds.iter().for_each(|r| builds.push(r.cells()));
        self.rays.iter().for_each(|r| rays.push(r.cells()));
        self.growth.iter().for_each(|r| growth.push(r.cells()));
        [builds, rays, growth].into_iter().filter(|t| !t.rows.is_empty()).collect()
    }
}
