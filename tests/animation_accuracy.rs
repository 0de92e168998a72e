//! How far posed vertices are off, and what time does to them: against the reference poses, against the vertices before their one
//! rounding, at a million seconds, and after ten thousand loops.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::float_cmp, reason = "small numbers")]

mod common;
#[path = "common/scenes.rs"]
#[allow(dead_code, unreachable_pub, reason = "shared with other test files")]
mod scenes;

use std::path::Path;

use glam::{DAffine3, DVec3, Vec3};
use kinora::{
    anim::{ActiveClip, Pose, deform, deform_unrounded, loop_time},
    scene::{ChannelTarget, ClipId, Interpolation, Scene, SceneNode, builtin, import},
};
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};
use proptest::prelude::*;
use scenes::{Maker, cuboid, node};
use serde_json::Value;

/// One part's vertices, as kept and before they are rounded.
type Posed = (Vec<Vec3>, Vec<DVec3>);

fn posed(scene: &Scene, clips: &[ActiveClip]) -> Vec<Posed> {
    let mut pose = Pose::rest(scene);
    pose.evaluate(scene, clips, &DAffine3::IDENTITY);
    let part = |&instance| {
        let count = scene.part(instance).positions.len();
        let (mut kept, mut wide) = (vec![Vec3::ZERO; count], vec![DVec3::ZERO; count]);
        deform(scene, &pose, instance, &mut kept);
        deform_unrounded(scene, &pose, instance, &mut wide);
        (kept, wide)
    };
    scene.instances.iter().map(part).collect()
}

/// Half the distance from the f32 nearest to `x` to the next one farther from 0.
fn half_ulp(x: f64) -> f64 {
    let near = (x as f32).abs();
    (f64::from(near.next_up()) - f64::from(near)) / 2.0
}

/// Asserts that every vertex is rounded once; the largest error in half units in the last place.
fn rounded_once(name: &str, parts: &[Posed]) -> f64 {
    let mut worst: f64 = 0.0;
    for (kept, wide) in parts.iter().flat_map(|(kept, wide)| kept.iter().zip(wide)) {
        for axis in 0..3 {
            let error = (f64::from(kept[axis]) - wide[axis]).abs();
            assert!(error <= half_ulp(wide[axis]), "{name}: {} for {}", kept[axis], wide[axis]);
            worst = worst.max(error / half_ulp(wide[axis]));
        }
    }
    worst
}

/// The reference's vertices at each time.
fn reference(file: &Path) -> (Value, Vec<DVec3>) {
    let bytes = std::fs::read(file).expect("a reference pose");
    let line = bytes.iter().position(|&b| b == b'\n').expect("a header");
    let numbers: Vec<f64> = bytes[line + 1..].as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
    (serde_json::from_slice(&bytes[..line]).expect("JSON"), numbers.chunks_exact(3).map(DVec3::from_slice).collect())
}

fn clips(scene: &Scene, animation: &Value, time_s: f64) -> Vec<ActiveClip> {
    let numbers: Vec<u32> = match animation.as_u64() {
        Some(number) => vec![number as u32],
        None if animation == "all" => (0..scene.clips.len() as u32).collect(),
        None => vec![],
    };
    numbers.into_iter().map(|clip| ActiveClip { clip: ClipId(clip), time_s }).collect()
}

