use arrayvec::ArrayVec;

use super::{
    narrow::Narrow,
    node::{Node, Side, Word},
    traverse::{SLACK, predicted},
};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::TriBlock,
        packet::{PACKET, PacketRays},
        query::{GROW, SHRINK},
        run,
        topology::MAX_DEPTH,
        wide::packet::group,
    },
    geom::{Aabb, Triangles},
    simd::{Halves, Lanes, Simd},
};

/// Groups of fewer rays of common direction signs are walked one by one.
const FEW: u32 = 3;

/// Rays of common direction signs, one to a lane, against single planes. The proof at `FastSlabs` holds lane by lane, with the slack added
/// to exits and limits, where it costs no instruction: that rounds once more at most, which the widening of exits covers. Lanes of rays with
/// other signs hold nonsense and are masked.
pub(super) struct PacketSlabs<S: Simd> {
    origin: [S::F; 3],
    /// By [`Side::row`]: factors for entries and exits, NaN for those that are not.
    entry: [S::F; Side::ROWS],
    exit: [S::F; Side::ROWS],
    backward: [bool; 3],
    t_near: S::F,
    pub(super) limit: S::F,
}

/// The part of each ray inside a node.
#[derive(Clone, Copy)]
pub(super) struct Segments<S: Simd> {
    pub(super) near: S::F,
    pub(super) far: S::F,
}

impl<S: Simd> Segments<S> {
    #[inline(always)]
    pub(super) fn open(self) -> u32 {
        self.near.le(self.far)
    }
}

impl<S: Simd> PacketSlabs<S> {
    #[inline(always)]
    pub(super) fn new(packet: &PacketRays, backward: [bool; 3]) -> Self {
        let nan = S::F::splat(f32::NAN);
        let row = |rows: &[[f32; PACKET]; 3], axis: usize| S::F::load(&rows[axis]);
        let origin = [row(&packet.origin32, 0), row(&packet.origin32, 1), row(&packet.origin32, 2)];
        let mut out = Self {
            origin,
            entry: [nan; Side::ROWS],
            exit: [nan; Side::ROWS],
            backward,
            t_near: S::F::load(&packet.t_near32),
            limit: S::F::load(&packet.t_cull) + S::F::splat(SLACK),
        };
        let one = S::F::splat(1.0);
        // As `TravRay::new`.
        let inv = [one / row(&packet.dir32, 0), one / row(&packet.dir32, 1), one / row(&packet.dir32, 2)];
        for side in Side::ALL {
            let inv = inv[side.axis()];
            if side.is_upper() == backward[side.axis()] {
                out.entry[side.row()] = inv * S::F::splat(SHRINK);
            } else {
                out.exit[side.row()] = inv * S::F::splat(GROW);
            }
        }
        out
    }

    #[inline(always)]
    pub(super) fn cut(&self, plane: f32, side: Side, segments: Segments<S>) -> Segments<S> {
        let distance = S::F::splat(plane) - self.origin[side.axis()];
        Segments {
            near: (distance * self.entry[side.row()]).max(segments.near),
            far: distance.mul_add_loose(self.exit[side.row()], S::F::splat(SLACK)).min(segments.far),
        }
    }

    #[inline(always)]
    fn cut_by(&self, node: Node, segments: Segments<S>) -> Segments<S> {
        self.cut(node.plane, node.word.side(), segments)
    }

    /// Cuts the rays of `mask` by two siblings; the one that comes first along the order axis is next, the other goes to the stack.
    #[inline(always)]
    fn descend(
        &self,
        stack: &mut Stack<S>,
        nodes: [Node; 2],
        order: usize,
        mask: u32,
        segments: Segments<S>,
    ) -> Option<Entry<S>> {
        let nearer = usize::from(self.backward[order]);
        let (first, second) = (nodes[nearer], nodes[1 - nearer]);
        let (segments1, segments2) = (self.cut_by(first, segments), self.cut_by(second, segments));
        let (mask1, mask2) = (segments1.open() & mask, segments2.open() & mask);
        let later = Entry { word: second.word, mask: mask2, segments: segments2 };
        if mask1 == 0 {
            return (mask2 != 0).then_some(Entry { word: predicted(second.word), ..later });
        }
        if mask2 != 0 {
            stack.push(later);
        }
        Some(Entry { word: predicted(first.word), mask: mask1, segments: segments1 })
    }

