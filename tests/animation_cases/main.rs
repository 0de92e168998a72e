//! Corner cases of posing, each a small file made here and compared with an independent evaluation of the same
//! source data.
#![allow(clippy::cast_possible_truncation, reason = "small numbers of a test's own")]

mod classes;
mod glb;
mod limits;
mod model;
mod normals;
mod reference;

use glam::{DAffine3, Vec3};
use kinora::{
    anim::{ActiveClip, Pose, deform, deform_parallel, deform_range_at},
    scene::{ClipId, Scene, import},
    simd::SimdLevel,
};
use model::{Channel, Interpolation, Mesh, Model, Node, Path, Skin, Storage};
use proptest::prelude::*;
use reference::Moment;

const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;
const NO_TURN: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
const ONE: [f32; 3] = [1.0; 3];
const IDENTITY: [f32; 16] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

fn imported(model: &Model) -> Scene {
    let scene = import::from_bytes("made.glb", &glb::bytes(model), &mut |uri| Err(format!("no {uri} here"))).unwrap();
    for clip in &scene.clips {
        assert_eq!(clip.disabled, None);
    }
    scene
}

fn posed(scene: &Scene, playing: &[(usize, f64)]) -> Vec<Vec<Vec3>> {
    let clips: Vec<_> =
        playing.iter().map(|&(clip, time_s)| ActiveClip { clip: ClipId(clip as u32), time_s }).collect();
    let mut pose = Pose::rest(scene);
    pose.evaluate(scene, &clips, &DAffine3::IDENTITY);
    let vertices = |&instance| {
        let mut out = vec![Vec3::NAN; scene.part(instance).positions.len()];
        deform(scene, &pose, instance, &mut out);
        out
    };
    scene.instances.iter().map(vertices).collect()
}

/// Checks that the model's vertices agree with the reference to 2e-7 of the diagonal: rounding to `f32` and
/// nothing else. Gives the largest error over the diagonal.
fn compare(scene: &Scene, model: &Model, playing: &[(usize, f64)]) -> f64 {
    let expected = Moment::new(model, playing).parts();
    let got = posed(scene, playing);
    assert_eq!(got.iter().map(Vec::len).collect::<Vec<_>>(), expected.iter().map(Vec::len).collect::<Vec<_>>());
    let all: Vec<_> = expected.iter().flatten().copied().collect();
    let span = |i: usize| {
        let (lo, hi) = all.iter().fold((f64::MAX, f64::MIN), |(lo, hi), p| (lo.min(p[i]), hi.max(p[i])));
        hi - lo
    };
    let size = all.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
    let diagonal = (span(0).powi(2) + span(1).powi(2) + span(2).powi(2)).sqrt();
    // Far from the origin the spacing of f32 is what counts.
    let allowed = (2e-7 * diagonal).max(1.1e-7 * size);
    let mut worst = 0.0;
    for (p, q) in got.iter().flatten().zip(&all) {
        let off = p.as_dvec3().distance((*q).into());
        assert!(off <= allowed, "{playing:?}: {p} instead of {q:?}, off by {:.2e} of the diagonal", off / diagonal);
        worst = off.max(worst);
    }
    worst / diagonal
}

/// Every time of interest of one animation alone: keys, between, before, after.
fn times(model: &Model, animation: usize) -> Vec<f64> {
    let mut times = vec![-1.0, 0.0];
    for channel in &model.animations[animation] {
        for pair in channel.times.windows(2) {
            let (a, b) = (f64::from(pair[0]), f64::from(pair[1]));
            times.extend([a, a + (b - a) * 0.25, a + (b - a) * 0.77, b, b + 0.3]);
        }
        times.push(f64::from(channel.times[0]) + 0.1);
    }
    times
}

fn compare_at_all_times(model: &Model) {
    let scene = imported(model);
    compare(&scene, model, &[]);
    for animation in 0..model.animations.len() {
        for time in times(model, animation) {
            compare(&scene, model, &[(animation, time)]);
        }
    }
}

fn triangles(count: usize) -> Vec<[f32; 3]> {
    (0..3 * count)
        .map(|i| [(i * i % 5) as f32 * 0.3 - 0.5, i as f32 * 0.2, (3 * i * i % 7) as f32 * 0.25 - 0.7])
        .collect()
}

