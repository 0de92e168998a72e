use super::{Bvh8, node::Link};
use crate::{
    accel::{
        topology::MAX_DEPTH,
        wide::{Place, WIDTH},
    },
    geom::{Aabb, Triangles},
};

/// Checks structure, boxes and corners; the first violation in words.
pub(super) fn validate(bvh: &Bvh8, prims: &Triangles<'_>) -> Result<(), String> {
    if bvh.lineage.prims() != prims.len() {
        return Err(format!("{} triangles, built over {}", prims.len(), bvh.lineage.prims()));
    }
    let mut walk = Walk { bvh, prims, seen: vec![false; prims.len()], next_node: 0, next_block: 0 };
    let bounds = walk.node(0, 1)?;
    if bounds != bvh.bounds && !(bounds.is_empty() && bvh.bounds.is_empty()) {
        return Err("the root box is not the box of its children".into());
    }
    if walk.next_node != bvh.nodes.len() || walk.next_block != bvh.blocks.len() {
        return Err("nodes or blocks are out of reach".into());
    }
    walk.seen.iter().position(|&seen| !seen).map_or(Ok(()), |p| Err(format!("triangle {p} is in no leaf")))
}

struct Walk<'a> {
    bvh: &'a Bvh8,
    prims: &'a Triangles<'a>,
    seen: Vec<bool>,
    next_node: usize,
    next_block: usize,
}

impl Walk<'_> {
    /// Returns the box of all that is below.
    fn node(&mut self, number: usize, depth: usize) -> Result<Aabb, String> {
        if number != self.next_node {
            return Err(format!("node {number} stands where {} is due", self.next_node));
        }
        if depth > MAX_DEPTH {
            return Err(format!("node {number} is deeper than {MAX_DEPTH}"));
        }
        self.next_node += 1;
        let node = &self.bvh.nodes[number];
        let mut all = Aabb::EMPTY;
        for child in 0..WIDTH {
            let link = node.links[child];
            let due = if link.is_leaf() { self.leaf(link)? } else { self.node(link.index(), depth + 1)? };
            let stored = node.aabb(child);
            if stored != due && !(stored.is_empty() && due.is_empty()) {
                return Err(format!("child {child} of node {number}: box {stored:?}, due {due:?}"));
            }
            all = all.union(due);
        }
        Ok(all)
    }

    fn leaf(&mut self, link: Link) -> Result<Aabb, String> {
        let mut aabb = Aabb::EMPTY;
        if link.is_none() {
            return Ok(aabb);
        }
        let range = link.blocks();
        if range.start != self.next_block {
            return Err(format!("block {} stands where {} is due", range.start, self.next_block));
        }
        self.next_block += range.len();
        for block in &self.bvh.blocks[range] {
            for (lane, prim) in block.prims().enumerate() {
                let seen = self.seen.get_mut(prim.0 as usize).ok_or("a leaf names a triangle that does not exist")?;
                if std::mem::replace(seen, true) {
                    return Err(format!("triangle {} is in two leaves", prim.0));
                }
                let own = self.prims.finite_aabb(prim);
                if !own.is_empty() && block.corners(lane) != self.prims.corners(prim) {
                    return Err(format!("triangle {} has stale corners", prim.0));
                }
                aabb = aabb.union(own);
            }
        }
        Ok(aabb)
    }
}
