//! The level over groups: which groups a ray may hit, nearest first.
//!
//! A group's box only proves misses, with a margin ([`SlabRay`]); every answer is decided in the groups.

use std::str::FromStr;

use super::{
    group::GroupFrame,
    slab::SlabRay,
    top_tree::{STACK, TopNode, TopTree, WideTree},
};
use crate::accel::{
    Eight, EightRay, SpecError, TravRay,
    events::{EventRay, FlatLists, FlatWalk, Inversions},
};
use crate::simd::Simd;

/// Up to this many groups are tested one by one and sorted by entry: a tree over so few costs more than it saves.
pub(super) const FLAT: usize = 8;

/// The structures over groups, by the names of `--top`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TopKind {
    /// Every group in turn.
    List,
    /// A binary tree over the groups' boxes, nearer child first; refitted each frame, and built anew when it has decayed.
    #[default]
    Bvh2,
    /// Sorted lists of the boxes' ends on three axes; sorted again each frame from the order of an earlier one.
    Events,
}

impl TopKind {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::List, Self::Bvh2, Self::Events];

    /// `list`, `bvh2` or `events`.
    pub fn name(self) -> &'static str {
        match self {
            Self::List => "list",
            Self::Bvh2 => "bvh2",
            Self::Events => "events",
        }
    }
}

impl FromStr for TopKind {
    type Err = SpecError;

    fn from_str(name: &str) -> Result<Self, SpecError> {
        let known = || Self::ALL.map(Self::name).join(", ");
        let unknown = || SpecError::UnknownKind { name: name.to_owned(), known: known() };
        Self::ALL.into_iter().find(|k| k.name() == name).ok_or_else(unknown)
    }
}

/// The structure over one frame's groups.
#[derive(Debug, Default)]
pub(crate) struct Top {
    kind: TopKind,
    tree: TopTree,
    /// The tree with eight children a node: what rays walk that [`EightRay`] is proven for.
    wide: WideTree,
    /// The greatest coordinate of the boxes.
    reach: f32,
    lists: FlatLists,
    /// Packets go by lane through every group, and through the level over them.
    takes_lanes: bool,
    /// The version of the boxes that it was made of; 0 for none.
    version: u64,
    inversions: Inversions,
}

fn takes_lanes(kind: TopKind, groups: &[GroupFrame]) -> bool {
    (groups.len() <= FLAT || kind == TopKind::Bvh2)
        && groups.iter().all(|group| group.rigid.is_some() || group.accel.takes_lanes())
}

impl Top {
    /// As [`Top::rebuild`] unless `version`, which names the boxes and is not 0, is that of the last time; true when it did.
    pub(crate) fn follow(&mut self, kind: TopKind, groups: &[GroupFrame], version: u64) -> bool {
        self.takes_lanes = takes_lanes(kind, groups);
        if self.version == version && self.kind == kind {
            self.inversions = Inversions::default();
            return false;
        }
        self.rebuild(kind, groups);
        self.version = version;
        true
    }

    /// What it took to sort event lists the last time; zero when there are none.
    pub(crate) fn inversions(&self) -> Inversions {
        self.inversions
    }

    /// True when there are event lists.
    pub(crate) fn has_events(&self) -> bool {
        self.lists.len() > 0
    }

    /// Prepares for `groups`, from what was prepared before where that serves. No allocation when there were as many groups before.
    pub(crate) fn rebuild(&mut self, kind: TopKind, groups: &[GroupFrame]) {
        (self.kind, self.version, self.inversions) = (kind, 0, Inversions::default());
        self.takes_lanes = takes_lanes(kind, groups);
        self.reach = groups
            .iter()
            .filter(|group| !group.bounds.is_empty())
            .fold(0.0, |reach, group| reach.max(group.bounds.reach()));
        if kind == TopKind::Bvh2 && groups.len() > FLAT {
            self.grow(groups);
        } else {
            self.tree.clear();
            self.wide.clear();
        }
        if kind == TopKind::Events && groups.len() > 1 {
            self.sort_events(groups);
        }
    }