fn translation(x: f32, y: f32, z: f32) -> [f32; 16] {
    let mut m = IDENTITY;
    m[12..15].copy_from_slice(&[x, y, z]);
    m
}

/// Two joints, the second turning about x under the first which turns about z; a mesh with the given influences.
fn arm(joint_sets: Vec<Vec<([u16; 4], [f32; 4])>>) -> Model {
    let count = joint_sets[0].len();
    Model {
        nodes: vec![
            Node::at([0.3, 0.0, 0.1], NO_TURN, [1.0, 1.5, 1.0]).over(&[1]),
            Node::at([0.0, 1.0, 0.0], [0.0, HALF, 0.0, HALF], ONE),
            Node::at([5.0, 5.0, 5.0], NO_TURN, [3.0; 3]).with_mesh(0).with_skin(0),
        ],
        roots: vec![0, 2],
        meshes: vec![Mesh { positions: triangles(count / 3), joint_sets, ..Mesh::default() }],
        skins: vec![Skin { joints: vec![0, 1], inverse_bind: vec![IDENTITY, translation(0.0, -1.0, 0.0)] }],
        animations: vec![vec![
            Channel::new(
                0,
                Path::Rotation,
                Interpolation::Linear,
                &[0.0, 1.0, 2.0],
                &[NO_TURN, [0.0, 0.0, 0.6, 0.8], [0.0, 0.0, -0.96, 0.28]].concat(),
            ),
            Channel::new(
                1,
                Path::Rotation,
                Interpolation::Linear,
                &[0.5, 1.5],
                &[[HALF, 0.0, 0.0, HALF], [0.0, -0.6, 0.0, -0.8]].concat(),
            ),
        ]],
    }
}

fn influences(count: usize, one: impl Fn(usize) -> ([u16; 4], [f32; 4])) -> Vec<([u16; 4], [f32; 4])> {
    (0..count).map(one).collect()
}

#[test]
fn skinned_node_transform_does_not_count() {
    compare_at_all_times(&arm(vec![influences(12, |v| ([0, 1, 0, 0], [0.25 * (v % 5) as f32, 1.0, 0.0, 0.0]))]));
}

#[test]
fn eight_influences_all_count() {
    let first = influences(12, |v| ([0, 1, 1, 0], [0.1, 0.2, 0.05 * v as f32, 0.1]));
    let second = influences(12, |v| ([1, 1, 0, 1], [0.1, 0.0, 0.3, 0.02 * v as f32]));
    compare_at_all_times(&arm(vec![first, second]));
}

#[test]
fn twelve_influences_all_count() {
    let set = |k: u16| influences(9, move |v| ([k % 2, 1, 0, 1], [0.1, 0.02 * f32::from(k), 0.03 * v as f32, 0.04]));
    compare_at_all_times(&arm(vec![set(0), set(1), set(2)]));
}

#[test]
fn weights_are_divided_by_their_sum() {
    let scale = [0.001, 0.5, 1.0, 7.0, 300.0, 1e-30];
    compare_at_all_times(&arm(vec![influences(12, |v| {
        let s = scale[v % 6];
        ([0, 1, 1, 0], [0.3 * s, 0.4 * s, 0.1 * s, 0.0])
    })]));
}

#[test]
fn vertices_without_weight_follow_their_first_joint() {
    compare_at_all_times(&arm(vec![influences(12, |v| {
        let w = if v % 2 == 0 { 0.0 } else { 0.5 };
        ([(v % 3 % 2) as u16, 0, 0, 0], [w, w, 0.0, 0.0])
    })]));
}

#[test]
fn vertices_without_weight_whose_joint_does_not_exist_follow_the_skins_first() {
    let model = arm(vec![influences(12, |_| ([u16::MAX, 77, 3, 2], [0.0; 4]))]);
    let mut first = model.clone();
    first.meshes[0].joint_sets = vec![influences(12, |_| ([0; 4], [1.0, 0.0, 0.0, 0.0]))];
    compare(&imported(&model), &first, &[(0, 0.7)]);
}

