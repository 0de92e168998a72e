//! Triangles by number, each tested once a ray as far as a small mailbox remembers.

use std::ops::Range;

use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::NO_PRIM,
        leaves::{Leaves, RareLeaves},
        query::is_blocked_by,
    },
    geom::{PrimId, Triangles},
};

/// Triangles that a mailbox remembers; a power of two.
const REMEMBERED: usize = 8;

/// The last triangle met of each class of numbers.
///
/// # Source
/// Benthin, "Realtime Ray Tracing on current CPU Architectures", 2006 (hashed mailboxing).
struct Mailbox([u32; REMEMBERED]);

impl Mailbox {
    #[inline(always)]
    fn new() -> Self {
        Self([NO_PRIM; REMEMBERED])
    }

    /// True when the triangle was met before; it is remembered.
    #[inline(always)]
    fn met(&mut self, prim: u32) -> bool {
        std::mem::replace(&mut self.0[prim as usize % REMEMBERED], prim) == prim
    }
}

/// For the closest hit.
pub(super) struct MailedClosest<'a, K> {
    ids: &'a [u32],
    prims: &'a Triangles<'a>,
    ray: &'a TravRay,
    best: &'a mut Closest,
    sink: &'a K,
    mailbox: Mailbox,
}

impl<'a, K> MailedClosest<'a, K> {
    #[inline(always)]
    pub(super) fn new(
        ids: &'a [u32],
        prims: &'a Triangles<'a>,
        ray: &'a TravRay,
        best: &'a mut Closest,
        sink: &'a K,
    ) -> Self {
        Self { ids, prims, ray, best, sink, mailbox: Mailbox::new() }
    }
}

impl<K: HitSink> Leaves for MailedClosest<'_, K> {
    #[inline(always)]
    fn t_limit(&self) -> f64 {
        self.best.t_high()
    }

    #[inline(always)]
    fn t_cull(&self) -> f32 {
        self.best.t_cull()
    }

    #[inline(always)]
    fn leaf<C: Counter>(&mut self, units: Range<usize>, count: &mut C) -> bool {
        for &id in &self.ids[units] {
            if !self.mailbox.met(id) {
                count.prim();
                self.best.offer(self.ray, self.prims, PrimId(id), self.sink);
            }
        }
        false
    }

    fn rare(&mut self) -> &mut dyn RareLeaves {
        self
    }
}

/// For any hit.
pub(super) struct MailedOccluded<'a, K> {
    ids: &'a [u32],
    prims: &'a Triangles<'a>,
    ray: &'a TravRay,
    sink: &'a K,
    mailbox: Mailbox,
}

impl<'a, K> MailedOccluded<'a, K> {
    #[inline(always)]
    pub(super) fn new(ids: &'a [u32], prims: &'a Triangles<'a>, ray: &'a TravRay, sink: &'a K) -> Self {
        Self { ids, prims, ray, sink, mailbox: Mailbox::new() }
    }
}

impl<K: HitSink> Leaves for MailedOccluded<'_, K> {
    #[inline(always)]
    fn t_limit(&self) -> f64 {
        f64::from(self.t_cull())
    }

    #[inline(always)]
    fn t_cull(&self) -> f32 {
        self.ray.range().t_far
    }

    #[inline(always)]
    fn leaf<C: Counter>(&mut self, units: Range<usize>, count: &mut C) -> bool {
        for &id in &self.ids[units] {
            if self.mailbox.met(id) {
                continue;
            }
            count.prim();
            if is_blocked_by(self.ray, self.prims, PrimId(id), self.sink) {
                return true;
            }
        }
        false
    }

    fn rare(&mut self) -> &mut dyn RareLeaves {
        self
    }
}
