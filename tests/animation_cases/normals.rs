//! Normals and tangents at single vertices.

use glam::{DAffine3, DVec3, Mat3, Vec3, Vec4};
use kinora::{
    anim::{ActiveClip, Pose, deform, vertex_normal, vertex_tangent},
    scene::{ClipId, PartInstance, Scene},
};
use proptest::prelude::*;

use crate::{NO_TURN, ONE, arm, imported, influences, model::Placement, morphs, pair, random_model};

/// Gives every part the plane normals of its first triangle's corners.
fn with_flat_normals(mut scene: Scene) -> Scene {
    for part in scene.meshes.iter_mut().flat_map(|m| &mut m.parts) {
        let p = &part.positions;
        part.normals = (0..p.len()).map(|v| plane(&p[v / 3 * 3..]).as_vec3()).collect();
    }
    scene
}

fn plane(p: &[Vec3]) -> DVec3 {
    let [a, b, c] = [0, 1, 2].map(|i| p[i].as_dvec3());
    (b - a).cross(c - a).normalize()
}

fn vertices(scene: &Scene, pose: &Pose, instance: PartInstance) -> Vec<Vec3> {
    let mut out = vec![Vec3::ZERO; scene.part(instance).positions.len()];
    deform(scene, pose, instance, &mut out);
    out
}

