use super::{
    Wide,
    node::{Node, Word},
};
use crate::{
    accel::{
        topology::MAX_DEPTH,
        wide::{Place, Tree, WIDTH, WideNode},
    },
    geom::{Aabb, Triangles},
};

/// Checks structure, planes and corners; the first violation in words.
pub(super) fn validate<const K: usize>(tree: &Wide<K>, prims: &Triangles<'_>) -> Result<(), String> {
    if tree.lineage.prims() != prims.len() {
        return Err(format!("{} triangles, built over {}", prims.len(), tree.lineage.prims()));
    }
    let mut walk = Walk { tree, prims, seen: vec![false; prims.len()], next_node: 0, next_block: 0 };
    let bounds = walk.node(0, &tree.bounds, 1)?;
    if bounds != tree.bounds && !(bounds.is_empty() && tree.bounds.is_empty()) {
        return Err("the root box is not the box of all triangles".into());
    }
    if walk.next_node != tree.nodes.len() || walk.next_block != tree.blocks.len() {
        return Err("nodes or blocks are out of reach".into());
    }
    walk.seen.iter().position(|&seen| !seen).map_or(Ok(()), |p| Err(format!("triangle {p} is in no leaf")))
}

struct Walk<'a, const K: usize> {
    tree: &'a Wide<K>,
    prims: &'a Triangles<'a>,
    seen: Vec<bool>,
    next_node: usize,
    next_block: usize,
}

impl<const K: usize> Walk<'_, K> {
    /// Returns the box of all that is below; `region` is the root box cut by all planes above.
    fn node(&mut self, number: usize, region: &Aabb, depth: usize) -> Result<Aabb, String> {
        if number != self.next_node {
            return Err(format!("node {number} stands where {} is due", self.next_node));
        }
        if depth > MAX_DEPTH {
            return Err(format!("node {number} is deeper than {MAX_DEPTH}"));
        }
        self.next_node += 1;
        let node = &self.tree.nodes[number];
        let mut all = Aabb::EMPTY;
        for slot in 0..WIDTH {
            let word = node.word(slot);
            let inside = node.inside(slot, region).0;
            let aabb = if word.is_leaf() { self.leaf(word)? } else { self.node(word.index(), &inside, depth + 1)? };
            self.check(node, slot, &aabb, region)?;
            all = all.union(aabb);
        }
        Ok(all)
    }

    /// The planes of a child against the box of what is below it.
    fn check(&self, node: &Node<K>, slot: usize, below: &Aabb, region: &Aabb) -> Result<(), String> {
        let word = node.word(slot);
        let open = word.is_leaf() && !word.is_none() && !self.tree.config.leaf_planes;
        for (row, planes) in node.planes.iter().enumerate() {
            let side = word.side(row);
            let due = match (open, side.is_upper()) {
                (false, _) => side.of(below),
                (true, true) => f32::INFINITY,
                (true, false) => f32::NEG_INFINITY,
            };
            if planes[slot].to_bits() != due.to_bits() {
                return Err(format!("child {slot} of a node: plane {} of {side:?}, due {due}", planes[slot]));
            }
        }
        let inside = node.inside(slot, region).0;
        if !inside.contains(*below) {
            return Err(format!("child {slot} of a node: {below:?} leaves its region {inside:?}"));
        }
        Ok(())
    }

    fn leaf(&mut self, word: Word) -> Result<Aabb, String> {
        let mut aabb = Aabb::EMPTY;
        if word.is_none() {
            return Ok(aabb);
        }
        let place = word.index();
        if place != self.next_block {
            return Err(format!("leaf {place} stands where {} is due", self.next_block));
        }
        let tree = self.tree;
        let blocks = &tree.blocks[place..place + tree.span(word)];
        self.next_block += blocks.len();
        for block in blocks {
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