    /// Rays that may meet the box around the triangles of a block, or around one of them.
    #[inline(always)]
    pub(super) fn meeting(&self, block: &TriBlock, lane: Option<usize>, mut segments: Segments<S>) -> u32 {
        let planes = box_of::<S>(block, lane);
        for side in Side::ALL {
            segments = self.cut(planes[side.axis()][usize::from(side.is_upper())], side, segments);
        }
        segments.open()
    }

    #[inline(always)]
    pub(super) fn clipped(&self, bounds: &Aabb) -> Segments<S> {
        let mut segments = Segments { near: self.t_near, far: self.limit };
        for side in Side::ALL {
            segments = self.cut(side.of(bounds), side, segments);
        }
        segments
    }
}

/// The least and the greatest of four lanes.
#[inline(always)]
fn least<S: Simd>(lanes: S::F4) -> f32 {
    let halves = lanes.min(lanes.high_half());
    let (a, b) = (halves.first(), halves.second());
    if a < b { a } else { b }
}

#[inline(always)]
fn greatest<S: Simd>(lanes: S::F4) -> f32 {
    let halves = lanes.max(lanes.high_half());
    let (a, b) = (halves.first(), halves.second());
    if a > b { a } else { b }
}

/// Lower and upper planes of the box around the triangles of a block, or around one of them.
#[inline(always)]
fn box_of<S: Simd>(block: &TriBlock, lane: Option<usize>) -> [[f32; 2]; 3] {
    let planes = block.boxes::<S>();
    let mut out = [[0.0; 2]; 3];
    for (out, [low, high]) in out.iter_mut().zip(planes) {
        *out = if let Some(lane) = lane {
            let mut rows = [[0.0; 4]; 2];
            low.store(&mut rows[0]);
            high.store(&mut rows[1]);
            [rows[0][lane & 3], rows[1][lane & 3]]
        } else {
            [least::<S>(low), greatest::<S>(high)]
        };
    }
    out
}

/// A node to visit: which rays meet it, and their parts inside.
#[derive(Clone, Copy)]
struct Entry<S: Simd> {
    word: Word,
    mask: u32,
    segments: Segments<S>,
}

/// Nodes to visit; at most one a level, and the builder bounds the depth.
type Stack<S> = ArrayVec<Entry<S>, MAX_DEPTH>;

