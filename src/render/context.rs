//! Everything that the rays of one frame share, borrowed.

use glam::Vec3;

use super::{
    RenderSettings, lights::LightSource, material::ShadeMaterial, prepared::PreparedScene, rays::RayMaker, sky::Sky,
    vertex_cache::VertexCache,
};
use crate::{
    anim::{Pose, vertex_normal, vertex_tangent},
    geom::{InstanceId, PrimId},
    scene::{MeshPart, PartInstance},
    world::World,
};

/// What shading knows about an instance of the world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InstanceInfo {
    /// Index into the prepared scenes.
    pub(crate) prepared: u32,
    /// Index into that scene's materials.
    pub(crate) material: u32,
    /// First entry of the instance in the vertex caches.
    pub(crate) first_vertex: usize,
    /// The world-space winding is the reverse of the file's.
    pub(crate) mirrored: bool,
    pub(crate) part: PartInstance,
}

/// One frame's shared state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameContext<'a> {
    pub(crate) world: &'a World,
    pub(crate) prepared: &'a [PreparedScene],
    pub(crate) instances: &'a [InstanceInfo],
    pub(crate) normals: &'a VertexCache,
    pub(crate) tangents: &'a VertexCache,
    pub(crate) lights: &'a [LightSource],
    pub(crate) sky: Sky,
    /// Scale of emitted light.
    pub(crate) emission: f32,
    pub(crate) rays: RayMaker,
    pub(crate) settings: RenderSettings,
    /// Some material lets rays through, in holes or in part.
    pub(crate) pierced: bool,
    /// Reach of ambient occlusion in metres.
    pub(crate) reach: f32,
    /// Depth that is shown white and depth that is shown black.
    pub(crate) depth_range: [f32; 2],
    /// Picture size in pixels.
    pub(crate) size: [u32; 2],
    /// Pixels that rays can hit anything in.
    pub(crate) rect: [u32; 4],
}

impl<'a> FrameContext<'a> {
    #[inline(always)]
    pub(crate) fn info(&self, instance: InstanceId) -> &'a InstanceInfo {
        &self.instances[instance.0 as usize]
    }

    #[inline(always)]
    pub(crate) fn scene(&self, info: &InstanceInfo) -> &'a PreparedScene {
        &self.prepared[info.prepared as usize]
    }

    #[inline(always)]
    pub(crate) fn material(&self, info: &InstanceInfo) -> &'a ShadeMaterial {
        &self.scene(info).materials[info.material as usize]
    }

    /// World-space corners and vertex numbers of a triangle.
    #[inline(always)]
    pub(crate) fn triangle(&self, instance: InstanceId, part: &MeshPart, prim: PrimId) -> ([u32; 3], [Vec3; 3]) {
        let vertices = part.triangles[prim.0 as usize];
        let positions = self.world.positions(instance);
        (vertices, vertices.map(|i| positions[i as usize]))
    }

    #[inline(always)]
    fn pose(&self, instance: InstanceId) -> &'a Pose {
        self.world.pose(instance)
    }

    /// World-space normal of a vertex; `None` when the part has none.
    #[inline(always)]
    pub(crate) fn normal(&self, instance: InstanceId, info: &InstanceInfo, vertex: u32) -> Option<Vec3> {
        let make = || {
            let normal = vertex_normal(&self.scene(info).scene, self.pose(instance), info.part, vertex);
            normal.map(|n| (n, 1.0))
        };
        self.normals.get(info.first_vertex + vertex as usize, make).map(|(n, _)| n)
    }

    /// World-space tangent of a vertex and the bitangent's sign; `None` when the part has none.
    #[inline(always)]
    pub(crate) fn tangent(&self, instance: InstanceId, info: &InstanceInfo, vertex: u32) -> Option<(Vec3, f32)> {
        let make = || vertex_tangent(&self.scene(info).scene, self.pose(instance), info.part, vertex);
        self.tangents.get(info.first_vertex + vertex as usize, make)
    }
}
