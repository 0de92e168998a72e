//! Rays that do not go together: many of them, a few in flight.
//!
//! The step of one ray through a node is a chain of operations that each wait for the one before, so a walk by itself leaves most of a core idle. Here the rays in
//! flight take turns, a step each. A step has few branches: the children that are met go on the stack in order, by a sorting network and not by comparisons, and
//! the next step takes the last. Rays are prepared and their hits are rounded a vector at a time.

use super::{
    crown::{self, Rest},
    full::Full,
    kernel::{Boxes, MAX_STACK},
    node::Link,
    tree::Tree8,
};
use crate::{
    accel::{
        AnyHit, PACKET,
        packet::{Nearest, PacketRays, Spread, bits},
        run,
        wide::{Place, WIDTH},
    },
    geom::{Forms, Hit, Ray, Triangles},
    simd::{Lanes, Simd, Task, prefetch_either},
};

/// Rays in flight.
const IN_FLIGHT: usize = 4;

/// Vectors of rays that are prepared at once.
const WINGS: usize = 4;

/// Places for all children of a node.
#[inline(always)]
fn room(words: &mut [u32; MAX_STACK], at: usize) -> &mut [u32; WIDTH] {
    words[at..].first_chunk_mut().expect("every level leaves room for its children")
}

/// A vector of rays.
struct Wing {
    rays: PacketRays,
    nearest: Nearest,
    /// Where they go on by themselves.
    rest: Rest,
    /// Those that are answered here.
    taken: u32,
    blocked: u32,
}

impl Wing {
    const EMPTY: Self =
        Self { rays: PacketRays::EMPTY, nearest: Nearest::NONE, rest: Rest::NONE, taken: 0, blocked: 0 };

    #[inline(always)]
    fn load<S: Simd>(&mut self, tree: &Tree8<Full>, rays: &[Ray], forms: Forms) {
        self.taken = self.rays.load::<S>(rays, tree.reach, forms);
        self.rays.bound::<S>();
        self.rays.prepare::<S>(forms.nodes);
        self.nearest.clear();
        self.blocked = 0;
        self.rest.whole(self.taken);
    }
}

/// A ray on its way.
struct Flight {
    boxes: Boxes,
    /// Where the ray is.
    wing: usize,
    lane: usize,
    /// Children to visit, the last first; the items before `len`.
    len: usize,
    keys: [u32; MAX_STACK],
    links: [u32; MAX_STACK],
}

impl Flight {
    const IDLE: Self =
        Self { boxes: Boxes::IDLE, wing: 0, lane: 0, len: 0, keys: [0; MAX_STACK], links: [0; MAX_STACK] };

    /// Puts a ray on its way.
    #[inline(always)]
    fn begin<S: Simd, const IS_REST: bool>(&mut self, wings: &[Wing; WINGS], wing: usize, lane: usize) {
        let from = &wings[wing % WINGS];
        self.boxes.take(&from.rays, lane % PACKET);
        (self.wing, self.lane) = (wing, lane);
        self.len = from.rest.unload(lane % PACKET, &mut self.keys, &mut self.links);
        if IS_REST {
            self.prune::<S>();
        }
    }

    /// Puts the next ray that has somewhere to go on its way; false when there is none.
    #[inline(always)]
    fn begin_next<S: Simd, const IS_REST: bool>(
        &mut self,
        waiting: &mut Waiting,
        wings: &[Wing; WINGS],
        used: usize,
    ) -> bool {
        while let Some((wing, lane)) = waiting.next(wings, used) {
            self.begin::<S, IS_REST>(wings, wing, lane);
            if !IS_REST || self.len > 0 {
                return true;
            }
        }
        false
    }

    #[inline(always)]
    fn closest_step<S: Simd, const ASK: bool>(&mut self, tree: &Tree8<Full>, wings: &mut [Wing; WINGS]) {
        self.len -= 1;
        let link = Link::from_bits(self.links[self.len]);
        if link.is_leaf() {
            let wing = &mut wings[self.wing % WINGS];
            S::call(ClosestLeaf { tree, link, wing, lane: self.lane % PACKET });
            let limit = wing.rays.t_cull[self.lane % PACKET];
            if self.boxes.set_limit(limit) {
                self.prune::<S>();
            }
            return;
        }
        let node = &tree.nodes[link.index()];
        let (near, hits) = self.boxes.test::<S>(node);
        let (keys, links) = (room(&mut self.keys, self.len), room(&mut self.links, self.len));
        S::descending(near, hits, Link::words(&node.links), keys, links);
        self.len += hits.count_ones() as usize;
        if ASK {
            self.ask(tree);
        }
    }