impl Narrow {
    #[inline(always)]
    pub(super) fn walk_closest_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        for start in (0..rays.len()).step_by(S::F::LEN) {
            let end = rays.len().min(start + S::F::LEN);
            let (rays, best, sinks) = (&rays[start..end], &mut best[start..end], &sinks[start..end]);
            let mut left = (active >> start) & ((1 << rays.len()) - 1);
            while left != 0 {
                let (members, backward) = group(|ray| self.is_ordinary(ray), rays, left);
                left &= !members;
                if members.count_ones() >= FEW {
                    self.closest_together::<S, C, K>(rays, members, backward, best, sinks, count);
                } else {
                    run::closest_singly::<S, _, C, K>(self, prims, rays, members, best, sinks, count);
                }
            }
        }
    }

    #[inline(always)]
    fn closest_together<S: Simd, C: Counter, K: HitSink>(
        &self,
        rays: &[TravRay],
        active: u32,
        backward: [bool; 3],
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        let mut packet = PacketRays::new(rays, self.reach);
        for (i, best) in best.iter().enumerate() {
            packet.set_limit(i, best);
        }
        let mut slabs = PacketSlabs::<S>::new(&packet, backward);
        let mut segments = slabs.clipped(&self.bounds);
        let (mut word, mut mask) = (self.root, active & segments.open());
        if mask == 0 {
            return;
        }
        let mut stack = Stack::<S>::new();
        loop {
            if word.is_leaf() {
                let (blocks, lane) = self.leaf_blocks(word, count);
                for block in blocks {
                    let mask = mask & slabs.meeting(block, lane, segments);
                    if mask != 0 {
                        block.closest_packet::<S, C, K>(rays, &mut packet, mask, best, sinks, count);
                    }
                }
                slabs.limit = S::F::load(&packet.t_cull) + S::F::splat(SLACK);
            } else {
                count.node();
                count.node();
                if let Some(next) = slabs.descend(&mut stack, self.pairs[word.index()].0, word.order(), mask, segments)
                {
                    Entry { word, mask, segments } = next;
                    continue;
                }
            }
            loop {
                let Some(entry) = stack.pop() else { return };
                segments = Segments { near: entry.segments.near, far: slabs.limit.min(entry.segments.far) };
                mask = entry.mask & segments.open();
                if mask != 0 {
                    word = entry.word;
                    break;
                }
            }
        }
    }

    /// The active rays that something blocks.
    #[inline(always)]
    pub(super) fn walk_occluded_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        sinks: &[K],
        count: &mut C,
    ) -> u32 {
        let mut blocked = 0;
        for start in (0..rays.len()).step_by(S::F::LEN) {
            let end = rays.len().min(start + S::F::LEN);
            let (rays, sinks) = (&rays[start..end], &sinks[start..end]);
            let mut left = (active >> start) & ((1 << rays.len()) - 1);
            while left != 0 {
                let (members, backward) = group(|ray| self.is_ordinary(ray), rays, left);
                left &= !members;
                if members.count_ones() >= FEW {
                    blocked |= self.occluded_together::<S, C, K>(rays, members, backward, sinks, count) << start;
                } else {
                    blocked |= run::occluded_singly::<S, _, C, K>(self, prims, rays, members, sinks, count) << start;
                }
            }
        }
        blocked
    }

    #[inline(always)]
    fn occluded_together<S: Simd, C: Counter, K: HitSink>(
        &self,
        rays: &[TravRay],
        active: u32,
        backward: [bool; 3],
        sinks: &[K],
        count: &mut C,
    ) -> u32 {
        let packet = PacketRays::new(rays, self.reach);
        let slabs = PacketSlabs::<S>::new(&packet, backward);
        let mut segments = slabs.clipped(&self.bounds);
        let (mut word, mut mask) = (self.root, active & segments.open());
        if mask == 0 {
            return 0;
        }
        let mut stack = Stack::<S>::new();
        let mut open = active;
        loop {
            if word.is_leaf() {
                let (blocks, lane) = self.leaf_blocks(word, count);
                for block in blocks {
                    let mask = mask & open & slabs.meeting(block, lane, segments);
                    if mask != 0 {
                        open &= !block.occluded_packet::<S, C, K>(rays, &packet, mask, sinks, count);
                    }
                }
                if open == 0 {
                    return active;
                }
            } else {
                count.node();
                count.node();
                if let Some(next) = slabs.descend(&mut stack, self.pairs[word.index()].0, word.order(), mask, segments)
                {
                    Entry { word, mask, segments } = next;
                    continue;
                }
            }
            loop {
                let Some(entry) = stack.pop() else { return active & !open };
                mask = entry.mask & open;
                if mask != 0 {
                    (word, segments) = (entry.word, entry.segments);
                    break;
                }
            }
        }
    }
}

/// What is left of a ray's range after one plane; `None` when nothing is.
#[cfg(test)]
#[inline(always)]
pub(super) fn cut_once<S: Simd>(ray: &TravRay, plane: f32, side: Side) -> Option<[f64; 2]> {
    let packet = PacketRays::new(std::slice::from_ref(ray), 0.0);
    let slabs = PacketSlabs::<S>::new(&packet, ray.range().dir.to_array().map(|d| d < 0.0));
    let segments = slabs.cut(plane, side, Segments { near: slabs.t_near, far: slabs.limit });
    let mut rows = [[0.0; PACKET]; 2];
    segments.near.store(&mut rows[0]);
    segments.far.store(&mut rows[1]);
    (segments.open() & 1 == 1).then(|| [rows[0][0].into(), rows[1][0].into()])
}