#[test]
fn sheared_matrices_above_skins_and_meshes_are_used_as_they_stand() {
    let mut model = arm(vec![influences(12, |v| ([0, 1, 0, 0], [0.2, 0.1 * v as f32, 0.0, 0.0]))]);
    let shear = [1.0, 0.2, 0.0, 0.0, 0.7, 1.1, -0.3, 0.0, 0.1, 0.0, 0.9, 0.0, 0.5, -2.0, 0.25, 1.0];
    model.nodes.push(Node::matrix(shear).over(&[0, 4]));
    model.nodes.push(Node::at([0.0, 0.5, 0.0], [0.36, 0.48, 0.0, 0.8], [2.0, 0.5, 1.0]).over(&[5]));
    model.nodes.push(Node::matrix(shear).with_mesh(1));
    model.meshes.push(Mesh { positions: triangles(5), ..Mesh::default() });
    model.roots = vec![3, 2];
    compare_at_all_times(&model);
}

#[test]
fn joints_outside_the_scene_move_the_skin() {
    let mut model = arm(vec![influences(12, |v| ([0, 1, 0, 0], [0.2, 0.1 * v as f32, 0.0, 0.0]))]);
    model.roots = vec![2];
    compare_at_all_times(&model);
}

#[test]
fn children_of_a_skinned_node_follow_it() {
    let mut model = arm(vec![influences(6, |_| ([1, 0, 0, 0], [1.0, 0.0, 0.0, 0.0]))]);
    model.nodes.push(Node::at([0.0, 1.0, 0.0], NO_TURN, ONE).with_mesh(1));
    model.nodes[2].children.push(3);
    model.meshes.push(Mesh { positions: triangles(2), ..Mesh::default() });
    model.animations[0].push(Channel::new(
        2,
        Path::Translation,
        Interpolation::Linear,
        &[0.0, 2.0],
        &[0.0, 0.0, 0.0, 4.0, 5.0, 6.0],
    ));
    compare_at_all_times(&model);
}

#[test]
fn negative_scales_mirror_rigid_and_skinned_parts() {
    let mut model = arm(vec![influences(12, |v| ([0, 1, 0, 0], [0.2, 0.1 * v as f32, 0.0, 0.0]))]);
    model.nodes[0].placement = model::Placement::Trs([0.3, 0.0, 0.1], NO_TURN, [-1.0, 1.5, 1.0]);
    model.nodes.push(Node::at([0.0, 1.0, 0.0], [0.0, 0.6, 0.0, 0.8], [1.0, -2.0, 0.5]).with_mesh(1));
    model.nodes[1].children.push(3);
    model.meshes.push(Mesh { positions: triangles(4), ..Mesh::default() });
    model.animations[0].push(Channel::new(
        1,
        Path::Scale,
        Interpolation::Linear,
        &[0.0, 2.0],
        &[1.0, -1.0, 1.0, 2.0, -0.5, -1.0],
    ));
    compare_at_all_times(&model);
}

/// One mesh on a node under another; channels drive both.
fn pair(channels: Vec<Channel>) -> Model {
    Model {
        nodes: vec![
            Node::at([1.0, 2.0, 3.0], [0.0, 0.6, 0.0, 0.8], [1.0, 2.0, 0.5]).over(&[1]),
            Node::at([0.0, 0.5, 0.0], NO_TURN, ONE).with_mesh(0),
        ],
        roots: vec![0],
        meshes: vec![Mesh { positions: triangles(4), ..Mesh::default() }],
        skins: vec![],
        animations: Some(channels).filter(|c| !c.is_empty()).into_iter().collect(),
    }
}

const TURNS: [[f32; 4]; 4] =
    [[0.0, 0.0, 0.6, 0.8], [0.5, 0.5, 0.5, 0.5], [0.0, -0.96, 0.0, 0.28], [-0.36, 0.48, 0.0, -0.8]];