    /// Asks for the memory of what comes next: other rays take their turns meanwhile.
    #[inline(always)]
    fn ask(&self, tree: &Tree8<Full>) {
        let link = Link::from_bits(self.links[self.len.saturating_sub(1)]);
        prefetch_either(link.is_leaf(), &tree.items, &tree.nodes, link.index());
    }

    /// Drops what the ray enters beyond its limit.
    #[inline(always)]
    fn prune<S: Simd>(&mut self) {
        let (last, mut kept) = (self.boxes.last_key(), 0);
        for at in (0..self.len.min(MAX_STACK)).step_by(WIDTH) {
            let within = u32::MAX >> (32 - (self.len - at).min(WIDTH));
            let (keys, links) = (*room(&mut self.keys, at), *room(&mut self.links, at));
            let within = within & S::at_most(&keys, last);
            S::compress(&keys, within, room(&mut self.keys, kept));
            S::compress(&links, within, room(&mut self.links, kept));
            kept += within.count_ones() as usize;
        }
        self.len = kept;
    }

    /// True when the ray is blocked.
    #[inline(always)]
    fn occluded_step<S: Simd, const ASK: bool>(&mut self, tree: &Tree8<Full>, wings: &[Wing; WINGS]) -> bool {
        self.len -= 1;
        let link = Link::from_bits(self.links[self.len]);
        if link.is_leaf() {
            let rays = &wings[self.wing % WINGS].rays;
            return S::call(OccludedLeaf { tree, link, rays, lane: self.lane % PACKET });
        }
        let node = &tree.nodes[link.index()];
        let (_, hits) = self.boxes.test::<S>(node);
        S::compress(Link::words(&node.links), hits, room(&mut self.links, self.len));
        self.len += hits.count_ones() as usize;
        if ASK {
            self.ask(tree);
        }
        false
    }
}

struct ClosestLeaf<'a> {
    tree: &'a Tree8<Full>,
    link: Link,
    wing: &'a mut Wing,
    lane: usize,
}

impl Task for ClosestLeaf<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, link, wing, lane } = self;
        for number in link.blocks() {
            wing.nearest.offer_one::<S, _>(&mut wing.rays, (&tree.items, number), lane, &AnyHit);
        }
    }
}

struct OccludedLeaf<'a> {
    tree: &'a Tree8<Full>,
    link: Link,
    rays: &'a PacketRays,
    lane: usize,
}

impl Task for OccludedLeaf<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let Self { tree, link, rays, lane } = self;
        for number in link.blocks() {
            if tree.items[number].blocks_one::<S>(rays, lane) {
                return true;
            }
        }
        false
    }
}

/// The rays that are still to begin, wing by wing.
struct Waiting {
    wing: usize,
    left: u32,
}

impl Waiting {
    /// The next ray.
    #[inline(always)]
    fn next(&mut self, wings: &[Wing; WINGS], used: usize) -> Option<(usize, usize)> {
        while self.left == 0 {
            self.wing += 1;
            if self.wing >= used {
                return None;
            }
            self.left = wings[self.wing % WINGS].rest.left;
        }
        let lane = self.left.trailing_zeros() as usize;
        self.left &= self.left - 1;
        Some((self.wing, lane))
    }
}

/// Flies all rays of the wings in use: to their closest hits, or to any.
#[inline(always)]
fn fly<S: Simd, const ANY: bool, const ASK: bool>(
    tree: &Tree8<Full>,
    wings: &mut [Wing; WINGS],
    used: usize,
    flights: &mut [Flight; IN_FLIGHT],
) {
    let mut waiting = Waiting { wing: 0, left: wings[0].rest.left };
    let mut order = flights.each_mut();
    let mut live = 0;
    while live < IN_FLIGHT && order[live].begin_next::<S, ASK>(&mut waiting, wings, used) {
        live += 1;
    }
    while live > 0 {
        let mut at = 0;
        while at < live {
            let flight = &mut *order[at % IN_FLIGHT];
            let mut is_done = false;
            if ANY {
                is_done = flight.occluded_step::<S, ASK>(tree, wings);
                wings[flight.wing % WINGS].blocked |= u32::from(is_done) << flight.lane;
            } else {
                flight.closest_step::<S, ASK>(tree, wings);
            }
            if (is_done || flight.len == 0) && !flight.begin_next::<S, ASK>(&mut waiting, wings, used) {
                live -= 1;
                order.swap(at, live);
            } else {
                at += 1;
            }
        }
    }
}

