//! Rays that are close together, from their records to their answers by lane: what each of them would need by itself is had for all at once.

use std::ops::Range;

use super::{
    Place,
    packet::{BlockTree, Entry, Stack, Together, descend},
};
use crate::{
    accel::{
        AnyHit, HitSink,
        packet::{Nearest, PacketRays, Spread, bits},
        run,
    },
    geom::{Forms, Hit, Ray, Triangles},
    simd::{Lanes, Simd},
};

/// Packets that are not looked at after one whose rays point apart, because theirs most likely do as well.
const UNSEEN: usize = 7;

/// The packets of a batch whose rays go together, one after the other.
struct Packets<'a> {
    rays: &'a [Ray],
    width: usize,
    /// The ray after the last packet looked at, and the end of the packet that it is in.
    at: usize,
    end: usize,
    /// Rays from here to the next packet point apart.
    waiting: usize,
}

/// A packet, and the rays before it that point apart.
struct Found {
    apart: Range<usize>,
    packet: Range<usize>,
    /// The rays that are prepared.
    taken: u32,
}

impl<'a> Packets<'a> {
    #[inline(always)]
    fn new(rays: &'a [Ray], width: usize) -> Self {
        Self { rays, width, at: 0, end: 0, waiting: 0 }
    }

    /// Loads and prepares the next packet.
    #[inline(always)]
    fn next<S: Simd>(&mut self, lines: &mut PacketRays, reach: f32, forms: Forms) -> Option<Found> {
        let len = self.rays.len();
        while self.at < len {
            if self.at == self.end {
                self.end = len.min(self.at + self.width);
            }
            // The rest of a packet that is longer than a vector follows by itself.
            let (first, next) = (self.at, self.end.min(self.at + S::F::LEN));
            self.at = next;
            let taken = lines.load::<S>(&self.rays[first..next], reach, forms);
            if taken != 0 && !lines.points_apart::<S>(taken) {
                lines.prepare::<S>(forms.nodes);
                let apart = self.waiting..first;
                self.waiting = next;
                return Some(Found { apart, packet: first..next, taken });
            }
            if self.at == self.end {
                self.at = len.min(self.end + UNSEEN * self.width);
                self.end = self.at;
            }
        }
        None
    }

    /// The rays after the last packet, which point apart.
    #[inline(always)]
    fn rest(&self) -> Range<usize> {
        self.waiting..self.rays.len()
    }
}

/// As [`Accel::closest_all`](crate::accel::Accel::closest_all), each `width` rays together; `apart` answers runs of those that point apart.
#[inline(always)]
pub(in crate::accel) fn closest<S: Simd, T: BlockTree>(
    tree: &T,
    prims: &Triangles<'_>,
    (rays, width): (&[Ray], usize),
    forms: Forms,
    out: &mut [Option<Hit>],
    apart: impl Fn(&[Ray], &mut [Option<Hit>]),
) {
    let (mut lines, mut tri, mut nearest) = (PacketRays::EMPTY, Spread::EMPTY, Nearest::NONE);
    let mut packets = Packets::new(rays, width);
    while let Some(found) = packets.next::<S>(&mut lines, tree.reach(), forms) {
        if !found.apart.is_empty() {
            apart(&rays[found.apart.clone()], &mut out[found.apart]);
        }
        let (packet, out) = (&rays[found.packet.clone()], &mut out[found.packet]);
        nearest.clear();
        closest_in::<S, T, _>(tree, &mut lines, found.taken, &mut nearest, &mut tri, &AnyHit);
        nearest.answer::<S, _>(&lines, tree.blocks(), &AnyHit, out);
        for i in bits(!found.taken & (u32::MAX >> (32 - packet.len()))) {
            out[i] = run::closest_one::<S, T>(tree, prims, &packet[i], forms);
        }
    }
    let rest = packets.rest();
    if !rest.is_empty() {
        apart(&rays[rest.clone()], &mut out[rest]);
    }
}

