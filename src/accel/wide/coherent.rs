//! Rays that are close together, from their records to their answers by lane: what each of them would need by itself is had for all at once.

use super::{
    Place,
    packet::{Entry, PacketTree, Stack, Together, descend},
};
use crate::{
    accel::{
        packet::{Nearest, PacketRays, Spread, bits},
        run,
    },
    geom::{Forms, Hit, Ray, Triangles},
    simd::{Lanes, Simd},
};

/// Up to this many rays are walked one by one.
const FEW: u32 = 2;

/// As [`Accel::closest_all`](crate::accel::Accel::closest_all), each `width` rays together; `apart` answers runs of those that point apart.
#[inline(always)]
pub(in crate::accel) fn closest<S: Simd, T: PacketTree>(
    tree: &T,
    prims: &Triangles<'_>,
    rays: &[Ray],
    width: usize,
    forms: Forms,
    out: &mut [Option<Hit>],
    apart: impl Fn(&[Ray], &mut [Option<Hit>]),
) {
    let (mut lines, mut tri) = (PacketRays::EMPTY, Spread::EMPTY);
    let (mut at, mut end) = (0, 0);
    // Rays from here to the packet point apart.
    let mut waiting = 0;
    while at < rays.len() {
        // The rest of a packet that is longer than a vector follows by itself.
        end = if at == end { rays.len().min(at + width) } else { end };
        let next = end.min(at + S::F::LEN);
        let (first, packet) = (at, &rays[at..next]);
        at = next;
        let mut left = lines.load::<S>(packet, tree.reach(), forms);
        if left == 0 || lines.points_apart::<S>(left) {
            continue;
        }
        if waiting < first {
            apart(&rays[waiting..first], &mut out[waiting..first]);
        }
        waiting = next;
        let out = &mut out[first..next];
        let mut single = !left;
        let mut nearest = Nearest::NONE;
        while left != 0 {
            let (members, backward) = lines.group(left);
            left &= !members;
            if members.count_ones() <= FEW {
                single |= members;
            } else {
                let (together, root) = tree.start::<S>(&lines, (members, backward), forms.nodes);
                if let Some(root) = root {
                    closest_below::<S, T, _>(tree, together, root, &mut lines, &mut nearest, &mut tri);
                }
            }
        }
        nearest.answer::<S>(&lines, tree.blocks(), out);
        for i in bits(single & (u32::MAX >> (32 - packet.len()))) {
            out[i] = run::closest_one::<S, T>(tree, prims, &packet[i], forms);
        }
    }
    if waiting < rays.len() {
        apart(&rays[waiting..], &mut out[waiting..]);
    }
}

/// As [`Accel::occluded_all`](crate::accel::Accel::occluded_all), each `width` rays together; `apart` answers runs of those that point apart.
#[inline(always)]
pub(in crate::accel) fn occluded<S: Simd, T: PacketTree>(
    tree: &T,
    prims: &Triangles<'_>,
    rays: &[Ray],
    width: usize,
    forms: Forms,
    out: &mut [bool],
    apart: impl Fn(&[Ray], &mut [bool]),
) {
    let (mut lines, mut tri) = (PacketRays::EMPTY, Spread::EMPTY);
    let (mut at, mut end) = (0, 0);
    // Rays from here to the packet point apart.
    let mut waiting = 0;
    while at < rays.len() {
        // The rest of a packet that is longer than a vector follows by itself.
        end = if at == end { rays.len().min(at + width) } else { end };
        let next = end.min(at + S::F::LEN);
        let (first, packet) = (at, &rays[at..next]);
        at = next;
        let mut left = lines.load::<S>(packet, tree.reach(), forms);
        if left == 0 || lines.points_apart::<S>(left) {
            continue;
        }
        if waiting < first {
            apart(&rays[waiting..first], &mut out[waiting..first]);
        }
        waiting = next;
        let out = &mut out[first..next];
        let mut single = !left;
        let mut blocked = 0;
        while left != 0 {
            let (members, backward) = lines.group(left);
            left &= !members;
            if members.count_ones() <= FEW {
                single |= members;
            } else {
                let (together, root) = tree.start::<S>(&lines, (members, backward), forms.nodes);
                if let Some(root) = root {
                    blocked |= occluded_below::<S, T, _>(tree, &together, root, &lines, &mut tri);
                }
            }
        }
        for (i, out) in out.iter_mut().enumerate() {
            *out = blocked >> i & 1 == 1;
        }
        for i in bits(single & (u32::MAX >> (32 - packet.len()))) {
            out[i] = run::occluded_one::<S, T>(tree, prims, &packet[i], forms);
        }
    }
    if waiting < rays.len() {
        apart(&rays[waiting..], &mut out[waiting..]);
    }
}

/// Offers the triangles below a node to the rays of a packet.
#[inline(always)]
fn closest_below<S: Simd, T: PacketTree, P: Together<S, T>>(
    tree: &T,
    mut together: P,
    start: Entry<S, T, P>,
    lines: &mut PacketRays,
    nearest: &mut Nearest,
    tri: &mut Spread,
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
            let blocks = tree.leaf_blocks(entry.word, &mut ());
            for (number, block) in (entry.word.index()..).zip(blocks) {
                let mask = mask & together.meeting(block, &entry.rays);
                if mask != 0 {
                    nearest.offer::<S>(lines, tree.blocks(), number, mask, tri);
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
fn occluded_below<S: Simd, T: PacketTree, P: Together<S, T>>(
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
            for block in tree.leaf_blocks(entry.word, &mut ()) {
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
