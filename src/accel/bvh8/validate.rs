use super::{
    format::Format,
    node::{EightNode, Link},
    tree::Tree8,
};
use crate::{
    accel::{
        topology::MAX_DEPTH,
        wide::{Place, WIDTH, WideNode},
    },
    geom::{Aabb, Triangles},
};

/// Checks structure, boxes and corners; the first violation in words.
pub(super) fn validate<F: Format>(bvh: &Tree8<F>, prims: &Triangles<'_>) -> Result<(), String> {
    if bvh.lineage.prims() != prims.len() {
        return Err(format!("{} triangles, built over {}", prims.len(), bvh.lineage.prims()));
    }
    let mut walk = Walk { bvh, prims, seen: vec![false; prims.len()], next_node: 0, next_item: 0 };
    let bounds = walk.node(0, 1)?;
    if bounds != bvh.bounds && !(bounds.is_empty() && bvh.bounds.is_empty()) {
        return Err("the root box is not the box of its children".into());
    }
    if walk.next_node != bvh.nodes.len() || walk.next_item != bvh.items.len() {
        return Err("nodes or leaves are out of reach".into());
    }
    walk.seen.iter().position(|&seen| !seen).map_or(Ok(()), |p| Err(format!("triangle {p} is in no leaf")))
}

struct Walk<'a, F: Format> {
    bvh: &'a Tree8<F>,
    prims: &'a Triangles<'a>,
    seen: Vec<bool>,
    next_node: usize,
    next_item: usize,
}

impl<F: Format> Walk<'_, F> {
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
        let mut due = [Aabb::EMPTY; WIDTH];
        for (child, due) in due.iter_mut().enumerate() {
            let link = node.word(child);
            *due = if link.is_leaf() { self.leaf(link)? } else { self.node(link.index(), depth + 1)? };
        }
        node.check(&due).map_err(|what| format!("node {number}: {what}"))?;
        Ok(due.into_iter().fold(Aabb::EMPTY, Aabb::union))
    }

    fn leaf(&mut self, link: Link) -> Result<Aabb, String> {
        let mut aabb = Aabb::EMPTY;
        if link.is_none() {
            return Ok(aabb);
        }
        let range = F::own(link);
        if range.start != self.next_item {
            return Err(format!("leaf {} stands where {} is due", range.start, self.next_item));
        }
        self.next_item += range.len();
        for item in &self.bvh.items[range] {
            for (prim, is_fresh) in F::triangles(item, self.prims) {
                let seen = self.seen.get_mut(prim.0 as usize).ok_or("a leaf names a triangle that does not exist")?;
                if std::mem::replace(seen, true) {
                    return Err(format!("triangle {} is in two leaves", prim.0));
                }
                let own = self.prims.finite_aabb(prim);
                if !is_fresh {
                    return Err(format!("triangle {} has stale corners", prim.0));
                }
                aabb = aabb.union(own);
            }
        }
        Ok(aabb)
    }
}
