use glam::Vec3;

use super::{KdTree, node::KdNode};
use crate::{
    accel::block::{NO_PRIM, TriBlock},
    geom::{Aabb, PrimId, Triangles},
};

/// Checks structure, corners, and that every triangle is where its corners are; the first violation in words.
pub(super) fn validate(kd: &KdTree, prims: &Triangles<'_>) -> Result<(), String> {
    if kd.prim_count != prims.len() {
        return Err(format!("{} triangles, built over {}", prims.len(), kd.prim_count));
    }
    let forest = Forest { nodes: &kd.tree.nodes, blocks: &kd.blocks, prims };
    let (mut nodes, mut units) = (0, 0);
    forest.subtree(0, kd.tree.bounds, &mut nodes, &mut units)?;
    if nodes != kd.tree.nodes.len() || units != kd.blocks.len() {
        return Err("nodes or blocks are out of reach".into());
    }
    for (prim, own) in finite_prims(prims) {
        if !kd.tree.bounds.contains(own) {
            return Err(format!("triangle {} leaves the bounds", prim.0));
        }
        forest.holds_corners(0, prim)?;
    }
    Ok(())
}

/// The triangles that can be hit, with their boxes.
#[expect(clippy::cast_possible_truncation, reason = "the build checked the number of triangles")]
pub(in crate::accel) fn finite_prims<'a>(prims: &'a Triangles<'_>) -> impl Iterator<Item = (PrimId, Aabb)> + 'a {
    let all = (0..prims.len() as u32).map(|id| (PrimId(id), prims.finite_aabb(PrimId(id))));
    all.filter(|(_, own)| !own.is_empty())
}

/// Kd-trees in one array of nodes.
pub(in crate::accel) struct Forest<'a> {
    pub(in crate::accel) nodes: &'a [KdNode],
    pub(in crate::accel) blocks: &'a [TriBlock],
    pub(in crate::accel) prims: &'a Triangles<'a>,
}

impl Forest<'_> {
    /// Checks the order of nodes and blocks and the leaves of a subtree; `nodes` and `units` are the next that are due.
    pub(in crate::accel) fn subtree(
        &self,
        at: usize,
        cell: Aabb,
        nodes: &mut usize,
        units: &mut usize,
    ) -> Result<(), String> {
        if at != *nodes {
            return Err(format!("node {at} stands where {nodes} is due"));
        }
        *nodes += 1;
        let node = self.nodes[at];
        if node.is_leaf() {
            if node.units().start != *units {
                return Err(format!("leaf {at} begins at block {}, due {units}", node.units().start));
            }
            *units = node.units().end;
            return self.leaf(at, cell);
        }
        let (axis, split) = (node.axis(), node.split());
        if split <= cell.min[axis] || split >= cell.max[axis] {
            return Err(format!("node {at} splits outside of its cell"));
        }
        let (mut below, mut above) = (cell, cell);
        below.max[axis] = split;
        above.min[axis] = split;
        self.subtree(at + 1, below, nodes, units)?;
        self.subtree(node.upper(), above, nodes, units)
    }

    fn leaf(&self, at: usize, cell: Aabb) -> Result<(), String> {
        let mut last = None;
        for block in &self.blocks[self.nodes[at].units()] {
            for lane in 0..4 {
                let prim = block.prim(lane);
                if prim == NO_PRIM {
                    continue;
                }
                if last.replace(prim).is_some_and(|last| last >= prim) {
                    return Err(format!("leaf {at} does not hold its triangles in order"));
                }
                if prim as usize >= self.prims.len() {
                    return Err(format!("leaf {at} names a triangle that does not exist"));
                }
                if block.corners(lane) != self.prims.corners(PrimId(prim)) {
                    return Err(format!("triangle {prim} has stale corners"));
                }
                let own = self.prims.finite_aabb(PrimId(prim));
                if own.min.cmpgt(cell.max).any() || own.max.cmplt(cell.min).any() {
                    return Err(format!("triangle {prim} does not reach leaf {at}"));
                }
            }
        }
        Ok(())
    }

    /// Checks that the leaves at a triangle's corners hold it.
    fn holds_corners(&self, root: usize, prim: PrimId) -> Result<(), String> {
        let lost = self.prims.corners(prim).into_iter().find(|&corner| !self.holds(root, corner, prim.0));
        lost.map_or(Ok(()), |corner| Err(format!("no leaf at {corner} holds triangle {}", prim.0)))
    }

    /// True when a leaf of the subtree that contains the point holds the triangle.
    pub(in crate::accel) fn holds(&self, at: usize, point: Vec3, prim: u32) -> bool {
        let node = self.nodes[at];
        if node.is_leaf() {
            return self.blocks[node.units()].iter().any(|b| b.prims().any(|p| p.0 == prim));
        }
        let x = point[node.axis()];
        (x <= node.split() && self.holds(at + 1, point, prim))
            || (x >= node.split() && self.holds(node.upper(), point, prim))
    }
}