fn posed_at(scene: &Scene, time_s: f64) -> Pose {
    let mut pose = Pose::rest(scene);
    pose.evaluate(scene, &[ActiveClip { clip: ClipId(0), time_s }], &DAffine3::IDENTITY);
    pose
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn normals_of_rigid_parts_stay_perpendicular(mut model in random_model(), time in 0.0_f64..3.0) {
        model.meshes[1].targets.clear();
        model.meshes[1].weights.clear();
        model.animations[0].retain(|c| c.path != crate::model::Path::Weights);
        let scene = with_flat_normals(imported(&model));
        let pose = posed_at(&scene, time);
        for &instance in scene.instances.iter().filter(|i| scene.nodes[i.node.index()].skin.is_none()) {
            let world = vertices(&scene, &pose, instance);
            let det = pose.world_from_node(instance.node).matrix3.determinant();
            let scale = world.iter().map(|p| p.length()).fold(0.0, f32::max);
            for v in 0..9_usize {
                let corners = &world[v / 3 * 3..];
                // Skip triangles that the matrix has flattened beyond what f32 vertices tell.
                let area = (corners[1] - corners[0]).as_dvec3().cross((corners[2] - corners[0]).as_dvec3()).length();
                let long = (corners[1] - corners[0]).length().max((corners[2] - corners[0]).length());
                if area < 1e-2 * f64::from(long * long) || long < 1e-2 * scale {
                    continue;
                }
                let normal = vertex_normal(&scene, &pose, instance, v as u32).unwrap();
                let expected = plane(corners) * det.signum();
                prop_assert!(normal.as_dvec3().distance(expected) < 1e-3, "{normal} {expected}");
                prop_assert!((normal.length() - 1.0).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn skinned_normals_turn_with_the_blended_matrix() {
    let model = arm(vec![influences(12, |v| ([0, 1, 0, 0], [0.5, 0.1 * (v / 3) as f32, 0.0, 0.0]))]);
    let scene = with_flat_normals(imported(&model));
    for time in [0.0, 0.4, 1.3, 2.0] {
        let pose = posed_at(&scene, time);
        let world = vertices(&scene, &pose, scene.instances[0]);
        for v in 0..12 {
            let normal = vertex_normal(&scene, &pose, scene.instances[0], v as u32).unwrap();
            let expected = plane(&world[v / 3 * 3..]);
            assert!(normal.as_dvec3().distance(expected) < 1e-4, "{normal} {expected}");
        }
    }
}

#[test]
fn morph_targets_bend_normals_and_tangents() {
    let mut scene = imported(&morphs(vec![]));
    let part = &mut scene.meshes[0].parts[0];
    part.normals = vec![Vec3::Z; 12];
    part.tangents = vec![Vec4::new(1.0, 0.0, 0.0, -1.0); 12];
    part.targets[0].normals = vec![Vec3::X; 12];
    part.targets[1].normals = vec![Vec3::new(0.0, 0.5, 0.0); 12];
    part.targets[1].tangents = vec![Vec3::new(0.0, 0.0, 2.0); 12];
    let pose = Pose::rest(&scene);
    // The mesh's default weights are 0.25 and 1.5.
    let normal = vertex_normal(&scene, &pose, scene.instances[0], 4).unwrap();
    assert!(normal.distance(Vec3::new(0.25, 0.75, 1.0).normalize()) < 1e-6);
    let (tangent, sign) = vertex_tangent(&scene, &pose, scene.instances[0], 4).unwrap();
    assert!(tangent.distance(Vec3::new(1.0, 0.0, 3.0).normalize()) < 1e-6);
    assert!(sign < 0.0);
}

#[test]
fn mirrored_parts_keep_their_outside_and_turn_the_bitangent() {
    for (scale, mirrored) in [([2.0, 2.0, 2.0], false), ([-2.0, 2.0, 2.0], true), ([-2.0, -2.0, -2.0], true)] {
        let mut model = pair(vec![]);
        model.nodes[0].placement = Placement::Trs([0.0; 3], [0.0, 0.6, 0.0, 0.8], scale);
        let mut scene = imported(&model);
        let part = &mut scene.meshes[0].parts[0];
        part.normals = vec![Vec3::Z; 12];
        part.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 12];
        let pose = Pose::rest(&scene);
        let matrix = pose.world_from_node(scene.instances[0].node).matrix3;
        let axes = Mat3::from_cols(matrix.x_axis.as_vec3(), matrix.y_axis.as_vec3(), matrix.z_axis.as_vec3()) * 0.5;
        let normal = vertex_normal(&scene, &pose, scene.instances[0], 0).unwrap();
        let (tangent, sign) = vertex_tangent(&scene, &pose, scene.instances[0], 0).unwrap();
        assert!(normal.distance(axes.z_axis) < 1e-6, "{scale:?}: the normal is carried along");
        assert!(tangent.distance(axes.x_axis) < 1e-6);
        assert!((normal.cross(tangent) * sign).distance(axes.y_axis) < 1e-6, "{scale:?}: so is the bitangent");
        assert_eq!(sign < 0.0, mirrored);
    }
}

#[test]
fn normals_survive_extreme_and_flat_scales() {
    for scale in [[1e-30, 1e-30, 1e-30], [1e30, 1e30, 1e30], [1.0, 3.0, 0.0], [1e-20, 1e20, 1.0]] {
        let mut model = pair(vec![]);
        model.nodes[0].placement = Placement::Trs([0.0; 3], NO_TURN, scale);
        let mut scene = imported(&model);
        scene.meshes[0].parts[0].normals = vec![Vec3::Z; 12];
        let pose = Pose::rest(&scene);
        assert_eq!(vertex_normal(&scene, &pose, scene.instances[0], 0), Some(Vec3::Z), "{scale:?}");
    }
}

#[test]
fn absent_and_vanishing_normals_are_none() {
    let mut model = pair(vec![]);
    model.nodes[0].placement = Placement::Trs([0.0; 3], NO_TURN, ONE);
    let mut scene = imported(&model);
    scene.meshes[0].parts[0].normals.clear();
    scene.meshes[0].parts[0].tangents.clear();
    let instance = scene.instances[0];
    assert_eq!(vertex_normal(&scene, &Pose::rest(&scene), instance, 0), None);
    assert_eq!(vertex_tangent(&scene, &Pose::rest(&scene), instance, 0), None);
    scene.meshes[0].parts[0].normals = vec![Vec3::ZERO; 12];
    assert_eq!(vertex_normal(&scene, &Pose::rest(&scene), instance, 0), None);
    model.nodes[0].placement = Placement::Trs([0.0; 3], NO_TURN, [0.0; 3]);
    let mut scene = imported(&model);
    scene.meshes[0].parts[0].normals = vec![Vec3::Z; 12];
    assert_eq!(vertex_normal(&scene, &Pose::rest(&scene), instance, 0), None);
}
