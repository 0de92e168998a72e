//! Ranks and cursors of three axes, packed into one word so that all three are compared at once.

use std::fmt::Debug;

/// A word with a field for each axis and a guard bit above each field.
pub(crate) trait RankWord: Copy + Default + PartialEq + Debug + Send + Sync + 'static {
    /// Most events that one list may hold: the fields' greatest number.
    const MAX_EVENTS: usize;

    /// Packs three numbers of at most [`RankWord::MAX_EVENTS`].
    fn pack(fields: [u32; 3]) -> Self;
    /// The number in a field.
    fn get(self, axis: usize) -> u32;
    /// This word with another number in a field.
    fn with(self, axis: usize, number: u32) -> Self;
    /// One more in a field, or one less.
    fn stepped(self, axis: usize, back: bool) -> Self;
    /// True when every field is at least `floor`'s and at most `ceiling`'s.
    fn is_within(self, floor: Self, ceiling: Self) -> bool;
}

macro_rules! rank_word {
    ($word:ty, $bits:literal) => {
        impl RankWord for $word {
            const MAX_EVENTS: usize = (1 << ($bits - 1)) - 1;

            #[inline(always)]
            fn pack([x, y, z]: [u32; 3]) -> Self {
                Self::from(x) | Self::from(y) << $bits | Self::from(z) << (2 * $bits)
            }

            #[inline(always)]
            #[expect(clippy::cast_possible_truncation, reason = "fields hold numbers of 32 bits")]
            fn get(self, axis: usize) -> u32 {
                (self >> ($bits * axis)) as u32 & (((1_u64 << ($bits - 1)) - 1) as u32)
            }

            #[inline(always)]
            fn with(self, axis: usize, number: u32) -> Self {
                let field = ((1 << ($bits - 1)) - 1) << ($bits * axis);
                (self & !field) | Self::from(number) << ($bits * axis)
            }

            #[inline(always)]
            fn stepped(self, axis: usize, back: bool) -> Self {
                let one = 1 << ($bits * axis);
                if back { self - one } else { self + one }
            }

            #[inline(always)]
            fn is_within(self, floor: Self, ceiling: Self) -> bool {
                // A guard bit survives the subtraction where the field did not need to borrow it.
                const GUARDS: $word = 1 << ($bits - 1) | 1 << (2 * $bits - 1) | 1 << (3 * $bits - 1);
                let above = (self | GUARDS) - floor;
                let below = (ceiling | GUARDS) - self;
                above & below & GUARDS == GUARDS
            }
        }
    };
}

rank_word!(u64, 21);
rank_word!(u128, 42);

/// Where the ends of one box stand in the three lists.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Ranks<W> {
    /// The rank of the lower end plus one: the least cursor that has passed it.
    floor: W,
    /// The rank of the upper end: the greatest cursor that has not passed it.
    ceiling: W,
}

impl<W: RankWord> Ranks<W> {
    /// Takes the rank of an end.
    #[inline(always)]
    pub(crate) fn set(&mut self, axis: usize, is_max: bool, rank: u32) {
        if is_max {
            self.ceiling = self.ceiling.with(axis, rank);
        } else {
            self.floor = self.floor.with(axis, rank + 1);
        }
    }

    /// Ranks of the lower and upper end on an axis.
    #[inline(always)]
    pub(crate) fn get(&self, axis: usize) -> [u32; 2] {
        [self.floor.get(axis) - 1, self.ceiling.get(axis)]
    }

    /// True when a point with these cursors is inside of the box on every axis.
    #[inline(always)]
    pub(crate) fn hold(&self, cursors: W) -> bool {
        cursors.is_within(self.floor, self.ceiling)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn agrees<W: RankWord>(cursor: [u32; 3], low: [u32; 3], high: [u32; 3]) -> bool {
        let mut ranks = Ranks::<W>::default();
        for axis in 0..3 {
            ranks.set(axis, false, low[axis]);
            ranks.set(axis, true, high[axis]);
        }
        let word = W::pack(cursor);
        let due = (0..3).all(|i| low[i] < cursor[i] && cursor[i] <= high[i]);
        let fields = (0..3).all(|i| {
            let stepped = [word.stepped(i, false), W::pack([cursor[0] + 1; 3]).stepped(i, true)];
            ranks.get(i) == [low[i], high[i]]
                && word.get(i) == cursor[i]
                && stepped[0].get(i) == cursor[i] + 1
                && stepped[1].get(i) == cursor[0]
        });
        fields && ranks.hold(word) == due
    }

    proptest! {
        #[test]
        fn packed_ranks_answer_as_numbers_do(
            numbers in prop::array::uniform9(prop_oneof![0_u32..6, (1_u32 << 20) - 8..(1 << 20) - 2]),
        ) {
            let [a, b, c, d, e, f, g, h, i] = numbers;
            prop_assert!(agrees::<u64>([a, b, c], [d, e, f], [g, h, i]));
            prop_assert!(agrees::<u128>([a, b, c], [d, e, f], [g, h, i]));
        }

        #[test]
        fn wide_words_hold_every_rank(
            numbers in prop::array::uniform9(prop_oneof![0_u32..6, u32::MAX - 6..u32::MAX - 1]),
        ) {
            let [a, b, c, d, e, f, g, h, i] = numbers;
            prop_assert!(agrees::<u128>([a, b, c], [d, e, f], [g, h, i]));
        }
    }
}
