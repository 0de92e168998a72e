//! Event lists over plain boxes, in either form.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;

use super::{
    EventState, EventsConfig, Form, Inversions, build, flat::FlatLists, ranks::RankWord, ray::EventRay, refit,
    refit::Swept, tree::EventTree, validate,
};
use crate::{
    accel::{AccelStats, BuildError, Counter, TravRay, Violation, Visitor, sah},
    geom::Aabb,
};

/// Most boxes: links to them take 31 bits, with as many again for volumes.
pub(super) const MAX_OBJECTS: usize = 1 << 30;

const _: () = assert!(2 * MAX_OBJECTS <= <u128 as RankWord>::MAX_EVENTS);

/// Numbers structures and their refits.
static NEXT: AtomicU64 = AtomicU64::new(1);

fn next_number() -> u64 {
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Event lists over plain boxes; rays and moving boxes ask them which boxes they meet.
///
/// Boxes are numbered in order. An empty box is met by nothing and may become a real one later.
#[derive(Debug)]
pub struct EventBoxes {
    lists: Lists,
    /// The same for structures that differ in the places of boxes only.
    topology: u64,
    /// Changes with every refit: what [`EventState`] is checked against.
    stamp: u64,
    count: usize,
    swept: Swept,
    fresh_cost: f64,
}

#[derive(Debug)]
enum Lists {
    Flat(FlatLists),
    Tree(EventTree),
}

impl Clone for EventBoxes {
    fn clone(&self) -> Self {
        let lists = match &self.lists {
            Lists::Flat(lists) => Lists::Flat(lists.clone()),
            Lists::Tree(tree) => Lists::Tree(tree.clone()),
        };
        Self { lists, ..*self }
    }
}

impl EventBoxes {
    /// Builds over `count` boxes, in the current rayon pool.
    ///
    /// # Errors
    /// When there are more than 2^30.
    pub fn build(count: usize, boxes: impl Fn(u32) -> Aabb + Sync, config: &EventsConfig) -> Result<Self, BuildError> {
        let number = check_count(count)?;
        let topology = next_number();
        let lists = match config.form {
            Form::Flat => Lists::Flat(FlatLists::build(number, boxes)),
            Form::Tree => {
                let mut tree = build::build(number, &boxes, config);
                let swept = refit::refit(&mut tree, &boxes, true);
                let fresh_cost = cost(&swept);
                let lists = Lists::Tree(tree);
                return Ok(Self { lists, topology, stamp: topology, count, swept, fresh_cost });
            }
        };
        Ok(Self { lists, topology, stamp: topology, count, swept: Swept::default(), fresh_cost: 0.0 })
    }

    /// Takes the boxes' new places and sorts the events again; nothing is allocated. O(boxes + inversions).
    pub fn refit(&mut self, boxes: impl Fn(u32) -> Aabb + Sync) {
        self.stamp = next_number();
        self.swept = match &mut self.lists {
            Lists::Flat(lists) => Swept { inversions: lists.refit(boxes), ..Swept::default() },
            Lists::Tree(tree) => refit::refit(tree, &boxes, false),
        };
    }

    /// What the last refit did to the order of events; zero after a build.
    pub fn last_inversions(&self) -> Inversions {
        self.swept.inversions
    }

    /// True when both were built as one: they differ in the places of boxes only.
    pub(super) fn is_alike(&self, other: &Self) -> bool {
        self.topology == other.topology
    }

    /// Number of boxes.
    pub fn len(&self) -> usize {
        self.count
    }

    /// True without boxes.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The least box around all.
    pub fn bounds(&self) -> Aabb {
        match &self.lists {
            Lists::Flat(lists) => lists.bounds(),
            Lists::Tree(tree) => tree.volumes[0].aabb,
        }
    }

    /// How much dearer rays are expected to be than right after the build; the flat form does not decay.
    pub fn decay(&self) -> f64 {
        if self.fresh_cost > 0.0 { cost(&self.swept) / self.fresh_cost } else { 1.0 }
    }

    /// The cursors of a point, once for all rays that begin there: for [`EventBoxes::walk_at`].
    ///
    /// O(log n) in the hierarchy, O(n) in the flat form. A point that is not finite gives an empty state.
    pub fn state_at(&self, point: Vec3) -> EventState {
        let mut state = EventState::default();
        if point.is_finite() {
            let point = (point + Vec3::ZERO).to_array();
            state.stamp = self.stamp;
            match &self.lists {
                Lists::Flat(lists) => lists.seat(point, &mut state),
                Lists::Tree(tree) => tree.seat(point, &mut state.seats),
            }
        }
        state
    }

    /// Shows `visitor` the boxes that `ray` meets within `[t_near, visitor.t_limit()]`, in the order in which it enters them;
    /// each once.
    #[inline(always)]
    pub fn walk<V: Visitor, C: Counter>(&self, ray: &TravRay, visitor: &mut V, count: &mut C) {
        let ray = EventRay::new(ray);
        match &self.lists {
            Lists::Flat(lists) => show(&mut lists.walk(ray, count), visitor, count),
            Lists::Tree(tree) => show(&mut tree.walk(ray, &[], count), visitor, count),
        };
    }

    /// As [`EventBoxes::walk`] from the cursors of a state.
    #[inline(always)]
    pub fn walk_at<V: Visitor, C: Counter>(&self, ray: &TravRay, state: &EventState, visitor: &mut V, count: &mut C) {
        let ray = EventRay::new(ray);
        let (seats, inside) =
            if state.stamp == self.stamp { (&state.seats[..], &state.inside[..]) } else { Default::default() };
        match &self.lists {
            Lists::Flat(lists) => show(&mut lists.walk_from(ray, seats, inside, None, count), visitor, count),
            Lists::Tree(tree) => show(&mut tree.walk(ray, seats, count), visitor, count),
        };
    }

    /// As [`EventBoxes::walk_at`]; the state is then that of the place where the walk ended, for rays that go on from there.
    #[inline(always)]
    pub fn walk_on<V: Visitor, C: Counter>(
        &self,
        ray: &TravRay,
        state: &mut EventState,
        visitor: &mut V,
        count: &mut C,
    ) {
        if state.stamp != self.stamp {
            state.clear();
        }
        let ray = EventRay::new(ray);
        let EventState { seats, inside, next_seats, next_inside, .. } = state;
        next_seats.clear();
        next_inside.clear();
        let done = match &self.lists {
            Lists::Flat(lists) => {
                let mut walk = lists.walk_from(ray, seats, inside, Some(next_inside), count);
                let done = show(&mut walk, visitor, count);
                walk.leave(next_seats);
                done
            }
            Lists::Tree(tree) => {
                let mut walk = tree.walk(ray, seats, count);
                let done = show(&mut walk, visitor, count);
                walk.leave(next_seats);
                done
            }
        };
        state.take_next(if done { self.stamp } else { 0 });
    }

    /// Checks order, ranks, containment and that every box is there once.
    ///
    /// # Errors
    /// The first violation found.
    pub fn validate(&self, boxes: impl Fn(u32) -> Aabb) -> Result<(), Violation> {
        match &self.lists {
            Lists::Flat(lists) => validate::flat(lists, boxes),
            Lists::Tree(tree) => validate::tree(tree, self.count, boxes),
        }
        .map_err(Violation)
    }

    /// Size and quality: a volume counts as a node.
    pub fn stats(&self) -> AccelStats {
        let root = sah::half_area(self.bounds());
        let (volumes, depth, leaves, node_bytes) = match &self.lists {
            Lists::Flat(lists) => (1, 1, 1, lists.bytes()),
            Lists::Tree(tree) => tree.size(),
        };
        AccelStats {
            nodes: volumes,
            leaves,
            depth,
            node_bytes,
            total_bytes: size_of::<Self>() + node_bytes,
            sah_cost: if root > 0.0 { self.swept.cost / root } else { 0.0 },
        }
    }
}

/// A walk over boxes: those that a ray enters, in that order.
pub(super) trait BoxWalk {
    /// The next box that the ray enters at `limit` or before.
    fn next<C: Counter>(&mut self, limit: f64, count: &mut C) -> Option<u32>;
}

/// Shows the boxes of a walk to a visitor; false when the visitor ended it.
#[inline(always)]
fn show<W: BoxWalk, V: Visitor, C: Counter>(walk: &mut W, visitor: &mut V, count: &mut C) -> bool {
    while let Some(object) = walk.next(visitor.t_limit(), count) {
        count.prim();
        if visitor.visit(object) {
            return false;
        }
    }
    true
}

/// Expected cost of a ray, in units of the objects' own area; see `decay`.
fn cost(swept: &Swept) -> f64 {
    if swept.own_area > 0.0 { swept.cost / swept.own_area } else { 0.0 }
}

fn check_count(count: usize) -> Result<u32, BuildError> {
    u32::try_from(count).ok().filter(|&n| n as usize <= MAX_OBJECTS).ok_or(BuildError::TooMany {
        structure: "events",
        limit: MAX_OBJECTS,
        actual: count,
    })
}