    /// Refits the tree, or builds it where that is not to be.
    fn grow(&mut self, groups: &[GroupFrame]) {
        let boxes = groups.iter().map(|group| group.bounds);
        if self.tree.refit(boxes.clone(), |group| groups[group as usize].bounds) {
            self.wide.refit(&self.tree);
        } else {
            self.tree.build(boxes);
            self.wide.make(&self.tree);
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "groups are numbered in 31 bits")]
    fn sort_events(&mut self, groups: &[GroupFrame]) {
        let bounds = |number: u32| groups[number as usize].bounds;
        if self.lists.len() == groups.len() {
            self.inversions = self.lists.refit(bounds);
        } else {
            self.lists.rebuild(groups.len() as u32, bounds);
        }
    }

    /// All of at most [`FLAT`] groups, those that `ray` enters first before the others, those that it misses last.
    ///
    /// [`TopKind::List`] keeps them in their own order. What lies past the number of groups means nothing.
    #[inline(always)]
    pub(super) fn order(&self, groups: &[GroupFrame], ray: &TravRay) -> [usize; FLAT] {
        if self.kind == TopKind::Events && groups.len() > 1 {
            return self.order_by_events(groups.len(), ray);
        }
        let (mut order, mut entries) = ([0; FLAT], [0.0; FLAT]);
        let slabs = SlabRay::new(ray);
        let t_far = f64::from(ray.range().t_far);
        for (number, group) in groups.iter().enumerate().take(FLAT) {
            let mut at = number;
            if self.kind == TopKind::Bvh2 && groups.len() > 1 {
                let entry = slabs.entry(&group.bounds, t_far).unwrap_or(f64::INFINITY);
                while at > 0 && entries[at - 1] > entry {
                    (order[at], entries[at]) = (order[at - 1], entries[at - 1]);
                    at -= 1;
                }
                entries[at] = entry;
            }
            order[at] = number;
        }
        order
    }

    /// As [`Top::order`]: the groups in the order in which `ray` enters them, then the others.
    fn order_by_events(&self, count: usize, ray: &TravRay) -> [usize; FLAT] {
        let (mut order, mut met, mut seen) = ([0; FLAT], 0, [false; FLAT]);
        let mut walk = self.lists.walk(EventRay::new(ray), &mut ());
        while let Some(number) = walk.next(f64::from(ray.range().t_far), &mut ()) {
            (order[met], seen[number as usize]) = (number as usize, true);
            met += 1;
        }
        for number in (0..count.min(FLAT)).filter(|&number| !seen[number]) {
            order[met] = number;
            met += 1;
        }
        order
    }

    /// True when packets go by lane through every group, and through the level over them.
    #[inline(always)]
    pub(super) fn takes_lanes(&self) -> bool {
        self.takes_lanes
    }

    /// The greatest coordinate of the boxes.
    pub(super) fn reach(&self) -> f32 {
        self.reach
    }

    /// Nodes of eight children over the groups, if this is a tree.
    #[inline(always)]
    pub(super) fn wide(&self) -> &[Eight] {
        self.wide.nodes()
    }

    /// A ray against the nodes of [`Top::wide`]; `None` when there are none or nothing is proven for the ray.
    #[inline(always)]
    pub(super) fn line<S: Simd>(&self, ray: &TravRay) -> Option<EightRay> {
        if self.wide.nodes().is_empty() {
            return None;
        }
        let range = ray.range();
        EightRay::new::<S>(range.origin.into(), range.dir.into(), [0.0; 3], self.reach, range.t_near)
    }

    /// Begins a walk over the groups that `ray` may hit.
    #[inline(always)]
    pub(crate) fn walk<'a>(&'a self, groups: &'a [GroupFrame], ray: &TravRay) -> Walk<'a> {
        let slabs = SlabRay::new(ray);
        let stack = [(0.0, 0); STACK];
        let mut walk =
            Walk { groups, nodes: self.tree.nodes(), slabs, stack, waiting: 0, next_in_order: 0, lists: None };
        if self.kind == TopKind::Events && groups.len() > 1 {
            walk.next_in_order = groups.len();
            walk.lists = Some(self.lists.walk(EventRay::new(ray), &mut ()));
        }
        if self.kind == TopKind::Bvh2 {
            walk.next_in_order = groups.len();
            let t_far = f64::from(ray.range().t_far);
            if groups.len() <= FLAT { walk.push_sorted(t_far) } else { walk.push_node(0, t_far) }
        }
        walk
    }
}

