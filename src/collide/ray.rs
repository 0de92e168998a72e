//! Rays: what they hit first, whether they hit anything, and all that they hit in order.

use std::cell::RefCell;

use glam::DVec3;
use rayon::prelude::*;

use super::{CollideError, Layers, PartId, Side, Snapshot, Surface, world::PartFrame};
use crate::{
    accel::{PACKET, TravRay},
    geom::{Hit, InstanceId, PrimId, Ray, exact::TriangleHit},
    simd::{Simd, SimdLevel, Task, check_float_mode, dispatch},
    world::{GroupFrame, World},
};

/// Where a ray meets a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// The hit as structures report it: `t`, `u` and `v` are the exact values correctly rounded; `instance` is the part's number.
    pub hit: Hit,
    /// What is there.
    pub surface: Surface,
    /// Which side the ray meets.
    pub side: Side,
}

/// Rays that one task takes.
const BATCH: usize = 1024;

impl Snapshot {
    /// The nearest hit on one of `layers` ([`Layers::ALL`]): least exact `t`, equal `t` to the lower (part, triangle).
    ///
    /// Both sides count; a triangle without area is never hit; a ray with NaN, a zero direction or an empty range hits nothing.
    ///
    /// # Errors
    /// When foreign code changed how this thread computes, or the structure cannot be built (at the first ray only).
    pub fn closest_hit(&self, ray: &Ray, layers: u32) -> Result<Option<RayHit>, CollideError> {
        if layers == Layers::ALL && !self.hides_parts() {
            let world = self.world()?;
            let hit = dispatch(SimdLevel::best(), Closest { world, ray, filter: None::<&fn(&Hit) -> bool> });
            return Ok(hit.map(|hit| self.found(ray, hit)));
        }
        self.closest_hit_where(ray, layers, |_| true)
    }

    /// As [`Snapshot::closest_hit`] of the hits that `accept` accepts.
    ///
    /// `accept` is asked about real hits only, in no particular order, possibly about hits behind the nearest and more than once.
    ///
    /// # Errors
    /// As there.
    pub fn closest_hit_where(
        &self,
        ray: &Ray,
        layers: u32,
        accept: impl Fn(&Hit) -> bool,
    ) -> Result<Option<RayHit>, CollideError> {
        let filter = |hit: &Hit| self.is_on(hit, layers) && accept(hit);
        let task = Closest { world: self.world()?, ray, filter: Some(&filter) };
        Ok(dispatch(SimdLevel::best(), task).map(|hit| self.found(ray, hit)))
    }

    /// Whether anything on one of `layers` is hit.
    ///
    /// # Errors
    /// As [`Snapshot::closest_hit`].
    pub fn any_hit(&self, ray: &Ray, layers: u32) -> Result<bool, CollideError> {
        if layers == Layers::ALL && !self.hides_parts() {
            let task = Any { world: self.world()?, ray, filter: None::<&fn(&Hit) -> bool> };
            return Ok(dispatch(SimdLevel::best(), task));
        }
        self.any_hit_where(ray, layers, |_| true)
    }

    /// Whether anything that `accept` accepts is hit; as [`Snapshot::closest_hit_where`].
    ///
    /// # Errors
    /// As [`Snapshot::closest_hit`].
    pub fn any_hit_where(&self, ray: &Ray, layers: u32, accept: impl Fn(&Hit) -> bool) -> Result<bool, CollideError> {
        let filter = |hit: &Hit| self.is_on(hit, layers) && accept(hit);
        Ok(dispatch(SimdLevel::best(), Any { world: self.world()?, ray, filter: Some(&filter) }))
    }

    /// Every triangle on one of `layers` that the ray hits, in the order of exact `t`, equal `t` in that of (part, triangle).
    ///
    /// # Errors
    /// As [`Snapshot::closest_hit`].
    pub fn all_hits(&self, ray: &Ray, layers: u32) -> Result<Vec<RayHit>, CollideError> {
        let found = RefCell::new(Vec::new());
        let collect = |hit: &Hit| {
            if self.is_on(hit, layers) {
                found.borrow_mut().push((hit.instance, hit.prim));
            }
            // Never enough: every hit is shown.
            false
        };
        dispatch(SimdLevel::best(), Closest { world: self.world()?, ray, filter: Some(&collect) });
        let mut found = found.into_inner();
        found.sort_unstable();
        found.dedup();
        let Some(range) = TravRay::new(ray).map(|r| *r.range()) else { return Ok(Vec::new()) };
        let exact = |&(part, prim): &(InstanceId, PrimId)| {
            let frame = &self.frames()[part.0 as usize];
            TriangleHit::test(&range, frame.corners(prim.0)).map(|hit| (hit, part, prim))
        };
        let mut hits: Vec<_> = found.iter().filter_map(exact).collect();
        // Stable: equal t stay in the order of part and triangle.
        hits.sort_by(|a, b| a.0.cmp_t(&b.0, &range));
        let named = |(hit, instance, prim): (TriangleHit, InstanceId, PrimId)| {
            let [t, u, v] = hit.tuv(&range);
            self.found(ray, Hit { t, u, v, prim, instance })
        };
        Ok(hits.into_iter().map(named).collect())
    }

