//! Trees of eight children a node, made of binary ones.

#![expect(clippy::cast_possible_truncation, reason = "there are fewer nodes than triangles")]

use arrayvec::ArrayVec;
use rayon::prelude::*;

use super::{Child, Siblings, Topology};

/// Most children of a node.
pub(in crate::accel) const WIDTH: usize = 8;

/// Subtrees of fewer pairs are one task's.
const TASK_PAIRS: usize = 4096;

/// The wide nodes over a binary tree, root first, depth first; [`Child::None`] after a node's last child, and [`Child::Inner`] is a wide node.
///
/// Of all ways to make wide nodes of the binary ones this is the one whose nodes have the least area in sum, which is what rays visit of them.
/// Children keep the order of their triangles, so a subtree owns contiguous runs of nodes and triangles.
///
/// # Source
/// Ylitie, Karras and Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", 2017, section 3.1. Departure: leaves stay as they are.
pub(in crate::accel) fn collapse(topology: &Topology) -> Vec<[Child; WIDTH]> {
    let pairs = &topology.pairs[..];
    let mut costs = vec![LEAF_COSTS; pairs.len()];
    fill(pairs, 0, &mut costs);
    let mut nodes = Vec::with_capacity(pairs.len() / 4 + 1);
    Collapse { pairs, costs: &costs }.node(0, pairs.len(), &mut nodes);
    nodes
}

/// Least sums of areas of the wide nodes that a subtree takes when its root becomes 1, at most 2, .. at most 8 children. The last is there for the
/// sake of alignment: only a root becomes as many, and counts then.
type Costs = [f32; WIDTH];

const LEAF_COSTS: Costs = [0.0; WIDTH];

/// The costs of the pairs of a subtree, the first of which has number `first`, from the bottom up.
fn fill(pairs: &[Siblings], first: usize, costs: &mut [Costs]) {
    if pairs.len() > TASK_PAIRS {
        let middle = second_child(&pairs[0], first, pairs.len());
        let (pairs0, pairs1) = pairs[1..].split_at(middle - 1);
        let (own, costs) = costs.split_first_mut().expect("a subtree has a root");
        let (costs0, costs1) = costs.split_at_mut(middle - 1);
        rayon::join(|| fill(pairs0, first + 1, costs0), || fill(pairs1, first + middle, costs1));
        let below0 = costs0.first().unwrap_or(&LEAF_COSTS);
        let below1 = costs1.first().unwrap_or(&LEAF_COSTS);
        *own = cost(pairs[0].area, below0, below1);
        return;
    }
    for i in (0..pairs.len()).rev() {
        let [child0, child1] = pairs[i].children;
        costs[i] = cost(pairs[i].area, &of(costs, child0, first), &of(costs, child1, first));
    }
}

/// Where the pairs of the second child begin, counted from the root of a subtree of so many pairs; their end where there are none.
#[inline(always)]
fn second_child(root: &Siblings, first: usize, count: usize) -> usize {
    if let Child::Inner(second) = root.children[1] { second as usize - first } else { count }
}

#[inline(always)]
fn of(costs: &[Costs], child: Child, first: usize) -> Costs {
    if let Child::Inner(pair) = child { costs[pair as usize - first] } else { LEAF_COSTS }
}

/// The costs of a pair of this area.
#[inline(always)]
fn cost(area: f32, first: &Costs, second: &Costs) -> Costs {
    let mut own = LEAF_COSTS;
    own[0] = area + split(first, second, WIDTH).1;
    for room in 2..WIDTH {
        let shared = split(first, second, room).1;
        own[room - 1] = if shared < own[room - 2] { shared } else { own[room - 2] };
    }
    own
}

/// How many of `room` children the first of two subtrees should be, and what both cost then.
#[inline(always)]
fn split(first: &Costs, second: &Costs, room: usize) -> (usize, f32) {
    let mut best = (1, f32::INFINITY);
    for own in 1..room {
        let cost = first[own - 1] + second[room - own - 1];
        if cost < best.1 {
            best = (own, cost);
        }
    }
    best
}

/// What a pair becomes.
type Children = ArrayVec<Child, WIDTH>;

struct Collapse<'a> {
    pairs: &'a [Siblings],
    costs: &'a [Costs],
}

impl Collapse<'_> {
    /// Emits the wide node over a pair's subtree, whose pairs end before number `end`; the depth is bounded by the builder's.
    fn node(&self, pair: usize, end: usize, nodes: &mut Vec<[Child; WIDTH]>) -> u32 {
        let mut children = Children::new();
        self.open(pair, WIDTH, &mut children);
        let number = nodes.len();
        nodes.push([Child::None; WIDTH]);
        if end - pair > TASK_PAIRS {
            self.apart(&children, end, number, nodes);
            return number as u32;
        }
        for slot in 0..children.len() {
            nodes[number][slot] = match children[slot] {
                Child::Inner(below) => Child::Inner(self.node(below as usize, end, nodes)),
                leaf => leaf,
            };
        }
        number as u32
    }

    /// The same for what is below a node of a large subtree, in the current rayon pool.
    fn apart(&self, children: &Children, end: usize, number: usize, nodes: &mut Vec<[Child; WIDTH]>) {
        let mut ends = [end; WIDTH];
        for slot in (1..children.len()).rev() {
            ends[slot - 1] = if let Child::Inner(below) = children[slot] { below as usize } else { ends[slot] };
        }
        let emit = |(child, end): (&Child, usize)| {
            let mut nodes = Vec::new();
            if let Child::Inner(below) = *child {
                nodes.reserve((end - below as usize) / 4);
                self.node(below as usize, end, &mut nodes);
            }
            nodes
        };
        let parts: Vec<_> = children.par_iter().zip(ends).map(emit).collect();
        for (slot, part) in parts.into_iter().enumerate() {
            let base = nodes.len() as u32;
            nodes[number][slot] = if part.is_empty() { children[slot] } else { Child::Inner(base) };
            for mut node in part {
                for child in &mut node {
                    if let Child::Inner(below) = child {
                        *below += base;
                    }
                }
                nodes.push(node);
            }
        }
    }

    /// The at most `room` children that a pair becomes.
    fn open(&self, pair: usize, room: usize, out: &mut Children) {
        let [first, second] = self.pairs[pair].children;
        let own = split(&of(self.costs, first, 0), &of(self.costs, second, 0), room).0;
        for (child, mut room) in [(first, own), (second, room - own)] {
            let costs = of(self.costs, child, 0);
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
    use crate::{
        accel::topology::{self, Cut, Settings},
        geom::Triangles,
    };

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
            let nodes = collapse(&binary);
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
        assert_eq!(collapse(&binary).len(), 9);
    }
}