/// The groups that a ray may hit, one after the other; nearest first except under [`TopKind::List`].
///
/// An iterator in all but name: the caller's best hit so far decides what still counts.
#[derive(Debug)]
pub(crate) struct Walk<'a> {
    groups: &'a [GroupFrame],
    /// Of the tree; empty when there is none, and the stack then holds groups.
    nodes: &'a [TopNode],
    slabs: SlabRay,
    /// What waits, the next last: a lower bound of its entry, and the node or group.
    stack: [(f32, u32); STACK],
    waiting: usize,
    next_in_order: usize,
    /// Of [`TopKind::Events`], which uses nothing else.
    lists: Option<FlatWalk<'a>>,
}

impl<'a> Walk<'a> {
    /// The next group that the ray may hit at `t_far` or before.
    #[inline(always)]
    pub(crate) fn next(&mut self, t_far: f64) -> Option<&'a GroupFrame> {
        if let Some(lists) = &mut self.lists {
            return self.groups.get(lists.next(t_far, &mut ())? as usize);
        }
        while self.next_in_order < self.groups.len() {
            let group = &self.groups[self.next_in_order];
            self.next_in_order += 1;
            if self.slabs.entry(&group.bounds, t_far).is_some() {
                return Some(group);
            }
        }
        while self.waiting > 0 {
            self.waiting -= 1;
            let (entry, number) = self.stack[self.waiting];
            if f64::from(entry) > t_far {
                continue;
            }
            match self.nodes.get(number as usize) {
                None => return self.groups.get(number as usize),
                Some(node) if node.leaf => return self.groups.get(node.link as usize),
                Some(node) => self.push_children(node.link, t_far),
            }
        }
        None
    }

    /// Pushes the groups that the ray meets, the nearest last.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "at most FLAT groups")]
    fn push_sorted(&mut self, t_far: f64) {
        for (number, group) in self.groups.iter().enumerate() {
            let Some(entry) = self.slabs.entry(&group.bounds, t_far) else { continue };
            let entry = below(entry);
            let mut at = self.waiting;
            while at > 0 && self.stack[at - 1].0 < entry {
                self.stack[at] = self.stack[at - 1];
                at -= 1;
            }
            self.stack[at] = (entry, number as u32);
            self.waiting += 1;
        }
    }

    #[inline(always)]
    fn push_node(&mut self, node: u32, t_far: f64) {
        let Some(TopNode { aabb, .. }) = self.nodes.get(node as usize) else { return };
        if let Some(entry) = self.slabs.entry(aabb, t_far) {
            self.stack[self.waiting] = (below(entry), node);
            self.waiting += 1;
        }
    }

    /// Pushes those of two sibling nodes that the ray meets, the nearer one last.
    #[inline(always)]
    fn push_children(&mut self, first: u32, t_far: f64) {
        let from = self.waiting;
        self.push_node(first, t_far);
        self.push_node(first + 1, t_far);
        if self.waiting == from + 2 && self.stack[from].0 < self.stack[from + 1].0 {
            self.stack.swap(from, from + 1);
        }
    }
}

