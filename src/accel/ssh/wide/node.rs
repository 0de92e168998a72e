//! A node of eight children: planes in structure-of-arrays form, and words.

#![expect(clippy::cast_possible_truncation, reason = "numbers of nodes and blocks are checked by the build")]

use crate::{
    accel::{
        ssh::{choose::size, node::Side},
        wide::{Place, WIDTH, WideNode},
    },
    geom::Aabb,
    simd::branch_barrier,
};

/// Most planes of a child.
const MAX_PLANES: usize = 4;

/// Bits of an index.
const INDEX_BITS: i32 = 25;

/// The largest number that fits into an index; it marks what is no child.
const NO_INDEX: u32 = (1 << INDEX_BITS) - 1;

/// Most triangles of a structure: every node and block then has a number below [`NO_INDEX`].
pub(super) const MAX_TRIANGLES: usize = NO_INDEX as usize;

/// First of the three bits of the fourth plane's side.
pub(super) const FOURTH: i32 = INDEX_BITS;

/// First of the three bits that tell whether the plane of an axis is an upper one.
pub(super) const UPPER: i32 = 28;

const LEAF: u32 = 1 << 31;

/// All of a child but its planes.
///
/// | bits | |
/// |---|---|
/// | 0..25 | number of the node that the child is, or of a leaf's first block |
/// | 25..28 | side of the fourth plane |
/// | 28..31 | of each axis, 1 where the plane is the upper one |
/// | 31 | leaf |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::accel::ssh) struct Word(u32);

impl Word {
    /// No child; its planes leave no space inside.
    const NONE: Self = Self(LEAF | NO_INDEX);

    pub(super) fn inner(number: usize) -> Self {
        debug_assert!(number < MAX_TRIANGLES);
        Self(number as u32)
    }

    pub(super) fn leaf(place: usize) -> Self {
        debug_assert!(place < MAX_TRIANGLES);
        Self(LEAF | place as u32)
    }

    /// The side of one of the planes: those of the axes, then the fourth.
    #[inline(always)]
    pub(super) fn side(self, row: usize) -> Side {
        let axis = row as u32;
        if row < 3 {
            Side::new(axis, self.0 >> (UPPER as u32 + axis) & 1 == 1)
        } else {
            Side::of_bits(self.0 >> FOURTH & 7)
        }
    }

    fn set_sides(&mut self, sides: [Side; MAX_PLANES]) {
        let [x, y, z, fourth] = sides;
        let upper = [x, y, z].iter().rev().fold(0, |bits, side| bits << 1 | u32::from(side.is_upper()));
        self.0 = self.0 & (LEAF | NO_INDEX) | upper << UPPER | (fourth.row() as u32) << FOURTH;
    }
}

impl Place for Word {
    #[inline(always)]
    fn is_leaf(self) -> bool {
        self.0 & LEAF != 0
    }

    #[inline(always)]
    fn is_none(self) -> bool {
        self.0 & NO_INDEX == NO_INDEX
    }

    #[inline(always)]
    fn index(self) -> usize {
        (self.0 & NO_INDEX) as usize
    }

    #[inline(always)]
    fn predicted(self) -> Self {
        Self(branch_barrier(self.0))
    }
}

/// Eight children with `K` planes each.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(in crate::accel::ssh) struct Node<const K: usize> {
    /// `[axis][child]`; in row 3 the fourth planes.
    pub(super) planes: [[f32; WIDTH]; K],
    words: [u32; WIDTH],
}

const _: () = assert!(size_of::<Node<3>>() == 128 && size_of::<Node<4>>() == 192);

impl<const K: usize> WideNode for Node<K> {
    type Word = Word;

    #[inline(always)]
    fn word(&self, slot: usize) -> Word {
        Word(self.words[slot])
    }
}

/// The sides that a child keeps, and what they leave of the box that it inherits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    sides: [Side; MAX_PLANES],
    pub(super) inherited: Aabb,
}

const X_UP: Side = Side::new(0, true);
const X_LOW: Side = Side::new(0, false);