/// The tolerance of the cases is 10^-5 of the diagonal, and f32 throughout stays below 4.4e-7. One rounding of exact sums is off by
/// what the reference itself loses when it is stored in f32.
#[test]
fn positions_differ_from_the_reference_by_one_rounding() {
    let Some(shared) = common::shared_dir() else { return };
    let text = std::fs::read_to_string(shared.join("reference/manifest.json")).expect("the manifest");
    let manifest: Value = serde_json::from_str(&text).expect("JSON");
    let (mut worst_kept, mut worst_wide, mut poses) = (0.0_f64, 0.0_f64, 0);
    for case in manifest["cases"].as_array().expect("cases") {
        let id = case["id"].as_str().expect("an id");
        let scene = import::from_path(&shared.join("assets").join(case["file"].as_str().expect("a file"))).expect(id);
        let (header, all) = reference(&shared.join("reference").join(case["data"].as_str().expect("a file")));
        let per_time = all.len() / header["times"].as_array().expect("times").len();
        let loss = case["rounding_to_f32"].as_f64().expect("a number");
        let (mut kept_error, mut wide_error) = (0.0_f64, 0.0_f64);
        for (number, due) in all.chunks_exact(per_time).enumerate() {
            let time_s = header["times"][number].as_f64().expect("a time");
            let parts = posed(&scene, &clips(&scene, &case["animation"], time_s));
            rounded_once(id, &parts);
            let diagonal = case["diagonal"][number].as_f64().expect("a number");
            let flat: Vec<(Vec3, DVec3)> = parts.into_iter().flat_map(|(a, b)| a.into_iter().zip(b)).collect();
            assert_eq!(flat.len(), due.len(), "{id}");
            for ((kept, wide), due) in flat.iter().zip(due) {
                kept_error = kept_error.max(kept.as_dvec3().distance(*due) / diagonal);
                wide_error = wide_error.max(wide.distance(*due) / diagonal);
            }
            poses += 1;
        }
        println!(
            "{id}: off by {kept_error:.1e} of the diagonal, {wide_error:.1e} before rounding ({loss:.1e} by rounding)"
        );
        let allowed = case["tolerance"].as_f64().expect("a number");
        assert!(kept_error <= allowed, "{id}: {kept_error:e}");
        // Beyond what readings of the specification differ by, only the rounding is left.
        if allowed <= 1e-5 {
            // Quantized numbers are rounded to f32 when they are read: 2^-24 of their size.
            assert!(
                wide_error <= 6e-8 && kept_error <= loss * 1.05 + wide_error,
                "{id}: {wide_error:e} {kept_error:e}"
            );
        }
        (worst_kept, worst_wide) = (worst_kept.max(kept_error), worst_wide.max(wide_error));
    }
    println!("worst of {poses} poses: {worst_kept:.2e} of the diagonal, {worst_wide:.2e} before rounding");
    assert!(poses > 100);
}

#[test]
fn every_vertex_of_the_built_in_scenes_is_rounded_once() {
    for name in builtin::names() {
        let scene = builtin::load(name).expect("a built-in scene");
        let mut worst: f64 = 0.0;
        for step in 0..=20 {
            let clip = ClipId(0);
            let time_s = scene.clips[0].duration_s * f64::from(step) / 20.0;
            worst = worst.max(rounded_once(name, &posed(&scene, &[ActiveClip { clip, time_s }])));
        }
        println!("{name}: off by at most {worst:.6} half units in the last place");
        assert!(worst > 0.5, "something moves");
    }
}

/// A cube whose node is moved, turned and morphed by keys around a million seconds.
fn late(times: &[f32], interpolation: Interpolation) -> Scene {
    let mut maker = Maker::default();
    let mesh = maker.mesh(cuboid(Vec3::splat(0.5)));
    let id = maker.node(None, SceneNode { mesh: Some(mesh), ..node(DVec3::ZERO) });
    let values = (0..times.len()).flat_map(|i| [i as f32 * 0.75, (i * i) as f32 * 0.25, 1.0 - i as f32]).collect();
    maker.channel(ChannelTarget::Translation(id), times, values);
    let mut scene = maker.finish();
    scene.clips[0].samplers[0].interpolation = interpolation;
    scene
}

fn place(scene: &Scene, time_s: f64) -> DVec3 {
    let (_, wide) = &posed(scene, &[ActiveClip { clip: ClipId(0), time_s }])[0];
    wide.iter().sum::<DVec3>() / wide.len() as f64
}

/// f32 keys are 1/16 s apart there; between them the time is f64, whose spacing is 1.2e-10 s.
#[test]
fn keys_near_a_million_seconds_are_met_and_passed_as_those_near_zero() {
    let start = 1_000_000.0_f32;
    let offsets = [0.0, 0.0625, 0.125, 0.3125, 1.5];
    let near = late(&offsets, Interpolation::Linear);
    let far = late(&offsets.map(|o| o + start), Interpolation::Linear);
    let mut worst: f64 = 0.0;
    for i in 0..=1600 {
        let offset = f64::from(i) / 1024.0;
        worst = worst.max(place(&near, offset).distance(place(&far, 1e6 + offset)));
    }
    println!("keys near 10^6 s: off by at most {worst:.1e} m");
    assert!(worst <= 1e-14, "binary fractions of a second are exact: {worst:e}");
    // Decimal times round to 1.2e-10 s at a million seconds; the steepest slope is 40 m/s.
    for i in 0..1000 {
        let offset = f64::from(i) * 0.0015;
        let moved = place(&near, offset).distance(place(&far, 1e6 + offset));
        assert!(moved <= 40.0 * 1.2e-10, "{offset}: {moved:e}");
    }
    let steps = late(&offsets.map(|o| o + start), Interpolation::Step);
    for (key, offset) in offsets.iter().enumerate() {
        let key_s = 1e6 + f64::from(*offset);
        assert_eq!(place(&steps, key_s).x, 0.75 * key as f64);
        assert_eq!(place(&steps, key_s.next_down()).x, 0.75 * key.saturating_sub(1) as f64);
    }
}

