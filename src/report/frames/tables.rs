//! The tables' columns, and runs that become rows.

use super::{
    refits::{Bandwidth, RefitRow},
    run::{Frame, Run},
};
use crate::{
    dynamics::RebuildPolicy,
    report::{Cell, Column, Role, Table},
};

const SUMMARY: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("policy", "policy", Role::Id, 0),
    Column::new("triangles", "triangles", Role::Note, 0),
    Column::new("frames", "frames", Role::Note, 0),
    Column::new("pose_ms", "pose [ms]", Role::Sooner, 3),
    Column::new("deform_ms", "deform [ms]", Role::Sooner, 3),
    Column::new("refit_ms", "refit [ms]", Role::Sooner, 3),
    Column::new("sort_ms", "sort [ms]", Role::Sooner, 3),
    Column::new("trace_ms", "trace [ms]", Role::Sooner, 2),
    Column::new("made_ms", "made [ms]", Role::Sooner, 2),
    Column::new("made_p99_ms", "p99", Role::Note, 2),
    Column::new("made_max_ms", "most", Role::Note, 2),
    Column::new("against_rebuild", "trace / rebuilt", Role::Note, 3),
    Column::new("against_rebuild_p99", "p99", Role::Note, 3),
    Column::new("against_rebuild_max", "most", Role::Note, 3),
    Column::new("quality", "quality, most", Role::Note, 2),
    Column::new("swaps", "swaps", Role::Note, 0),
    Column::new("dropped", "dropped", Role::Note, 0),
    Column::new("age", "tree age, median", Role::Note, 0),
    Column::new("age_max", "most", Role::Note, 0),
    Column::new("trees", "trees learnt", Role::Note, 0),
    Column::new("learning_ms", "learning [ms]", Role::Note, 0),
    Column::new("rays", "rays a frame", Role::Note, 0),
    Column::new("differences", "frames that answer otherwise", Role::Less, 0),
];

const FRAMES: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("policy", "policy", Role::Id, 0),
    Column::new("frame", "frame", Role::Id, 0),
    Column::new("pose_ms", "pose [ms]", Role::Note, 3),
    Column::new("deform_ms", "deform [ms]", Role::Note, 3),
    Column::new("refit_ms", "refit [ms]", Role::Note, 3),
    Column::new("sort_ms", "sort [ms]", Role::Note, 3),
    Column::new("trace_ms", "trace [ms]", Role::Note, 3),
    Column::new("made_ms", "made [ms]", Role::Note, 3),
    Column::new("against_rebuild", "trace / rebuilt", Role::Note, 3),
    Column::new("quality", "quality", Role::Note, 3),
    Column::new("swaps", "swaps", Role::Note, 0),
    Column::new("age", "tree age", Role::Note, 0),
];

const REFITS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("triangles", "triangles", Role::Note, 0),
    Column::new("refit_ms", "refit [ms]", Role::Sooner, 3),
    Column::new("refit_spread", "± [%]", Role::Note, 0),
    Column::new("build", "fastest build", Role::Note, 0),
    Column::new("build_ms", "build [ms]", Role::Sooner, 2),
    Column::new("builds", "build / refit", Role::Note, 2),
    Column::new("bytes", "bytes touched", Role::Less, 0),
    Column::new("memory_ms", "memory alone [ms]", Role::Note, 3),
    Column::new("over_memory", "refit / memory", Role::Note, 2),
];

/// All policies over one play.
#[derive(Clone, Debug)]
pub(super) struct Played {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) runs: Vec<Run>,
}

impl Played {
    /// The run under a policy.
    pub(super) fn run(&self, policy: RebuildPolicy) -> Option<&Run> {
        self.runs.iter().find(|run| run.policy == policy)
    }

    /// Frames that some run answers other than the first does.
    pub(super) fn differences(&self) -> usize {
        self.runs.iter().map(|run| run.differences(&self.runs[0])).sum()
    }

    /// True when refitting alone makes rays twice as slow as fresh trees do, at some frame.
    pub(super) fn defeats_refit(&self) -> Option<bool> {
        let fresh = self.run(RebuildPolicy::Rebuild)?;
        let against = self.run(RebuildPolicy::Refit)?.against(fresh);
        Some(against.quantile(0.75)? > 2.0)
    }

