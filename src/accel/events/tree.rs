//! The hierarchical form: volumes within volumes, each with the three lists of what it holds directly.

use std::cell::Cell;

use super::{
    Seat,
    boxes::BoxWalk,
    lists::Event,
    ranks::Ranks,
    ray::{EventRay, WIDEN},
    walk::{Entered, ListView, ListWalk},
};
use crate::{accel::Counter, geom::Aabb};

/// Ranks within a volume: 21 bits an axis.
pub(super) type Word = u64;

/// A volume; what it holds stands in one run of the tree's links, ranks and events.
#[derive(Clone, Copy, Debug)]
pub(super) struct Volume {
    /// The least box around what it holds.
    pub(super) aabb: Aabb,
    pub(super) first: u32,
    pub(super) count: u32,
}

const _: () = assert!(size_of::<Volume>() == 32);

/// Marks a link to a volume.
const VOLUME: u32 = 1 << 31;

/// What a volume holds: an object or another volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link(u32);

impl Link {
    pub(super) fn object(number: u32) -> Self {
        Self(number)
    }

    pub(super) fn volume(number: u32) -> Self {
        Self(number | VOLUME)
    }

    /// The object's number, or else the volume's.
    #[inline(always)]
    pub(super) fn target(self) -> Result<u32, u32> {
        if self.0 & VOLUME == 0 { Ok(self.0) } else { Err(self.0 & !VOLUME) }
    }
}

/// A hierarchy of volumes. The root is volume 0; a volume comes before those within it, depth first.
#[derive(Clone, Debug, Default)]
pub(crate) struct EventTree {
    pub(super) volumes: Vec<Volume>,
    pub(super) links: Vec<Link>,
    pub(super) ranks: Vec<Ranks<Word>>,
    /// Two events a link, in the same order of volumes.
    pub(super) events: [Vec<Event>; 3],
}

impl EventTree {
    #[inline(always)]
    pub(super) fn view(&self, volume: &Volume) -> ListView<'_, Word> {
        ListView::new(&self.events, &self.ranks, volume.first as usize, volume.count as usize)
    }

    /// Cursors of a point in every volume that holds it.
    pub(super) fn seat(&self, point: [f32; 3], seats: &mut Vec<Seat>) {
        let place = glam::Vec3::from(point);
        let holds = |aabb: Aabb| aabb.min.cmple(place).all() && place.cmple(aabb.max).all();
        let from = seats.len();
        let mut next = from;
        let open = |volume: u32, seats: &mut Vec<Seat>| {
            let view = self.view(&self.volumes[volume as usize]);
            seats.push(Seat { volume, cursors: super::walk::seat_point(&view, point, None, &mut ()) });
        };
        if holds(self.volumes[0].aabb) {
            open(0, seats);
        }
        while next < seats.len() {
            let Volume { first, count, .. } = self.volumes[seats[next].volume as usize];
            for link in &self.links[first as usize..(first + count) as usize] {
                if let Err(volume) = link.target()
                    && holds(self.volumes[volume as usize].aabb)
                {
                    open(volume, seats);
                }
            }
            next += 1;
        }
    }

    /// Number of volumes, longest path from the root, volumes without volumes, bytes.
    pub(super) fn size(&self) -> (usize, usize, usize, usize) {
        let mut depths = vec![1; self.volumes.len()];
        let (mut depth, mut leaves) = (0, 0);
        for (number, volume) in self.volumes.iter().enumerate() {
            depth = depth.max(depths[number]);
            let links = &self.links[volume.first as usize..(volume.first + volume.count) as usize];
            let mut is_leaf = true;
            for inner in links.iter().filter_map(|link| link.target().err()) {
                depths[inner as usize] = depths[number] + 1;
                is_leaf = false;
            }
            leaves += usize::from(is_leaf);
        }
        let events: usize = self.events.iter().map(|list| size_of_val(&list[..])).sum();
        let bytes =
            events + size_of_val(&self.volumes[..]) + size_of_val(&self.links[..]) + size_of_val(&self.ranks[..]);
        (self.volumes.len(), depth, leaves, bytes)
    }

    /// Begins a walk over the objects whose boxes `ray` meets. `hints` are cursors at a place near the ray's start.
    #[inline(always)]
    pub(super) fn walk<'a, C: Counter>(&'a self, ray: EventRay, hints: &'a [Seat], count: &mut C) -> TreeWalk<'a> {
        let mut walk = TreeWalk { tree: self, ray, hints, scratch: Scratch::take() };
        if let Some((now, axis)) = walk.ray.enters(self.volumes[0].aabb) {
            walk.open(0, axis.map(|axis| (axis, now)), count);
        }
        walk
    }
}

