//! The level over groups: which groups a ray may hit, nearest first.
//!
//! A group's box only proves misses, with a margin ([`SlabRay`]); every answer is decided in the groups.

use std::str::FromStr;

use super::{group::GroupFrame, slab::SlabRay, top_tree::TopTree};
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

    /// Calls `visit` with each group that `ray` may hit before the bound that the last call returned
    /// (at first `t_far`); a bound of negative infinity ends the walk.
    #[inline(always)]
    pub(crate) fn visit(&self, groups: &[GroupFrame], ray: &TravRay, mut visit: impl FnMut(&GroupFrame) -> f64) {
        match groups {
            [] => {}
            [group] => {
                visit(group);
            }
            _ if self.kind == TopKind::List => visit_in_order(groups, ray, visit),
            _ if groups.len() <= FLAT => visit_sorted(groups, ray, visit),
            _ => self
                .tree
                .visit(&SlabRay::new(ray), f64::from(ray.range().t_far), |group| visit(&groups[group as usize])),
        }
    }
}

/// Every group in turn.
#[inline(always)]
fn visit_in_order(groups: &[GroupFrame], ray: &TravRay, mut visit: impl FnMut(&GroupFrame) -> f64) {
    let slabs = SlabRay::new(ray);
    let mut t_far = f64::from(ray.range().t_far);
    for group in groups {
        if slabs.entry(&group.bounds, t_far).is_some() {
            t_far = visit(group);
        }
    }
}

/// At most [`FLAT`] groups, in order of entry.
#[inline(always)]
fn visit_sorted(groups: &[GroupFrame], ray: &TravRay, mut visit: impl FnMut(&GroupFrame) -> f64) {
    let slabs = SlabRay::new(ray);
    let mut t_far = f64::from(ray.range().t_far);
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
    for &(entry, number) in &met[..count] {
        if entry > t_far {
            break;
        }
        t_far = visit(&groups[number]);
    }
}
