use super::{
    World,
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
        let trav = TravRay::new(ray)?;
        let mut best = Closest::new(&trav);
        let mut walk = self.top.walk(&self.groups, &trav);
        while let Some(group) = walk.next(best.t_high()) {
            let sink = GroupSink { layout: &group.layout, filter };
            group.accel.closest::<S, (), _>(&group.triangles(), &trav, &mut best, &sink, &mut ());
        }
        best.hit(&trav)
    }

    #[inline(always)]
    fn occluded<S: Simd, F: Filter>(&self, ray: &Ray, filter: F) -> bool {
        let Some(trav) = TravRay::new(ray) else { return false };
        let mut walk = self.top.walk(&self.groups, &trav);
        while let Some(group) = walk.next(f64::from(trav.range().t_far)) {
            let sink = GroupSink { layout: &group.layout, filter };
            if group.accel.occluded::<S, (), _>(&group.triangles(), &trav, &sink, &mut ()) {
                return true;
            }
        }
        false
    }
}
