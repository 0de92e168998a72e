use super::{
    narrow::Narrow,
    node::{Node, Side, Word},
};
use crate::{
    accel::{block::TriBlock, sah::BLOCK, topology::MAX_DEPTH},
    geom::{Aabb, PrimId, Triangles},
};

/// Checks structure, planes and corners; the first violation in words.
///
/// Of the invariants of a single slab hierarchy, every triangle below a node is held against the node's half-space, by the tightness of its plane;
/// that regions nest and hold what is below them follows from it.
pub(super) fn validate(ssh: &Narrow, prims: &Triangles<'_>) -> Result<(), String> {
    if ssh.lineage.prims() != prims.len() {
        return Err(format!("{} triangles, built over {}", prims.len(), ssh.lineage.prims()));
    }
    let mut walk = Walk { ssh, prims, seen: vec![false; prims.len()], next_pair: 0, next_place: 0 };
    let bounds = walk.pair(ssh.root, &ssh.bounds, 1)?;
    if bounds != ssh.bounds && !(bounds.is_empty() && ssh.bounds.is_empty()) {
        return Err("the root box is not the box of all triangles".into());
    }
    let places = if ssh.packed { ssh.lineage.prims() } else { ssh.blocks.len() };
    if walk.next_pair != ssh.pairs.len() || walk.next_place != places {
        return Err("pairs or blocks are out of reach".into());
    }
    walk.seen.iter().position(|&seen| !seen).map_or(Ok(()), |p| Err(format!("triangle {p} is in no leaf")))
}

struct Walk<'a> {
    ssh: &'a Narrow,
    prims: &'a Triangles<'a>,
    seen: Vec<bool>,
    next_pair: usize,
    next_place: usize,
}

impl Walk<'_> {
    /// Returns the box of all that is below; `region` is the root box cut by all planes above.
    fn pair(&mut self, word: Word, region: &Aabb, depth: usize) -> Result<Aabb, String> {
        let number = word.index();
        if number != self.next_pair || word.order() > 2 {
            return Err(format!("pair {number} stands where {} is due", self.next_pair));
        }
        if depth > MAX_DEPTH {
            return Err(format!("pair {number} is deeper than {MAX_DEPTH}"));
        }
        self.next_pair += 1;
        let mut both = Aabb::EMPTY;
        for node in self.ssh.pairs[number].0 {
            let side = node.word.side();
            if !Side::ALL.contains(&side) {
                return Err(format!("pair {number}: no such side"));
            }
            let inside = side.tightened(*region, node.plane);
            let (aabb, due) = if node.word.is_leaf() {
                let aabb = self.leaf(node.word)?;
                (aabb, if self.ssh.config.leaf_planes || node.word.is_none() { side.of(&aabb) } else { f32::INFINITY })
            } else {
                let aabb = self.pair(node.word, &inside, depth + 1)?;
                (aabb, side.of(&aabb))
            };
            check(number, node, due, &aabb, region, &inside)?;
            both = both.union(aabb);
        }
        Ok(both)
    }

    fn leaf(&mut self, word: Word) -> Result<Aabb, String> {
        if word.is_none() {
            return Ok(Aabb::EMPTY);
        }
        let place = word.index();
        if place != self.next_place {
            return Err(format!("leaf {place} stands where {} is due", self.next_place));
        }
        let mut aabb = Aabb::EMPTY;
        if self.ssh.packed {
            self.next_place += 1;
            return self.lane(&self.ssh.blocks[place / BLOCK], place % BLOCK);
        }
        let ssh = self.ssh;
        let blocks = &ssh.blocks[place..place + ssh.span(place)];
        self.next_place += blocks.len();
        for block in blocks {
            for lane in 0..block.prims().count() {
                aabb = aabb.union(self.lane(block, lane)?);
            }
        }
        Ok(aabb)
    }

    fn lane(&mut self, block: &TriBlock, lane: usize) -> Result<Aabb, String> {
        let prim = PrimId(block.prim(lane));
        let seen = self.seen.get_mut(prim.0 as usize).ok_or("a leaf names a triangle that does not exist")?;
        if std::mem::replace(seen, true) {
            return Err(format!("triangle {} is in two leaves", prim.0));
        }
        let own = self.prims.finite_aabb(prim);
        if !own.is_empty() && block.corners(lane) != self.prims.corners(prim) {
            return Err(format!("triangle {} has stale corners", prim.0));
        }
        Ok(own)
    }
}

/// A node's plane, the box below it, and the regions outside and inside of the plane.
fn check(pair: usize, node: Node, due: f32, below: &Aabb, outer: &Aabb, inside: &Aabb) -> Result<(), String> {
    if node.plane.to_bits() != (due + 0.0).to_bits() {
        return Err(format!("pair {pair}: plane {} of {:?}, due {due}", node.plane, node.word.side()));
    }
    if !inside.contains(*below) {
        return Err(format!("pair {pair}: {below:?} leaves its region {inside:?}"));
    }
    let unlimited = node.plane.is_infinite();
    if !unlimited && !outer.contains(*inside) {
        return Err(format!("pair {pair}: region {inside:?} leaves {outer:?} around it"));
    }
    Ok(())
}
