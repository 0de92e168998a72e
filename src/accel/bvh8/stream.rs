//! Many single rays, a few of them in flight.
//!
//! The step of one ray through a node is a chain of operations that each wait for the one before, so a walk by itself leaves most of a core idle. Here the rays in
//! flight take turns, a step each. A step has few branches: the children that are met go on the stack in order, by a sorting network and not by comparisons, and
//! the next step takes the last.

use super::{
    Bvh8,
    kernel::{Boxes, ClosestLeaf, MAX_STACK, OccludedLeaf},
    node::Link,
};
use crate::{
    accel::{
        AnyHit, Closest, TravRay, slabs,
        wide::{Place, WIDTH},
    },
    geom::{Forms, Hit, Ray},
    simd::{LEAST_KEY, Scalar, Simd, Task, key_floor},
};

impl Bvh8 {
    #[cold]
    #[inline(never)]
    fn one_wide(&self, ray: &TravRay) -> Option<Hit> {
        let mut best = Closest::new(ray);
        self.closest_wide(ray, &mut best, &AnyHit, &mut ());
        best.hit(ray)
    }
}

/// Rays in flight.
const IN_FLIGHT: usize = 4;

/// Places for all children of a node.
#[inline(always)]
fn room(words: &mut [u32; MAX_STACK], at: usize) -> &mut [u32; WIDTH] {
    words[at..].first_chunk_mut().expect("every level leaves room for its children")
}

/// A ray on its way.
struct Flight {
    boxes: Boxes,
    ray: TravRay,
    best: Closest,
    /// Number of the ray.
    number: usize,
    /// Children to visit, the last first; the items before `len`.
    len: usize,
    keys: [u32; MAX_STACK],
    links: [u32; MAX_STACK],
}

impl Flight {
    fn idle() -> Self {
        let ray = TravRay::STAND_IN;
        Self {
            boxes: Boxes::new::<Scalar>(&ray, 1.0, 0.0),
            best: Closest::new(&ray),
            ray,
            number: 0,
            len: 0,
            keys: [0; MAX_STACK],
            links: [0; MAX_STACK],
        }
    }

    /// Puts a ray on its way.
    #[inline(always)]
    fn begin<S: Simd>(&mut self, tree: &Bvh8, ray: TravRay, number: usize) {
        self.boxes = Boxes::new::<S>(&ray, tree.reach, ray.range().t_far);
        self.best = Closest::new(&ray);
        self.ray = ray;
        self.number = number;
        self.len = 1;
        (self.keys[0], self.links[0]) = (LEAST_KEY, Bvh8::root().bits());
    }

    #[inline(always)]
    fn closest_step<S: Simd>(&mut self, tree: &Bvh8) {
        self.len -= 1;
        let (key, link) = (self.keys[self.len], Link::from_bits(self.links[self.len]));
        if !self.boxes.reaches(key_floor(key)) {
            return;
        }
        if link.is_leaf() {
            S::call(ClosestLeaf { tree, link, ray: &self.ray, best: &mut self.best, sink: &AnyHit, count: &mut () });
            self.boxes.set_limit(self.best.t_cull());
            return;
        }
        let node = &tree.nodes[link.index()];
        let (near, hits) = self.boxes.test::<S>(node);
        let (keys, links) = (room(&mut self.keys, self.len), room(&mut self.links, self.len));
        S::descending(near, hits, Link::words(&node.links), keys, links);
        self.len += hits.count_ones() as usize;
    }

    /// True when the ray is blocked.
    #[inline(always)]
    fn occluded_step<S: Simd>(&mut self, tree: &Bvh8) -> bool {
        self.len -= 1;
        let link = Link::from_bits(self.links[self.len]);
        if link.is_leaf() {
            return S::call(OccludedLeaf { tree, link, ray: &self.ray, sink: &AnyHit, count: &mut () });
        }
        let node = &tree.nodes[link.index()];
        let (_, hits) = self.boxes.test::<S>(node);
        S::compress(Link::words(&node.links), hits, room(&mut self.links, self.len));
        self.len += hits.count_ones() as usize;
        false
    }
}

