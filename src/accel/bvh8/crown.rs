//! The top of the tree for a vector of rays that point apart.
//!
//! Rays that start close together meet the same nodes near the root whatever their directions, and a box costs a vector of rays less than a node costs one ray.
//! So nodes that many of the rays meet are tested by lane; what few of them meet each of them notes, to go on by itself from there (`stream.rs`).
//!
//! # Source
//! The hybrid traversal of Embree's packets: Benthin, Wald, Woop, Ernst and Mark, "Combining Single and Packet-Ray Tracing for Arbitrary Ray Distributions on the
//! Intel MIC Architecture", 2012. Departures: single rays go on after the packet is done, several in flight; children that no ray's segment comes near are left
//! out.

use super::{
    full::Full,
    kernel::MAX_STACK,
    node::{Link, Node},
    tree::Tree8,
};
use crate::{
    accel::{
        AnyHit, PACKET,
        packet::{Nearest, PacketRays, Spread, bits},
        query::SLACK,
        wide::{Place, WIDTH},
    },
    simd::{LEAST_KEY, Lanes, Simd, Stack},
};

/// Up to this many rays go on by themselves.
const FEW: u32 = 3;

/// Most places that a ray notes; one that comes by more begins at the root.
const ROOM: usize = 24;

/// Where each ray of a vector goes on by itself.
pub(super) struct Rest {
    /// The places before `len`, each with the key of where the ray enters it.
    keys: [[u32; ROOM]; PACKET],
    links: [[u32; ROOM]; PACKET],
    len: [usize; PACKET],
    /// Rays that have places left.
    pub(super) left: u32,
    /// Rays that came by more places than there is room for.
    lost: u32,
}

impl Rest {
    pub(super) const NONE: Self =
        Self { keys: [[0; ROOM]; PACKET], links: [[0; ROOM]; PACKET], len: [0; PACKET], left: 0, lost: 0 };

    /// All rays in `taken` begin at the root.
    #[inline(always)]
    pub(super) fn whole(&mut self, taken: u32) {
        (self.left, self.lost) = (taken, taken);
    }

    #[inline(always)]
    fn clear(&mut self) {
        self.len = [0; PACKET];
        (self.left, self.lost) = (0, 0);
    }

    #[inline(always)]
    fn note(&mut self, ray: usize, entry: f32, link: Link) {
        let at = self.len[ray];
        self.left |= 1 << ray;
        if at < ROOM {
            self.keys[ray][at] = entry.to_bits() + LEAST_KEY;
            self.links[ray][at] = link.bits();
            self.len[ray] = at + 1;
        } else {
            self.lost |= 1 << ray;
        }
    }

    /// Notes a place for each of the rays in `mask`.
    #[inline(always)]
    fn note_each<S: Simd>(&mut self, mask: u32, due: &Due<S>) {
        let mut entries = [0.0; PACKET];
        due.near.store(&mut entries);
        for i in bits(mask) {
            self.note(i % PACKET, entries[i % PACKET], due.link);
        }
    }

    /// Moves a ray's places to a stack, the nearest last; their number.
    #[inline(always)]
    pub(super) fn unload(&self, ray: usize, keys: &mut [u32; MAX_STACK], links: &mut [u32; MAX_STACK]) -> usize {
        if self.lost >> ray & 1 == 1 {
            (keys[0], links[0]) = (LEAST_KEY, Tree8::<Full>::root().bits());
            return 1;
        }
        let len = self.len[ray].min(ROOM);
        for i in 0..len {
            let (key, link) = (self.keys[ray][i], self.links[ray][i]);
            let mut at = i;
            while at > 0 && keys[at - 1] < key {
                (keys[at], links[at]) = (keys[at - 1], links[at - 1]);
                at -= 1;
            }
            (keys[at], links[at]) = (key, link);
        }
        len
    }
}

/// A node or leaf to visit: the rays that meet it and where each enters it.
#[derive(Clone, Copy)]
struct Due<S: Simd> {
    near: S::F,
    link: Link,
    mask: u32,
}

/// Rays of any directions against the boxes of a node.
struct Crown<S: Simd> {
    /// By axis, factor and summand of the lower and of the upper plane, as [`Slab`](crate::accel::slabs::Slab) proves them for entries and exits. Which is
    /// which depends on the lane: the lesser of both products is at most the entry, the greater at least the exit.
    planes: [[[S::F; 2]; 2]; 3],
    near: S::F,
    limit: S::F,
    /// By axis, bounds on the rays' segments within the reach.
    hull: [[S::F8; 2]; 3],
}

/// Part of the numbers that end points are made of by which they are moved outward: above their roundings, three of 2^-24 each.
const OUTWARD: f32 = 1.0 / 2_097_152.0;