/// An `f32` that is not above `entry`.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "moved down past the rounding")]
fn below(entry: f64) -> f32 {
    (entry as f32).next_down()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        geom::{Aabb, Ray, Triangles},
        world::GroupLayout,
    };

    /// Groups without triangles in the given boxes, told apart by their epochs.
    fn groups(boxes: &[Aabb]) -> Vec<GroupFrame> {
        let none = Triangles { positions: &[], indices: &[], topology_epoch: 0 };
        let accel = Arc::new("list".parse::<crate::accel::AccelSpec>().unwrap().build(&none).unwrap());
        let group = |(topology_epoch, &bounds): (u64, &Aabb)| GroupFrame {
            layout: Arc::new(GroupLayout { topology_epoch, ..GroupLayout::default() }),
            positions: Arc::default(),
            accel: accel.clone(),
            rigid: None,
            bounds,
        };
        (0..).zip(boxes).map(group).collect()
    }

    fn visited(kind: TopKind, boxes: &[Aabb], ray: &Ray, t_far: f64) -> Vec<u64> {
        let groups = groups(boxes);
        let mut top = Top::default();
        top.rebuild(kind, &groups);
        let mut walk = top.walk(&groups, &TravRay::new(ray).unwrap());
        std::iter::from_fn(|| walk.next(t_far)).map(|group| group.layout.topology_epoch).collect()
    }

    #[test]
    fn empty_or_no_boxes_are_not_visited() {
        for kind in TopKind::ALL {
            for boxes in [vec![], vec![Aabb::EMPTY; 3], vec![Aabb::EMPTY; 20]] {
                assert!(visited(kind, &boxes, &Ray::new(Vec3::ZERO, Vec3::X), f64::INFINITY).is_empty());
            }
        }
    }

    #[test]
    fn a_bound_that_shrinks_ends_the_walk() {
        for (kind, count) in [TopKind::Bvh2, TopKind::Events].into_iter().flat_map(|kind| [(kind, 4_u8), (kind, 30)]) {
            let unit = |i: u8| Aabb { min: Vec3::X * f32::from(i), max: Vec3::X * f32::from(i) + 0.5 };
            let boxes: Vec<_> = (0..count).map(unit).collect();
            let groups = groups(&boxes);
            let mut top = Top::default();
            top.rebuild(kind, &groups);
            let mut walk = top.walk(&groups, &TravRay::new(&Ray::new(Vec3::new(-1.0, 0.2, 0.2), Vec3::X)).unwrap());
            let epochs = [f64::INFINITY, f64::INFINITY, 2.9].map(|t| walk.next(t).map(|g| g.layout.topology_epoch));
            assert_eq!(epochs, [Some(0), Some(1), None], "the third begins at 3");
        }
    }

    #[test]
    fn what_serves_again_after_a_motion_visits_what_is_made_anew_does() {
        let moved = |step: u8| -> Vec<Aabb> {
            let corner = |i: u8| Vec3::new(f32::from(i * step % 17), f32::from(i * 5 % 11), f32::from(i % 3));
            (0..40).map(|i| Aabb { min: corner(i), max: corner(i) + 1.5 }).collect()
        };
        let slid = |by: f32| moved(5).iter().map(|b| Aabb { min: b.min + by, max: b.max + by }).collect();
        for kind in [TopKind::Events, TopKind::Bvh2] {
            let mut top = Top::default();
            for boxes in [moved(1), moved(2), moved(5), slid(0.1), slid(0.3), moved(2)] {
                let groups = groups(&boxes);
                top.rebuild(kind, &groups);
                for origin in [Vec3::new(-3.0, 1.0, 0.5), Vec3::new(4.0, 4.0, 1.0)] {
                    let ray = Ray::new(origin, Vec3::new(1.0, 0.4, 0.1));
                    let mut walk = top.walk(&groups, &TravRay::new(&ray).unwrap());
                    let mut again: Vec<_> =
                        std::iter::from_fn(|| walk.next(50.0)).map(|g| g.layout.topology_epoch).collect();
                    let mut fresh = visited(kind, &boxes, &ray, 50.0);
                    if kind == TopKind::Bvh2 {
                        again.sort_unstable();
                        fresh.sort_unstable();
                    }
                    assert_eq!(again, fresh);
                    assert!(!again.is_empty());
                }
            }
        }
    }

    #[test]
    fn few_groups_are_ordered_alike_by_every_structure_but_the_list() {
        let boxes = [5.0, 1.0, 9.0, 3.0].map(|x| Aabb { min: Vec3::X * x, max: Vec3::X * x + 1.0 });
        let groups = groups(&boxes);
        let ray = TravRay::new(&Ray::new(Vec3::new(-1.0, 0.5, 0.5), Vec3::X)).unwrap();
        let order = |kind| {
            let mut top = Top::default();
            top.rebuild(kind, &groups);
            top.order(&groups, &ray)[..4].to_vec()
        };
        assert_eq!(TopKind::ALL.map(order), [vec![0, 1, 2, 3], vec![1, 3, 0, 2], vec![1, 3, 0, 2]]);
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
            let slabs = SlabRay::new(&TravRay::new(&ray).unwrap());
            let t_far = f64::from(t_far);
            let expected: Vec<u64> =
                (0..).zip(&boxes).filter(|(_, b)| slabs.entry(b, t_far).is_some()).map(|(i, _)| i).collect();
            for kind in TopKind::ALL {
                let mut epochs = visited(kind, &boxes, &ray, t_far);
                epochs.sort_unstable();
                prop_assert_eq!(&epochs, &expected, "{:?}", kind);
            }
        }
    }
}
