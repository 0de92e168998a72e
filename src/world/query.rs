use super::{
    GroupFrame, World,
    sink::{Filter, GroupSink, Unfiltered},
};
use crate::{
    accel::{Closest, LEAF, OneVisit, TravRay, walk_one},
    geom::{Hit, Ray},
    simd::Simd,
};

impl World {
    /// The nearest hit: least exact `t`, equal `t` to the lower (instance, prim).
    ///
    /// NaN anywhere, a zero direction or an empty range is a miss. No allocation.
    #[inline(always)]
    pub fn nearest_hit<S: Simd>(&self, ray: &Ray) -> Option<Hit> {
        self.closest::<S, _>(ray, Unfiltered)
    }

    /// The nearest hit that `filter` accepts: least exact `t`, equal `t` to the lower (instance, prim).
    ///
    /// `filter` is asked about real hits only, in no particular order, possibly also about hits behind the
    /// nearest. NaN anywhere, a zero direction or an empty range is a miss. No allocation.
    #[inline(always)]
    pub fn closest_hit<S: Simd, F: Fn(&Hit) -> bool>(&self, ray: &Ray, filter: &F) -> Option<Hit> {
        self.closest::<S, _>(ray, filter)
    }

    /// True when anything at all is hit within the ray's range. No allocation.
    #[inline(always)]
    pub fn is_blocked<S: Simd>(&self, ray: &Ray) -> bool {
        self.occluded::<S, _>(ray, Unfiltered)
    }

    /// True when anything that `filter` accepts is hit within the ray's range. No allocation.
    #[inline(always)]
    pub fn is_occluded<S: Simd, F: Fn(&Hit) -> bool>(&self, ray: &Ray, filter: &F) -> bool {
        self.occluded::<S, _>(ray, filter)
    }

    #[inline(always)]
    fn closest<S: Simd, F: Filter>(&self, ray: &Ray, filter: F) -> Option<Hit> {
        let trav = TravRay::with_forms(ray, self.forms)?;
        let mut best = Closest::new(&trav);
        if let [group] = &self.groups[..] {
            group.closest::<S, F>(&trav, &mut best, filter);
        } else if let Some(line) = self.top.line::<S>(&trav) {
            let mut visit = NearestGroup { groups: &self.groups, ray: &trav, best: &mut best, filter };
            walk_one::<S, _>(self.top.wide(), &line, 0, &mut visit);
        } else {
            let mut walk = self.top.walk(&self.groups, &trav);
            while let Some(group) = walk.next(best.t_high()) {
                group.closest::<S, F>(&trav, &mut best, filter);
            }
        }
        best.hit(&trav)
    }

    #[inline(always)]
    fn occluded<S: Simd, F: Filter>(&self, ray: &Ray, filter: F) -> bool {
        let Some(trav) = TravRay::with_forms(ray, self.forms) else { return false };
        if let [group] = &self.groups[..] {
            return group.occluded::<S, F>(&trav, filter);
        }
        if let Some(line) = self.top.line::<S>(&trav) {
            let mut visit = AnyGroup { groups: &self.groups, ray: &trav, filter, is_blocked: false };
            walk_one::<S, _>(self.top.wide(), &line, 0, &mut visit);
            return visit.is_blocked;
        }
        let t_far = f64::from(trav.range().t_far);
        let mut walk = self.top.walk(&self.groups, &trav);
        while let Some(group) = walk.next(t_far) {
            if group.occluded::<S, F>(&trav, filter) {
                return true;
            }
        }
        false
    }
}

/// Offers the triangles of groups to a ray.
pub(super) struct NearestGroup<'a, F> {
    pub(super) groups: &'a [GroupFrame],
    pub(super) ray: &'a TravRay,
    pub(super) best: &'a mut Closest,
    pub(super) filter: F,
}

impl<F: Filter> OneVisit for NearestGroup<'_, F> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.best.t_cull()
    }

    #[inline(always)]
    fn leaf<S: Simd>(&mut self, word: u32) -> bool {
        self.groups[(word & !LEAF) as usize].closest::<S, F>(self.ray, self.best, self.filter);
        false
    }
}

/// Asks groups whether they block a ray.
pub(super) struct AnyGroup<'a, F> {
    pub(super) groups: &'a [GroupFrame],
    pub(super) ray: &'a TravRay,
    pub(super) filter: F,
    pub(super) is_blocked: bool,
}

impl<F: Filter> OneVisit for AnyGroup<'_, F> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.ray.range().t_far
    }

    #[inline(always)]
    fn leaf<S: Simd>(&mut self, word: u32) -> bool {
        self.is_blocked = self.groups[(word & !LEAF) as usize].occluded::<S, F>(self.ray, self.filter);
        self.is_blocked
    }
}

// Kernels must be inlined into the function that carries the SIMD level's features. A closure would not be, so
// nothing between the dispatch and a structure is one.
impl GroupFrame {
    #[inline(always)]
    pub(super) fn closest<S: Simd, F: Filter>(&self, ray: &TravRay, best: &mut Closest, filter: F) {
        let sink = GroupSink { layout: &self.layout, filter };
        match &self.rigid {
            Some((tree, place)) => tree.closest::<S, _>(place, &self.triangles(), ray, best, &sink),
            None => self.accel.closest::<S, (), _>(&self.triangles(), ray, best, &sink, &mut ()),
        }
    }

    #[inline(always)]
    pub(super) fn occluded<S: Simd, F: Filter>(&self, ray: &TravRay, filter: F) -> bool {
        let sink = GroupSink { layout: &self.layout, filter };
        match &self.rigid {
            Some((tree, place)) => tree.occluded::<S, _>(place, &self.triangles(), ray, &sink),
            None => self.accel.occluded::<S, (), _>(&self.triangles(), ray, &sink, &mut ()),
        }
    }
}
