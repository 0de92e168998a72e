//! The three lists of a set of boxes with their ranks: filled, and brought to new boxes.

use rayon::prelude::*;

use super::{
    lists::{Event, Inversions, ends, place, resort, sort},
    ranks::{RankWord, Ranks},
};
use crate::geom::Aabb;

/// Lists of at least this many events are sorted by several threads.
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
        let done = if self.events[0].len() < PARALLEL {
            self.events.iter_mut().map(|list| order(list, fresh)).fold(Inversions::default(), Inversions::plus)
        } else {
            let [x, y, z] = &mut self.events;
            let (x, (y, z)) =
                rayon::join(|| order_long(x, fresh), || rayon::join(|| order_long(y, fresh), || order_long(z, fresh)));
            x.plus(y).plus(z)
        };
        if fresh || done != Inversions::default() {
            self.write_ranks();
        }
        done
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

fn order_long(list: &mut [Event], fresh: bool) -> Inversions {
    if fresh {
        list.par_sort_unstable_by_key(|e| e.key());
        return Inversions::default();
    }
    resort(list)
}
