//! What lies at a point of a triangle.

use glam::{DVec2, DVec3, Vec2, Vec3};

use super::{CollideError, ObjectId, PartId, Snapshot, world::PartFrame};
use crate::{
    anim::{Pose, vertex_normal},
    scene::{NodeId, PartInstance, Scene},
};

/// Which side of a triangle is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// That from which its corners run counter-clockwise, as glTF says; under a mirroring transform the other.
    Front,
    /// The other.
    Back,
}

/// A point of a part: where it is, on what, and how the surface stands there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// The object.
    pub object: ObjectId,
    /// The part.
    pub part: PartId,
    /// The node that places the part.
    pub node: NodeId,
    /// Number of the part (glTF primitive) within the node's mesh.
    pub mesh_part: u32,
    /// The copy's number under `EXT_mesh_gpu_instancing`, else `None`.
    pub copy: Option<u32>,
    /// The triangle, in the file's order.
    pub triangle: u32,
    /// Weights of the triangle's corners.
    pub barycentric: [f64; 3],
    /// First texture coordinates; `None` without.
    pub uv: Option<Vec2>,
    /// The point, world space.
    pub point: DVec3,
    /// Unit normal of the triangle, to its front; `None` for one without area.
    pub n_geom: Option<DVec3>,
    /// Unit interpolated normal, to the side that the file's normals say; the triangle's own where there are none.
    pub n_shade: Option<DVec3>,
}

impl Surface {
    /// Which side is seen along `dir`; the front for directions in the triangle's plane, and for triangles without area.
    pub fn side_seen_along(&self, dir: DVec3) -> Side {
        let back = self.n_geom.is_some_and(|n| n.dot(dir) > 0.0);
        if back { Side::Back } else { Side::Front }
    }

    /// Which side is seen from a point: [`Surface::side_seen_along`].
    pub fn side_seen_from(&self, eye: DVec3) -> Side {
        self.side_seen_along(self.point - eye)
    }
}

impl Snapshot {
    /// What lies at weights `u` and `v` of a triangle's second and third corner.
    ///
    /// Cost: some 100 ns, more where normals are skinned. No allocation.
    ///
    /// # Errors
    /// When there is no such part or triangle, or a weight is not finite.
    pub fn surface(&self, part: PartId, triangle: u32, u: f64, v: f64) -> Result<Surface, CollideError> {
        let frame = self.frame(part)?;
        if triangle as usize >= frame.len() {
            return Err(CollideError::NoSuchTriangle { part, triangle, count: frame.len() });
        }
        if !(u.is_finite() && v.is_finite()) {
            return Err(CollideError::NotFinite { what: "weight" });
        }
        Ok(self.surface_at(frame, part, triangle, u, v))
    }

    /// As [`Snapshot::surface`] of what is there.
    pub(super) fn surface_at(&self, frame: &PartFrame, part: PartId, triangle: u32, u: f64, v: f64) -> Surface {
        let [a, b, c] = frame.corners(triangle).map(Vec3::as_dvec3);
        let point = a + (b - a) * u + (c - a) * v;
        self.surface_of(frame, part, triangle, [1.0 - u - v, u, v], point)
    }

    /// As [`Snapshot::surface`] of a point that lies on the triangle.
    pub(super) fn surface_near(&self, frame: &PartFrame, part: PartId, triangle: u32, point: DVec3) -> Surface {
        let barycentric = weights(&frame.corners(triangle).map(Vec3::as_dvec3), point);
        self.surface_of(frame, part, triangle, barycentric, point)
    }

    fn surface_of(
        &self,
        frame: &PartFrame,
        part: PartId,
        triangle: u32,
        barycentric: [f64; 3],
        point: DVec3,
    ) -> Surface {
        let (scene, pose, own) = self.object(frame);
        let corners = frame.shape.triangles()[triangle as usize];
        let mesh_part = scene.part(frame.instance);
        let uv = mesh_part.tex_coords.first().and_then(|set| {
            let sum = (0..3).map(|i| set.get(corners[i] as usize).map(|uv| uv.as_dvec2() * barycentric[i]));
            sum.sum::<Option<DVec2>>().map(DVec2::as_vec2)
        });
        let mut n_geom = normal(&frame.corners(triangle));
        if !own && is_mirrored(scene, pose, frame.instance, corners[0]) {
            n_geom = n_geom.map(|n| -n);
        }
        let vertex =
            |i: usize| vertex_normal(scene, pose, frame.instance, corners[i]).map(|n| n.as_dvec3() * barycentric[i]);
        let blended =
            if *own || mesh_part.normals.is_empty() { None } else { (0..3).map(vertex).sum::<Option<DVec3>>() };
        Surface {
            object: frame.object,
            part,
            node: frame.instance.node,
            mesh_part: frame.instance.part,
            copy: frame.instance.copy,
            triangle,
            barycentric,
            uv,
            point,
            n_geom,
            n_shade: blended.and_then(unit).or(n_geom),
        }
    }
}

/// A vector at unit length; `None` for what has no direction.
pub(super) fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let v = v / largest;
    Some(v / v.length())
}

/// Unit normal by the order of corners.
pub(super) fn normal(corners: &[Vec3; 3]) -> Option<DVec3> {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    unit((b - a).cross(c - a))
}

/// Weights of a triangle's corners at a point on it; for a triangle without area those along its longest edge.
pub(super) fn weights(&[a, b, c]: &[DVec3; 3], point: DVec3) -> [f64; 3] {
    let (e1, e2, from) = (b - a, c - a, point - a);
    let n = e1.cross(e2);
    let square = n.length_squared();
    if square > 0.0 && square.is_normal() {
        let (u, v) = (from.cross(e2).dot(n) / square, e1.cross(from).dot(n) / square);
        let (u, v) = (u.clamp(0.0, 1.0), v.clamp(0.0, 1.0));
        return [(1.0 - u - v).max(0.0), u, v];
    }
    let along = |from: DVec3, to: DVec3| {
        let way = to - from;
        if way.length_squared() > 0.0 { ((point - from).dot(way) / way.length_squared()).clamp(0.0, 1.0) } else { 0.0 }
    };
    let lengths = [e1.length_squared(), e2.length_squared(), (c - b).length_squared()];
    if lengths[0] >= lengths[1] && lengths[0] >= lengths[2] {
        let s = along(a, b);
        [1.0 - s, s, 0.0]
    } else if lengths[1] >= lengths[2] {
        let s = along(a, c);
        [1.0 - s, 0.0, s]
    } else {
        let s = along(b, c);
        [0.0, 1.0 - s, s]
    }
}

/// Whether what places a vertex turns left to right, so that triangles wind the other way.
fn is_mirrored(scene: &Scene, pose: &Pose, instance: PartInstance, vertex: u32) -> bool {
    let node = &scene.nodes[instance.node.index()];
    let influences = scene.part(instance).influences.as_ref();
    if let (Some(skin), Some(influences)) = (node.skin, influences)
        && let Some(&joint) = influences.joints.get(vertex as usize * influences.per_vertex)
        && let Some(matrix) = pose.joint_matrices(skin).get(usize::from(joint))
    {
        return matrix.matrix3.determinant() < 0.0;
    }
    let copy = instance.copy.and_then(|copy| node.copies.as_ref()?.get(copy as usize));
    let of_copy = copy.is_some_and(|trs| trs.scale.x * trs.scale.y * trs.scale.z < 0.0);
    (pose.world_from_node(instance.node).matrix3.determinant() < 0.0) != of_copy
}
