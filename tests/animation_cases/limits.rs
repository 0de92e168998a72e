//! Deep trees, values out of range, driven matrices, big scenes.

use std::time::{Duration, Instant};

use glam::{DAffine3, DVec3, Vec3};
use kinora::{
    anim::{ActiveClip, MotionClass, Pose, animation_bounds, classify, deform},
    scene::{ClipId, LocalTransform, NodeId, Scene, Trs},
};

use crate::{
    NO_TURN, ONE, TURNS, imported,
    model::{Channel, Interpolation, Mesh, Model, Node, Path},
    pair, posed,
};

/// A chain of `depth` copies of a node under the root, the mesh of [`pair`] on the last.
fn chain(depth: u32, local: Trs) -> Scene {
    let mut scene = imported(&pair(vec![]));
    let mut link = scene.nodes[0].clone();
    let mut end = scene.nodes[1].clone();
    link.local = LocalTransform::Trs(local);
    end.local = LocalTransform::Trs(local);
    end.parent = Some(NodeId(depth - 1));
    scene.nodes = vec![link; depth as usize];
    for (n, node) in (0..).zip(&mut scene.nodes) {
        node.parent = u32::checked_sub(n, 1).map(NodeId);
        node.children = vec![NodeId(n + 1)];
    }
    scene.nodes.push(end);
    scene.eval_order = (0..=depth).map(NodeId).collect();
    scene.draw_order.clone_from(&scene.eval_order);
    scene.instances[0].node = NodeId(depth);
    scene
}

#[test]
fn a_chain_of_a_hundred_thousand_nodes_is_posed_without_recursion() {
    let step = Trs { translation: DVec3::new(0.0, 0.5, 0.0), ..Trs::IDENTITY };
    let scene = chain(100_000, step);
    let began = Instant::now();
    let out = &posed(&scene, &[])[0];
    assert!(began.elapsed() < Duration::from_secs(10));
    for (p, rest) in out.iter().zip(&scene.meshes[0].parts[0].positions) {
        assert_eq!(*p, *rest + Vec3::new(0.0, 50_000.5, 0.0));
    }
}

#[test]
fn coordinates_out_of_range_saturate_and_are_never_nan() {
    for scale in [DVec3::splat(2.0), DVec3::new(-3.0, 1e30, 1.0), DVec3::splat(1e-20)] {
        let rotation = glam::DQuat::from_xyzw(0.1, 0.2, 0.3, 0.9);
        let scene = chain(5_000, Trs { translation: DVec3::new(1e30, -2.0, 3.0), rotation, scale });
        for p in &posed(&scene, &[])[0] {
            assert!(p.is_finite(), "{scale}: {p}");
        }
    }
}

#[test]
fn channels_on_a_matrix_do_nothing() {
    let mut scene = imported(&pair(vec![Channel::new(
        0,
        Path::Rotation,
        Interpolation::Linear,
        &[0.0, 1.0],
        &TURNS[..2].concat(),
    )]));
    scene.nodes[0].local = LocalTransform::Matrix(glam::DMat4::from_translation(DVec3::X));
    assert_eq!(posed(&scene, &[(0, 0.6)]), posed(&scene, &[]));
    assert_eq!(classify(&scene), [MotionClass::Static]);
}

#[test]
fn bounds_of_a_scene_too_big_to_deform_throughout_are_close() {
    // 40 copies of 30,000 vertices over 60 times: nine times the budget.
    let copies = (0..40).map(|i| ([3.0 * i as f32, 0.0, 0.0], NO_TURN, ONE)).collect();
    let slide = Channel::new(0, Path::Translation, Interpolation::Linear, &[0.0, 1.0], &[0.0, 0.0, 0.0, 0.0, 7.0, 0.0]);
    let positions: Vec<[f32; 3]> = (0..30_000).map(|i| [(i % 3) as f32, (i % 31) as f32, (i % 7) as f32]).collect();
    let model = Model {
        nodes: vec![Node { copies, ..Node::default().with_mesh(0) }],
        roots: vec![0],
        meshes: vec![Mesh { positions, ..Mesh::default() }],
        skins: vec![],
        animations: vec![vec![slide]],
    };
    let scene = imported(&model);
    let began = Instant::now();
    let bounds = animation_bounds(&scene, &[ClipId(0)]);
    assert!(began.elapsed() < Duration::from_secs(20));
    assert_eq!((bounds.min, bounds.max), (Vec3::ZERO, Vec3::new(119.0, 37.0, 6.0)));
}

#[test]
fn bounds_without_clips_are_those_of_the_rest_pose() {
    let model =
        pair(vec![Channel::new(0, Path::Scale, Interpolation::Linear, &[0.0, 1.0], &[1.0, 1.0, 1.0, 9.0, 9.0, 9.0])]);
    let scene = imported(&model);
    let rest = posed(&scene, &[])[0].clone();
    assert_eq!(animation_bounds(&scene, &[]), kinora::geom::Aabb::from_points(rest));
    assert!(animation_bounds(&Scene::default(), &[]).is_empty());
    let whole = animation_bounds(&scene, &[ClipId(0)]);
    let end = kinora::geom::Aabb::from_points(posed(&scene, &[(0, 1.0)])[0].clone());
    assert!(whole.contains(end));
}

#[test]
fn times_that_are_no_numbers_hold_the_first_key() {
    let model = pair(vec![Channel::new(0, Path::Rotation, Interpolation::Linear, &[0.5, 1.0], &TURNS[..2].concat())]);
    let scene = imported(&model);
    let first = posed(&scene, &[(0, 0.5)]);
    assert_eq!(posed(&scene, &[(0, f64::NAN)]), first);
    assert_eq!(posed(&scene, &[(0, f64::NEG_INFINITY)]), first);
    assert_eq!(posed(&scene, &[(0, f64::INFINITY)]), posed(&scene, &[(0, 1.0)]));
}

#[test]
fn world_from_scene_moves_rigid_and_skinned_parts_alike() {
    let model = crate::arm(vec![crate::influences(6, |_| ([0, 1, 0, 0], [0.5, 0.5, 0.0, 0.0]))]);
    let scene = imported(&model);
    let clips = [ActiveClip { clip: ClipId(0), time_s: 0.4 }];
    let mut pose = Pose::rest(&scene);
    pose.evaluate(&scene, &clips, &DAffine3::IDENTITY);
    let (mut here, mut there) = (vec![Vec3::ZERO; 6], vec![Vec3::ZERO; 6]);
    deform(&scene, &pose, scene.instances[0], &mut here);
    pose.evaluate(&scene, &clips, &DAffine3::from_translation(DVec3::new(8.0, 0.0, -4.0)));
    deform(&scene, &pose, scene.instances[0], &mut there);
    for (a, b) in here.iter().zip(&there) {
        assert!((*a + Vec3::new(8.0, 0.0, -4.0)).distance(*b) < 2e-6);
    }
}