/// The phase by rationals.
fn exact_phase(start_s: f64, elapsed_s: f64, speed: f64, duration_s: f64) -> BigRational {
    let number = |x: f64| BigRational::from_float(x).expect("finite");
    let time = number(start_s) + number(elapsed_s) * number(speed);
    let duration = number(duration_s);
    let rounds = (&time / &duration).floor();
    time - rounds * duration
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_loop_is_within_a_microsecond_of_its_phase_after_a_million_seconds(
        start_s in 0.0_f64..10.0,
        elapsed_s in prop_oneof![9.9e5_f64..1.1e6, 0.0_f64..2e6],
        speed in prop_oneof![Just(1.0), Just(-1.0), Just(0.5), Just(2.0), -4.0_f64..4.0],
        duration_s in prop_oneof![(0.01_f32..100.0).prop_map(f64::from), Just(0.7), Just(1.25), Just(1.0 / 30.0)],
    ) {
        let phase = loop_time(start_s, elapsed_s, speed, duration_s);
        prop_assert!((0.0..duration_s).contains(&phase));
        let due = exact_phase(start_s, elapsed_s, speed, duration_s);
        let off = (BigRational::from_float(phase).expect("finite") - &due).abs();
        // Round the loop's end the phases 0 and duration are one.
        let duration = BigRational::from_float(duration_s).expect("finite");
        let off = off.clone().min((duration - off).abs());
        // A product and a sum, each rounded: two half units in the last place of 8 million.
        prop_assert!(off.is_zero() || off.to_f64().expect("a number") <= 2.0e-9, "{}", off.to_f64().unwrap_or(f64::NAN));
    }
}

#[test]
fn a_pose_is_the_same_bits_after_ten_thousand_loops() {
    for name in builtin::names() {
        let scene = builtin::load(name).expect("a built-in scene");
        let duration_s = scene.clips[0].duration_s;
        let at = |time_s| posed(&scene, &[ActiveClip { clip: ClipId(0), time_s }]);
        let bits = |parts: &[Posed]| -> Vec<[u32; 3]> {
            parts.iter().flat_map(|(kept, _)| kept.iter().map(|p| p.to_array().map(f32::to_bits))).collect()
        };
        for step in 0..4 {
            // Phases in binary fractions: a duration is f32, so whole rounds and the sum are exact.
            let phase = (duration_s * f64::from(step) / 4.0 * 1024.0).floor() / 1024.0;
            let due = bits(&at(phase));
            for loops in [1.0, 7.0, 9_999.0, 10_000.0] {
                for speed in [1.0, 0.5] {
                    let time_s = loop_time(phase, loops * duration_s / speed, speed, duration_s);
                    assert!(
                        bits(&at(time_s)) == due,
                        "{name}: {loops} loops at speed {speed} from {phase} s: {time_s}"
                    );
                }
            }
        }
    }
}

/// One pose object, evaluated through ten thousand cycles, holds nothing from one to the next.
#[test]
fn ten_thousand_cycles_leave_nothing_behind_in_a_pose() {
    let scene = scenes::figure(6);
    let clip = ClipId(0);
    let joints = |pose: &Pose| -> Vec<u64> {
        let nodes = (0..scene.nodes.len() as u32).map(kinora::scene::NodeId);
        nodes.flat_map(|n| pose.world_from_node(n).to_cols_array().map(f64::to_bits)).collect()
    };
    let mut pose = Pose::rest(&scene);
    let times = [0.0, 0.3, 0.9, 1.7];
    let due = times.map(|time_s| {
        let mut fresh = Pose::rest(&scene);
        fresh.evaluate(&scene, &[ActiveClip { clip, time_s }], &DAffine3::IDENTITY);
        joints(&fresh)
    });
    let cycles = if cfg!(debug_assertions) { 1000 } else { 10_000 };
    for cycle in 0..cycles {
        for (time_s, due) in times.iter().zip(&due) {
            pose.evaluate(&scene, &[ActiveClip { clip, time_s: *time_s }], &DAffine3::IDENTITY);
            assert!(joints(&pose) == *due, "cycle {cycle}, {time_s} s");
        }
    }
}
