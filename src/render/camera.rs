//! Placed cameras: from the file, or framed on a box.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::{
    anim::Pose,
    geom::Aabb,
    scene::{NodeId, Projection, Scene},
};

/// Vertical field of view of automatic cameras: 30 degrees, close to what portraits are taken with.
const FRAMING_FOV: f32 = std::f32::consts::FRAC_PI_6;
/// Part of the picture that a framed box may fill.
const FRAMING_FILL: f64 = 0.92;

/// A placed camera: world placement (looking along -Z, +Y up) and projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// Rigid placement in the world.
    pub world_from_camera: DAffine3,
    /// Kind and field of view.
    pub projection: Projection,
}

impl CameraView {
    /// Looks from `eye` at `target` with vertical field of view `y_fov` (radians).
    ///
    /// When `up` is parallel to the view direction another axis takes its place; equal `eye` and `target` look
    /// along -Z.
    pub fn look_at(eye: Vec3, target: Vec3, up: Vec3, y_fov: f32) -> Self {
        let eye = eye.as_dvec3();
        let back = unit_or(eye - target.as_dvec3(), DVec3::Z);
        Self::from_axes(eye, back, up.as_dvec3(), y_fov)
    }

    fn from_axes(eye: DVec3, back: DVec3, up: DVec3, y_fov: f32) -> Self {
        let other = if back.y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
        let right = unit_or(up.cross(back), unit_or(other.cross(back), DVec3::X));
        Self {
            world_from_camera: DAffine3 { matrix3: DMat3::from_cols(right, back.cross(right), back), translation: eye },
            projection: Projection::Perspective { y_fov, aspect: None, z_near: 0.0, z_far: None },
        }
    }

    /// The camera at a node of `scene` in `pose`; `None` when the node has none. Scale in the node's transform
    /// does not count, as glTF says.
    pub fn at_node(scene: &Scene, pose: &Pose, node: NodeId) -> Option<Self> {
        let camera = scene.cameras.get(scene.nodes.get(node.index())?.camera?.index())?;
        let placed = pose.world_from_node(node);
        let back = unit_or(placed.matrix3.z_axis, DVec3::Z);
        let view = Self::from_axes(placed.translation, back, placed.matrix3.y_axis, FRAMING_FOV);
        Some(Self { projection: camera.projection, ..view })
    }

    /// Nodes of the default scene that hold a camera, in draw order.
    pub fn nodes(scene: &Scene) -> Vec<NodeId> {
        scene.draw_order.iter().copied().filter(|n| scene.nodes[n.index()].camera.is_some()).collect()
    }

    /// Frames `bounds` in a three-quarter view of its front (+Z) from a little above, for a picture of the given
    /// aspect (width over height). All eight corners lie inside. An empty box is taken as a unit box at the origin.
    pub fn framing(bounds: Aabb, aspect: f32) -> Self {
        // 33 degrees to the side, 12 degrees up.
        let back = DVec3::new(0.544_639, 0.0, 0.838_671) * 0.978_148 + DVec3::Y * 0.207_912;
        Self::framing_from(bounds, aspect, back.as_vec3())
    }

    /// Frames `bounds` seen from the direction `back` (from the box to the camera, +Y up).
    pub fn framing_from(bounds: Aabb, aspect: f32, back: Vec3) -> Self {
        let usable = !bounds.is_empty() && bounds.min.is_finite() && bounds.max.is_finite();
        let bounds = if usable { bounds } else { Aabb { min: Vec3::splat(-0.5), max: Vec3::splat(0.5) } };
        let back = unit_or(back.as_dvec3(), DVec3::Z);
        let mut view = Self::from_axes(DVec3::ZERO, back, DVec3::Y, FRAMING_FOV);
        let tan_y = libm::tan(f64::from(FRAMING_FOV) * 0.5) * FRAMING_FILL;
        let aspect = if aspect.is_finite() && aspect > 0.0 { f64::from(aspect) } else { 1.0 };
        view.world_from_camera.translation =
            framing_eye(&view.world_from_camera.matrix3, bounds, tan_y * aspect, tan_y);
        view
    }
}

