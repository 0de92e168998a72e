//! Long lists brought back into order: by insertion where the motion is coherent, by radix where it is not.
//!
//! Insertion costs by the event that is passed over and by the inversion; a radix sort costs by the event alone. The inversions of the last
//! time say which is cheaper this time, and an insertion that meets too many ends in a radix sort. Insertion looks for the next event
//! out of order over whole vectors and notes which places it changed, so that only their ranks are written.
//!
//! # Source
//! Baraff, "Dynamic Simulation of Non-penetrating Rigid Bodies", 1992, for insertion from the order before. Footrule against inversions: Diaconis and
//! Graham, "Spearman's Footrule as a Measure of Disarray", 1977.
#![expect(clippy::cast_possible_truncation, reason = "lists hold fewer than 2^32 events")]

use super::lists::{Event, Inversions, insert, sort};
use crate::simd::{Simd, SimdLevel, Task, dispatch};

/// Lists of fewer events are sorted by insertion or comparison: [`resort`](super::lists::resort).
pub(super) const LONG: usize = 1 << 10;

/// Events to an inversion at which a radix sort costs as much as insertion. An event out of order costs more than the events in between: the
/// processor does not foresee it.
const CROSSOVER: u64 = 2;

/// Insertion gives up at so many times the inversions of the crossover, so that chance does not make both sorts run.
const PATIENCE: u64 = 2;

/// Spans of changed places that are remembered one by one.
const SPANS: usize = 1 << 12;

/// Events looked at together by the search for the next one out of order.
const STRIDE: usize = 16;

/// Bits of a value that one pass of the radix sort takes.
const DIGITS: [u32; 3] = [11, 11, 10];

/// How a long list is sorted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum How {
    /// What the last time says is cheaper.
    #[default]
    Adaptive,
    /// From the order before, whatever it takes.
    Insertion,
    /// By digits, from any order.
    Radix,
    /// By comparisons, from any order.
    Comparison,
}

/// What a list remembers between two sorts, and memory to sort in.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    other: Vec<Event>,
    counts: Vec<u32>,
    /// Places whose events changed, or all.
    spans: Vec<(u32, u32)>,
    all: bool,
    /// Inversions of the last time, if it is known.
    last: Option<u64>,
}

impl Scratch {
    /// Sorts a list that was in order before its events moved; the places that changed are then [`Scratch::changed`].
    pub(super) fn order(&mut self, events: &mut [Event], how: How) -> Inversions {
        self.spans.clear();
        self.spans.reserve(SPANS);
        self.all = false;
        let most = events.len() as u64 / CROSSOVER;
        let (begins, ends) = match how {
            How::Adaptive => (self.last.is_none_or(|last| last <= most), PATIENCE * most),
            How::Insertion => (true, u64::MAX),
            How::Radix | How::Comparison => (false, 0),
        };
        if begins {
            let swaps =
                dispatch(SimdLevel::best(), Insert { events, most: ends, spans: &mut self.spans, all: &mut self.all });
            self.last = Some(swaps);
            if swaps <= ends {
                return Inversions { swaps, whole: 0 };
            }
        }
        self.all = true;
        match how {
            How::Comparison => sort(events),
            _ => self.radix(events),
        }
        // How many it were is for whoever knows the ranks of before.
        self.last = None;
        Inversions { swaps: 0, whole: 1 }
    }

    /// The places that may hold other events than before, as ranges that do not begin past the end.
    pub(super) fn changed(&self, len: usize) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        let whole = self.all.then_some(0..len);
        let spans = if self.all { &[][..] } else { &self.spans[..] };
        whole.into_iter().chain(spans.iter().map(|&(first, end)| first as usize..end as usize))
    }

    /// True when all places may.
    pub(super) fn is_all(&self) -> bool {
        self.all
    }

    /// Takes note of the sum of the distances by which events moved in a sort that counted no inversions: between half of them and all.
    pub(super) fn note_footrule(&mut self, distances: u64) -> u64 {
        let swaps = distances / 3 * 2;
        self.last = Some(swaps);
        swaps
    }

    /// Sorts by value in passes of some bits, lowest first, after a pass that puts the events in the order of their tags.
    fn radix(&mut self, events: &mut [Event]) {
        let boxes = events.len() / 2;
        self.other.clear();
        self.other.resize(events.len(), Event::unplaced(0, false));
        self.counts.clear();
        self.counts.resize(DIGITS.iter().map(|bits| 1_usize << bits).sum(), 0);
        let (first, rest) = self.counts.split_at_mut(1 << DIGITS[0]);
        let (second, third) = rest.split_at_mut(1 << DIGITS[1]);
        let mut counts = [first, second, third];
        let shifts = [0, DIGITS[0], DIGITS[0] + DIGITS[1]];
        let digit = |event: Event, pass: usize| {
            ((event.key() >> 32) as u32 >> shifts[pass]) as usize & ((1 << DIGITS[pass]) - 1)
        };
        for &event in &*events {
            let place = event.owner() as usize + if event.is_max() { boxes } else { 0 };
            self.other[place] = event;
            for (pass, counts) in counts.iter_mut().enumerate() {
                counts[digit(event, pass)] += 1;
            }
        }
        let mut from: &mut [Event] = &mut self.other;
        let mut to: &mut [Event] = events;
        for (pass, counts) in counts.into_iter().enumerate() {
            let mut next = 0;
            for count in &mut *counts {
                next += std::mem::replace(count, next);
            }
            for &event in &*from {
                let place = &mut counts[digit(event, pass)];
                to[*place as usize] = event;
                *place += 1;
            }
            std::mem::swap(&mut from, &mut to);
        }
    }
}

