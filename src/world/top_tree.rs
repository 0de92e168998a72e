use super::slab::SlabRay;
use crate::geom::Aabb;

/// Bins of the surface-area heuristic.
const BINS: usize = 12;

/// Depth from which splits halve the count: at most 32 more levels for any number of boxes.
const SAH_DEPTH: usize = 24;

/// Greatest number of nodes that wait on the stack of a walk: one a level, and the next one.
const STACK: usize = SAH_DEPTH + 34;

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
struct TopNode {
    aabb: Aabb,
    /// First of two children that follow each other, or the group when `leaf`.
    link: u32,
    leaf: bool,
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

    /// The groups whose boxes `ray` meets, nearer child first.
    pub(crate) fn walk(&self, ray: SlabRay, t_far: f64) -> TreeWalk<'_> {
        let mut walk = TreeWalk { nodes: &self.nodes, ray, stack: [(0.0, 0); STACK], waiting: 0 };
        if let Some(entry) = self.nodes.first().and_then(|root| walk.ray.entry(&root.aabb, t_far)) {
            walk.stack[0] = (entry, 0);
            walk.waiting = 1;
        }
        walk
    }
}

/// A walk of one ray through a tree.
#[derive(Debug)]
pub(crate) struct TreeWalk<'a> {
    nodes: &'a [TopNode],
    ray: SlabRay,
    /// Entry and number of nodes still to visit.
    stack: [(f64, u32); STACK],
    waiting: usize,
}

impl TreeWalk<'_> {
    /// The next group whose box the ray enters no later than `t_far`.
    pub(crate) fn next(&mut self, t_far: f64) -> Option<u32> {
        loop {
            self.waiting = self.waiting.checked_sub(1)?;
            let (entry, number) = self.stack[self.waiting];
            if entry > t_far {
                continue;
            }
            let node = self.nodes[number as usize];
            if node.leaf {
                return Some(node.link);
            }
            let child =
                |child: u32| self.ray.entry(&self.nodes[child as usize].aabb, t_far).map(|entry| (entry, child));
            let (a, b) = (child(node.link), child(node.link + 1));
            let (near, far) = match (a, b) {
                (Some(x), Some(y)) if y.0 < x.0 => (b, a),
                _ => (a, b),
            };
            for met in [far, near].into_iter().flatten() {
                self.stack[self.waiting] = met;
                self.waiting += 1;
            }
        }
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
    let border = cheapest_border(items, bin);
    items.sort_unstable_by_key(|item| (bin(item) >= border, item.group));
    let mid = items.partition_point(|item| bin(item) < border);
    if mid == 0 || mid == items.len() { items.len() / 2 } else { mid }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates; NaN is bin 0")]
fn bin_of(place: f32) -> usize {
    (place as usize).min(BINS - 1)
}

/// The bin that the second half begins with: least area times count, earliest first.
fn cheapest_border(items: &[Item], bin: impl Fn(&Item) -> usize) -> usize {
    let mut bins = [(Aabb::EMPTY, 0_usize); BINS];
    for item in items {
        let (aabb, count) = &mut bins[bin(item)];
        *aabb = aabb.union(item.aabb);
        *count += 1;
    }
    let weigh = |(aabb, count): (Aabb, usize)| if count == 0 { 0.0 } else { aabb.half_area() * count as f32 };
    let join = |a: (Aabb, usize), b: (Aabb, usize)| (a.0.union(b.0), a.1 + b.1);
    let mut right = [0.0; BINS];
    let mut sum = (Aabb::EMPTY, 0);
    for at in (1..BINS).rev() {
        sum = join(sum, bins[at]);
        right[at] = weigh(sum);
    }
    let mut best = (f32::INFINITY, BINS / 2);
    let mut left = (Aabb::EMPTY, 0);
    for at in 1..BINS {
        left = join(left, bins[at - 1]);
        let cost = weigh(left) + right[at];
        if cost < best.0 {
            best = (cost, at);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::{accel::TravRay, geom::Ray};

    fn slabs(ray: &Ray) -> SlabRay {
        SlabRay::new(&TravRay::new(ray).unwrap())
    }

    fn depth(tree: &TopTree, node: u32) -> usize {
        let node = &tree.nodes[node as usize];
        if node.leaf { 1 } else { 1 + depth(tree, node.link).max(depth(tree, node.link + 1)) }
    }

    fn visited(tree: &TopTree, ray: &Ray, t_far: f64) -> Vec<u32> {
        let mut groups = Vec::new();
        let mut walk = tree.walk(slabs(ray), t_far);
        while let Some(group) = walk.next(t_far) {
            groups.push(group);
        }
        groups.sort_unstable();
        groups
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
            assert!(depth(&tree, 0) <= STACK, "{}", depth(&tree, 0));
            assert_eq!(visited(&tree, &Ray::new(Vec3::ZERO, Vec3::ONE), f64::INFINITY).len(), boxes.len());
        }
    }

    #[test]
    fn a_tree_of_empty_or_no_boxes_visits_nothing() {
        let mut tree = TopTree::default();
        for boxes in [vec![], vec![Aabb::EMPTY; 20]] {
            tree.build(boxes.into_iter());
            assert!(visited(&tree, &Ray::new(Vec3::ZERO, Vec3::X), f64::INFINITY).is_empty());
        }
    }

    proptest! {
        #[test]
        fn the_walk_visits_exactly_the_boxes_that_the_ray_meets(
            boxes in prop::collection::vec((prop::array::uniform3(-8_i8..8), prop::array::uniform3(0_u8..4)), 1..60),
            origin in prop::array::uniform3(-10_i8..10),
            dir in prop::array::uniform3(-2_i8..3),
            t_far in 0_u8..20,
        ) {
            let boxes: Vec<_> = boxes.into_iter().map(|(min, size)| {
                let min = Vec3::from(min.map(f32::from));
                Aabb { min, max: min + Vec3::from(size.map(f32::from)) }
            }).collect();
            let ray = Ray::new(Vec3::from(origin.map(f32::from)), Vec3::from(dir.map(f32::from)));
            prop_assume!(ray.dir != Vec3::ZERO);
            let mut tree = TopTree::default();
            tree.build(boxes.iter().copied());
            let slabs = slabs(&ray);
            let expected: Vec<u32> = (0_u32..).zip(&boxes)
                .filter(|(_, b)| slabs.entry(b, f64::from(t_far)).is_some()).map(|(i, _)| i).collect();
            prop_assert_eq!(visited(&tree, &ray, f64::from(t_far)), expected);
        }
    }
}
