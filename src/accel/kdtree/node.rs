use std::ops::Range;

/// Most nodes, and most units, that a tree may hold: 30 bits number them.
pub(in crate::accel) const MAX_NUMBER: usize = (1 << 30) - 1;

const LEAF: u32 = 3;

/// A node in 8 bytes.
///
/// Bits 0..2 of `link` are the axis of the split, or 3 for a leaf. The rest is the number of the child above the split (the one below it
/// follows the node), or a leaf's first unit. `data` is the bits of the split, or a leaf's number of units.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::accel) struct KdNode {
    data: u32,
    link: u32,
}

const _: () = assert!(size_of::<KdNode>() == 8);

#[expect(clippy::cast_possible_truncation, reason = "the builder keeps the numbers of nodes and units below 2^30")]
impl KdNode {
    pub(in crate::accel) fn inner(axis: usize, split: f32, upper: usize) -> Self {
        debug_assert!(axis < 3 && upper <= MAX_NUMBER);
        Self { data: split.to_bits(), link: (upper as u32) << 2 | axis as u32 }
    }

    pub(in crate::accel) fn leaf(units: &Range<usize>) -> Self {
        debug_assert!(units.end <= MAX_NUMBER);
        Self { data: units.len() as u32, link: (units.start as u32) << 2 | LEAF }
    }

    /// Eight bytes that are no node: part of something else kept between nodes.
    pub(in crate::accel) fn raw(words: [u32; 2]) -> Self {
        Self { data: words[0], link: words[1] }
    }

    /// The bytes of [`KdNode::raw`].
    #[inline(always)]
    pub(in crate::accel) fn words(self) -> [u32; 2] {
        [self.data, self.link]
    }

    #[inline(always)]
    pub(in crate::accel) fn is_leaf(self) -> bool {
        self.link & LEAF == LEAF
    }

    /// Axis of the split; 3 for a leaf.
    #[inline(always)]
    pub(in crate::accel) fn axis(self) -> usize {
        (self.link & LEAF) as usize
    }

    #[inline(always)]
    pub(in crate::accel) fn split(self) -> f32 {
        f32::from_bits(self.data)
    }

    /// Number of the child above the split.
    #[inline(always)]
    pub(in crate::accel) fn upper(self) -> usize {
        (self.link >> 2) as usize
    }

    /// Units of a leaf.
    #[inline(always)]
    pub(in crate::accel) fn units(self) -> Range<usize> {
        let first = (self.link >> 2) as usize;
        first..first + self.data as usize
    }

    /// The node when the nodes and units that it names move by as many.
    pub(in crate::accel) fn moved(self, nodes: usize, units: usize) -> Self {
        let by = if self.is_leaf() { units } else { nodes };
        Self { link: self.link + ((by as u32) << 2), ..self }
    }
}