#[test]
fn every_interpolation_of_every_component() {
    for interpolation in [Interpolation::Step, Interpolation::Linear, Interpolation::Cubic] {
        let slots = if interpolation == Interpolation::Cubic { 12 } else { 4 };
        let times = [0.25, 0.5, 1.75, 3.0];
        let moves: Vec<f32> = (0..slots * 3).map(|i| ((i * 7 + 3) % 11) as f32 * 0.2 - 1.0).collect();
        let scales: Vec<f32> = moves.iter().map(|v| 0.5 + v * v).collect();
        let turns: Vec<f32> = (0..slots)
            .flat_map(|s| match (interpolation, s % 3) {
                (Interpolation::Cubic, 1) => TURNS[s / 3],
                (Interpolation::Cubic, _) => [0.1, -0.2, 0.05 * s as f32, 0.3],
                _ => TURNS[s],
            })
            .collect();
        compare_at_all_times(&pair(vec![
            Channel::new(0, Path::Translation, interpolation, &times, &moves),
            Channel::new(0, Path::Rotation, interpolation, &times, &turns),
            Channel::new(1, Path::Scale, interpolation, &times, &scales),
        ]));
    }
}

#[test]
fn interleaved_keys_are_read_with_their_stride() {
    let moves = [0.0, 0.1, 0.2, 1.0, 1.1, 1.2, -2.0, 2.5, 3.0];
    compare_at_all_times(&pair(vec![
        Channel::new(0, Path::Rotation, Interpolation::Linear, &[0.0, 0.5, 1.0, 4.0], &TURNS.concat())
            .stored(Storage::Interleaved),
        Channel::new(1, Path::Translation, Interpolation::Linear, &[0.5, 1.0, 2.0], &moves)
            .stored(Storage::Interleaved),
    ]));
}

#[test]
fn quantised_rotations_are_normalised() {
    for storage in [Storage::Int8, Storage::Int16] {
        for interpolation in [Interpolation::Step, Interpolation::Linear] {
            compare_at_all_times(&pair(vec![
                Channel::new(0, Path::Rotation, interpolation, &[0.0, 0.5, 1.0, 4.0], &TURNS.concat()).stored(storage),
            ]));
        }
    }
}

#[test]
fn rotation_keys_of_any_length_and_sign_are_normalised_before_slerp() {
    let turns: Vec<f32> =
        TURNS.iter().zip([0.707, 3.0, -0.1, -40.0]).flat_map(|(q, scale)| q.map(|v| v * scale)).collect();
    compare_at_all_times(&pair(vec![Channel::new(
        0,
        Path::Rotation,
        Interpolation::Linear,
        &[0.0, 0.5, 1.0, 4.0],
        &turns,
    )]));
}

#[test]
fn keys_that_start_late_and_keys_near_a_million_seconds_lose_nothing() {
    let moves = [0.0, 0.1, 0.2, 1.0, 1.1, 1.2, -2.0, 2.5, 3.0];
    for start in [3.0, 1_000.0, 999_999.0, 1_000_000.0] {
        let times = [start, start + 0.125, start + 2.0];
        let model = pair(vec![
            Channel::new(0, Path::Rotation, Interpolation::Linear, &times, &TURNS[..3].concat()),
            Channel::new(1, Path::Translation, Interpolation::Linear, &[0.0, 1.0, 2.0], &moves),
        ]);
        compare_at_all_times(&model);
        let scene = imported(&model);
        for step in 0..40 {
            compare(&scene, &model, &[(0, f64::from(start) + 0.0531 * f64::from(step))]);
        }
    }
}

#[test]
fn one_key_and_equal_ends_hold() {
    compare_at_all_times(&pair(vec![
        Channel::new(0, Path::Translation, Interpolation::Linear, &[0.0], &[4.0, 5.0, 6.0]),
        Channel::new(0, Path::Rotation, Interpolation::Linear, &[2.0], &TURNS[1]),
        Channel::new(1, Path::Scale, Interpolation::Cubic, &[1.0], &[9.0, 9.0, 9.0, 0.5, 2.0, 1.0, 9.0, 9.0, 9.0]),
        Channel::new(1, Path::Translation, Interpolation::Step, &[1.0], &[0.5, 2.0, 1.0]),
    ]));
}