/// What each ray's best hit leaves, with slack for underflows.
#[inline(always)]
fn limit<S: Simd>(rays: &PacketRays) -> S::F {
    S::F::load(&rays.t_cull) + S::F::splat(SLACK)
}

impl<S: Simd> Crown<S> {
    #[inline(always)]
    fn new(rays: &PacketRays, taken: u32, reach: f32) -> Self {
        let zero = S::F::splat(0.0);
        let mut planes = [[[zero; 2]; 2]; 3];
        let mut hull = [[S::F8::splat(0.0); 2]; 3];
        // Longer ways lead beyond the reach from wherever a ray may start.
        let most = S::F::splat(4096.0 * reach);
        for axis in 0..3 {
            let (slab, backward) = (rays.lines.slab::<S>(axis), rays.backward[axis]);
            planes[axis] = [
                [
                    S::F::select(backward, slab.exit_mul, slab.entry_mul),
                    S::F::select(backward, slab.exit_add, slab.entry_add),
                ],
                [
                    S::F::select(backward, slab.entry_mul, slab.exit_mul),
                    S::F::select(backward, slab.entry_add, slab.exit_add),
                ],
            ];
            let (from, dir) = (S::F::load(&rays.origin32[axis]), S::F::load(&rays.dir32[axis]));
            let way = (dir * S::F::load(&rays.t_cull)).min(most).max(-most);
            let pad = (from.abs() + way.abs()).mul_add_loose(S::F::splat(OUTWARD), S::F::splat(f32::MIN_POSITIVE));
            let to = from + way;
            let low = S::range(from.min(to) - pad, taken)[0].max(-reach);
            let high = S::range(from.max(to) + pad, taken)[1].min(reach);
            hull[axis] = [S::F8::splat(low), S::F8::splat(high)];
        }
        Self { planes, near: S::F::load(&rays.t_near32), limit: limit::<S>(rays), hull }
    }

    /// The children that the rays' segments come near. An empty box lies beyond the reach.
    #[inline(always)]
    fn near(&self, node: &Node) -> u32 {
        let mut hits = S::F8::ALL;
        for axis in 0..3 {
            let [low, high] = self.hull[axis];
            hits &= S::F8::load(&node.planes[axis][0]).le(high) & low.le(S::F8::load(&node.planes[axis][1]));
        }
        hits
    }

    /// Where each ray enters a child, and the rays that may meet it.
    #[inline(always)]
    fn each(&self, node: &Node, slot: usize) -> (S::F, u32) {
        let (mut near, mut far) = (self.near, self.limit);
        for axis in 0..3 {
            let [low, high] = &self.planes[axis];
            let a = S::F::splat(node.planes[axis][0][slot]).mul_add_loose(low[0], low[1]);
            let b = S::F::splat(node.planes[axis][1][slot]).mul_add_loose(high[0], high[1]);
            near = a.min(b).max(near);
            far = a.max(b).min(far);
        }
        (near, near.le(far))
    }

    /// Notes or stacks the children of a node for the rays in `mask`, the nearest last unless `ANY` will do. Which rays meet which child is found without branches.
    #[inline(always)]
    fn descend<const ANY: bool>(
        &self,
        node: &Node,
        mask: u32,
        kids: &mut Kids,
        rest: &mut Rest,
        stack: &mut Stack<Due<S>, MAX_STACK>,
    ) {
        let near = self.near(node);
        // Rays by themselves, 16 bits a child, and children that many meet.
        let (mut alone, mut many) = ([0_u64; 2], 0_u32);
        for slot in 0..WIDTH {
            let (entries, hits) = self.each(node, slot);
            entries.store(&mut kids.entries[slot]);
            let hits = hits & mask & 0_u32.wrapping_sub(near >> slot & 1);
            kids.hits[slot] = hits;
            let is_many = hits.count_ones() > FEW;
            many |= u32::from(is_many) << slot;
            alone[slot / 4] |= u64::from(if is_many { 0 } else { hits }) << (16 * (slot % 4));
        }
        for half in 0..2 {
            let mut alone = alone[half];
            while alone != 0 {
                let bit = alone.trailing_zeros() as usize;
                alone &= alone - 1;
                let (slot, ray) = (half * 4 + (bit / 16) % 4, bit % 16);
                rest.note(ray, kids.entries[slot][ray], node.links[slot]);
            }
        }
        let mut len = 0;
        while many != 0 {
            let slot = (many.trailing_zeros() & 7) as usize;
            many &= many - 1;
            let (near, hits) = (S::F::load(&kids.entries[slot]), kids.hits[slot]);
            if ANY {
                stack.push(Due { near, link: node.links[slot], mask: hits });
                continue;
            }
            let entry = S::range(near, hits)[0];
            let mut at = len;
            while at > 0 && kids.order[(at - 1) % WIDTH].0 < entry {
                kids.order[at % WIDTH] = kids.order[(at - 1) % WIDTH];
                at -= 1;
            }
            kids.order[at % WIDTH] = (entry, slot);
            len += 1;
        }
        for i in 0..len.min(WIDTH) {
            let slot = kids.order[i].1 % WIDTH;
            stack.push(Due { near: S::F::load(&kids.entries[slot]), link: node.links[slot], mask: kids.hits[slot] });
        }
    }
}

