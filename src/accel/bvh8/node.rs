#![expect(clippy::cast_possible_truncation, reason = "the builder keeps the numbers of nodes and blocks below 2^28")]

use std::{fmt::Debug, ops::Range};

use glam::Vec3;

use crate::{
    accel::{
        sah::BLOCK,
        topology::MAX_LEAF,
        wide::{Place, WIDTH, WideNode},
    },
    geom::Aabb,
    simd::{Lanes, Simd, branch_barrier},
};

/// Blocks that one leaf may hold.
const MAX_LEAF_BLOCKS: usize = MAX_LEAF.div_ceil(BLOCK);

/// Most blocks a tree may hold: a leaf has 28 bits for the first, and the last number marks what is no child.
pub(super) const MAX_BLOCKS: usize = (1 << 28) - 2;

const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 28;
const FIRST: u32 = (1 << COUNT_SHIFT) - 1;

const RUN_SHIFT: u32 = 26;
const FIRST_OF_RUN: u32 = (1 << RUN_SHIFT) - 1;
const _: () = assert!(MAX_LEAF <= 1 << (31 - RUN_SHIFT));

/// Where a child is: a node, a run of blocks, or nowhere.
///
/// Bit 31 marks a leaf; bits 28..31 are its block count less one, bits 0..28 its first block.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub(in crate::accel) struct Link(u32);

impl Link {
    /// A child without triangles; its box is empty, so no ray follows it.
    pub(super) const NONE: Self = Self(u32::MAX);

    pub(super) fn inner(node: usize) -> Self {
        Self(node as u32)
    }

    pub(super) fn leaf(first: usize, count: usize) -> Self {
        debug_assert!((1..=MAX_LEAF_BLOCKS).contains(&count) && first <= MAX_BLOCKS);
        Self(LEAF | ((count as u32 - 1) << COUNT_SHIFT) | first as u32)
    }

    /// Most triangles of a tree whose leaves are runs of triangles: 26 bits for the first, and the last number marks what is no child.
    pub(super) const MOST_IN_RUNS: usize = (1 << RUN_SHIFT) - 2;

    /// A leaf of so many triangles, at most [`MAX_LEAF`]: bits 26..31 are their count less one.
    pub(super) fn run(first: usize, count: usize) -> Self {
        debug_assert!((1..=MAX_LEAF).contains(&count) && first <= Self::MOST_IN_RUNS);
        Self(LEAF | ((count as u32 - 1) << RUN_SHIFT) | first as u32)
    }

    /// The triangles of such a leaf.
    #[inline(always)]
    pub(super) fn triangles(self) -> Range<usize> {
        let first = (self.0 & FIRST_OF_RUN) as usize;
        first..first + ((self.0 & !LEAF) >> RUN_SHIFT) as usize + 1
    }

    #[inline(always)]
    pub(super) fn bits(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub(super) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// The words of all children.
    #[inline(always)]
    pub(super) fn words(links: &[Self; WIDTH]) -> &[u32; WIDTH] {
        bytemuck::cast_ref(links)
    }

    /// Number of blocks of a leaf that has some.
    #[inline(always)]
    pub(super) fn span(self) -> usize {
        ((self.0 & !LEAF) >> COUNT_SHIFT) as usize + 1
    }

    /// Blocks of a leaf that has some.
    #[inline(always)]
    pub(super) fn blocks(self) -> Range<usize> {
        let first = (self.0 & FIRST) as usize;
        first..first + self.span()
    }
}

impl Place for Link {
    #[inline(always)]
    fn is_leaf(self) -> bool {
        self.0 & LEAF != 0
    }

    #[inline(always)]
    fn is_none(self) -> bool {
        self == Self::NONE
    }

    #[inline(always)]
    fn index(self) -> usize {
        (self.0 & FIRST) as usize
    }

    #[inline(always)]
    fn predicted(self) -> Self {
        Self(branch_barrier(self.0))
    }
}

/// Eight children's boxes in structure-of-arrays form.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(in crate::accel) struct Node {
    /// `[axis][min, max][child]`.
    pub(super) planes: [[[f32; WIDTH]; 2]; 3],
    /// The children, in the order of their triangles; [`Link::NONE`] after the last.
    pub(super) links: [Link; WIDTH],
}

const _: () = assert!(size_of::<Node>() == 224);

/// A node of any layout: eight boxes, each plane of which is a number of f32.
pub(in crate::accel) trait EightNode: WideNode<Word = Link> + Clone + Debug + 'static {
    /// Children whose boxes are still to be set.
    fn new(links: [Link; WIDTH]) -> Self;
    /// The lower (0) or upper (1) planes of the children on an axis.
    fn planes<S: Simd>(&self, axis: usize, side: usize) -> S::F8;
    /// One of them.
    fn plane(&self, axis: usize, side: usize, child: usize) -> f32;
    /// Bits of the children that the planes speak for; others are not there whatever the planes say.
    fn present(&self) -> u32;
    /// The children.
    fn links(&self) -> &[Link; WIDTH];
    /// Sets one of the children.
    fn set_link(&mut self, child: usize, link: Link);
    /// What is wrong with the planes when these are the children's boxes.
    fn check(&self, aabbs: &[Aabb; WIDTH]) -> Result<(), String>;
}

impl WideNode for Node {
    type Word = Link;

    #[inline(always)]
    fn word(&self, slot: usize) -> Link {
        self.links[slot]
    }
}

impl EightNode for Node {
    fn new(links: [Link; WIDTH]) -> Self {
        Self { planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3], links }
    }

    #[inline(always)]
    fn planes<S: Simd>(&self, axis: usize, side: usize) -> S::F8 {
        S::F8::load(&self.planes[axis][side])
    }

    #[inline(always)]
    fn plane(&self, axis: usize, side: usize, child: usize) -> f32 {
        self.planes[axis][side][child]
    }

    #[inline(always)]
    fn present(&self) -> u32 {
        u32::MAX
    }

    #[inline(always)]
    fn links(&self) -> &[Link; WIDTH] {
        &self.links
    }

    fn set_link(&mut self, child: usize, link: Link) {
        self.links[child] = link;
    }

    fn check(&self, aabbs: &[Aabb; WIDTH]) -> Result<(), String> {
        for (child, &due) in aabbs.iter().enumerate() {
            let stored = self.aabb(child);
            if stored != due && !(stored.is_empty() && due.is_empty()) {
                return Err(format!("child {child}: box {stored:?}, due {due:?}"));
            }
        }
        Ok(())
    }
}

impl Node {
    #[inline(always)]
    fn aabb(&self, child: usize) -> Aabb {
        let [x, y, z] = &self.planes;
        Aabb {
            min: Vec3::new(x[0][child], y[0][child], z[0][child]),
            max: Vec3::new(x[1][child], y[1][child], z[1][child]),
        }
    }

    #[inline(always)]
    pub(super) fn set_aabbs(&mut self, aabbs: &[Aabb; WIDTH]) {
        for (child, aabb) in aabbs.iter().enumerate() {
            for axis in 0..3 {
                self.planes[axis][0][child] = aabb.min[axis];
                self.planes[axis][1][child] = aabb.max[axis];
            }
        }
    }
}
