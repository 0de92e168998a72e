use crate::{
    accel::{
        block::{NO_PRIM, TriBlock},
        sah::BLOCK,
    },
    geom::{PrimId, Triangles},
};

/// A triangle of a leaf.
#[repr(C, align(16))]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(in crate::accel) struct Corners {
    /// Numbers of its vertices.
    pub(super) vertices: [u32; 3],
    prim: u32,
}

impl Corners {
    pub(super) fn new(prim: u32, prims: &Triangles<'_>) -> Self {
        Self { vertices: prims.indices[prim as usize], prim }
    }

    /// Puts up to four triangles of a leaf, at least one, into a block.
    #[inline(always)]
    pub(super) fn gather(own: &[Self], prims: &Triangles<'_>, block: &mut TriBlock) {
        let mut vertices = [own[0].vertices; BLOCK];
        let mut numbers = [NO_PRIM; BLOCK];
        for (i, corners) in own.iter().enumerate().take(BLOCK) {
            vertices[i] = corners.vertices;
            numbers[i] = corners.prim;
        }
        block.gather(numbers, &vertices, prims);
    }

    /// The triangle's number, and whether the vertices are its own.
    pub(super) fn checked(&self, prims: &Triangles<'_>) -> (PrimId, bool) {
        (PrimId(self.prim), prims.indices.get(self.prim as usize) == Some(&self.vertices))
    }
}