/// What was found of the children of a node.
struct Kids {
    entries: [[f32; PACKET]; WIDTH],
    hits: [u32; WIDTH],
    order: [(f32, usize); WIDTH],
}

impl Kids {
    const NONE: Self = Self { entries: [[0.0; PACKET]; WIDTH], hits: [0; WIDTH], order: [(0.0, 0); WIDTH] };
}

/// Offers what many of the prepared rays in `taken` meet to them, and notes the rest.
#[inline(always)]
pub(super) fn closest<S: Simd>(
    tree: &Tree8<Full>,
    rays: &mut PacketRays,
    taken: u32,
    nearest: &mut Nearest,
    tri: &mut Spread,
    rest: &mut Rest,
) {
    rest.clear();
    let mut crown = Crown::<S>::new(rays, taken, tree.reach);
    let mut stack = Stack::<Due<S>, MAX_STACK>::new();
    let mut kids = Kids::NONE;
    stack.push(Due { near: crown.near, link: Tree8::<Full>::root(), mask: taken });
    while let Some(due) = stack.pop() {
        let mask = due.mask & due.near.le(crown.limit);
        if mask.count_ones() <= FEW {
            rest.note_each::<S>(mask, &due);
        } else if due.link.is_leaf() {
            for number in due.link.blocks() {
                nearest.offer::<S, _>(rays, (&tree.items, number), mask, tri, &AnyHit);
            }
            crown.limit = limit::<S>(rays);
        } else {
            crown.descend::<false>(&tree.nodes[due.link.index()], mask, &mut kids, rest, &mut stack);
        }
    }
}

/// The rays in `taken` that something blocks which many of them meet; notes the rest.
#[inline(always)]
pub(super) fn occluded<S: Simd>(
    tree: &Tree8<Full>,
    rays: &PacketRays,
    taken: u32,
    tri: &mut Spread,
    rest: &mut Rest,
) -> u32 {
    rest.clear();
    let crown = Crown::<S>::new(rays, taken, tree.reach);
    let mut stack = Stack::<Due<S>, MAX_STACK>::new();
    let mut kids = Kids::NONE;
    stack.push(Due { near: crown.near, link: Tree8::<Full>::root(), mask: taken });
    let mut open = taken;
    while let Some(due) = stack.pop() {
        let mask = due.mask & open;
        if mask.count_ones() <= FEW {
            rest.note_each::<S>(mask, &due);
        } else if due.link.is_leaf() {
            let mut left = mask;
            for number in due.link.blocks() {
                left &= !tree.items[number].blocked::<S>(rays, left, tri);
            }
            open &= !(mask & !left);
        } else {
            crown.descend::<true>(&tree.nodes[due.link.index()], mask, &mut kids, rest, &mut stack);
        }
    }
    rest.left &= open;
    taken & !open
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_come_off_nearest_last() {
        let mut rest = Rest::NONE;
        for (entry, number) in [(2.0, 20), (0.0, 0), (3.0, 30), (1.0, 10)] {
            rest.note(5, entry, Link::inner(number));
        }
        let (mut keys, mut links) = ([0; MAX_STACK], [0; MAX_STACK]);
        assert_eq!((rest.unload(5, &mut keys, &mut links), rest.left), (4, 1 << 5));
        assert_eq!(links[..4], [30, 20, 10, 0].map(|number| Link::inner(number).bits()));
        assert_eq!(keys[..4].iter().map(|&key| crate::simd::key_floor(key)).collect::<Vec<_>>(), [3.0, 2.0, 1.0, 0.0]);
    }

    #[test]
    fn a_ray_with_more_places_than_room_begins_at_the_root() {
        let mut rest = Rest::NONE;
        for number in 1..=ROOM + 1 {
            rest.note(3, 1.0, Link::inner(number));
            rest.note(4, 1.0, Link::inner(number));
        }
        let (mut keys, mut links) = ([0; MAX_STACK], [0; MAX_STACK]);
        assert_eq!(rest.unload(3, &mut keys, &mut links), 1);
        assert_eq!((keys[0], links[0]), (LEAST_KEY, Tree8::<Full>::root().bits()));
        rest.clear();
        rest.note(4, 1.0, Link::inner(7));
        assert_eq!((rest.unload(4, &mut keys, &mut links), links[0]), (1, Link::inner(7).bits()));
    }
}
