//! Rays of common direction signs against the wide form.

use super::{
    Wide,
    kernel::{ClosestFrom, End, OccludedFrom, Segment, Segments, by_row, cut_all, flips, sides},
    node::{FOURTH, Node, Word},
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::TriBlock,
        packet::{PACKET, PacketRays},
        query::SLACK,
        ssh::packet::{self as slabs, PacketSlabs},
        wide::{
            WIDTH, WideNode,
            packet::{Entry, GROW, PacketTree, Start, Together, spreads},
            walk,
        },
    },
    geom::Triangles,
    simd::{Lanes, Simd},
};

/// `(plane - origin) * inv` of the first or the last ray to pass a plane.
#[derive(Clone, Copy)]
struct Bound<S: Simd> {
    origin: [f32; 3],
    inv: [f32; 3],
    row_origin: S::F8,
    row_inv: S::F8,
}

impl<S: Simd> Bound<S> {
    #[inline(always)]
    fn new(origin: [f32; 3], inv: [f32; 3], sides: [usize; 3]) -> Self {
        Self { origin, inv, row_origin: by_row::<S>(origin, sides), row_inv: by_row::<S>(inv, sides) }
    }
}

impl<S: Simd> End<S> for Bound<S> {
    #[inline(always)]
    fn at(&self, planes: S::F8, axis: usize) -> S::F8 {
        (planes - S::F8::splat(self.origin[axis])) * S::F8::splat(self.inv[axis])
    }

    #[inline(always)]
    fn at_row(&self, planes: S::F8, words: S::U8) -> S::F8 {
        (planes - S::picked::<FOURTH>(self.row_origin, words)) * S::picked::<FOURTH>(self.row_inv, words)
    }
}

/// All rays by their bounds, and each of them by its own planes: [`Spread::ends`](crate::accel::wide::packet::Spread::ends) has the proof
/// of the first, and that of the second is at the packets of the paper's form.
pub(in crate::accel) struct Packet<S: Simd> {
    slabs: PacketSlabs<S>,
    entry: Bound<S>,
    exit: Bound<S>,
    flips: u32,
}

impl<S: Simd> Packet<S> {
    #[inline(always)]
    fn new(packet: &PacketRays, active: u32, backward: [bool; 3]) -> Self {
        let mut ends = [[[0.0; 3]; 2]; 2];
        for (axis, spread) in spreads::<S>(packet, active).into_iter().enumerate() {
            for (end, (origin, inv)) in ends.iter_mut().zip(spread.ends(backward[axis])) {
                (end[0][axis], end[1][axis]) = (origin, inv);
            }
        }
        let [[entry_origin, entry_inv], [exit_origin, exit_inv]] = ends;
        Self {
            slabs: PacketSlabs::new(packet, backward),
            entry: Bound::new(entry_origin, entry_inv, sides(backward, false)),
            exit: Bound::new(exit_origin, exit_inv, sides(backward, true)),
            flips: flips(backward),
        }
    }
}

/// The part of one ray.
#[inline(always)]
fn of_ray<S: Simd>(segments: &slabs::Segments<S>, ray: usize) -> Segment<f32> {
    let mut rows = [[0.0; PACKET]; 2];
    segments.near.store(&mut rows[0]);
    segments.far.store(&mut rows[1]);
    Segment { near: rows[0][ray], far: rows[1][ray] }
}

impl<S: Simd, const K: usize> Together<S, Wide<K>> for Packet<S> {
    type Mark = Segment<f32>;
    type Kids = Segments<f32>;
    type Rays = slabs::Segments<S>;

    #[inline(always)]
    fn kids() -> Segments<f32> {
        Segments { near: [0.0; WIDTH], far: [0.0; WIDTH] }
    }

    #[inline(always)]
    fn all(&self, node: &Node<K>, mark: Segment<f32>, kids: &mut Segments<f32>) -> u32 {
        let (near, far) = cut_all::<S, _, K>(node, [&self.entry, &self.exit], self.flips, mark, kids);
        near.le(far.mul_add_loose(S::F8::splat(GROW), S::F8::splat(SLACK)))
    }

