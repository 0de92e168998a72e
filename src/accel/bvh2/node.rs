#![expect(clippy::cast_possible_truncation, reason = "the builder keeps the numbers of pairs and blocks below 2^28")]

use std::ops::Range;

use glam::Vec3;

use crate::{
    accel::{sah::BLOCK, topology::MAX_LEAF},
    geom::Aabb,
};

/// Blocks that one leaf may hold.
const MAX_LEAF_BLOCKS: usize = MAX_LEAF.div_ceil(BLOCK);

/// Most blocks a tree may hold: a leaf link has 28 bits for the first, and the last number marks an empty child.
pub(super) const MAX_BLOCKS: usize = (1 << 28) - 2;

const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 28;
const FIRST: u32 = (1 << COUNT_SHIFT) - 1;

/// Where a child is: a pair of nodes, a run of blocks, or nowhere.
///
/// Bit 31 marks a leaf; bits 28..31 are its block count less one, bits 0..28 its first block.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link(u32);

impl Link {
    /// A child without triangles; its box is empty, so no ray follows it.
    pub(super) const NONE: Self = Self(u32::MAX);

    pub(super) fn inner(pair: usize) -> Self {
        Self(pair as u32)
    }

    pub(super) fn leaf(first: usize, count: usize) -> Self {
        debug_assert!((1..=MAX_LEAF_BLOCKS).contains(&count) && first <= MAX_BLOCKS);
        Self(LEAF | ((count as u32 - 1) << COUNT_SHIFT) | first as u32)
    }

    #[inline(always)]
    pub(super) fn is_leaf(self) -> bool {
        self.0 & LEAF != 0
    }

    /// Number of the pair that an inner child is.
    #[inline(always)]
    pub(super) fn pair(self) -> usize {
        self.0 as usize
    }

    /// Blocks of a leaf, or of no child.
    pub(super) fn blocks(self) -> Range<usize> {
        if self == Self::NONE { 0..0 } else { self.leaf_blocks() }
    }

    /// Blocks of a leaf that has some.
    #[inline(always)]
    pub(super) fn leaf_blocks(self) -> Range<usize> {
        let first = (self.0 & FIRST) as usize;
        first..first + ((self.0 & !LEAF) >> COUNT_SHIFT) as usize + 1
    }

    /// The link after its bits have passed through an identity.
    #[inline(always)]
    pub(super) fn map_bits(self, identity: impl Fn(u32) -> u32) -> Self {
        Self(identity(self.0))
    }
}

/// Two sibling nodes in one cache line.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    /// `[axis][min of 0, min of 1, max of 0, max of 1]`.
    pub(super) planes: [[f32; 4]; 3],
    /// The two children.
    pub(super) links: [Link; 2],
    /// Blocks below each child.
    pub(super) blocks: [u32; 2],
}

const _: () = assert!(size_of::<Pair>() == 64 && align_of::<Pair>() == 64);

impl Pair {
    /// Two children with empty boxes.
    pub(super) fn new(links: [Link; 2], blocks: [u32; 2]) -> Self {
        let planes = [[f32::INFINITY, f32::INFINITY, f32::NEG_INFINITY, f32::NEG_INFINITY]; 3];
        Self { planes, links, blocks }
    }

    #[inline(always)]
    pub(super) fn aabb(&self, child: usize) -> Aabb {
        let [x, y, z] = self.planes;
        Aabb { min: Vec3::new(x[child], y[child], z[child]), max: Vec3::new(x[child + 2], y[child + 2], z[child + 2]) }
    }

    #[inline(always)]
    pub(super) fn set_aabb(&mut self, child: usize, aabb: Aabb) {
        for axis in 0..3 {
            self.planes[axis][child] = aabb.min[axis];
            self.planes[axis][child + 2] = aabb.max[axis];
        }
    }

    /// The box around both children.
    #[inline(always)]
    pub(super) fn union(&self) -> Aabb {
        self.aabb(0).union(self.aabb(1))
    }
}
