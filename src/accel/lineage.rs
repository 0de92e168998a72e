//! What trees that can be refitted remember of the triangles that they were built over.

use std::sync::atomic::{AtomicU64, Ordering};

use super::Refit;
use crate::geom::Triangles;

/// The number of the next tree that is built.
static NEXT: AtomicU64 = AtomicU64::new(0);

/// Which build a tree comes from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lineage {
    /// Trees of equal number differ in bounds and corners only.
    number: u64,
    topology_epoch: u64,
    prims: usize,
    positions: usize,
    /// Expected cost of a ray per own area of the triangles, right after the build.
    fresh_cost: f64,
}

impl Lineage {
    /// Of a tree that is being built over `prims`.
    pub(super) fn new(prims: &Triangles<'_>) -> Self {
        Self {
            number: NEXT.fetch_add(1, Ordering::Relaxed),
            topology_epoch: prims.topology_epoch,
            prims: prims.len(),
            positions: prims.positions.len(),
            fresh_cost: 0.0,
        }
    }

    /// Ends the build.
    pub(super) fn set_fresh_cost(&mut self, cost: f64) {
        self.fresh_cost = cost;
    }

    /// How much dearer a ray has become since the build.
    pub(super) fn decay(&self, cost: f64) -> f64 {
        if self.fresh_cost > 0.0 { cost / self.fresh_cost } else { 1.0 }
    }

    /// How many triangles there are.
    pub(super) fn prims(&self) -> usize {
        self.prims
    }

    /// True when `prims` are the triangles of the build, moved or not.
    fn takes(&self, prims: &Triangles<'_>) -> bool {
        prims.topology_epoch == self.topology_epoch
            && prims.len() == self.prims
            && prims.positions.len() == self.positions
    }
}

/// A tree that follows its triangles.
pub(super) trait Refittable: Clone {
    /// The build it comes from.
    fn lineage(&self) -> &Lineage;
    /// Takes new positions of the same triangles.
    fn retake(&mut self, prims: &Triangles<'_>);
}

/// As [`Accel::refit_into`](super::Accel::refit_into).
pub(super) fn refit_into<T: Refittable>(tree: &T, out: &mut T, prims: &Triangles<'_>) -> Refit {
    if !tree.lineage().takes(prims) {
        return Refit::NeedsRebuild;
    }
    if out.lineage().number != tree.lineage().number {
        out.clone_from(tree);
    }
    out.retake(prims);
    Refit::Done
}