/// The nearest eye point from which every corner of `bounds` lies within the two slopes.
fn framing_eye(axes: &DMat3, bounds: Aabb, tan_x: f64, tan_y: f64) -> DVec3 {
    // Support of the box along each side plane of the frustum, for (right, up) and both signs.
    let mut support = [[f64::NEG_INFINITY; 2]; 2];
    let mut nearest = f64::NEG_INFINITY;
    for corner in corners(bounds) {
        let local = axes.transpose() * corner.as_dvec3();
        nearest = nearest.max(local.z);
        for (axis, tan) in [tan_x, tan_y].into_iter().enumerate() {
            support[axis][0] = support[axis][0].max(local[axis] + tan * local.z);
            support[axis][1] = support[axis][1].max(-local[axis] + tan * local.z);
        }
    }
    let [x, y] = support;
    let reach = ((x[0] + x[1]) / (2.0 * tan_x)).max((y[0] + y[1]) / (2.0 * tan_y));
    // A point-like box still gets some distance.
    let size = f64::from(bounds.diagonal()).max(1e-6);
    let z = reach.max(nearest + 0.05 * size);
    *axes * DVec3::new((x[0] - x[1]) * 0.5, (y[0] - y[1]) * 0.5, z)
}

/// The eight corners of a box.
pub(crate) fn corners(b: Aabb) -> [Vec3; 8] {
    std::array::from_fn(|i| {
        let pick = |bit: usize, low: f32, high: f32| if i >> bit & 1 == 0 { low } else { high };
        Vec3::new(pick(0, b.min.x, b.max.x), pick(1, b.min.y, b.max.y), pick(2, b.min.z, b.max.z))
    })
}

fn unit_or(v: DVec3, or: DVec3) -> DVec3 {
    let length = v.length();
    if length > 1e-300 && length.is_finite() { v / length } else { or }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::rays::RayMaker;

    #[test]
    fn framing_holds_every_corner_and_fills_the_picture() {
        for (w, h) in [(1280u32, 720u32), (300, 700), (64, 64)] {
            for scale in [1e-3f32, 1.0, 1e5] {
                let bounds = Aabb { min: Vec3::new(-0.4, 0.0, -0.3) * scale, max: Vec3::new(0.4, 1.8, 0.3) * scale };
                let view = CameraView::framing(bounds, w as f32 / h as f32);
                let maker = RayMaker::new(&view, w, h);
                let rect = maker.pixel_rect(bounds);
                assert!(rect[0] > 0 && rect[1] > 0 && rect[2] < w && rect[3] < h, "{rect:?} in {w}x{h}");
                let fill = ((rect[2] - rect[0]) as f32 / w as f32).max((rect[3] - rect[1]) as f32 / h as f32);
                assert!(fill > 0.85, "{fill}");
            }
        }
    }

    #[test]
    fn framing_sees_the_front() {
        let view = CameraView::framing(Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE }, 1.5);
        let eye = view.world_from_camera.translation;
        assert!(eye.z > eye.x && eye.x > 0.0 && eye.y > 0.0);
    }

    #[test]
    fn odd_boxes_and_looks_give_rigid_cameras() {
        let odd = [
            CameraView::framing(Aabb::EMPTY, 1.0),
            CameraView::framing(Aabb { min: Vec3::ONE, max: Vec3::ONE }, f32::NAN),
            CameraView::look_at(Vec3::Y, Vec3::ZERO, Vec3::Y, 0.7),
            CameraView::look_at(Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, 0.7),
        ];
        for view in odd {
            let m = view.world_from_camera.matrix3;
            assert!((m.determinant() - 1.0).abs() < 1e-12, "{view:?}");
            assert!(view.world_from_camera.translation.is_finite());
        }
    }
}
