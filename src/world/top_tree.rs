use arrayvec::ArrayVec;

use super::border::{BINS, cheapest_border};
use crate::{
    accel::{EIGHT, Eight, LEAF},
    geom::Aabb,
};

/// Depth from which splits halve the count: at most 32 more levels for any number of boxes.
const SAH_DEPTH: usize = 16;

/// Places on the stack of a walk: one node waits a level, and both children are there for a moment.
pub(crate) const STACK: usize = SAH_DEPTH + 34;

/// A binary tree over the boxes of groups, one group a leaf.
///
/// Binned surface-area splits (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007).
/// The order of input decides ties, so equal boxes give equal trees. Empty boxes are left out.
#[derive(Debug, Default)]
pub(crate) struct TopTree {
    nodes: Vec<TopNode>,
    items: Vec<Item>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct TopNode {
    pub(crate) aabb: Aabb,
    /// First of two children that follow each other, or the group when `leaf`.
    pub(crate) link: u32,
    pub(crate) leaf: bool,
}

#[derive(Clone, Copy, Debug)]
struct Item {
    aabb: Aabb,
    group: u32,
}

impl TopTree {
    pub(crate) fn clear(&mut self) {
        self.nodes.clear();
        self.items.clear();
    }

    /// Builds over `boxes`, numbered in order; fewer than 2^31 of them.
    #[expect(clippy::cast_possible_truncation, reason = "groups are numbered in 32 bits")]
    pub(crate) fn build(&mut self, boxes: impl Iterator<Item = Aabb>) {
        self.clear();
        let items = boxes.enumerate().filter(|(_, b)| !b.is_empty());
        self.items.extend(items.map(|(group, aabb)| Item { aabb, group: group as u32 }));
        if self.items.is_empty() {
            return;
        }
        self.nodes.push(TopNode { aabb: Aabb::EMPTY, link: 0, leaf: true });
        let mut items = std::mem::take(&mut self.items);
        self.split(0, &mut items, 0);
        self.items = items;
    }

    #[expect(clippy::cast_possible_truncation, reason = "two nodes a group, groups are numbered in 31 bits")]
    fn split(&mut self, node: usize, items: &mut [Item], depth: usize) {
        let aabb = items.iter().fold(Aabb::EMPTY, |all, i| all.union(i.aabb));
        if let [only] = items {
            self.nodes[node] = TopNode { aabb, link: only.group, leaf: true };
            return;
        }
        let mid = if depth < SAH_DEPTH { partition(items) } else { items.len() / 2 };
        let first = self.nodes.len();
        self.nodes[node] = TopNode { aabb, link: first as u32, leaf: false };
        self.nodes.extend([TopNode { aabb: Aabb::EMPTY, link: 0, leaf: true }; 2]);
        let (left, right) = items.split_at_mut(mid);
        self.split(first, left, depth + 1);
        self.split(first + 1, right, depth + 1);
    }

    /// Nodes of eight children that lead to the same groups, the root first; none without boxes.
    ///
    /// Of a node's children the largest inner one is opened until there are as many as fit. No allocation when there were as many boxes before.
    pub(super) fn widen(&self, wide: &mut Vec<Eight>) {
        wide.clear();
        if !self.nodes.is_empty() {
            // Nodes that hold but two groups are at most half as many as these, and those above have more than a few children.
            wide.reserve(self.nodes.len() / 3 + 2);
            self.widen_node(0, wide);
        }
    }

    /// Depth first; the number of the node. The builder bounds the depth.
    #[expect(clippy::cast_possible_truncation, reason = "fewer nodes than groups, which are numbered in 31 bits")]
    fn widen_node(&self, node: usize, wide: &mut Vec<Eight>) -> u32 {
        let mut children = ArrayVec::<usize, EIGHT>::new();
        children.push(node);
        while children.len() < EIGHT {
            let area = |&at: &usize| self.nodes[children[at]].aabb.half_area();
            let inner = (0..children.len()).filter(|&at| !self.nodes[children[at]].leaf);
            let Some(at) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
            let first = self.nodes[children[at]].link as usize;
            children[at] = first;
            children.push(first + 1);
        }
        let number = wide.len();
        wide.push(Eight::EMPTY);
        for (slot, &child) in children.iter().enumerate() {
            let TopNode { aabb, link, leaf } = self.nodes[child];
            let word = if leaf { LEAF | link } else { self.widen_node(child, wide) };
            wide[number].put(slot, &aabb, word);
        }
        number as u32
    }

    /// The root first; empty without boxes.
    pub(crate) fn nodes(&self) -> &[TopNode] {
        &self.nodes
    }
}

/// Reorders `items` (two or more) and returns where the second half begins: the cheapest of the bin borders
/// along the widest axis of the centres, or the middle when all centres agree.
fn partition(items: &mut [Item]) -> usize {
    let centers = Aabb::from_points(items.iter().map(|i| i.aabb.center()));
    let extent = centers.extent();
    let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
    let scale = BINS as f32 / extent[axis];
    if !(scale.is_finite() && extent[axis].is_finite()) {
        return items.len() / 2;
    }
    let bin = |item: &Item| bin_of((item.aabb.center()[axis] - centers.min[axis]) * scale);
    let border = cheapest_border(items.iter().map(|item| (bin(item), item.aabb)), 1);
    items.sort_unstable_by_key(|item| (bin(item) >= border, item.group));
    let mid = items.partition_point(|item| bin(item) < border);
    if mid == 0 || mid == items.len() { items.len() / 2 } else { mid }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates; NaN is bin 0")]
fn bin_of(place: f32) -> usize {
    (place as usize).min(BINS - 1)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn depth(tree: &TopTree, node: u32) -> usize {
        let node = &tree.nodes[node as usize];
        if node.leaf { 1 } else { 1 + depth(tree, node.link).max(depth(tree, node.link + 1)) }
    }

    #[test]
    fn equal_and_geometric_boxes_stay_within_the_depth_of_the_stack() {
        let equal = vec![Aabb { min: Vec3::ZERO, max: Vec3::ONE }; 5000];
        let far: Vec<_> = (0..120_u8)
            .map(|i| {
                let at = Vec3::splat(2.0_f32.powi(i32::from(i)));
                Aabb { min: at, max: at * 1.25 }
            })
            .collect();
        for boxes in [equal, far] {
            let mut tree = TopTree::default();
            tree.build(boxes.iter().copied());
            assert!(depth(&tree, 0) < STACK, "{}", depth(&tree, 0));
            assert_eq!(tree.nodes.iter().filter(|node| node.leaf).count(), boxes.len());
        }
    }
}