    #[inline(always)]
    fn mark(kids: &Segments<f32>, slot: usize) -> Segment<f32> {
        Segment { near: kids.near[slot], far: kids.far[slot] }
    }

    #[inline(always)]
    fn key(kids: &Segments<f32>, slot: usize) -> u64 {
        walk::key32(kids.near[slot], slot)
    }

    #[inline(always)]
    fn each(&self, node: &Node<K>, slot: usize, rays: &slabs::Segments<S>) -> (u32, slabs::Segments<S>) {
        let (word, mut segments) = (node.word(slot), *rays);
        for (row, planes) in node.planes.iter().enumerate() {
            segments = self.slabs.cut(planes[slot], word.side(row), segments);
        }
        (segments.open(), segments)
    }

    #[inline(always)]
    fn limit(&mut self, packet: &PacketRays) {
        self.slabs.limit = S::F::load(&packet.t_cull) + S::F::splat(SLACK);
    }

    #[inline(always)]
    fn reopened(&self, rays: &mut slabs::Segments<S>) -> u32 {
        rays.far = self.slabs.limit.min(rays.far);
        rays.open()
    }

    #[inline(always)]
    fn meeting(&self, block: &TriBlock, rays: &slabs::Segments<S>) -> u32 {
        self.slabs.meeting(block, None, *rays)
    }

    #[inline(always)]
    fn closest_below<C: Counter, H: HitSink>(
        tree: &Wide<K>,
        (word, rays, i): (Word, &slabs::Segments<S>, usize),
        ray: (&TravRay, &Triangles<'_>),
        best: &mut Closest,
        sink: &H,
        count: &mut C,
    ) {
        S::call(ClosestFrom { tree, start: Some((word, of_ray(rays, i))), ray, best, sink, count });
    }

    #[inline(always)]
    fn occluded_below<C: Counter, H: HitSink>(
        tree: &Wide<K>,
        (word, rays, i): (Word, &slabs::Segments<S>, usize),
        ray: (&TravRay, &Triangles<'_>),
        sink: &H,
        count: &mut C,
    ) -> bool {
        S::call(OccludedFrom { tree, start: Some((word, of_ray(rays, i))), ray, sink, count })
    }
}

impl<const K: usize> PacketTree for Wide<K> {
    type Packet<S: Simd> = Packet<S>;

    #[inline(always)]
    fn start<S: Simd>(&self, packet: &PacketRays, (active, backward): (u32, [bool; 3])) -> Start<S, Self> {
        let together = Packet::<S>::new(packet, active, backward);
        let rays = together.slabs.clipped(&self.bounds);
        let mask = rays.open() & active;
        let mark = Segment {
            near: S::range(S::F::load(&packet.t_near32), active)[0],
            far: S::range(S::F::load(&packet.t_cull), active)[1],
        };
        let root = (mask != 0).then_some(Entry { word: Self::root(), mask, mark, rays });
        (together, root)
    }
}

/// The children of a node that a packet of equal rays meets: as a whole, and the rays one by one.
#[cfg(test)]
#[inline(always)]
pub(super) fn met_together<S: Simd, const K: usize>(ray: &TravRay, node: &Node<K>) -> [u32; 2] {
    let rays = [*ray; 3];
    let range = ray.range();
    let packet =
        Packet::<S>::new(&PacketRays::new(&rays, 0.0), 7, [range.dir.x < 0.0, range.dir.y < 0.0, range.dir.z < 0.0]);
    let start = slabs::Segments { near: S::F::splat(range.t_near), far: S::F::splat(range.t_far) };
    let mut kids = Segments { near: [0.0; WIDTH], far: [0.0; WIDTH] };
    let segment = Segment { near: range.t_near, far: range.t_far };
    let all = Together::<S, Wide<K>>::all(&packet, node, segment, &mut kids);
    let mut each = 0;
    for slot in 0..WIDTH {
        let hits = Together::<S, Wide<K>>::each(&packet, node, slot, &start).0 & 7;
        assert!(hits == 0 || hits == 7, "{hits:b}");
        each |= (hits & 1) << slot;
    }
    [all, each]
}
