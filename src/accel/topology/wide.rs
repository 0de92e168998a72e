//! Trees of eight children a node, made of binary ones.

#![expect(clippy::cast_possible_truncation, reason = "there are fewer nodes than triangles")]

use arrayvec::ArrayVec;
use rayon::prelude::*;

use super::{Child, Siblings, Topology};
use crate::{
    accel::sah,
    geom::{Aabb, PrimId, Triangles},
};

/// Most children of a node.
pub(in crate::accel) const WIDTH: usize = 8;

/// Pairs whose leaves one task measures.
const TASK_PAIRS: usize = 4096;

/// The wide nodes over a binary tree, root first, depth first; [`Child::None`] after a node's last child, and [`Child::Inner`] is a wide node.
///
/// Of all ways to make wide nodes of the binary ones this is the one whose nodes have the least area in sum, which is what rays visit of them.
/// Children keep the order of their triangles, so a subtree owns contiguous runs of nodes and triangles.
///
/// # Source
/// Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017, section 3.1. Departure: leaves stay as they are.
pub(in crate::accel) fn collapse(topology: &Topology, prims: &Triangles<'_>) -> Vec<[Child; WIDTH]> {
    let costs = costs(topology, prims);
    let mut nodes = Vec::with_capacity(topology.pairs.len() / 4 + 1);
    Collapse { pairs: &topology.pairs, costs: &costs }.node(0, &mut nodes);
    nodes
}

/// Least sums of areas of the wide nodes that a subtree takes when its root becomes 1, at most 2, .. at most 7 children.
type Costs = [f64; WIDTH - 1];

const LEAF_COSTS: Costs = [0.0; WIDTH - 1];

/// The costs of every pair, from the bottom up.
fn costs(topology: &Topology, prims: &Triangles<'_>) -> Vec<Costs> {
    let pairs = &topology.pairs;
    let of_leaf = |child: &Child| match *child {
        Child::Leaf { first, count } => {
            let own = &topology.prims[first as usize..][..count as usize];
            own.iter().fold(Aabb::EMPTY, |aabb, &prim| aabb.union(prims.finite_aabb(PrimId(prim))))
        }
        _ => Aabb::EMPTY,
    };
    let leaves = |siblings: &Siblings| of_leaf(&siblings.children[0]).union(of_leaf(&siblings.children[1]));
    let mut boxes: Vec<_> = pairs.par_iter().with_min_len(TASK_PAIRS).map(leaves).collect();
    let mut costs = vec![LEAF_COSTS; pairs.len()];
    for i in (0..pairs.len()).rev() {
        for child in pairs[i].children {
            if let Child::Inner(below) = child {
                boxes[i] = boxes[i].union(boxes[below as usize]);
            }
        }
        let below = pairs[i].children.map(|child| of(&costs, child));
        let mut own = LEAF_COSTS;
        own[0] = sah::half_area(boxes[i]) + split(&below, WIDTH).1;
        for room in 2..WIDTH {
            own[room - 1] = own[room - 2].min(split(&below, room).1);
        }
        costs[i] = own;
    }
    costs
}

fn of(costs: &[Costs], child: Child) -> Costs {
    if let Child::Inner(pair) = child { costs[pair as usize] } else { LEAF_COSTS }
}

/// How many of `room` children the first of two subtrees should be, and what both cost then.
#[inline(always)]
fn split([first, second]: &[Costs; 2], room: usize) -> (usize, f64) {
    let mut best = (1, f64::INFINITY);
    for own in 1..room {
        let cost = first[own - 1] + second[room - own - 1];
        if cost < best.1 {
            best = (own, cost);
        }
    }
    best
}

struct Collapse<'a> {
    pairs: &'a [Siblings],
    costs: &'a [Costs],
}

impl Collapse<'_> {
    /// Emits the wide node over a pair's subtree; the depth is bounded by the builder's.
    fn node(&self, pair: usize, nodes: &mut Vec<[Child; WIDTH]>) -> u32 {
        let mut children = ArrayVec::new();
        self.open(pair, WIDTH, &mut children);
        let number = nodes.len();
        nodes.push([Child::None; WIDTH]);
        for (slot, child) in children.into_iter().enumerate() {
            nodes[number][slot] = match child {
                Child::Inner(below) => Child::Inner(self.node(below as usize, nodes)),
                leaf => leaf,
            };
        }
        number as u32
    }

    /// The at most `room` children that a pair becomes.
    fn open(&self, pair: usize, room: usize, out: &mut ArrayVec<Child, WIDTH>) {
        let [first, second] = self.pairs[pair].children;
        let own = split(&[of(self.costs, first), of(self.costs, second)], room).0;
        for (child, mut room) in [(first, own), (second, room - own)] {
            let costs = of(self.costs, child);
            while room > 1 && costs[room - 2] <= costs[room - 1] {
                room -= 1;
            }
            match child {
                Child::None => {}
                Child::Inner(below) if room > 1 => self.open(below as usize, room, out),
                child => out.push(child),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::accel::topology::{self, Cut, Settings};

    fn mesh(corners: &[[f32; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let positions = corners.iter().flat_map(|&c| [Vec3::from(c), Vec3::from(c) + Vec3::X, Vec3::from(c) + Vec3::Y]);
        (positions.collect(), (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    }

    /// Places of the leaves below a node, in order.
    fn places(nodes: &[[Child; WIDTH]], number: usize, next: &mut usize, out: &mut Vec<(u32, u32)>) {
        assert_eq!(number, *next, "depth first");
        *next += 1;
        for child in nodes[number] {
            match child {
                Child::None => {}
                Child::Leaf { first, count } => out.push((first, count)),
                Child::Inner(below) => places(nodes, below as usize, next, out),
            }
        }
    }

    proptest! {
        #[test]
        fn wide_trees_keep_the_leaves_in_their_order(
            corners in prop::collection::vec(prop::array::uniform3(-10.0_f32..10.0), 0..200),
            leaf in 1_usize..9,
        ) {
            let (positions, indices) = mesh(&corners);
            let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
            let binary = topology::build(&prims, &Settings { cut: Cut::Sah, bins: 16, leaf });
            let nodes = collapse(&binary, &prims);
            let (mut next, mut found) = (0, Vec::new());
            places(&nodes, 0, &mut next, &mut found);
            prop_assert_eq!(next, nodes.len());
            let mut end = 0;
            for (first, count) in found {
                prop_assert_eq!(first, end);
                end += count;
            }
            prop_assert_eq!(end as usize, indices.len());
        }
    }

    #[test]
    fn sixty_four_leaves_in_a_row_take_nine_nodes() {
        let corners: Vec<_> = (0_u8..64).map(|i| [2.0 * f32::from(i), 0.0, 0.0]).collect();
        let (positions, indices) = mesh(&corners);
        let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
        let binary = topology::build(&prims, &Settings { cut: Cut::Median, bins: 16, leaf: 1 });
        assert_eq!(collapse(&binary, &prims).len(), 9);
    }
}
