//! The runs over their frames.

use super::{run::Run, tables::Played};
use crate::{
    dynamics::RebuildPolicy,
    report::{Chart, Line, Plot, Series},
};

/// Trace times and ages of trees.
pub(super) fn plots(play: &Played) -> Vec<Plot> {
    let lines = |of: &dyn Fn(&Run) -> Vec<f64>| {
        let line = |(i, run): (usize, &Run)| {
            Line::new(i, run.policy.to_string(), of(run).into_iter().enumerate().map(|(x, y)| (x as f64, y)).collect())
        };
        play.runs.iter().enumerate().map(line).collect::<Vec<_>>()
    };
    let chart = |y: &str, lines| Chart::Series(Series { x: "frame".into(), y: y.into(), lines });
    let scene = &play.scene;
    let mut plots = vec![Plot::new(
        format!("trace-{scene}"),
        format!("{scene}: casting a frame's rays"),
        chart("trace [ms]", lines(&|run| run.each(|f| f.trace_s * 1e3).0)),
    )];
    if play
        .runs
        .iter()
        .any(|run| run.policy != RebuildPolicy::Rebuild && run.each(|f| f.state.quality).most() > Some(1.1))
    {
        plots.push(Plot::new(
            format!("quality-{scene}"),
            format!("{scene}: surface-area cost since the last build"),
            chart("quality", lines(&|run| run.each(|f| f.state.quality).0)),
        ));
        plots.push(Plot::new(
            format!("age-{scene}"),
            format!("{scene}: frames since a tree was built"),
            chart("age [frames]", lines(&|run| run.each(|f| f.state.tree_age as f64).0)),
        ));
    }
    plots
}
