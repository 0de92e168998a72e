//! Sorted lists of events: the ends of boxes along an axis.
//!
//! Plain functions over slices, so that a whole scene, one volume of a hierarchy and a level over instances share them.

use crate::geom::Aabb;

/// Bit of [`Event::tag`] that marks the upper end of a box.
const MAX_BIT: u32 = 1 << 31;

/// One end of a box on one axis.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Event {
    /// Coordinate; never NaN nor -0.
    value: f32,
    /// Number of the box in its list, and [`MAX_BIT`] for an upper end.
    tag: u32,
}

const _: () = assert!(size_of::<Event>() == 8);

impl Event {
    /// An end of box `owner`; its value is set by [`place`].
    pub(crate) fn unplaced(owner: u32, is_max: bool) -> Self {
        Self { value: 0.0, tag: if is_max { owner | MAX_BIT } else { owner } }
    }

    /// Coordinate on the axis.
    #[inline(always)]
    pub(crate) fn value(self) -> f32 {
        self.value
    }

    /// Number of the box in its list.
    #[inline(always)]
    pub(crate) fn owner(self) -> u32 {
        self.tag & !MAX_BIT
    }

    /// True for an upper end.
    #[inline(always)]
    pub(crate) fn is_max(self) -> bool {
        self.tag & MAX_BIT != 0
    }

    /// Orders events: by value, lower ends before upper ones, then by box.
    #[inline(always)]
    pub(crate) fn key(self) -> u64 {
        let bits = self.value.to_bits();
        let ordered = if bits & MAX_BIT == 0 { bits | MAX_BIT } else { !bits };
        u64::from(ordered) << 32 | u64::from(self.tag)
    }
}

/// The two coordinates of a box on an axis. An empty box lies beyond everything, where no ray arrives.
#[inline(always)]
pub(crate) fn ends(aabb: Aabb, axis: usize) -> [f32; 2] {
    if aabb.is_empty() { [f32::INFINITY; 2] } else { [aabb.min[axis] + 0.0, aabb.max[axis] + 0.0] }
}

/// Writes the events of box `owner`, which stand at `ranks`, anew; the list is then out of order.
#[inline(always)]
pub(crate) fn place(events: &mut [Event], ranks: [u32; 2], ends: [f32; 2]) {
    for (rank, value) in ranks.into_iter().zip(ends) {
        events[rank as usize].value = value;
    }
}

/// What it took to bring lists back into order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inversions {
    /// Pairs of neighbours that were swapped: how far the order before the motion was from the one after.
    pub swaps: u64,
    /// Lists whose swaps passed n log n and that were sorted as a whole instead; their further swaps are not counted.
    pub whole: u64,
}

impl Inversions {
    /// Both together.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self { swaps: self.swaps + other.swaps, whole: self.whole + other.whole }
    }
}

/// Sorts events that are in no known order.
pub(crate) fn sort(events: &mut [Event]) {
    events.sort_unstable_by_key(|e| e.key());
}

/// Sorts events that were in order before a motion: insertion, O(n + inversions), until the swaps pass n log n.
pub(crate) fn resort(events: &mut [Event]) -> Inversions {
    let budget = events.len() as u64 * u64::from(events.len().max(2).ilog2());
    let mut swaps = 0;
    for next in 1..events.len() {
        let event = events[next];
        let key = event.key();
        let mut at = next;
        while at > 0 && events[at - 1].key() > key {
            events[at] = events[at - 1];
            at -= 1;
        }
        events[at] = event;
        swaps += (next - at) as u64;
        if swaps > budget {
            sort(events);
            return Inversions { swaps, whole: 1 };
        }
    }
    Inversions { swaps, whole: 0 }
}

/// True for an event that a point at `place` has passed on its way up: lower ends at or before it, upper ends before it.
///
/// So a point on a face is inside.
#[inline(always)]
pub(crate) fn is_passed(event: Event, place: f32) -> bool {
    event.value < place || (event.value <= place && !event.is_max())
}

/// The number of events that a point at `place` has passed on its way up.
pub(crate) fn seat(events: &[Event], place: f32) -> usize {
    events.partition_point(|&e| is_passed(e, place))
}

/// As [`seat`], by a walk from a place nearby; also how many events the walk looked past.
pub(crate) fn reseat(events: &[Event], place: f32, from: usize) -> (usize, usize) {
    let from = from.min(events.len());
    let mut at = from;
    while at < events.len() && is_passed(events[at], place) {
        at += 1;
    }
    while at > 0 && !is_passed(events[at - 1], place) {
        at -= 1;
    }
    (at, at.abs_diff(from))
}