/// A volume that the ray is in.
#[derive(Clone, Copy, Debug)]
struct Open {
    local: ListWalk<Word>,
    volume: u32,
}

/// What a walk keeps in memory, borrowed from the thread.
#[derive(Debug, Default)]
struct Scratch {
    open: Vec<Open>,
    /// When the next event of each open volume is due, and its place in `open`; the soonest last.
    order: Vec<(f64, u32)>,
    /// Places in `open` that are free.
    free: Vec<u32>,
}

thread_local! {
    static SCRATCH: Cell<Scratch> =
        const { Cell::new(Scratch { open: Vec::new(), order: Vec::new(), free: Vec::new() }) };
}

impl Scratch {
    fn take() -> Self {
        let mut scratch = SCRATCH.take();
        scratch.open.clear();
        scratch.order.clear();
        scratch.free.clear();
        scratch
    }

    /// Brings the last volume of the order, whose next event is now due at `t`, to its place.
    #[inline(always)]
    fn sink(&mut self, t: f64) {
        let Some((last, rest)) = self.order.split_last_mut() else { return };
        last.0 = t;
        let mut at = rest.len();
        while at > 0 && self.order[at - 1].0 < t {
            self.order.swap(at - 1, at);
            at -= 1;
        }
    }
}

/// The objects whose boxes a ray meets, in the order in which it enters them.
#[derive(Debug)]
pub(super) struct TreeWalk<'a> {
    tree: &'a EventTree,
    ray: EventRay,
    hints: &'a [Seat],
    scratch: Scratch,
}

impl Drop for TreeWalk<'_> {
    fn drop(&mut self) {
        SCRATCH.set(std::mem::take(&mut self.scratch));
    }
}

impl BoxWalk for TreeWalk<'_> {
    #[inline(always)]
    fn next<C: Counter>(&mut self, limit: f64, count: &mut C) -> Option<u32> {
        let limit = limit * WIDEN;
        while let Some(&(t, place)) = self.scratch.order.last() {
            // A volume without end has its last event at infinity.
            if t > limit || t == f64::INFINITY {
                return None;
            }
            let bound = match self.scratch.order[..] {
                [.., (next, _), _] if next < limit => next,
                _ => limit,
            };
            let open = &mut self.scratch.open[place as usize];
            let volume = &self.tree.volumes[open.volume as usize];
            let entered = open.local.next(&self.tree.view(volume), &self.ray, bound, count);
            let (t, end) = (open.local.t(), open.local.end());
            if t <= end {
                self.scratch.sink(t);
            } else {
                self.scratch.order.pop();
                self.scratch.free.push(place);
            }
            if let Some(Entered { child, at }) = entered {
                match self.tree.links[(volume.first + child) as usize].target() {
                    Ok(object) => return Some(object),
                    Err(volume) => self.open(volume, at, count),
                }
            }
        }
        None
    }
}

impl TreeWalk<'_> {
    /// Opens a volume: its next events join those of the others.
    #[inline(always)]
    fn open<C: Counter>(&mut self, volume: u32, at: Option<(usize, f64)>, count: &mut C) {
        count.node();
        let Volume { aabb, .. } = self.tree.volumes[volume as usize];
        let view = self.tree.view(&self.tree.volumes[volume as usize]);
        let local = if let Some((axis, now)) = at {
            ListWalk::enter(&view, aabb, &self.ray, axis, now, count)
        } else {
            let hint = self.hints.iter().find(|seat| seat.volume == volume).map(|seat| seat.cursors);
            ListWalk::start(&view, aabb, &self.ray, hint, count)
        };
        let t = local.t();
        if t > local.end() {
            return;
        }
        let open = Open { local, volume };
        let place = if let Some(place) = self.scratch.free.pop() {
            self.scratch.open[place as usize] = open;
            place
        } else {
            self.scratch.open.push(open);
            #[expect(clippy::cast_possible_truncation, reason = "there are fewer than 2^31 volumes")]
            let place = (self.scratch.open.len() - 1) as u32;
            place
        };
        self.scratch.order.push((t, place));
        self.scratch.sink(t);
    }

    /// Notes where the walk stands: the open volumes and their cursors.
    pub(super) fn leave(&self, seats: &mut Vec<Seat>) {
        let open = self.scratch.order.iter().map(|&(_, place)| &self.scratch.open[place as usize]);
        seats.extend(open.map(|open| Seat { volume: open.volume, cursors: open.local.cursors() }));
    }
}