    /// The nearest hit of every ray, in order, into `out`: what [`Snapshot::closest_hit`] finds, [`Snapshot::named`] on demand.
    ///
    /// In parallel in the current rayon pool; pays most where consecutive rays run close together, and where there is one part only, whose structure then
    /// answers a batch as a whole.
    ///
    /// # Errors
    /// As [`Snapshot::closest_hit`], and when `out` and `rays` differ in length.
    pub fn closest_hits(&self, rays: &[Ray], layers: u32, out: &mut [Option<Hit>]) -> Result<(), CollideError> {
        same_length(rays.len(), out.len())?;
        let world = self.world()?;
        let (only, unfiltered) = (only_group(world), self.are_all_on(layers));
        let one = |(rays, out): (&[Ray], &mut [Option<Hit>])| -> Result<(), CollideError> {
            if let (Some((group, instance)), true) = (only, unfiltered) {
                let prims = group.triangles();
                group.accel.closest_hits_as(&prims, rays, PACKET, SimdLevel::best(), world.forms, out)?;
                out.iter_mut().flatten().for_each(|hit| hit.instance = instance);
                return Ok(());
            }
            if unfiltered {
                return Ok(world.hit_all(rays, SimdLevel::best(), out)?);
            }
            check_float_mode()?;
            let filter = |hit: &Hit| self.is_on(hit, layers);
            dispatch(SimdLevel::best(), Each { world, rays, out, filter: &filter });
            Ok(())
        };
        if rays.len() <= BATCH {
            return one((rays, out));
        }
        rays.par_chunks(BATCH).zip(out.par_chunks_mut(BATCH)).try_for_each(one)
    }

    /// Whether every ray hits anything, in order, into `out`; as [`Snapshot::closest_hits`].
    ///
    /// # Errors
    /// As there.
    pub fn any_hits(&self, rays: &[Ray], layers: u32, out: &mut [bool]) -> Result<(), CollideError> {
        same_length(rays.len(), out.len())?;
        let world = self.world()?;
        let (only, unfiltered) = (only_group(world), self.are_all_on(layers));
        let one = |(rays, out): (&[Ray], &mut [bool])| -> Result<(), CollideError> {
            if let (Some((group, _)), true) = (only, unfiltered) {
                let prims = group.triangles();
                return Ok(group.accel.blocked_as(&prims, rays, PACKET, SimdLevel::best(), world.forms, out)?);
            }
            if unfiltered {
                return Ok(world.block_all(rays, SimdLevel::best(), out)?);
            }
            check_float_mode()?;
            let filter = |hit: &Hit| self.is_on(hit, layers);
            for (ray, out) in rays.iter().zip(out) {
                *out = dispatch(SimdLevel::best(), Any { world, ray, filter: Some(&filter) });
            }
            Ok(())
        };
        if rays.len() <= BATCH {
            return one((rays, out));
        }
        rays.par_chunks(BATCH).zip(out.par_chunks_mut(BATCH)).try_for_each(one)
    }

    /// What a hit of `ray` on this snapshot hit.
    ///
    /// # Errors
    /// When the hit is not one of this snapshot's.
    pub fn named(&self, ray: &Ray, hit: &Hit) -> Result<RayHit, CollideError> {
        let part = PartId(hit.instance.0);
        let count = self.frame(part)?.len();
        if hit.prim.0 as usize >= count {
            return Err(CollideError::NoSuchTriangle { part, triangle: hit.prim.0, count });
        }
        Ok(self.found(ray, *hit))
    }

    fn world(&self) -> Result<&World, CollideError> {
        check_float_mode()?;
        self.rays()
    }

    fn are_all_on(&self, layers: u32) -> bool {
        self.frames().iter().all(|part| part.len() == 0 || part.layers.on & layers != 0)
    }

    fn is_on(&self, hit: &Hit, layers: u32) -> bool {
        self.frames()[hit.instance.0 as usize].layers.on & layers != 0
    }

    fn found(&self, ray: &Ray, hit: Hit) -> RayHit {
        let frame: &PartFrame = &self.frames()[hit.instance.0 as usize];
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let surface = self.surface_at(frame, PartId(hit.instance.0), hit.prim.0, u, v);
        let dir: DVec3 = ray.dir.as_dvec3();
        RayHit { hit, side: surface.side_seen_along(dir), surface }
    }
}

/// The group of a world that has one only, of one part: its structure then answers whole batches.
fn only_group(world: &World) -> Option<(&GroupFrame, InstanceId)> {
    match (&world.groups[..], world.groups.first().map(|group| &group.layout.instances[..])) {
        ([group], Some(&[instance])) if group.rigid.is_none() => Some((group, instance)),
        _ => None,
    }
}

fn same_length(expected: usize, actual: usize) -> Result<(), CollideError> {
    if actual == expected { Ok(()) } else { Err(CollideError::Count { what: "places for hits", actual, expected }) }
}

struct Closest<'a, F> {
    world: &'a World,
    ray: &'a Ray,
    filter: Option<&'a F>,
}

impl<F: Fn(&Hit) -> bool> Task for Closest<'_, F> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Option<Hit> {
        match self.filter {
            Some(filter) => self.world.closest_hit::<S, F>(self.ray, filter),
            None => self.world.nearest_hit::<S>(self.ray),
        }
    }
}

struct Any<'a, F> {
    world: &'a World,
    ray: &'a Ray,
    filter: Option<&'a F>,
}

impl<F: Fn(&Hit) -> bool> Task for Any<'_, F> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        match self.filter {
            Some(filter) => self.world.is_occluded::<S, F>(self.ray, filter),
            None => self.world.is_blocked::<S>(self.ray),
        }
    }
}

struct Each<'a, F> {
    world: &'a World,
    rays: &'a [Ray],
    out: &'a mut [Option<Hit>],
    filter: &'a F,
}

impl<F: Fn(&Hit) -> bool> Task for Each<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        for (ray, out) in self.rays.iter().zip(self.out) {
            *out = self.world.closest_hit::<S, F>(ray, self.filter);
        }
    }
}
