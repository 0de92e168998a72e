//! Motion classes of small models.

use kinora::anim::{MotionClass, classify};
use proptest::prelude::*;

use crate::{
    HALF, IDENTITY, NO_TURN, ONE, TURNS, arm, bits, imported, influences,
    model::{Channel, Interpolation, Model, Node, Path, Placement},
    morphs, pair, posed, random_model,
};
use MotionClass::{Deforming, Rigid, Static};

fn classes(model: &Model) -> Vec<MotionClass> {
    classify(&imported(model))
}

fn linear(target: usize, path: Path, values: &[f32]) -> Channel {
    Channel::new(target, path, Interpolation::Linear, &[0.5, 2.0], values)
}

#[test]
fn undriven_parts_are_static() {
    assert_eq!(classes(&pair(vec![])), [Static]);
    assert_eq!(classes(&morphs(vec![])), [Static; 3]);
}

#[test]
fn channels_that_hold_the_rest_value_move_nothing() {
    let turn = [0.0, 0.6, 0.0, 0.8];
    assert_eq!(
        classes(&pair(vec![
            linear(0, Path::Translation, &[1.0, 2.0, 3.0, 1.0, 2.0, 3.0]),
            linear(0, Path::Rotation, &[turn, turn].concat()),
            linear(1, Path::Scale, &[1.0; 6]),
            Channel::new(
                1,
                Path::Translation,
                Interpolation::Cubic,
                &[0.0, 1.0],
                &[[0.0; 3], [0.0, 0.5, 0.0], [0.0; 3], [0.0; 3], [0.0, 0.5, 0.0], [0.0; 3]].concat()
            ),
        ])),
        [Static]
    );
}

#[test]
fn a_constant_other_than_the_rest_value_moves() {
    assert_eq!(classes(&pair(vec![linear(0, Path::Translation, &[1.0, 2.0, 4.0, 1.0, 2.0, 4.0])])), [Rigid]);
}

#[test]
fn parts_below_a_driven_node_are_rigid_and_others_static() {
    let mut model = pair(vec![linear(0, Path::Rotation, &TURNS[..2].concat())]);
    model.nodes.push(Node::at([9.0, 0.0, 0.0], NO_TURN, ONE).with_mesh(0));
    model.roots.push(2);
    assert_eq!(classes(&model), [Rigid, Static]);
}

#[test]
fn scales_that_may_vanish_or_flatten_make_a_part_deforming() {
    let scaled = |values: [f32; 6]| classes(&pair(vec![linear(1, Path::Scale, &values)]));
    assert_eq!(scaled([1.0, 1.0, 1.0, 2.0, 0.5, 3.0]), [Rigid]);
    assert_eq!(scaled([-1.0, 1.0, 1.0, -2.0, 0.5, 3.0]), [Rigid]);
    assert_eq!(scaled([1.0, 1.0, 1.0, 1.0, -1.0, 1.0]), [Deforming]);
    assert_eq!(scaled([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), [Deforming]);
    assert_eq!(scaled([1.0, 1.0, 1.0, 1e5, 1.0, 1.0]), [Deforming]);
    assert_eq!(scaled([1.0, 1.0, 1.0, 1e13, 1e13, 1e13]), [Deforming]);
    let keys: Vec<f32> = (0..18).map(|i| if i / 3 % 3 == 1 { 1.0 + i as f32 } else { 0.0 }).collect();
    let swing = Channel::new(1, Path::Scale, Interpolation::Cubic, &[0.0, 1.0], &keys);
    assert_eq!(classes(&pair(vec![swing])), [Deforming]);
}

#[test]
fn singular_matrices_and_copies_below_a_driven_node_make_a_part_deforming() {
    let mut model = pair(vec![linear(0, Path::Translation, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0])]);
    let mut flat = IDENTITY;
    flat[5] = 0.0;
    model.nodes[1].placement = Placement::Matrix(flat);
    assert_eq!(classes(&model), [Deforming]);
    model.nodes[1].placement = Placement::Matrix(IDENTITY);
    assert_eq!(classes(&model), [Rigid]);
    model.nodes[1].copies = vec![([0.0; 3], NO_TURN, ONE), ([0.0; 3], NO_TURN, [1.0, 1.0, 0.0])];
    assert_eq!(classes(&model), [Rigid, Deforming]);
}

#[test]
fn a_skin_moves_with_its_joints_and_not_with_its_node() {
    let sets = vec![influences(6, |_| ([0, 1, 0, 0], [0.5, 0.5, 0.0, 0.0]))];
    let mut model = arm(sets);
    assert_eq!(classes(&model), [Deforming]);
    model.animations[0].retain(|c| c.target == 0);
    assert_eq!(classes(&model), [Deforming]);
    model.animations = vec![vec![linear(2, Path::Translation, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0])]];
    assert_eq!(classes(&model), [Static]);
}

#[test]
fn driven_morph_weights_make_a_part_deforming() {
    let keys = [0.0, 1.0, 0.5, -0.5];
    assert_eq!(classes(&morphs(vec![linear(2, Path::Weights, &keys)])), [Static, Static, Deforming]);
    // The second node has weights of its own, which those of the mesh do not reach.
    assert_eq!(classes(&morphs(vec![linear(0, Path::MeshWeights, &keys)])), [Deforming, Static, Deforming]);
    assert_eq!(classes(&morphs(vec![linear(2, Path::Weights, &[0.25, 1.5, 0.25, 1.5])])), [Static; 3]);
}

#[test]
fn one_clip_of_several_is_enough_to_move_a_part() {
    let mut model = pair(vec![]);
    model.animations = vec![
        vec![linear(0, Path::Rotation, &[[0.0, 0.6, 0.0, 0.8]; 2].concat())],
        vec![linear(0, Path::Rotation, &[[0.0, 0.6, 0.0, 0.8], [HALF, 0.0, 0.0, HALF]].concat())],
    ];
    assert_eq!(classes(&model), [Rigid]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn static_parts_keep_their_bits(mut model in random_model(), held in 0_usize..8, time in -0.5_f64..6.0) {
        // Keep few channels, so that something is static, and add one that holds the rest value.
        model.animations[0].truncate(2);
        if let Placement::Trs(_, r, _) = model.nodes[held].placement {
            model.animations[0].retain(|c| c.target != held);
            model.animations[0].push(linear(held, Path::Rotation, &[r, r].concat()));
        }
        let scene = imported(&model);
        let (rest, then) = (posed(&scene, &[]), posed(&scene, &[(0, time)]));
        for ((class, a), b) in classify(&scene).into_iter().zip(&rest).zip(&then) {
            if class == Static {
                prop_assert_eq!(bits(a), bits(b));
            }
        }
    }
}
