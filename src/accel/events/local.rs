//! The three lists of a set of boxes with their ranks: filled, and brought to new boxes.

use rayon::prelude::*;

use super::{
    lists::{Event, Inversions, ends, place, resort, sort},
    long::{How, LONG, Scratch},
    ranks::{RankWord, Ranks},
};
use crate::geom::Aabb;

/// Lists of at least this many events are sorted at once, each by a thread.
const PARALLEL: usize = 1 << 14;

/// The lists of one volume, to be changed.
pub(super) struct ListMut<'a, W> {
    pub(super) events: [&'a mut [Event]; 3],
    pub(super) ranks: &'a mut [Ranks<W>],
}

/// Appends the lists of `count` boxes whose places are still unknown.
pub(super) fn append<W: RankWord>(events: &mut [Vec<Event>; 3], ranks: &mut Vec<Ranks<W>>, count: u32) {
    for list in events {
        list.extend((0..count).flat_map(|owner| [Event::unplaced(owner, false), Event::unplaced(owner, true)]));
    }
    ranks.extend((0..count).map(|owner| {
        let mut ranks = Ranks::default();
        for axis in 0..3 {
            ranks.set(axis, false, 2 * owner);
            ranks.set(axis, true, 2 * owner + 1);
        }
        ranks
    }));
}

impl<W: RankWord> ListMut<'_, W> {
    /// Puts a box where it is now; the lists are then out of order until [`ListMut::settle`].
    #[inline(always)]
    pub(super) fn place(&mut self, child: usize, aabb: Aabb) {
        for (axis, events) in self.events.iter_mut().enumerate() {
            place(events, self.ranks[child].get(axis), ends(aabb, axis));
        }
    }

    /// Sorts the lists and writes the ranks. `fresh` lists are in no order that helps.
    pub(super) fn settle(&mut self, fresh: bool) -> Inversions {
        let done = self.events.iter_mut().map(|list| order(list, fresh)).fold(Inversions::default(), Inversions::plus);
        if fresh || done != Inversions::default() {
            self.write_ranks();
        }
        done
    }

    /// As [`ListMut::settle`] for lists that may be long, which remember in `scratch`.
    pub(super) fn settle_long(&mut self, scratch: &mut [Scratch; 3], fresh: bool, how: How) -> Inversions {
        if fresh {
            *scratch = Default::default();
            self.events.iter_mut().for_each(|list| list.par_sort_unstable_by_key(|e| e.key()));
            self.write_ranks();
            return Inversions::default();
        }
        if self.events[0].len() < LONG && how == How::Adaptive {
            return self.settle(false);
        }
        let ([x, y, z], [a, b, c]) = (&mut self.events, &mut *scratch);
        let done = if x.len() < PARALLEL {
            [a.order(x, how), b.order(y, how), c.order(z, how)]
        } else {
            let (x, (y, z)) = rayon::join(|| a.order(x, how), || rayon::join(|| b.order(y, how), || c.order(z, how)));
            [x, y, z]
        };
        let mut all = Inversions::default();
        for (axis, (scratch, done)) in scratch.iter_mut().zip(done).enumerate() {
            let distances = self.write_changed_ranks(axis, scratch);
            let swaps = if done.whole > 0 { scratch.note_footrule(distances) } else { done.swaps };
            all = all.plus(Inversions { swaps, ..done });
        }
        all
    }

    /// Writes the ranks of what a sort moved; the sum of the distances by which events moved, where all places may have changed.
    #[expect(clippy::cast_possible_truncation, reason = "the build checks the lengths of lists")]
    fn write_changed_ranks(&mut self, axis: usize, scratch: &Scratch) -> u64 {
        let events = &self.events[axis];
        let mut distances = 0;
        for span in scratch.changed(events.len()) {
            for (rank, event) in (span.start as u32..).zip(&events[span]) {
                let ranks = &mut self.ranks[event.owner() as usize];
                if scratch.is_all() {
                    distances += u64::from(rank.abs_diff(ranks.get(axis)[usize::from(event.is_max())]));
                }
                ranks.set(axis, event.is_max(), rank);
            }
        }
        distances
    }

    #[expect(clippy::cast_possible_truncation, reason = "the build checks the lengths of lists")]
    fn write_ranks(&mut self) {
        for (axis, events) in self.events.iter().enumerate() {
            for (rank, event) in events.iter().enumerate() {
                self.ranks[event.owner() as usize].set(axis, event.is_max(), rank as u32);
            }
        }
    }
}

fn order(list: &mut [Event], fresh: bool) -> Inversions {
    if fresh {
        sort(list);
        return Inversions::default();
    }
    resort(list)
}
