use super::{
    Bvh2, MAX_DEPTH,
    node::{Link, Pair},
};
use crate::geom::{Aabb, Triangles};

/// Checks structure, boxes and corners; the first violation in words.
pub(super) fn validate(bvh: &Bvh2, prims: &Triangles<'_>) -> Result<(), String> {
    if bvh.lineage.prims() != prims.len() {
        return Err(format!("{} triangles, built over {}", prims.len(), bvh.lineage.prims()));
    }
    let mut walk = Walk { bvh, prims, seen: vec![false; prims.len()], next_pair: 0, next_block: 0 };
    let bounds = walk.pair(Link::inner(0), 1)?;
    if bounds != bvh.bounds && !(bounds.is_empty() && bvh.bounds.is_empty()) {
        return Err("the root box is not the box of its children".into());
    }
    if walk.next_pair != bvh.pairs.len() || walk.next_block != bvh.blocks.len() {
        return Err("pairs or blocks are out of reach".into());
    }
    walk.seen.iter().position(|&seen| !seen).map_or(Ok(()), |p| Err(format!("triangle {p} is in no leaf")))
}

struct Walk<'a> {
    bvh: &'a Bvh2,
    prims: &'a Triangles<'a>,
    seen: Vec<bool>,
    next_pair: usize,
    next_block: usize,
}

impl Walk<'_> {
    fn pair(&mut self, link: Link, depth: usize) -> Result<Aabb, String> {
        let number = link.pair();
        if number != self.next_pair {
            return Err(format!("pair {number} stands where {} is due", self.next_pair));
        }
        if depth > MAX_DEPTH {
            return Err(format!("pair {number} is deeper than {MAX_DEPTH}"));
        }
        self.next_pair += 1;
        let pair: Pair = self.bvh.pairs[number];
        for child in 0..2 {
            let link = pair.links[child];
            let first_block = self.next_block;
            let aabb = if link.is_leaf() { self.leaf(link)? } else { self.pair(link, depth + 1)? };
            let stored = pair.aabb(child);
            if stored != aabb {
                return Err(format!("child {child} of pair {number}: box {stored:?}, due {aabb:?}"));
            }
            if self.next_block - first_block != pair.blocks[child] as usize {
                return Err(format!("child {child} of pair {number}: wrong number of blocks"));
            }
        }
        Ok(pair.union())
    }

    fn leaf(&mut self, link: Link) -> Result<Aabb, String> {
        let range = link.blocks();
        if !range.is_empty() && range.start != self.next_block {
            return Err(format!("block {} stands where {} is due", range.start, self.next_block));
        }
        self.next_block += range.len();
        let mut aabb = Aabb::EMPTY;
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
