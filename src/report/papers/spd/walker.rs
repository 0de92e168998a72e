//! Structures over boxes as the tracer sees them.

use glam::Vec3;

use crate::{
    accel::{
        Counter, TravRay, Visitor,
        events::{EventBoxes, EventState},
        grid::BoxGrid,
    },
    geom::Aabb,
    world::{STACK, SlabRay, TopTree},
};

/// Finds the objects whose boxes a ray meets.
pub trait Walker: Sync {
    /// What a walk leaves for rays that start where its ray ended.
    type State: Clone + Default + Send + Sync;

    /// The state of rays that start at `point`; made once for an image's eye.
    fn seat(&self, point: Vec3) -> Self::State;

    /// Shows `visitor` every object that can change its answer, until it ends the walk. `state` is that of the ray's
    /// origin.
    fn walk_at<V: Visitor, C: Counter>(&self, ray: &TravRay, state: &Self::State, visitor: &mut V, count: &mut C);

    /// As [`Walker::walk_at`]; `state` becomes that of the point where the ray ends, the hit at [`Visitor::t_limit`],
    /// for rays that start there.
    fn walk_on<V: Visitor, C: Counter>(&self, ray: &TravRay, state: &mut Self::State, visitor: &mut V, count: &mut C) {
        self.walk_at(ray, state, visitor, count);
    }
}

/// Every object for every ray.
#[derive(Clone, Copy, Debug)]
pub struct Naive {
    objects: u32,
}

impl Naive {
    /// Over `boxes`, fewer than 2^32.
    pub fn new(boxes: &[Aabb]) -> Self {
        Self { objects: u32::try_from(boxes.len()).unwrap_or(u32::MAX) }
    }
}

impl Walker for Naive {
    type State = ();

    fn seat(&self, _point: Vec3) {}

    fn walk_at<V: Visitor, C: Counter>(&self, _ray: &TravRay, _state: &(), visitor: &mut V, _count: &mut C) {
        for object in 0..self.objects {
            if visitor.visit(object) {
                return;
            }
        }
    }
}

/// A binary tree of boxes, one object a leaf, walked front to back.
#[derive(Debug)]
pub struct BoxTree {
    tree: TopTree,
}

impl BoxTree {
    /// Over `boxes`, fewer than 2^31.
    pub fn new(boxes: &[Aabb]) -> Self {
        let mut tree = TopTree::default();
        tree.build(boxes.iter().copied());
        Self { tree }
    }
}

impl Walker for BoxTree {
    type State = ();

    fn seat(&self, _point: Vec3) {}

    fn walk_at<V: Visitor, C: Counter>(&self, ray: &TravRay, _state: &(), visitor: &mut V, count: &mut C) {
        let nodes = self.tree.nodes();
        let slabs = SlabRay::new(ray);
        let Some(root) = nodes.first() else { return };
        count.node();
        let Some(entry) = slabs.entry(&root.aabb, visitor.t_limit()) else { return };
        let mut stack = [(entry, 0_u32); STACK];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (entry, node) = stack[waiting];
            if entry > visitor.t_limit() {
                continue;
            }
            let node = &nodes[node as usize];
            if node.leaf {
                if visitor.visit(node.link) {
                    return;
                }
                continue;
            }
            let first = waiting;
            for child in [node.link, node.link + 1] {
                count.node();
                if let Some(entry) = slabs.entry(&nodes[child as usize].aabb, visitor.t_limit()) {
                    stack[waiting] = (entry, child);
                    waiting += 1;
                }
            }
            if waiting - first == 2 && stack[first].0 < stack[first + 1].0 {
                stack.swap(first, first + 1);
            }
        }
    }
}

/// Sorted event lists, flat or hierarchical: cursors go from a ray to those that it spawns.
impl Walker for EventBoxes {
    type State = EventState;

    fn seat(&self, point: Vec3) -> EventState {
        self.state_at(point)
    }

    fn walk_at<V: Visitor, C: Counter>(&self, ray: &TravRay, state: &EventState, visitor: &mut V, count: &mut C) {
        Self::walk_at(self, ray, state, visitor, count);
    }

    fn walk_on<V: Visitor, C: Counter>(&self, ray: &TravRay, state: &mut EventState, visitor: &mut V, count: &mut C) {
        Self::walk_on(self, ray, state, visitor, count);
    }
}

/// A uniform grid: an object is tested in every cell that it is met in.
impl Walker for BoxGrid {
    type State = ();

    fn seat(&self, _point: Vec3) {}

    fn walk_at<V: Visitor, C: Counter>(&self, ray: &TravRay, _state: &(), visitor: &mut V, count: &mut C) {
        self.walk(ray, visitor, count);
    }
}

/// Counts as nodes the boxes that a ray enters before it ends: no structure over the boxes can answer with fewer tests
/// of objects. A ray that the visitor ends early, because any hit will do, counts one.
#[derive(Debug)]
pub struct LeastTests {
    tree: BoxTree,
}

impl LeastTests {
    /// Over `boxes`, fewer than 2^31.
    pub fn new(boxes: &[Aabb]) -> Self {
        Self { tree: BoxTree::new(boxes) }
    }
}

/// Notes whether the visitor ended the walk.
struct Watch<'v, V> {
    inner: &'v mut V,
    ended: bool,
}

impl<V: Visitor> Visitor for Watch<'_, V> {
    fn t_limit(&self) -> f64 {
        self.inner.t_limit()
    }

    fn visit(&mut self, object: u32) -> bool {
        self.ended = self.inner.visit(object);
        self.ended
    }
}

/// Meets every box up to a limit.
struct Tick<'c, C> {
    limit: f64,
    count: &'c mut C,
}

impl<C: Counter> Visitor for Tick<'_, C> {
    fn t_limit(&self) -> f64 {
        self.limit
    }

    fn visit(&mut self, _object: u32) -> bool {
        self.count.node();
        false
    }
}

impl Walker for LeastTests {
    type State = ();

    fn seat(&self, _point: Vec3) {}

    fn walk_at<V: Visitor, C: Counter>(&self, ray: &TravRay, _state: &(), visitor: &mut V, count: &mut C) {
        let mut watch = Watch { inner: visitor, ended: false };
        self.tree.walk_at(ray, &(), &mut watch, &mut ());
        if watch.ended {
            count.node();
        } else {
            let limit = visitor.t_limit();
            self.tree.walk_at(ray, &(), &mut Tick { limit, count }, &mut ());
        }
    }
}
