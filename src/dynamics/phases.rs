//! Trees for a clip that is known beforehand: as few as serve all of it by refitting.
//!
//! A clip is posed at equally spaced times and a tree built at each. From the first time on, the tree that serves the longest run of the times is
//! kept for that run, where serving means that, refitted to each of them, its surface-area cost is at most [`SERVES`] times that of the tree built there.
//! A walk needs one tree; an explosion several, one for each phase.
//!
//! # Source
//! Bittner and Meister, "T-SAH: Animation Optimized Bounding Volume Hierarchies", 2015, for the cost of a tree over the poses of a clip. Departures: trees are
//! chosen among those of the poses, not optimised by reinsertion, and there may be several.

use std::sync::Arc;

use crate::{
    accel::{AccelSpec, AnyAccel, BuildError, Refit},
    anim::ActiveClip,
    scene::ClipId,
    world::GroupLayout,
};

/// Most that a tree may cost against a fresh one to serve a time.
const SERVES: f64 = 1.06;

/// Times that a clip is posed at, unless memory allows for fewer.
const SAMPLES: usize = 48;

/// Bytes that the trees and vertices of all times may take while trees are chosen.
const BYTES: usize = 1 << 30;

/// Groups of fewer triangles are not worth trees of their own times.
pub(super) const LEAST: usize = 4096;

/// The trees of one clip.
#[derive(Debug)]
pub(super) struct Phases {
    clip: ClipId,
    /// By time.
    trees: Vec<Phase>,
}

/// A tree and the end of the times that it serves.
#[derive(Debug)]
struct Phase {
    until_s: f64,
    accel: Arc<AnyAccel>,
}

/// A group at one time.
#[derive(Debug)]
pub(super) struct Sample {
    pub(super) time_s: f64,
    pub(super) positions: Vec<glam::Vec3>,
}

/// Times of a clip to pose `layout` at.
#[expect(clippy::cast_precision_loss, reason = "few samples")]
pub(super) fn times(layout: &GroupLayout, duration_s: f64) -> Vec<f64> {
    let each = layout.indices.len() * 64 + layout.vertex_count * size_of::<glam::Vec3>();
    let count = if duration_s > 0.0 { (BYTES / each.max(1)).clamp(2, SAMPLES) } else { 1 };
    (0..count).map(|i| duration_s * i as f64 / (count.max(2) - 1) as f64).collect()
}

impl Phases {
    /// Chooses the trees, in the current rayon pool.
    ///
    /// # Errors
    /// When a tree cannot be built.
    pub(super) fn choose(
        clip: ClipId,
        layout: &GroupLayout,
        samples: &[Sample],
        spec: &AccelSpec,
    ) -> Result<Self, BuildError> {
        let mut trees = Vec::with_capacity(samples.len());
        for sample in samples {
            trees.push(spec.build(&layout.triangles(&sample.positions))?);
            if !trees[0].refits() {
                return Ok(Self { clip, trees: Vec::new() });
            }
        }
        let costs: Vec<f64> = trees.iter().map(|tree| tree.stats().sah_cost).collect();
        let mut probe = trees.first().cloned();
        let mut serves = |tree: usize, at: usize| {
            let Some(probe) = &mut probe else { return false };
            let refitted = trees[tree].refit_into(probe, &layout.triangles(&samples[at].positions));
            tree == at || (refitted == Refit::Done && probe.stats().sah_cost <= SERVES * costs[at])
        };
        let runs = runs(samples.len(), &mut serves);
        let end = |at: usize| match samples.get(at) {
            Some(next) => f64::midpoint(samples[at - 1].time_s, next.time_s),
            None => f64::INFINITY,
        };
        let mut trees: Vec<Option<AnyAccel>> = trees.into_iter().map(Some).collect();
        let phase =
            |(tree, until): (usize, usize)| Some(Phase { until_s: end(until), accel: Arc::new(trees[tree].take()?) });
        Ok(Self { clip, trees: runs.into_iter().filter_map(phase).collect() })
    }

    /// Number of trees.
    pub(super) fn len(&self) -> usize {
        self.trees.len()
    }

    /// The clip that they are for.
    pub(super) fn clip(&self) -> ClipId {
        self.clip
    }

    /// The number of the tree for a time of the clip, and the tree; `None` for another clip.
    pub(super) fn at(&self, playing: ActiveClip) -> Option<(usize, &Arc<AnyAccel>)> {
        if playing.clip != self.clip {
            return None;
        }
        let number = self.trees.partition_point(|phase| phase.until_s <= playing.time_s);
        self.trees.get(number).map(|phase| (number, &phase.accel))
    }
}

/// Cuts `count` times into runs, each with the tree that serves all of it and its end: from each start the tree that reaches farthest.
fn runs(count: usize, serves: &mut impl FnMut(usize, usize) -> bool) -> Vec<(usize, usize)> {
    let mut runs = Vec::new();
    let mut start = 0;
    while start < count {
        let mut best = (start, start + 1);
        for tree in start..count {
            // Trees of later times serve the start less and less.
            if !(start..tree).all(|at| serves(tree, at)) {
                break;
            }
            let end = (tree + 1..count).find(|&at| !serves(tree, at)).unwrap_or(count);
            if end > best.1 {
                best = (tree, end);
            }
            if end == count {
                break;
            }
        }
        runs.push(best);
        start = best.1;
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_served_by_the_tree_that_reaches_farthest() {
        // Each tree serves the two times on either side.
        let mut near = |tree: usize, at: usize| tree.abs_diff(at) <= 2;
        assert_eq!(runs(10, &mut near), [(2, 5), (7, 10)]);
        assert_eq!(runs(3, &mut near), [(0, 3)]);
        assert_eq!(runs(0, &mut near), []);
        assert_eq!(runs(3, &mut |tree, at| tree == at), [(0, 1), (1, 2), (2, 3)]);
    }
}
