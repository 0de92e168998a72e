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
    /// Pairs of neighbours that were swapped: how far the order before the motion was from the one after. For lists that were sorted as a
    /// whole, what was counted until then, or two thirds of the sum of the distances that events moved: that sum is the swaps at least and twice them at most.
    pub swaps: u64,
    /// Lists that were sorted as a whole, since insertion would have cost more.
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

/// Brings the event at `next` to its place among those before it, which are in order: the place.
#[inline(always)]
pub(super) fn insert(events: &mut [Event], next: usize) -> usize {
    let event = events[next];
    let key = event.key();
    let mut at = next;
    while at > 0 && events[at - 1].key() > key {
        events[at] = events[at - 1];
        at -= 1;
    }
    events[at] = event;
    at
}

/// Sorts events that were in order before a motion: insertion, O(n + inversions), until the swaps pass n log n.
pub(crate) fn resort(events: &mut [Event]) -> Inversions {
    let budget = events.len() as u64 * u64::from(events.len().max(2).ilog2());
    let mut swaps = 0;
    for next in 1..events.len() {
        swaps += (next - insert(events, next)) as u64;
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

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;

    fn event(value: f32, owner: u32, is_max: bool) -> Event {
        Event { value, ..Event::unplaced(owner, is_max) }
    }

    #[test]
    fn l02_events_are_ordered_by_value_then_lower_ends_then_box() {
        let due = [
            event(f32::NEG_INFINITY, 9, false),
            event(-2.0, 9, true),
            event(-1e-45, 3, true),
            event(0.0, 1, false),
            event(0.0, 2, false),
            event(0.0, 0, true),
            event(1e-45, 0, false),
            event(7.0, (1 << 31) - 1, true),
            event(f32::INFINITY, 4, false),
        ];
        let mut events = due;
        events.reverse();
        sort(&mut events);
        assert_eq!(events, due);
    }

    #[test]
    fn l05_a_point_on_an_end_has_passed_lower_ends_and_not_upper_ones() {
        let events = [event(1.0, 0, false), event(2.0, 1, false), event(2.0, 2, false), event(2.0, 0, true)];
        let seats = [0.5, 1.0, 1.5, 2.0, 2.5].map(|place| seat(&events, place));
        assert_eq!(seats, [0, 1, 1, 3, 4]);
    }

    #[test]
    fn ends_are_never_minus_zero_and_empty_boxes_lie_beyond_everything() {
        let flat = Aabb { min: Vec3::splat(-0.0), max: Vec3::splat(-0.0) };
        assert_eq!(ends(flat, 1).map(f32::to_bits), [0, 0]);
        let without_depth = Aabb { min: Vec3::new(0.0, 0.0, 1.0), max: Vec3::ZERO };
        let broken = Aabb { min: Vec3::splat(f32::NAN), max: Vec3::ONE };
        for aabb in [Aabb::EMPTY, without_depth, broken] {
            assert_eq!(ends(aabb, 0).map(f32::to_bits), [f32::INFINITY.to_bits(); 2]);
        }
    }

    /// Swaps that a sort of neighbours needs, counted pair by pair.
    fn inversions(events: &[Event]) -> u64 {
        let pairs = events.iter().enumerate().flat_map(|(i, a)| events[i + 1..].iter().map(move |b| (a, b)));
        pairs.map(|(a, b)| u64::from(a.key() > b.key())).sum()
    }

    proptest! {
        #[test]
        fn sorting_again_gives_what_sorting_gives_and_counts_inversions(
            values in prop::collection::vec(-4_i8..4, 1..80),
            swaps in prop::collection::vec((0_usize..79, 1_usize..4), 0..60),
        ) {
            let mut due: Vec<_> = (0..).zip(&values).map(|(i, &v)| event(f32::from(v), i, i % 3 == 0)).collect();
            sort(&mut due);
            prop_assert!(due.windows(2).all(|pair| pair[0].key() < pair[1].key()));
            // A little out of order.
            let mut events = due.clone();
            for (at, by) in swaps {
                let at = at % events.len();
                let to = (at + by).min(events.len() - 1);
                events.swap(at, to);
            }
            let disorder = inversions(&events);
            let budget = events.len() as u64 * u64::from(events.len().max(2).ilog2());
            let done = resort(&mut events);
            prop_assert_eq!(&events, &due);
            if disorder <= budget {
                prop_assert_eq!(done, Inversions { swaps: disorder, whole: 0 });
            } else {
                prop_assert_eq!(done.whole, 1);
            }
            prop_assert_eq!(resort(&mut events), Inversions::default());
        }

        #[test]
        fn l06_a_seat_found_from_anywhere_is_the_seat(
            values in prop::collection::vec(-4_i8..4, 0..40),
            place in -5_i8..5,
            from in 0_usize..50,
        ) {
            let mut events: Vec<_> = (0..).zip(&values).map(|(i, &v)| event(f32::from(v), i, i % 2 == 0)).collect();
            sort(&mut events);
            let due = seat(&events, f32::from(place));
            let (at, steps) = reseat(&events, f32::from(place), from);
            prop_assert_eq!((at, steps), (due, due.abs_diff(from.min(events.len()))));
        }
    }
}
