//! The immutable snapshot that readers hold: one frame's geometry and the structures over it.

use std::sync::Arc;

use glam::Vec3;

use crate::{
    anim::Pose,
    geom::{Aabb, Hit, InstanceId, PrimId, Ray},
    scene::{PartInstance, Scene},
    simd::Simd,
};

/// One part instance of a world: which actor it belongs to and what it is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorldInstance {
    /// Number of the actor, in order of addition.
    pub actor: u32,
    /// Node, part and copy within the actor's scene.
    pub part: PartInstance,
}

/// One frame: world-space vertices, the structures over them, and the pose they came from.
///
/// Cheap to clone the `Arc` around it; holds its buffers as long as it lives.
#[derive(Debug)]
pub struct World {
    pub(crate) instances: Arc<[WorldInstance]>,
}

impl World {
    /// The nearest hit that `filter` accepts: least exact `t`, equal `t` to the lower (instance, prim).
    #[inline(always)]
    pub fn closest_hit<S: Simd, F: Fn(&Hit) -> bool>(&self, _ray: &Ray, _filter: &F) -> Option<Hit> {
        None
    }

    /// True when anything that `filter` accepts is hit within the ray's range.
    #[inline(always)]
    pub fn is_occluded<S: Simd, F: Fn(&Hit) -> bool>(&self, _ray: &Ray, _filter: &F) -> bool {
        false
    }

    /// The least box around everything traced.
    pub fn bounds(&self) -> Aabb {
        Aabb::EMPTY
    }

    /// All part instances; an [`InstanceId`] is an index here.
    pub fn instances(&self) -> &[WorldInstance] {
        &self.instances
    }

    /// World-space vertices of an instance in POSITION accessor order.
    pub fn positions(&self, _instance: InstanceId) -> &[Vec3] {
        &[]
    }

    /// World-space corners of a triangle.
    #[inline(always)]
    pub fn corners(&self, instance: InstanceId, prim: PrimId) -> [Vec3; 3] {
        let positions = self.positions(instance);
        self.scene(instance).part(self.instances[instance.0 as usize].part).triangles[prim.0 as usize]
            .map(|i| positions[i as usize])
    }

    /// The scene that an instance belongs to.
    pub fn scene(&self, _instance: InstanceId) -> &Scene {
        unreachable!("skeleton")
    }

    /// The pose that an instance's actor has in this frame.
    pub fn pose(&self, _instance: InstanceId) -> &Pose {
        unreachable!("skeleton")
    }

    /// Number of actors.
    pub fn actor_count(&self) -> usize {
        0
    }

    /// Scene of an actor.
    pub fn actor_scene(&self, _actor: usize) -> &Scene {
        unreachable!("skeleton")
    }

    /// Pose of an actor in this frame.
    pub fn actor_pose(&self, _actor: usize) -> &Pose {
        unreachable!("skeleton")
    }
}