    fn cells(&self, run: &Run) -> Vec<Cell> {
        let ms = |of: fn(&Frame) -> f64| run.each(move |f| of(f) * 1e3);
        let made = ms(|f| f.made_s);
        let against = self.run(RebuildPolicy::Rebuild).map(|fresh| run.against(fresh));
        let age = run.each(|f| f.state.tree_age as f64);
        let shown = |q| against.as_ref().and_then(|a| a.quantile(q)).into();
        vec![
            self.scene.clone().into(),
            run.policy.to_string().into(),
            self.triangles.into(),
            run.frames.len().into(),
            ms(|f| f.times.pose.as_secs_f64()).median().into(),
            ms(|f| f.times.deform.as_secs_f64()).median().into(),
            ms(|f| f.times.refit.as_secs_f64()).median().into(),
            ms(|f| f.times.sort.as_secs_f64()).median().into(),
            ms(|f| f.trace_s).median().into(),
            made.median().into(),
            made.quantile(0.99).into(),
            made.most().into(),
            shown(0.5),
            shown(0.99),
            shown(1.0),
            run.counts.quality_max.into(),
            run.counts.swaps.into(),
            run.counts.rebuilds_dropped.into(),
            age.median().into(),
            age.most().into(),
            (run.trees > 0).then_some(run.trees).into(),
            (run.trees > 0).then_some(run.learning_s * 1e3).into(),
            (run.rays / run.frames.len().max(1)).into(),
            run.differences(&self.runs[0]).into(),
        ]
    }

    fn frame_cells<'a>(&'a self, run: &'a Run) -> impl Iterator<Item = Vec<Cell>> + 'a {
        let against = self.run(RebuildPolicy::Rebuild).map(|fresh| run.against(fresh));
        run.frames.iter().enumerate().map(move |(number, frame)| {
            let ms = |seconds: f64| Cell::from(seconds * 1e3);
            vec![
                self.scene.clone().into(),
                run.policy.to_string().into(),
                number.into(),
                ms(frame.times.pose.as_secs_f64()),
                ms(frame.times.deform.as_secs_f64()),
                ms(frame.times.refit.as_secs_f64()),
                ms(frame.times.sort.as_secs_f64()),
                ms(frame.trace_s),
                ms(frame.made_s),
                against.as_ref().map(|a| a.0[number]).into(),
                frame.state.quality.into(),
                frame.state.swaps.into(),
                frame.state.tree_age.into(),
            ]
        })
    }
}

/// All policies over all plays, medians.
pub(super) fn summary(plays: &[Played]) -> Table {
    let mut table = Table::new("summary", "Policies", SUMMARY).with_note(
        "Medians over the frames unless a column says otherwise. Rays are those of a picture, with a shadow and a bounce for each hit; trace is the processor time \
         of one thread that casts them. The other stages, and made, which is all of them, are wall-clock times in the pool while the background builder has its \
         own thread. A frame's rays are cast several times, which is the time that the builder has for it, and the median counts; \
         trace / rebuilt divides it by that of the frame under `rebuild`. Quality is the surface-area cost over that of the last build; age counts the frames since the vertices that a tree was built from.",
    );
    for play in plays {
        play.runs.iter().for_each(|run| table.push(play.cells(run)));
    }
    table
}

/// Every frame, for the JSON.
pub(super) fn frames(plays: &[Played]) -> Table {
    let mut table = Table::new("frames", "Frames", FRAMES).in_json_only();
    for play in plays {
        for run in &play.runs {
            play.frame_cells(run).for_each(|row| table.push(row));
        }
    }
    table
}

/// Refits against builds and memory.
pub(super) fn refits(rows: &[RefitRow], bandwidth: Bandwidth) -> Table {
    let mut table = Table::new("refits", "Refits", REFITS).with_note(format!(
        "Processor time of one thread, over the largest group that deforms. Bytes touched are the structure read and written in place, the numbers \
         of the corners and the vertices; memory alone is the time that a pass which reads and writes as many bytes takes: {:.1} GB/s here.",
        bandwidth.gigabytes()
    ));
    for row in rows {
        let refit = row.refit.median();
        table.push(vec![
            row.scene.clone().into(),
            row.structure.clone().into(),
            row.triangles.into(),
            refit.map(|s| s * 1e3).into(),
            row.refit.spread().into(),
            row.build.0.clone().into(),
            (row.build.1 * 1e3).into(),
            refit.map(|s| row.build.1 / s).into(),
            row.bytes.into(),
            (row.memory_s * 1e3).into(),
            refit.map(|s| s / row.memory_s).into(),
        ]);
    }
    table
}