/// Insertion that gives up when the inversions pass `most`; the inversions.
struct Insert<'a> {
    events: &'a mut [Event],
    most: u64,
    spans: &'a mut Vec<(u32, u32)>,
    all: &'a mut bool,
}

impl Task for Insert<'_> {
    type Output = u64;

    #[inline(always)]
    fn run<S: Simd>(self) -> u64 {
        let Self { events, most, spans, all } = self;
        let mut swaps = 0;
        let mut next = 1;
        let (mut first, mut end) = (0, 0);
        loop {
            next = next_descent(events, next);
            if next == events.len() {
                break;
            }
            let at = insert(events, next);
            swaps += (next - at) as u64;
            next += 1;
            if at < end {
                // Reaches back into the span: they are one.
                first = first.min(at);
            } else {
                note(spans, all, first, end);
                first = at;
            }
            end = next;
            if swaps > most {
                return swaps;
            }
        }
        note(spans, all, first, end);
        swaps
    }
}

/// Remembers a span that is not empty, or that there were too many.
#[inline(always)]
fn note(spans: &mut Vec<(u32, u32)>, all: &mut bool, first: usize, end: usize) {
    if first < end {
        if spans.len() < SPANS {
            spans.push((first as u32, end as u32));
        } else {
            *all = true;
        }
    }
}

/// The first place from `next` on whose event belongs before the one in front of it; the length when there is none.
#[inline(always)]
fn next_descent(events: &[Event], mut next: usize) -> usize {
    while next + STRIDE <= events.len() {
        let (before, after) = (&events[next - 1..next - 1 + STRIDE], &events[next..next + STRIDE]);
        let mut descents = 0;
        for i in 0..STRIDE {
            descents |= u64::from(before[i].key() > after[i].key());
        }
        if descents != 0 {
            break;
        }
        next += STRIDE;
    }
    while next < events.len() && events[next - 1].key() <= events[next].key() {
        next += 1;
    }
    next
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::accel::events::lists::place;

    /// The ends of boxes, in order.
    fn list(boxes: &[(i16, u8)]) -> Vec<Event> {
        let mut events: Vec<_> =
            (0..boxes.len() as u32).flat_map(|i| [Event::unplaced(i, false), Event::unplaced(i, true)]).collect();
        for (i, &(at, size)) in (0..).zip(boxes) {
            place(&mut events, [2 * i, 2 * i + 1], [f32::from(at), f32::from(at) + f32::from(size)]);
        }
        sort(&mut events);
        events
    }

    fn inversions(events: &[Event]) -> u64 {
        let pairs = events.iter().enumerate().flat_map(|(i, a)| events[i + 1..].iter().map(move |b| (a, b)));
        pairs.map(|(a, b)| u64::from(a.key() > b.key())).sum()
    }

    proptest! {
        #[test]
        fn every_way_of_sorting_gives_the_same_order_and_names_every_place_that_changed(
            boxes in prop::collection::vec((-300_i16..300, 0_u8..5), 1..120),
            swaps in prop::collection::vec((0_usize..240, 0_usize..40), 0..60),
        ) {
            let due = list(&boxes);
            let mut moved = due.clone();
            for (at, by) in swaps {
                let at = at % moved.len();
                let to = (at + by) % moved.len();
                moved.swap(at, to);
            }
            let disorder = inversions(&moved);
            for how in [How::Adaptive, How::Insertion, How::Radix, How::Comparison] {
                let (mut scratch, mut events) = (Scratch::default(), moved.clone());
                let done = scratch.order(&mut events, how);
                prop_assert_eq!(&events, &due, "{:?}", how);
                let mut changed = vec![false; due.len()];
                scratch.changed(due.len()).for_each(|span| changed[span].fill(true));
                let unnamed = (0..due.len()).find(|&i| moved[i] != due[i] && !changed[i]);
                prop_assert_eq!(unnamed, None, "{:?}", how);
                if how == How::Insertion {
                    prop_assert_eq!(done, Inversions { swaps: disorder, whole: 0 });
                }
                prop_assert_eq!(done.whole == 1, how == How::Radix || how == How::Comparison
                    || how == How::Adaptive && disorder > PATIENCE * (due.len() as u64 / CROSSOVER));
            }
        }
    }

    #[test]
    fn the_last_time_decides_and_a_coherent_one_leads_back_to_insertion() {
        let boxes: Vec<_> = (0..200_i16).map(|i| (i, 1)).collect();
        let due = list(&boxes);
        let mut scratch = Scratch::default();
        let mut reversed = due.clone();
        reversed.reverse();
        assert_eq!(scratch.order(&mut reversed, How::Adaptive).whole, 1);
        assert_eq!(reversed, due);
        scratch.note_footrule(u64::MAX / 2);
        assert_eq!(scratch.order(&mut due.clone(), How::Adaptive).whole, 1, "as much as before is expected");
        scratch.note_footrule(0);
        assert_eq!(scratch.order(&mut due.clone(), How::Adaptive), Inversions::default());
    }
}
