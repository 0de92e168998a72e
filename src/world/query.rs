use super::{
    GroupFrame, World,
    sink::{Filter, GroupSink, Unfiltered},
};
use crate::{
    accel::{Closest, TravRay},
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

// Kernels must be inlined into the function that carries the SIMD level's features. A closure would not be, so
// nothing between the dispatch and a structure is one.
impl GroupFrame {
    #[inline(always)]
    fn closest<S: Simd, F: Filter>(&self, ray: &TravRay, best: &mut Closest, filter: F) {
        let sink = GroupSink { layout: &self.layout, filter };
        match &self.rigid {
            Some((tree, place)) => tree.closest::<S, _>(place, &self.triangles(), ray, best, &sink),
            None => self.accel.closest::<S, (), _>(&self.triangles(), ray, best, &sink, &mut ()),
        }
    }

    #[inline(always)]
    fn occluded<S: Simd, F: Filter>(&self, ray: &TravRay, filter: F) -> bool {
        let sink = GroupSink { layout: &self.layout, filter };
        match &self.rigid {
            Some((tree, place)) => tree.occluded::<S, _>(place, &self.triangles(), ray, &sink),
            None => self.accel.occluded::<S, (), _>(&self.triangles(), ray, &sink, &mut ()),
        }
    }
}
