//! The eight bytes of a node: one plane and one word.

#![expect(clippy::cast_possible_truncation, reason = "numbers of pairs and slots are checked by the build")]

use crate::geom::Aabb;

/// The largest number that fits into a node's index; it marks a child without triangles.
const NO_INDEX: u32 = (1 << INDEX_BITS) - 1;

/// Bits of an index.
const INDEX_BITS: u32 = 27;

/// Most triangles of a structure: every pair, block and slot then has a number below [`NO_INDEX`].
pub(super) const MAX_TRIANGLES: usize = NO_INDEX as usize;

const INDEX_SHIFT: u32 = 32 - INDEX_BITS;
const ORDER_SHIFT: u32 = 3;
const ORDER: u32 = 3 << ORDER_SHIFT;
const UPPER: u32 = 4;
const SIDE: u32 = 7;

/// One side of a box: bits 0..2 are the axis, bit 2 is set for the upper plane. 3 and 7 do not occur.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Side(u32);

impl Side {
    /// Every side, in the order in which equals are preferred.
    pub(super) const ALL: [Self; 6] = [
        Self::new(0, true),
        Self::new(0, false),
        Self::new(1, true),
        Self::new(1, false),
        Self::new(2, true),
        Self::new(2, false),
    ];

    /// Rows of a table by [`Side::row`].
    pub(super) const ROWS: usize = 8;

    pub(super) const fn new(axis: u32, upper: bool) -> Self {
        Self(axis | if upper { UPPER } else { 0 })
    }

    /// The side of a [`Side::row`].
    #[inline(always)]
    pub(super) fn of_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// The other side of the axis.
    pub(super) fn opposite(self) -> Self {
        Self(self.0 ^ UPPER)
    }

    #[inline(always)]
    pub(super) fn axis(self) -> usize {
        (self.0 & 3) as usize
    }

    /// True when the geometry lies below the plane.
    #[inline(always)]
    pub(super) fn is_upper(self) -> bool {
        self.0 & UPPER != 0
    }

    #[inline(always)]
    pub(super) fn row(self) -> usize {
        (self.0 & SIDE) as usize
    }

    /// The box's plane on this side; no -0.
    #[inline(always)]
    pub(super) fn of(self, aabb: &Aabb) -> f32 {
        (if self.is_upper() { aabb.max } else { aabb.min })[self.axis()] + 0.0
    }

    /// `outer` with this side taken from `inner`.
    #[inline(always)]
    pub(super) fn tightened(self, mut outer: Aabb, plane: f32) -> Aabb {
        (if self.is_upper() { &mut outer.max } else { &mut outer.min })[self.axis()] = plane;
        outer
    }
}

/// All of a node but its plane.
///
/// | bits | |
/// |---|---|
/// | 0..2 | axis of the plane |
/// | 2 | 1: the geometry satisfies `x <= plane`; 0: `x >= plane` |
/// | 3..5 | axis along which the children are ordered; 3: leaf |
/// | 5..32 | number of the pair that the children are; of a leaf, its first block, or its slot where leaves hold one triangle |
#[repr(transparent)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Word(u32);

impl Word {
    /// A leaf without triangles.
    pub(super) const NONE: Self = Self(NO_INDEX << INDEX_SHIFT | ORDER);

    pub(super) fn inner(pair: usize, order: u8) -> Self {
        debug_assert!(pair < MAX_TRIANGLES && order < 3);
        Self((pair as u32) << INDEX_SHIFT | u32::from(order) << ORDER_SHIFT)
    }

    pub(super) fn leaf(place: usize) -> Self {
        debug_assert!(place < MAX_TRIANGLES);
        Self((place as u32) << INDEX_SHIFT | ORDER)
    }

    /// True for a leaf without triangles; its plane leaves no space inside.
    #[inline(always)]
    pub(super) fn is_none(self) -> bool {
        self.0 >> INDEX_SHIFT == NO_INDEX
    }

    #[inline(always)]
    pub(super) fn is_leaf(self) -> bool {
        self.0 & ORDER == ORDER
    }

    #[inline(always)]
    pub(super) fn side(self) -> Side {
        Side(self.0 & SIDE)
    }

    #[inline(always)]
    pub(super) fn set_side(&mut self, side: Side) {
        self.0 = self.0 & !SIDE | side.0;
    }

    /// Axis along which the children of an inner node are ordered.
    #[inline(always)]
    pub(super) fn order(self) -> usize {
        ((self.0 & ORDER) >> ORDER_SHIFT) as usize
    }

    /// Number of the children's pair, or place of the leaf.
    #[inline(always)]
    pub(super) fn index(self) -> usize {
        (self.0 >> INDEX_SHIFT) as usize
    }

    /// The word after its bits have passed through an identity.
    #[inline(always)]
    pub(super) fn map_bits(self, identity: impl Fn(u32) -> u32) -> Self {
        Self(identity(self.0))
    }
}

/// A node.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) plane: f32,
    pub(super) word: Word,
}

/// Two siblings.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pair(pub(super) [Node; 2]);

const _: () = assert!(size_of::<Node>() == 8 && size_of::<Pair>() == 16 && align_of::<Pair>() == 16);