impl<const K: usize> Node<K> {
    /// No children.
    pub(super) fn new() -> Self {
        let mut out = Self { planes: [[0.0; WIDTH]; K], words: [Word::NONE.0; WIDTH] };
        for slot in 0..WIDTH {
            out.close(slot);
        }
        out
    }

    #[inline(always)]
    pub(super) fn raw_words(&self) -> &[u32; WIDTH] {
        &self.words
    }

    pub(super) fn words(&self) -> impl Iterator<Item = Word> + '_ {
        self.words.iter().map(|&word| Word(word))
    }

    /// Puts a child in a slot; its sides are to be chosen.
    pub(super) fn set_word(&mut self, slot: usize, word: Word) {
        self.words[slot] = word.0;
    }

    /// Planes that leave no space inside.
    pub(super) fn close(&mut self, slot: usize) {
        self.take(slot, &Aabb::EMPTY, &Choice::first(Aabb::EMPTY));
    }

    /// Planes that never cut.
    pub(super) fn open(&mut self, slot: usize) {
        let all = Aabb { min: glam::Vec3::NEG_INFINITY, max: glam::Vec3::INFINITY };
        self.take(slot, &all, &Choice::first(all));
    }

    /// Takes the chosen sides of `tight`.
    pub(super) fn take(&mut self, slot: usize, tight: &Aabb, choice: &Choice) {
        let mut word = self.word(slot);
        word.set_sides(choice.sides);
        self.words[slot] = word.0;
        self.set_planes(slot, tight);
    }

    /// Moves the planes of a child to the sides of its box.
    #[inline(always)]
    pub(super) fn set_planes(&mut self, slot: usize, tight: &Aabb) {
        let word = self.word(slot);
        for (row, planes) in self.planes.iter_mut().enumerate() {
            planes[slot] = word.side(row).of(tight);
        }
    }

    /// `inherited` within the planes of a child, and how many of them take nothing off.
    pub(super) fn inside(&self, slot: usize, inherited: &Aabb) -> (Aabb, usize) {
        let (mut inside, mut useless) = (*inherited, 0);
        for (row, planes) in self.planes.iter().enumerate() {
            let (side, plane) = (self.word(slot).side(row), planes[slot]);
            let cut = if side.is_upper() { plane < inside.max[side.axis()] } else { plane > inside.min[side.axis()] };
            if cut {
                inside = side.tightened(inside, plane);
            } else {
                useless += 1;
            }
        }
        (inside, useless)
    }

    /// The sides of `tight` that leave the least of `inherited`: one of each axis, and of one axis both where there are four.
    pub(super) fn choose(tight: &Aabb, inherited: &Aabb) -> Choice {
        let mut best = Choice::first(*tight);
        if tight.is_empty() {
            return best;
        }
        let mut least = (f64::INFINITY, f64::INFINITY);
        for bits in 0..8 {
            let side = |axis: u32| Side::new(axis, bits >> axis & 1 == 0);
            let sides = [side(0), side(1), side(2)];
            let mut inside = *inherited;
            for side in sides {
                inside = side.tightened(inside, side.of(tight));
            }
            if K < MAX_PLANES {
                let size = size(&inside);
                if size < least {
                    (best, least) = (Choice { sides: [sides[0], sides[1], sides[2], X_UP], inherited: inside }, size);
                }
                continue;
            }
            // A pair of an axis is met twice, once from each side; one of them is enough.
            for fourth in sides.into_iter().filter(|side| side.is_upper()).map(Side::opposite) {
                let inside = fourth.tightened(inside, fourth.of(tight));
                let size = size(&inside);
                if size < least {
                    (best, least) = (Choice { sides: [sides[0], sides[1], sides[2], fourth], inherited: inside }, size);
                }
            }
        }
        best
    }
}

impl Choice {
    /// The upper sides, and the lower one of x.
    fn first(inherited: Aabb) -> Self {
        Self { sides: [X_UP, Side::new(1, true), Side::new(2, true), X_LOW], inherited }
    }
}