/// A mesh with two targets drawn by three nodes, the second with weights of its own.
fn morphs(channels: Vec<Channel>) -> Model {
    let shift = |k: f32| triangles(4).iter().map(|p| [p[1] * k, -p[0], p[2] * p[1] * 0.1]).collect();
    Model {
        nodes: vec![
            Node::default().with_mesh(0),
            Node { weights: Some(vec![0.75, -0.5]), ..Node::at([0.0, 0.0, 3.0], NO_TURN, ONE).with_mesh(0) },
            Node::at([3.0, 0.0, 0.0], TURNS[0], ONE).with_mesh(0),
        ],
        roots: vec![0, 1, 2],
        meshes: vec![Mesh {
            positions: triangles(4),
            targets: vec![shift(0.3), shift(-1.1)],
            weights: vec![0.25, 1.5],
            joint_sets: vec![],
        }],
        skins: vec![],
        animations: Some(channels).filter(|c| !c.is_empty()).into_iter().collect(),
    }
}

const WEIGHT_KEYS: [f32; 6] = [0.0, 1.0, 0.5, -0.5, 1.0, 2.0];

#[test]
fn node_weights_stand_before_mesh_weights_and_animated_ones_before_both() {
    for interpolation in [Interpolation::Step, Interpolation::Linear] {
        compare_at_all_times(&morphs(vec![Channel::new(
            2,
            Path::Weights,
            interpolation,
            &[0.0, 1.0, 2.5],
            &WEIGHT_KEYS,
        )]));
    }
    let cubic: Vec<f32> = (0..18).map(|i| (i % 5) as f32 * 0.3 - 0.4).collect();
    compare_at_all_times(&morphs(vec![Channel::new(1, Path::Weights, Interpolation::Cubic, &[0.0, 1.0, 2.5], &cubic)]));
}

#[test]
fn animated_mesh_weights_reach_the_nodes_without_their_own() {
    let mesh = Channel::new(0, Path::MeshWeights, Interpolation::Linear, &[0.0, 1.0, 2.5], &WEIGHT_KEYS);
    let node = Channel::new(2, Path::Weights, Interpolation::Linear, &[0.5, 2.0], &[1.0, 0.0, 0.0, 1.0]);
    compare_at_all_times(&morphs(vec![mesh.clone()]));
    compare_at_all_times(&morphs(vec![mesh.clone(), node.clone()]));
    compare_at_all_times(&morphs(vec![node, mesh]));
}

#[test]
fn morphing_comes_before_skinning() {
    let mut model = arm(vec![influences(12, |v| ([0, 1, 0, 0], [0.2, 0.1 * v as f32, 0.0, 0.0]))]);
    model.meshes[0].targets = vec![triangles(4).iter().map(|p| [p[2], p[0], -p[1]]).collect()];
    model.meshes[0].weights = vec![0.4];
    model.animations[0].push(Channel::new(2, Path::Weights, Interpolation::Linear, &[0.0, 2.0], &[1.0, -0.3]));
    compare_at_all_times(&model);
}

#[test]
fn of_several_clips_the_later_one_wins_where_both_drive_a_target() {
    let mut model = pair(vec![
        Channel::new(0, Path::Translation, Interpolation::Linear, &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 2.0, 3.0]),
        Channel::new(0, Path::Rotation, Interpolation::Linear, &[0.0, 1.0], &TURNS[..2].concat()),
    ]);
    model.animations.push(vec![
        Channel::new(0, Path::Translation, Interpolation::Linear, &[0.0, 2.0], &[5.0, 0.0, 0.0, 5.0, 9.0, 3.0]),
        Channel::new(1, Path::Scale, Interpolation::Linear, &[0.0, 2.0], &[1.0, 1.0, 1.0, 2.0, 3.0, 4.0]),
    ]);
    let scene = imported(&model);
    for time in [0.0, 0.3, 1.0, 1.9] {
        compare(&scene, &model, &[(0, time), (1, time)]);
        compare(&scene, &model, &[(1, time), (0, time * 0.5)]);
    }
}

