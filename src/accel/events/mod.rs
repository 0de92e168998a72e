//! Sorted event lists: three of them over all boxes, or a hierarchy of volumes with three each.
//!
//! # Source
//! Fournier and Poulin, "A Ray Tracing Accelerator Based on a Hierarchy of 1D Sorted Lists", Graphics Interface 1993.
//! The ends of boxes along an axis are sorted events. A ray walks the three lists at once, always on to the nearest
//! event, and tests an object when it has entered its box on every axis.
//!
//! Departures:
//! - Integer ranks and cursors in place of status marks: a mark goes stale when an object is left on one axis before it is
//!   entered on another, and a ray that turns back would then miss it.
//! - Arrays of events in place of linked lists.
//! - A volume is closed when its exit lies behind, with a margin for rounding, and not by its exit event; whether a box is held
//!   is decided with the same margin, so that the order of events whose times differ by rounding does not matter.
//! - The next events are merged in one order over volumes, each of which knows its soonest on three axes, and not in one
//!   order an axis. The order of events is the same.
//! - Volumes of large objects, and those deeper than 48 levels, are halved by number of objects.
//!
//! An object is tested exactly if the ray enters its box no later than the nearest hit: the fewest tests that boxes alone
//! allow, in both forms.
//!
//! Cost: build O(n log n), refit O(n + inversions) a list. Flat: 80 bytes a box; a ray handles events in proportion to n.
//! Hierarchical: about 115 bytes a box. Choose the flat form for tens of boxes or to watch them move, the hierarchical one
//! as a ray tracer where tests are dear.

mod boxes;
mod build;
mod config;
mod flat;
mod lists;
mod local;
mod long;
mod ranks;
mod ray;
mod refit;
mod state;
mod tree;
mod validate;
mod walk;

pub(crate) use flat::{FlatLists, FlatWalk};
pub(crate) use ray::EventRay;

pub use boxes::EventBoxes;
pub use config::{EventsConfig, Form};
pub use lists::Inversions;
pub(crate) use long::How;
pub use state::EventState;
use state::Seat;

use super::{
    Accel, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation, Visitor, check_indices,
    query::is_blocked_by,
};
use crate::{
    geom::{Aabb, PrimId, Triangles},
    simd::Simd,
};
use boxes::MAX_OBJECTS;

/// Event lists over triangles.
#[derive(Debug)]
pub struct Events {
    boxes: EventBoxes,
    topology_epoch: u64,
    position_count: usize,
}

impl Clone for Events {
    fn clone(&self) -> Self {
        Self { boxes: self.boxes.clone(), ..*self }
    }

    fn clone_from(&mut self, source: &Self) {
        self.boxes.clone_from(&source.boxes);
        (self.topology_epoch, self.position_count) = (source.topology_epoch, source.position_count);
    }
}

/// Offers triangles to the best hit.
struct Offer<'a, K> {
    prims: &'a Triangles<'a>,
    ray: &'a TravRay,
    best: &'a mut Closest,
    sink: &'a K,
}

impl<K: HitSink> Visitor for Offer<'_, K> {
    #[inline(always)]
    fn t_limit(&self) -> f64 {
        self.best.t_high()
    }

    #[inline(always)]
    fn visit(&mut self, object: u32) -> bool {
        self.best.offer(self.ray, self.prims, PrimId(object), self.sink);
        false
    }
}

/// Looks for any triangle that blocks.
struct Block<'a, K> {
    prims: &'a Triangles<'a>,
    ray: &'a TravRay,
    sink: &'a K,
    blocked: bool,
}

impl<K: HitSink> Visitor for Block<'_, K> {
    #[inline(always)]
    fn t_limit(&self) -> f64 {
        f64::from(self.ray.range().t_far)
    }

    #[inline(always)]
    fn visit(&mut self, object: u32) -> bool {
        let prim = PrimId(object);
        self.blocked |= is_blocked_by(self.ray, self.prims, prim, self.sink);
        self.blocked
    }
}

impl Events {
    /// The lists over the triangles' boxes.
    pub fn boxes(&self) -> &EventBoxes {
        &self.boxes
    }

    /// What the last refit did to the order of events; zero after a build.
    pub fn last_inversions(&self) -> Inversions {
        self.boxes.last_inversions()
    }

    /// As [`Accel::closest`] for rays that begin at or near the point that `state` was made for, as [`EventBoxes::state_at`]
    /// does. One state serves all primary rays of an image.
    #[inline(always)]
    pub fn closest_at<C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        state: &EventState,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        self.boxes.walk_at(ray, state, &mut Offer { prims, ray, best, sink }, count);
    }
}

impl Accel for Events {
    const NAME: &'static str = "events";
    const NODE_FORMAT: &'static str = "sorted lists";
    type Config = EventsConfig;
    type RayState = EventState;

    fn build(prims: &Triangles<'_>, config: &EventsConfig) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, MAX_OBJECTS)?;
        Ok(Self {
            boxes: EventBoxes::build(prims.len(), |i| prims.finite_aabb(PrimId(i)), config)?,
            topology_epoch: prims.topology_epoch,
            position_count: prims.positions.len(),
        })
    }

    fn refit_into(&self, out: &mut Self, prims: &Triangles<'_>) -> Refit {
        let same = prims.topology_epoch == self.topology_epoch
            && prims.len() == self.boxes.len()
            && prims.positions.len() == self.position_count;
        if !same {
            return Refit::NeedsRebuild;
        }
        if !out.boxes.is_alike(&self.boxes) {
            out.clone_from(self);
        }
        out.boxes.refit(|i| prims.finite_aabb(PrimId(i)));
        Refit::Done
    }

    #[inline(always)]
    fn closest<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        self.boxes.walk(ray, &mut Offer { prims, ray, best, sink }, count);
    }

    #[inline(always)]
    fn closest_from<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        state: &mut EventState,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        self.boxes.walk_on(ray, state, &mut Offer { prims, ray, best, sink }, count);
    }

    #[inline(always)]
    fn occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        let mut any = Block { prims, ray, sink, blocked: false };
        self.boxes.walk(ray, &mut any, count);
        any.blocked
    }

    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
        if self.boxes.len() != prims.len() {
            return Err(Violation(format!("{} triangles, built over {}", prims.len(), self.boxes.len())));
        }
        self.boxes.validate(|i| prims.finite_aabb(PrimId(i)))
    }

    fn stats(&self) -> AccelStats {
        let stats = self.boxes.stats();
        AccelStats { total_bytes: stats.total_bytes + size_of::<Self>() - size_of::<EventBoxes>(), ..stats }
    }

    fn bounds(&self) -> Aabb {
        self.boxes.bounds()
    }

    fn decay(&self) -> f64 {
        self.boxes.decay()
    }
}
