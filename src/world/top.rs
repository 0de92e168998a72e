//! The level over groups: which groups a ray may hit, nearest first.
//!
//! A group's box only proves misses, with a margin ([`SlabRay`]); every answer is decided in the groups.

use std::str::FromStr;

use super::{
    group::GroupFrame,
    slab::SlabRay,
    top_tree::{TopTree, TreeWalk},
};
use crate::accel::{SpecError, TravRay};

/// Up to this many groups are tested one by one and sorted by entry: a tree over so few costs more than it saves.
const FLAT: usize = 8;

/// The structures over groups, by the names of `--top`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TopKind {
    /// Every group in turn.
    List,
    /// A binary tree over the groups' boxes, nearer child first; made anew each frame.
    #[default]
    Bvh2,
}

impl TopKind {
    /// Every kind.
    pub const ALL: [Self; 2] = [Self::List, Self::Bvh2];

    /// `list` or `bvh2`.
    pub fn name(self) -> &'static str {
        match self {
            Self::List => "list",
            Self::Bvh2 => "bvh2",
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
}

impl Top {
    /// Prepares for `groups`. No allocation when there were as many groups before.
    pub(crate) fn rebuild(&mut self, kind: TopKind, groups: &[GroupFrame]) {
        self.kind = kind;
        self.tree.clear();
        if kind == TopKind::Bvh2 && groups.len() > FLAT {
            self.tree.build(groups.iter().map(|g| g.bounds));
        }
    }

    /// The groups that `ray` may hit, nearest first as far as the kind orders them.
    #[inline(always)]
    pub(crate) fn walk<'a>(&'a self, groups: &'a [GroupFrame], ray: &TravRay) -> Walk<'a> {
        let order = if groups.len() <= 1 { Order::All } else { self.order(groups, ray) };
        Walk { groups, next: 0, order }
    }

    fn order<'a>(&'a self, groups: &[GroupFrame], ray: &TravRay) -> Order<'a> {
        let slabs = SlabRay::new(ray);
        let t_far = f64::from(ray.range().t_far);
        match self.kind {
            TopKind::List => Order::Listed(slabs),
            TopKind::Bvh2 if groups.len() <= FLAT => Order::Sorted(Sorted::new(groups, &slabs, t_far)),
            TopKind::Bvh2 => Order::Tree(self.tree.walk(slabs, t_far)),
        }
    }
}

/// A walk over groups. A loop over it keeps what is done with each group at one place, so that traversals are compiled
/// once there, for the caller's SIMD level (a closure would be compiled for none).
#[derive(Debug)]
pub(crate) struct Walk<'a> {
    groups: &'a [GroupFrame],
    next: usize,
    order: Order<'a>,
}

/// How a walk goes on.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "lives on the stack for the time of a ray")]
enum Order<'a> {
    /// Every group, unseen.
    All,
    /// Every group whose box the ray meets.
    Listed(SlabRay),
    /// By entry.
    Sorted(Sorted),
    /// By the tree.
    Tree(TreeWalk<'a>),
}

impl<'a> Walk<'a> {
    /// The next group that the ray may hit no later than `t_far`.
    #[inline(always)]
    pub(crate) fn next(&mut self, t_far: f64) -> Option<&'a GroupFrame> {
        if matches!(self.order, Order::All) {
            let group = self.groups.get(self.next);
            self.next += 1;
            return group;
        }
        self.next_of_many(t_far)
    }

    fn next_of_many(&mut self, t_far: f64) -> Option<&'a GroupFrame> {
        let number = match &mut self.order {
            Order::All => return None,
            Order::Listed(slabs) => {
                let rest = self.groups.get(self.next..)?;
                let skip = rest.iter().position(|group| slabs.entry(&group.bounds, t_far).is_some())?;
                self.next += skip + 1;
                self.next - 1
            }
            Order::Sorted(sorted) => {
                let (entry, number) = *sorted.met[..sorted.count].get(self.next)?;
                self.next += 1;
                if entry > t_far {
                    return None;
                }
                number
            }
            Order::Tree(walk) => walk.next(t_far)? as usize,
        };
        self.groups.get(number)
    }
}

/// At most [`FLAT`] groups, in order of entry.
#[derive(Debug)]
struct Sorted {
    met: [(f64, usize); FLAT],
    count: usize,
}

impl Sorted {
    fn new(groups: &[GroupFrame], slabs: &SlabRay, t_far: f64) -> Self {
        let mut met = [(0.0, 0_usize); FLAT];
        let mut count = 0;
        for (number, group) in groups.iter().enumerate() {
            let Some(entry) = slabs.entry(&group.bounds, t_far) else { continue };
            let mut at = count;
            while at > 0 && met[at - 1].0 > entry {
                met[at] = met[at - 1];
                at -= 1;
            }
            met[at] = (entry, number);
            count += 1;
        }
        Self { met, count }
    }
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
        for count in [4_u8, 30] {
            let unit = |i: u8| Aabb { min: Vec3::X * f32::from(i), max: Vec3::X * f32::from(i) + 0.5 };
            let boxes: Vec<_> = (0..count).map(unit).collect();
            let groups = groups(&boxes);
            let mut top = Top::default();
            top.rebuild(TopKind::Bvh2, &groups);
            let mut walk = top.walk(&groups, &TravRay::new(&Ray::new(Vec3::new(-1.0, 0.2, 0.2), Vec3::X)).unwrap());
            let epochs = [f64::INFINITY, f64::INFINITY, 2.9].map(|t| walk.next(t).map(|g| g.layout.topology_epoch));
            assert_eq!(epochs, [Some(0), Some(1), None], "the third begins at 3");
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
