use super::group::GroupLayout;
use crate::{
    accel::HitSink,
    geom::{Hit, InstanceId, PrimId},
};

/// Decides whether a hit counts.
pub(super) trait Filter: Copy {
    /// True when every hit does.
    const ACCEPTS_ALL: bool;
    fn accept(self, hit: &Hit) -> bool;
}

/// Every hit counts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unfiltered;

impl Filter for Unfiltered {
    const ACCEPTS_ALL: bool = true;

    #[inline(always)]
    fn accept(self, _hit: &Hit) -> bool {
        true
    }
}

impl<F: Fn(&Hit) -> bool> Filter for &F {
    const ACCEPTS_ALL: bool = false;

    #[inline(always)]
    fn accept(self, hit: &Hit) -> bool {
        self(hit)
    }
}

/// Reports hits on a group under the numbers of the world, and asks the caller's filter.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroupSink<'a, F> {
    pub(super) layout: &'a GroupLayout,
    pub(super) filter: F,
}

impl<F: Filter> HitSink for GroupSink<'_, F> {
    const ACCEPTS_ALL: bool = F::ACCEPTS_ALL;

    #[inline(always)]
    fn key(&self, prim: PrimId) -> (InstanceId, PrimId) {
        self.layout.key(prim)
    }

    #[inline(always)]
    fn accept(&self, hit: &Hit) -> bool {
        self.filter.accept(hit)
    }
}