#[test]
fn instanced_copies_are_placed_under_their_node() {
    let mut model =
        pair(vec![Channel::new(0, Path::Rotation, Interpolation::Linear, &[0.0, 1.0, 2.0, 3.0], &TURNS.concat())]);
    model.nodes[1].copies = vec![
        ([0.0, 0.0, 0.0], NO_TURN, ONE),
        ([4.0, 0.0, 1.0], [0.0, 1.4, 0.0, 1.4], [1.0, 2.0, 3.0]),
        ([0.0, -3.0, 0.0], TURNS[3], [-1.0, 0.5, 0.5]),
    ];
    compare_at_all_times(&model);
}

#[test]
fn every_level_range_and_thread_count_gives_the_same_bits() {
    for sets in 1..=3 {
        let set =
            |k: usize| influences(9_999, move |v| ([(v % 2) as u16, 1, 0, 1], [0.1, 0.3, (v % 17) as f32, k as f32]));
        let mut model = arm((0..sets).map(set).collect());
        model.nodes.push(Node::at([1.0, 2.0, 0.1], TURNS[3], [0.3, 0.7, -1.3]).with_mesh(0));
        model.roots.push(3);
        model.meshes[0].targets = vec![triangles(3_333)];
        model.meshes[0].weights = vec![0.37];
        let scene = imported(&model);
        let mut pose = Pose::rest(&scene);
        pose.evaluate(&scene, &[ActiveClip { clip: ClipId(0), time_s: 0.77 }], &DAffine3::IDENTITY);
        for &instance in &scene.instances {
            let mut whole = vec![Vec3::NAN; 9_999];
            deform_range_at(SimdLevel::Scalar, &scene, &pose, instance, 0, &mut whole);
            let mut other = vec![Vec3::NAN; 9_999];
            deform_parallel(SimdLevel::best(), &scene, &pose, instance, &mut other);
            assert_eq!(bits(&whole), bits(&other));
            for level in SimdLevel::ALL.into_iter().filter(|l| l.is_available()) {
                for (first, count) in [(0, 9_999), (0, 1), (9_998, 1), (63, 66), (1_001, 4_096), (5, 0)] {
                    let out = &mut other[..count];
                    deform_range_at(level, &scene, &pose, instance, first, out);
                    assert_eq!(bits(&whole[first..first + count]), bits(out), "{level} {first} {count}");
                }
            }
        }
    }
}

fn bits(points: &[Vec3]) -> Vec<[u32; 3]> {
    points.iter().map(|p| p.to_array().map(f32::to_bits)).collect()
}

#[test]
fn a_reused_pose_equals_a_fresh_one() {
    let mut model = arm(vec![influences(12, |v| ([0, 1, 0, 0], [0.2, 0.1 * v as f32, 0.0, 0.0]))]);
    model.nodes.push(Node::default().with_mesh(0).over(&[4]));
    model.nodes.push(Node::at([1.0, 0.0, 0.0], TURNS[0], ONE).with_mesh(0));
    model.roots.push(3);
    model.animations.push(vec![Channel::new(
        3,
        Path::Translation,
        Interpolation::Linear,
        &[0.0, 1.0],
        &[0.0, 0.0, 0.0, 1.0, 2.0, 3.0],
    )]);
    let scene = imported(&model);
    let mut reused = Pose::rest(&scene);
    let shifted = DAffine3::from_translation(glam::DVec3::new(0.1, 0.2, 0.3));
    let rounds: [(&[(u32, f64)], DAffine3); 7] = [
        (&[(0, 0.4)], DAffine3::IDENTITY),
        (&[(1, 0.4)], DAffine3::IDENTITY),
        (&[], DAffine3::IDENTITY),
        (&[(0, 0.4), (1, 0.9)], DAffine3::IDENTITY),
        (&[(1, 0.9)], shifted),
        (&[], shifted),
        (&[], DAffine3::IDENTITY),
    ];
    for (playing, root) in rounds {
        let clips: Vec<_> = playing.iter().map(|&(c, time_s)| ActiveClip { clip: ClipId(c), time_s }).collect();
        reused.evaluate(&scene, &clips, &root);
        let mut fresh = Pose::rest(&scene);
        fresh.evaluate(&scene, &clips, &root);
        for &instance in &scene.instances {
            let (mut a, mut b) = (vec![Vec3::ZERO; 12], vec![Vec3::ONE; 12]);
            deform(&scene, &reused, instance, &mut a);
            deform(&scene, &fresh, instance, &mut b);
            assert_eq!(bits(&a), bits(&b), "{playing:?}");
        }
    }
}

