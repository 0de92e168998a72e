//! The walk of packets: the children of a node against all rays at once, then the rays against each child that is left.

use super::{Place, Tree, WIDTH, WideNode, Word};
use crate::{
    accel::{
        Accel, Closest, Counter, HitSink, TravRay,
        block::TriBlock,
        packet::{PacketRays, bits},
        run, slabs,
        topology::MAX_DEPTH,
    },
    geom::Triangles,
    simd::{self, Lanes, Simd},
};

/// Up to this many rays are walked one by one.
const FEW: u32 = 2;

/// Relative slack between the entries and exits of all rays together: 8 * 2^-24, for three roundings of each.
pub(in crate::accel) const GROW: f32 = 1.0 + 8.0 / 16_777_216.0;

/// Rays of common direction signs, one to a lane.
pub(in crate::accel) trait Together<S: Simd, T: Tree> {
    /// Where the rays as a whole enter a child, and what else is needed of it below.
    type Mark: Copy;
    /// The marks of all children of a node.
    type Kids;
    /// The same of each ray.
    type Rays: Copy;

    /// Any marks.
    fn kids() -> Self::Kids;
    /// Bits of the children that any ray may meet; their marks are written.
    fn all(&self, node: &T::Node, mark: Self::Mark, kids: &mut Self::Kids) -> u32;
    /// The mark of a child.
    fn mark(kids: &Self::Kids, slot: usize) -> Self::Mark;
    /// As [`super::walk::Kernel::key`].
    fn key(kids: &Self::Kids, slot: usize) -> u64;
    /// The rays that may meet a child, among them some that do not meet its node.
    fn each(&self, node: &T::Node, slot: usize, rays: &Self::Rays) -> (u32, Self::Rays);
    /// Nothing beyond the best hits counts any more.
    fn limit(&mut self, packet: &PacketRays);
    /// The rays for which something within the limit is left.
    fn reopened(&self, rays: &mut Self::Rays) -> u32;
    /// The rays that may meet a triangle of a block of a leaf.
    fn meeting(&self, block: &TriBlock, rays: &Self::Rays) -> u32;
    /// Walks one ray from a node on.
    fn closest_below<C: Counter, H: HitSink>(
        tree: &T,
        start: (Word<T>, &Self::Rays, usize),
        ray: (&TravRay, &Triangles<'_>),
        best: &mut Closest,
        sink: &H,
        count: &mut C,
    );
    /// As [`Together::closest_below`]: whether anything is hit.
    fn occluded_below<C: Counter, H: HitSink>(
        tree: &T,
        start: (Word<T>, &Self::Rays, usize),
        ray: (&TravRay, &Triangles<'_>),
        sink: &H,
        count: &mut C,
    ) -> bool;
}

/// A node to visit: which rays meet it, and where.
pub(in crate::accel) struct Entry<S: Simd, T: Tree, P: Together<S, T>> {
    pub(in crate::accel) word: Word<T>,
    pub(in crate::accel) mask: u32,
    pub(in crate::accel) mark: P::Mark,
    pub(in crate::accel) rays: P::Rays,
}

impl<S: Simd, T: Tree, P: Together<S, T>> Clone for Entry<S, T, P> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: Simd, T: Tree, P: Together<S, T>> Copy for Entry<S, T, P> {}

/// A packet, and the root for those of its rays that may meet it.
pub(in crate::accel) type Start<S, T> =
    (<T as PacketTree>::Packet<S>, Option<Entry<S, T, <T as PacketTree>::Packet<S>>>);

/// A tree whose packets are walked together.
pub(in crate::accel) trait PacketTree: Tree + Accel {
    /// Its packets.
    type Packet<S: Simd>: Together<S, Self>;

    /// A prepared packet of rays with `backward` signs, and the root for those that may meet it.
    fn start<S: Simd>(&self, packet: &PacketRays, rays: (u32, [bool; 3])) -> Start<S, Self>;
}

/// A packet tree that owns its blocks.
pub(in crate::accel) trait BlockTree: PacketTree {
    /// The blocks of all leaves.
    fn blocks(&self) -> &[TriBlock];
    /// Blocks of a leaf that has some.
    fn leaf_blocks(&self, word: Word<Self>) -> &[TriBlock];
}

/// As [`Accel::closest_packet`].
#[inline(always)]
pub(in crate::accel) fn closest_packet<S: Simd, T: PacketTree, C: Counter, H: HitSink>(
    tree: &T,
    prims: &Triangles<'_>,
    rays: &[TravRay],
    active: u32,
    best: &mut [Closest],
    sinks: &[H],
    count: &mut C,
) {
    for (start, end, mut left) in lanes::<S>(rays.len(), active) {
        let (rays, best, sinks) = (&rays[start..end], &mut best[start..end], &sinks[start..end]);
        while left != 0 {
            let (members, backward) = group(|ray| slabs::fits(ray, tree.reach()), rays, left);
            left &= !members;
            if members.count_ones() <= FEW {
                run::closest_singly::<S, T, C, H>(tree, prims, rays, members, best, sinks, count);
                continue;
            }
            let mut packet = PacketRays::new(rays, tree.reach());
            packet.prepare::<S>(rays[0].forms().nodes);
            for (i, best) in best.iter().enumerate() {
                packet.set_limit(i, best);
            }
            let (together, root) = tree.start::<S>(&packet, (members, backward));
            if let Some(root) = root {
                closest::<S, T, _, C, H>(tree, together, root, (rays, prims), &mut packet, (&mut *best, sinks), count);
            }
        }
    }
}

/// As [`Accel::occluded_packet`].
#[inline(always)]
pub(in crate::accel) fn occluded_packet<S: Simd, T: PacketTree, C: Counter, H: HitSink>(
    tree: &T,
    prims: &Triangles<'_>,
    rays: &[TravRay],
    active: u32,
    sinks: &[H],
    count: &mut C,
) -> u32 {
    let mut blocked = 0;
    for (start, end, mut left) in lanes::<S>(rays.len(), active) {
        let (rays, sinks) = (&rays[start..end], &sinks[start..end]);
        while left != 0 {
            let (members, backward) = group(|ray| slabs::fits(ray, tree.reach()), rays, left);
            left &= !members;
            if members.count_ones() <= FEW {
                blocked |= run::occluded_singly::<S, T, C, H>(tree, prims, rays, members, sinks, count) << start;
                continue;
            }
            let mut packet = PacketRays::new(rays, tree.reach());
            packet.prepare::<S>(rays[0].forms().nodes);
            let (together, root) = tree.start::<S>(&packet, (members, backward));
            if let Some(root) = root {
                blocked |=
                    occluded::<S, T, _, C, H>(tree, &together, root, (rays, prims), &packet, sinks, count) << start;
            }
        }
    }
    blocked
}

/// Nodes to visit, the next last.
pub(super) type Stack<S, T, P> = simd::Stack<Entry<S, T, P>, { MAX_DEPTH * (WIDTH - 1) + 1 }>;

/// Puts the children that rays of an entry meet on the stack, nearest last.
#[inline(always)]
pub(super) fn descend<S: Simd, T: Tree, P: Together<S, T>>(
    together: &P,
    node: &T::Node,
    (mask, mark, rays): (u32, P::Mark, &P::Rays),
    kids: &mut P::Kids,
    stack: &mut Stack<S, T, P>,
) {
    let mut hits = together.all(node, mark, kids);
    let mut keys = [0_u64; WIDTH];
    let mut len = 0;
    while hits != 0 {
        let key = P::key(kids, (hits.trailing_zeros() & 7) as usize);
        hits &= hits - 1;
        let mut at = len;
        while at > 0 && keys[(at - 1) & 7] < key {
            keys[at & 7] = keys[(at - 1) & 7];
            at -= 1;
        }
        keys[at & 7] = key;
        len += 1;
    }
    for &key in &keys[..len] {
        let slot = (key & 7) as usize;
        let (hits, rays) = together.each(node, slot, rays);
        let mask = hits & mask;
        if mask != 0 {
            stack.push(Entry { word: node.word(slot), mask, mark: P::mark(kids, slot), rays });
        }
    }
}

/// Offers the triangles below a node to the rays of a packet.
#[inline(always)]
fn closest<S: Simd, T: Tree, P: Together<S, T>, C: Counter, H: HitSink>(
    tree: &T,
    mut together: P,
    start: Entry<S, T, P>,
    (rays, prims): (&[TravRay], &Triangles<'_>),
    packet: &mut PacketRays,
    (best, sinks): (&mut [Closest], &[H]),
    count: &mut C,
) {
    let (mut kids, mut room) = (P::kids(), TriBlock::EMPTY);
    let mut stack = Stack::<S, T, P>::new();
    stack.push(start);
    while let Some(mut entry) = stack.pop() {
        let mask = entry.mask & together.reopened(&mut entry.rays);
        if mask == 0 {
            continue;
        }
        if entry.word.is_leaf() {
            for i in 0..tree.span(entry.word) {
                let block = tree.block((entry.word, i), prims, &mut room, count);
                let mask = mask & together.meeting(block, &entry.rays);
                if mask != 0 {
                    block.closest_packet::<S, C, H>(rays, packet, mask, best, sinks, count);
                }
            }
            together.limit(packet);
        } else if mask.count_ones() <= FEW {
            for i in bits(mask) {
                P::closest_below(tree, (entry.word, &entry.rays, i), (&rays[i], prims), &mut best[i], &sinks[i], count);
                packet.set_limit(i, &best[i]);
            }
            together.limit(packet);
        } else {
            count.node();
            descend(&together, tree.node(entry.word.index()), (mask, entry.mark, &entry.rays), &mut kids, &mut stack);
        }
    }
}

/// The rays of the start that something blocks.
#[inline(always)]
fn occluded<S: Simd, T: Tree, P: Together<S, T>, C: Counter, H: HitSink>(
    tree: &T,
    together: &P,
    start: Entry<S, T, P>,
    (rays, prims): (&[TravRay], &Triangles<'_>),
    packet: &PacketRays,
    sinks: &[H],
    count: &mut C,
) -> u32 {
    let (mut kids, mut room) = (P::kids(), TriBlock::EMPTY);
    let mut stack = Stack::<S, T, P>::new();
    let active = start.mask;
    let mut open = active;
    stack.push(start);
    while let Some(entry) = stack.pop() {
        let mask = entry.mask & open;
        if mask == 0 {
            continue;
        }
        if entry.word.is_leaf() {
            for i in 0..tree.span(entry.word) {
                let block = tree.block((entry.word, i), prims, &mut room, count);
                let mask = mask & open & together.meeting(block, &entry.rays);
                if mask != 0 {
                    open &= !block.occluded_packet::<S, C, H>(rays, packet, mask, sinks, count);
                }
            }
            if open == 0 {
                break;
            }
        } else if mask.count_ones() <= FEW {
            for i in bits(mask) {
                let hit = P::occluded_below(tree, (entry.word, &entry.rays, i), (&rays[i], prims), &sinks[i], count);
                open &= !(u32::from(hit) << i);
            }
        } else {
            count.node();
            descend(together, tree.node(entry.word.index()), (mask, entry.mark, &entry.rays), &mut kids, &mut stack);
        }
    }
    active & !open
}

/// Bounds on the origins and reciprocal directions of some rays along one axis.
#[derive(Clone, Copy, Debug)]
pub(in crate::accel) struct Spread {
    pub(in crate::accel) origin: [f32; 2],
    pub(in crate::accel) inv: [f32; 2],
}

impl Spread {
    /// `(origin, inv)` of entries and of exits, for rays downward along the axis or not.
    ///
    /// For rays upward the entry of a plane is `(p - o) inv`, with `o` at most the greatest origin and `inv` at least the least factor: where the
    /// difference is not negative the product of these is at most the entry, and elsewhere it is not positive, while rays begin at 0 or later. The
    /// exit is at most the product of the difference to the least origin and the greatest factor, where that is not negative; elsewhere no ray meets what
    /// ends there. Downward the differences and factors are negative and change places.
    #[inline(always)]
    pub(in crate::accel) fn ends(self, backward: bool) -> [(f32, f32); 2] {
        let Self { origin, inv } = self;
        if backward { [(origin[0], inv[1]), (origin[1], inv[0])] } else { [(origin[1], inv[0]), (origin[0], inv[1])] }
    }
}

/// The spreads of some rays of a packet.
#[inline(always)]
pub(in crate::accel) fn spreads<S: Simd>(packet: &PacketRays, active: u32) -> [Spread; 3] {
    let mut out = [Spread { origin: [0.0; 2], inv: [0.0; 2] }; 3];
    for (axis, out) in out.iter_mut().enumerate() {
        let inv = S::F::splat(1.0) / S::F::load(&packet.dir32[axis]);
        *out = Spread { origin: S::range(S::F::load(&packet.origin32[axis]), active), inv: S::range(inv, active) };
    }
    out
}

/// The rays that go into one vector each time: the first, the end, and the active ones among them.
#[inline(always)]
fn lanes<S: Simd>(rays: usize, active: u32) -> impl Iterator<Item = (usize, usize, u32)> {
    (0..rays).step_by(S::F::LEN).map(move |start| {
        let end = rays.min(start + S::F::LEN);
        (start, end, (active >> start) & ((1 << (end - start)) - 1))
    })
}

/// The first of the rays in `left` and all others of the same direction signs; rays that are not ordinary stand alone.
#[inline(always)]
pub(in crate::accel) fn group(is_ordinary: impl Fn(&TravRay) -> bool, rays: &[TravRay], left: u32) -> (u32, [bool; 3]) {
    let signs = |ray: &TravRay| ray.range().dir.to_array().map(|d| d < 0.0);
    let leader = left.trailing_zeros() as usize;
    let due = signs(&rays[leader]);
    if !is_ordinary(&rays[leader]) {
        return (1 << leader, due);
    }
    let mut members = 0;
    for i in bits(left) {
        members |= u32::from(is_ordinary(&rays[i]) && signs(&rays[i]) == due) << i;
    }
    (members, due)
}
