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