/// As [`Accel::occluded_all`](crate::accel::Accel::occluded_all), each `width` rays together; `apart` answers runs of those that point apart.
#[inline(always)]
pub(in crate::accel) fn occluded<S: Simd, T: BlockTree>(
    tree: &T,
    prims: &Triangles<'_>,
    (rays, width): (&[Ray], usize),
    forms: Forms,
    out: &mut [bool],
    apart: impl Fn(&[Ray], &mut [bool]),
) {
    let (mut lines, mut tri) = (PacketRays::EMPTY, Spread::EMPTY);
    let mut packets = Packets::new(rays, width);
    while let Some(found) = packets.next::<S>(&mut lines, tree.reach(), forms) {
        if !found.apart.is_empty() {
            apart(&rays[found.apart.clone()], &mut out[found.apart]);
        }
        let (packet, out) = (&rays[found.packet.clone()], &mut out[found.packet]);
        let blocked = occluded_in::<S, T>(tree, &lines, found.taken, &mut tri);
        for (i, out) in out.iter_mut().enumerate() {
            *out = blocked >> i & 1 == 1;
        }
        for i in bits(!found.taken & (u32::MAX >> (32 - packet.len()))) {
            out[i] = run::occluded_one::<S, T>(tree, prims, &packet[i], forms);
        }
    }
    let rest = packets.rest();
    if !rest.is_empty() {
        apart(&rays[rest.clone()], &mut out[rest]);
    }
}

/// Offers the triangles of a tree to the prepared rays in `left`.
#[inline(always)]
pub(in crate::accel) fn closest_in<S: Simd, T: BlockTree, K: HitSink>(
    tree: &T,
    lines: &mut PacketRays,
    mut left: u32,
    nearest: &mut Nearest,
    tri: &mut Spread,
    sink: &K,
) {
    while left != 0 {
        let (members, backward) = lines.group(left);
        left &= !members;
        let (together, root) = tree.start::<S>(lines, (members, backward));
        if let Some(root) = root {
            closest_below::<S, T, _, _>(tree, together, root, lines, nearest, tri, sink);
        }
    }
}

/// The prepared rays in `left` that something of a tree blocks.
#[inline(always)]
pub(in crate::accel) fn occluded_in<S: Simd, T: BlockTree>(
    tree: &T,
    lines: &PacketRays,
    mut left: u32,
    tri: &mut Spread,
) -> u32 {
    let mut blocked = 0;
    while left != 0 {
        let (members, backward) = lines.group(left);
        left &= !members;
        let (together, root) = tree.start::<S>(lines, (members, backward));
        if let Some(root) = root {
            blocked |= occluded_below::<S, T, _>(tree, &together, root, lines, tri);
        }
    }
    blocked
}

/// Offers the triangles below a node to the rays of a packet.
#[inline(always)]
fn closest_below<S: Simd, T: BlockTree, P: Together<S, T>, K: HitSink>(
    tree: &T,
    mut together: P,
    start: Entry<S, T, P>,
    lines: &mut PacketRays,
    nearest: &mut Nearest,
    tri: &mut Spread,
    sink: &K,
) {
    let mut kids = P::kids();
    let mut stack = Stack::<S, T, P>::new();
    stack.push(start);
    while let Some(mut entry) = stack.pop() {
        let mask = entry.mask & together.reopened(&mut entry.rays);
        if mask == 0 {
            continue;
        }
        if entry.word.is_leaf() {
            let blocks = tree.leaf_blocks(entry.word);
            for (number, block) in (entry.word.index()..).zip(blocks) {
                let mask = mask & together.meeting(block, &entry.rays);
                if mask != 0 {
                    nearest.offer::<S, K>(lines, (tree.blocks(), number), mask, tri, sink);
                }
            }
            together.limit(lines);
        } else {
            descend(&together, tree.node(entry.word.index()), (mask, entry.mark, &entry.rays), &mut kids, &mut stack);
        }
    }
}

/// The rays of the start that something blocks.
#[inline(always)]
fn occluded_below<S: Simd, T: BlockTree, P: Together<S, T>>(
    tree: &T,
    together: &P,
    start: Entry<S, T, P>,
    lines: &PacketRays,
    tri: &mut Spread,
) -> u32 {
    let mut kids = P::kids();
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
            for block in tree.leaf_blocks(entry.word) {
                let mask = mask & open & together.meeting(block, &entry.rays);
                if mask != 0 {
                    open &= !block.blocked::<S>(lines, mask, tri);
                }
            }
            if open == 0 {
                break;
            }
        } else {
            descend(together, tree.node(entry.word.index()), (mask, entry.mark, &entry.rays), &mut kids, &mut stack);
        }
    }
    active & !open
}
