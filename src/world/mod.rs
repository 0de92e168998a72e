//! The immutable snapshot that readers hold: one frame's geometry and the structures over it.
//!
//! Part instances are held in groups: each has its world-space vertices, its triangles over them and one
//! structure. A [`top`](TopKind) level finds the groups that a ray may hit. How instances are grouped
//! changes no byte of any answer: a group's own triangle numbers are ordered as (instance, prim), the best
//! hit is shared over groups, and boxes only prove misses.
//!
//! Batches ([`World::hit_all`], [`World::block_all`]) ask [`crate::simd::check_float_mode`] themselves; single rays and packets do not.

mod batch;
mod border;
mod group;
mod lanes;
mod packet;
mod query;
mod sink;
mod slab;
mod top;
mod top_tree;

use std::{fmt, sync::Arc};

use glam::Vec3;

use crate::{
    accel::Violation,
    anim::Pose,
    geom::{Aabb, Forms, Hit, InstanceId, PrimId, leave},
    scene::{PartInstance, Scene},
};

pub(crate) use border::{BINS, cheapest_border};
pub(crate) use group::{GroupFrame, GroupLayout};
pub(crate) use slab::SlabRay;
pub(crate) use top::Top;
pub use top::TopKind;
pub(crate) use top_tree::{STACK, TopTree};

/// One part instance of a world: which actor it belongs to and what it is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorldInstance {
    /// Number of the actor, in order of addition.
    pub actor: u32,
    /// Node, part and copy within the actor's scene.
    pub part: PartInstance,
}

/// Where an instance's vertices lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) group: u32,
    pub(crate) first_vertex: u32,
    pub(crate) vertex_count: u32,
}

/// One frame of an actor.
#[derive(Clone, Debug)]
pub(crate) struct ActorFrame {
    pub(crate) scene: Arc<Scene>,
    pub(crate) pose: Arc<Pose>,
}

/// One frame: world-space vertices, the structures over them, and the pose they came from.
///
/// Cheap to clone the `Arc` around it; holds its buffers as long as it lives. Queries are safe from any
/// number of threads.
#[derive(Default)]
pub struct World {
    pub(crate) instances: Arc<[WorldInstance]>,
    pub(crate) places: Arc<[Place]>,
    pub(crate) actors: Vec<ActorFrame>,
    pub(crate) groups: Vec<GroupFrame>,
    pub(crate) top: Top,
    pub(crate) forms: Forms,
}

impl fmt::Debug for World {
    /// Sizes only: the contents fill pages.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("World")
            .field("actors", &self.actors.len())
            .field("instances", &self.instances.len())
            .field("groups", &self.groups.len())
            .field("triangles", &self.triangle_count())
            .field("bounds", &self.bounds())
            .finish_non_exhaustive()
    }
}

impl World {
    /// The least box around everything traced: the triangles with finite corners.
    pub fn bounds(&self) -> Aabb {
        self.groups.iter().fold(Aabb::EMPTY, |all, group| all.union(group.bounds))
    }

    /// How the world was made and how its queries are answered.
    pub fn forms(&self) -> Forms {
        self.forms
    }

    /// All part instances; an [`InstanceId`] is an index here.
    pub fn instances(&self) -> &[WorldInstance] {
        &self.instances
    }

    /// Number of triangles, over all instances.
    pub fn triangle_count(&self) -> usize {
        self.groups.iter().map(|group| group.layout.indices.len()).sum()
    }

    /// Number of groups, each with its own structure.
    pub fn group_count(&self) -> usize {
        self.groups.len()
    }

    /// World-space vertices of an instance in POSITION accessor order. Panics when `instance` is out of range.
    pub fn positions(&self, instance: InstanceId) -> &[Vec3] {
        let place = self.places[instance.0 as usize];
        let first = place.first_vertex as usize;
        &self.groups[place.group as usize].positions[first..first + place.vertex_count as usize]
    }

    /// World-space corners of a triangle. Panics when a number is out of range.
    #[inline(always)]
    pub fn corners(&self, instance: InstanceId, prim: PrimId) -> [Vec3; 3] {
        let positions = self.positions(instance);
        self.scene(instance).part(self.instances[instance.0 as usize].part).triangles[prim.0 as usize]
            .map(|i| positions[i as usize])
    }

    /// Where a ray starts that leaves `hit` along `dir`: see [`leave`]. Panics when a number of `hit` is out of range.
    pub fn leave(&self, hit: &Hit, dir: Vec3) -> Vec3 {
        leave(&self.corners(hit.instance, hit.prim), hit.u, hit.v, dir)
    }

    /// Checks every structure, and every group's box, against the vertices of this frame. O(triangles).
    ///
    /// # Errors
    /// The first violation found.
    pub fn validate(&self) -> Result<(), Violation> {
        for group in &self.groups {
            let prims = group.triangles();
            if group.rigid.is_none() {
                group.accel.validate(&prims)?;
            }
            let outside = (0..).map(PrimId).take(prims.len()).find(|&p| !group.bounds.contains(prims.finite_aabb(p)));
            if let Some(prim) = outside {
                return Err(Violation(format!("triangle {} lies outside of its group's box", prim.0)));
            }
        }
        Ok(())
    }

    /// The first instance with a triangle that reaches the end of f32, if any. O(groups) when there is none.
    pub(crate) fn beyond_f32(&self) -> Option<&WorldInstance> {
        let at_end = |aabb: Aabb| !aabb.is_empty() && aabb.min.abs().max(aabb.max.abs()).max_element() >= f32::MAX;
        let group = self.groups.iter().find(|group| at_end(group.bounds))?;
        let prims = group.triangles();
        let prim = (0..).map(PrimId).take(prims.len()).find(|&p| at_end(prims.finite_aabb(p)))?;
        self.instances.get(group.layout.key(prim).0.0 as usize)
    }

    /// The scene that an instance belongs to.
    pub fn scene(&self, instance: InstanceId) -> &Scene {
        self.actor_scene(self.instances[instance.0 as usize].actor as usize)
    }

    /// The pose that an instance's actor has in this frame.
    pub fn pose(&self, instance: InstanceId) -> &Pose {
        self.actor_pose(self.instances[instance.0 as usize].actor as usize)
    }

    /// Number of actors.
    pub fn actor_count(&self) -> usize {
        self.actors.len()
    }

    /// Scene of an actor.
    pub fn actor_scene(&self, actor: usize) -> &Scene {
        &self.actors[actor].scene
    }

    /// Scene of an actor, to be shared.
    pub fn shared_scene(&self, actor: usize) -> &Arc<Scene> {
        &self.actors[actor].scene
    }

    /// Pose of an actor in this frame.
    pub fn actor_pose(&self, actor: usize) -> &Pose {
        &self.actors[actor].pose
    }

    /// Lets go of every frame buffer, keeping the memory of the lists.
    pub(crate) fn clear(&mut self) {
        self.actors.clear();
        self.groups.clear();
    }
}