/// A random model: a tree of eight nodes, a skinned and two rigid morphing parts, channels on everything.
fn random_model() -> impl Strategy<Value = Model> {
    let number = || -2.0_f32..2.0;
    let vec3 = move || prop::array::uniform3(number());
    let quat = || {
        prop::array::uniform4(-1.0_f32..1.0).prop_filter("long enough", |q| q.iter().map(|v| v * v).sum::<f32>() > 0.01)
    };
    let scale = || prop::array::uniform3(prop_oneof![0.3_f32..2.0, -2.0_f32..-0.3]);
    let nodes = prop::collection::vec((vec3(), quat(), scale()), 8);
    let binds = prop::collection::vec(vec3(), 3);
    let sets = prop::collection::vec(
        prop::collection::vec((prop::array::uniform4(0_u16..3), prop::array::uniform4(0.0_f32..1.0)), 9),
        1..3,
    );
    let targets = prop::collection::vec(prop::collection::vec(vec3(), 9), 0..3);
    let channels = prop::collection::vec(random_channel(), 1..8);
    (nodes, binds, sets, targets, channels).prop_map(|(nodes, binds, joint_sets, targets, mut channels)| {
        let mut nodes: Vec<_> = nodes.into_iter().map(|(t, r, s)| Node::at(t, r, s)).collect();
        for (parent, children) in [(0, vec![1, 2]), (1, vec![3]), (3, vec![4, 5]), (6, vec![7])] {
            nodes[parent].children = children;
        }
        for (node, mesh) in [(2, 1), (5, 1), (7, 0)] {
            nodes[node].mesh = Some(mesh);
        }
        nodes[7].skin = Some(0);
        let weights = vec![0.5; targets.len()];
        let rigid = Mesh { positions: triangles(3), targets, weights, joint_sets: vec![] };
        channels.retain(|c| c.path != Path::Weights);
        if !rigid.targets.is_empty() {
            let keys: Vec<f32> = (0..3 * rigid.targets.len()).map(|i| i as f32 * 0.2).collect();
            channels.push(Channel::new(5, Path::Weights, Interpolation::Linear, &[0.0, 0.7, 1.9], &keys));
        }
        let inverse_bind = binds.into_iter().map(|b| translation(b[0], b[1], b[2])).collect();
        Model {
            nodes,
            roots: vec![0, 6],
            meshes: vec![Mesh { joint_sets, ..rigid.clone() }, rigid],
            skins: vec![Skin { joints: vec![1, 3, 4], inverse_bind }],
            animations: Some(channels).filter(|c| !c.is_empty()).into_iter().collect(),
        }
    })
}

fn random_channel() -> impl Strategy<Value = Channel> {
    let path = prop_oneof![Just(Path::Translation), Just(Path::Rotation), Just(Path::Scale)];
    let interpolation = prop_oneof![Just(Interpolation::Step), Just(Interpolation::Linear), Just(Interpolation::Cubic)];
    let gaps = prop::collection::vec(0.01_f32..1.0, 1..6);
    let values = prop::collection::vec(prop_oneof![0.1_f32..2.0, -2.0_f32..-0.1], 6 * 3 * 4);
    (0_usize..8, path, interpolation, gaps, values).prop_map(|(target, path, interpolation, gaps, values)| {
        let times: Vec<f32> = gaps
            .iter()
            .scan(0.0, |t, gap| {
                *t += gap;
                Some(*t)
            })
            .collect();
        let width = if path == Path::Rotation { 4 } else { 3 };
        let slots = if interpolation == Interpolation::Cubic { 3 * times.len() } else { times.len() };
        Channel::new(target, path, interpolation, &times, &values[..slots * width])
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn random_models_agree_with_the_reference(model in random_model(), time in -0.5_f64..6.0) {
        let scene = imported(&model);
        compare(&scene, &model, &[(0, time)]);
    }
}