/// Prepares the rays, at most as many as the wings hold: the number of wings in use.
#[inline(always)]
fn load<S: Simd>(wings: &mut [Wing; WINGS], tree: &Tree8<Full>, rays: &[Ray], forms: Forms) -> usize {
    let mut used = 0;
    for (wing, rays) in wings.iter_mut().zip(rays.chunks(S::F::LEN)) {
        wing.load::<S>(tree, rays, forms);
        used += 1;
    }
    used
}

/// The closest hit of every ray.
pub(super) struct ClosestApart<'a> {
    pub(super) tree: &'a Tree8<Full>,
    pub(super) prims: &'a Triangles<'a>,
    pub(super) rays: &'a [Ray],
    pub(super) forms: Forms,
    /// Whether the rays of a vector share the top of the tree.
    pub(super) together: bool,
    pub(super) out: &'a mut [Option<Hit>],
}

impl Task for ClosestApart<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, prims, rays, forms, together, out } = self;
        #[expect(clippy::large_stack_arrays, reason = "24 KiB, mostly of places that few rays note")]
        let mut wings = [const { Wing::EMPTY }; WINGS];
        let mut flights = [const { Flight::IDLE }; IN_FLIGHT];
        let mut tri = Spread::EMPTY;
        let many = WINGS * S::F::LEN;
        for (rays, out) in rays.chunks(many).zip(out.chunks_mut(many)) {
            let used = load::<S>(&mut wings, tree, rays, forms);
            if together {
                for wing in &mut wings[..used] {
                    let Wing { rays, nearest, rest, taken, .. } = wing;
                    crown::closest::<S>(tree, rays, *taken, nearest, &mut tri, rest);
                }
                fly::<S, false, true>(tree, &mut wings, used, &mut flights);
            } else {
                fly::<S, false, false>(tree, &mut wings, used, &mut flights);
            }
            for ((wing, rays), out) in wings.iter().zip(rays.chunks(S::F::LEN)).zip(out.chunks_mut(S::F::LEN)) {
                wing.nearest.answer::<S, _>(&wing.rays, &tree.items, &AnyHit, out);
                for i in bits(!wing.taken & (u32::MAX >> (32 - rays.len()))) {
                    out[i] = run::closest_one::<S, Tree8<Full>>(tree, prims, &rays[i], forms);
                }
            }
        }
    }
}

/// Whether every ray is blocked.
pub(super) struct OccludedApart<'a> {
    pub(super) tree: &'a Tree8<Full>,
    pub(super) prims: &'a Triangles<'a>,
    pub(super) rays: &'a [Ray],
    pub(super) forms: Forms,
    /// Whether the rays of a vector share the top of the tree.
    pub(super) together: bool,
    pub(super) out: &'a mut [bool],
}

impl Task for OccludedApart<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, prims, rays, forms, together, out } = self;
        #[expect(clippy::large_stack_arrays, reason = "24 KiB, mostly of places that few rays note")]
        let mut wings = [const { Wing::EMPTY }; WINGS];
        let mut flights = [const { Flight::IDLE }; IN_FLIGHT];
        let mut tri = Spread::EMPTY;
        let many = WINGS * S::F::LEN;
        for (rays, out) in rays.chunks(many).zip(out.chunks_mut(many)) {
            let used = load::<S>(&mut wings, tree, rays, forms);
            if together {
                for wing in &mut wings[..used] {
                    let Wing { rays, rest, taken, blocked, .. } = wing;
                    *blocked = crown::occluded::<S>(tree, rays, *taken, &mut tri, rest);
                }
                fly::<S, true, true>(tree, &mut wings, used, &mut flights);
            } else {
                fly::<S, true, false>(tree, &mut wings, used, &mut flights);
            }
            for ((wing, rays), out) in wings.iter().zip(rays.chunks(S::F::LEN)).zip(out.chunks_mut(S::F::LEN)) {
                for (i, out) in out.iter_mut().enumerate() {
                    *out = wing.blocked >> i & 1 == 1;
                }
                for i in bits(!wing.taken & (u32::MAX >> (32 - rays.len()))) {
                    out[i] = run::occluded_one::<S, Tree8<Full>>(tree, prims, &rays[i], forms);
                }
            }
        }
    }
}