/// The rays of a batch that are still to begin.
struct Waiting<'a> {
    tree: &'a Bvh8,
    rays: &'a [Ray],
    forms: Forms,
    next: usize,
}

impl Waiting<'_> {
    /// Puts the next ray on its way that can hit something and whose f32 tests are proven; `wide` answers the others. False when none is left.
    #[inline(always)]
    fn launch<S: Simd>(&mut self, flight: &mut Flight, mut wide: impl FnMut(&TravRay, usize)) -> bool {
        while let Some(ray) = self.rays.get(self.next) {
            let number = self.next;
            self.next += 1;
            if let Some(ray) = TravRay::with_forms(ray, self.forms) {
                if slabs::fits(&ray, self.tree.reach) {
                    flight.begin::<S>(self.tree, ray, number);
                    return true;
                }
                wide(&ray, number);
            }
        }
        false
    }
}

/// The closest hit of every ray.
pub(super) struct ClosestApart<'a> {
    pub(super) tree: &'a Bvh8,
    pub(super) rays: &'a [Ray],
    pub(super) forms: Forms,
    pub(super) out: &'a mut [Option<Hit>],
}

impl Task for ClosestApart<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, rays, forms, out } = self;
        closest::<S>(tree, rays, forms, out);
    }
}

#[inline(always)]
fn closest<S: Simd>(tree: &Bvh8, rays: &[Ray], forms: Forms, out: &mut [Option<Hit>]) {
    out.fill(None);
    let mut waiting = Waiting { tree, rays, forms, next: 0 };
    let mut flights: [Flight; IN_FLIGHT] = std::array::from_fn(|_| Flight::idle());
    let mut slots: [usize; IN_FLIGHT] = std::array::from_fn(|slot| slot);
    let mut live = 0;
    while live < IN_FLIGHT && waiting.launch::<S>(&mut flights[live], |ray, number| out[number] = tree.one_wide(ray)) {
        live += 1;
    }
    while live > 0 {
        let mut at = 0;
        while at < live {
            let flight = &mut flights[slots[at] % IN_FLIGHT];
            flight.closest_step::<S>(tree);
            if flight.len == 0 {
                out[flight.number] = flight.best.hit(&flight.ray);
                if !waiting.launch::<S>(flight, |ray, number| out[number] = tree.one_wide(ray)) {
                    live -= 1;
                    slots.swap(at, live);
                    continue;
                }
            }
            at += 1;
        }
    }
}

/// Whether every ray is blocked.
pub(super) struct OccludedApart<'a> {
    pub(super) tree: &'a Bvh8,
    pub(super) rays: &'a [Ray],
    pub(super) forms: Forms,
    pub(super) out: &'a mut [bool],
}

impl Task for OccludedApart<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, rays, forms, out } = self;
        occluded::<S>(tree, rays, forms, out);
    }
}

#[inline(always)]
fn occluded<S: Simd>(tree: &Bvh8, rays: &[Ray], forms: Forms, out: &mut [bool]) {
    out.fill(false);
    let mut waiting = Waiting { tree, rays, forms, next: 0 };
    let mut flights: [Flight; IN_FLIGHT] = std::array::from_fn(|_| Flight::idle());
    let mut slots: [usize; IN_FLIGHT] = std::array::from_fn(|slot| slot);
    let mut live = 0;
    let wide = |ray: &TravRay| tree.occluded_wide(ray, &AnyHit, &mut ());
    while live < IN_FLIGHT && waiting.launch::<S>(&mut flights[live], |ray, number| out[number] = wide(ray)) {
        live += 1;
    }
    while live > 0 {
        let mut at = 0;
        while at < live {
            let flight = &mut flights[slots[at] % IN_FLIGHT];
            let blocked = flight.occluded_step::<S>(tree);
            if blocked || flight.len == 0 {
                out[flight.number] = blocked;
                if !waiting.launch::<S>(flight, |ray, number| out[number] = wide(ray)) {
                    live -= 1;
                    slots.swap(at, live);
                    continue;
                }
            }
            at += 1;
        }
    }
}
