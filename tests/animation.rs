//! Posing real files: the program against the reference positions, and worlds against the program.
#![cfg(feature = "cli")]

mod common;

use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::Arc,
};

use common::shared_dir;
use glam::DAffine3;
use kinora::{
    anim::{ActiveClip, MotionClass, animation_bounds, classify},
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy},
    geom::{Forms, InstanceId},
    scene::{ClipId, Scene, import},
};

const KINORA: &str = env!("CARGO_BIN_EXE_kinora");

fn asset(file: &str) -> Option<PathBuf> {
    shared_dir().map(|dir| dir.join("assets").join(file))
}

/// Writes a pose file and gives its header line and its numbers.
fn pose_file(file: &Path, args: &[&str]) -> (serde_json::Value, Vec<f64>) {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.pos");
    let run = Command::new(KINORA).arg("pose").arg(file).args(args).arg("--output").arg(&output).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    assert!(run.stdout.is_empty());
    let bytes = std::fs::read(&output).unwrap();
    let line = bytes.iter().position(|&b| b == b'\n').unwrap();
    let numbers = bytes[line + 1..].as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
    (serde_json::from_slice(&bytes[..line]).unwrap(), numbers)
}

#[test]
fn every_reference_pose_is_reproduced_to_a_millionth_of_the_diagonal() {
    let Some(shared) = shared_dir() else { return };
    let command = format!("{KINORA} pose {{file}} --animation {{animation}} --time {{time}} --output {{out}}");
    let script = shared.join("reference/check_pose.py");
    let run = Command::new("python3").arg(script).args(["--limit", "1e-6", "--run", &command]).output();
    let run = match run {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            assert!(std::env::var_os("KINORA_REQUIRE_SHARED").is_none(), "python3 is not there");
            println!("skipped: python3 is not there");
            return;
        }
        run => run.unwrap(),
    };
    let text = String::from_utf8_lossy(&run.stdout);
    let bad: Vec<_> = text.lines().filter(|l| !l.ends_with(" ok")).collect();
    assert!(run.status.success(), "{}", bad.join("\n"));
    assert!(text.contains("38 cases checked, 0 with failures"), "{text}");
}

#[test]
fn pose_files_hold_the_very_vertices_of_the_world() {
    for (file, clip, time) in [
        ("khronos/CesiumMan/glTF-Binary/CesiumMan.glb", 0, "0.773496"),
        ("khronos/AnimatedMorphCube/glTF-Binary/AnimatedMorphCube.glb", 0, "2.851378"),
        ("khronos/CesiumMilkTruck/glTF-Binary/CesiumMilkTruck.glb", 0, "0.642625"),
        ("khronos/SimpleInstancing/glTF-Binary/SimpleInstancing.glb", u32::MAX, "0"),
    ] {
        let Some(path) = asset(file) else { return };
        let scene = Arc::new(import::from_path(&path).unwrap());
        let name = if clip == u32::MAX { "none".to_owned() } else { clip.to_string() };
        let (header, numbers) = pose_file(&path, &["--animation", &name, "--time", time]);
        let active = ActiveClip { clip: ClipId(clip), time_s: time.parse().unwrap() };
        let clips = if clip == u32::MAX { &[][..] } else { std::slice::from_ref(&active) };
        let world = frame(&scene, clips);
        let mut at = 0;
        for (i, part) in (0..).zip(header["primitives"].as_array().unwrap()) {
            let instance = world.instances()[i as usize].part;
            assert_eq!(part["node"], instance.node.0);
            assert_eq!(part.get("instance").and_then(serde_json::Value::as_u64), instance.copy.map(u64::from));
            for v in world.positions(InstanceId(i)) {
                let written = &numbers[at..at + 3];
                assert_eq!(v.to_array().map(|x| f64::from(x).to_bits()), [0, 1, 2].map(|k| written[k].to_bits()));
                at += 3;
            }
        }
        assert_eq!(at, numbers.len(), "{file}");
    }
}

fn frame(scene: &Arc<Scene>, clips: &[ActiveClip]) -> Arc<kinora::world::World> {
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap());
    let config = FrameConfig {
        accel: "list".to_owned(),
        top: "list".to_owned(),
        policy: RebuildPolicy::Refit,
        forms: Forms::EXACT,
        pool,
    };
    let mut frames = FrameLoop::new(config).unwrap();
    frames.add(Arc::clone(scene), DAffine3::IDENTITY);
    // A frame before, so that the second one's vertices come through the reused buffers.
    frames.advance(&[&[]]).unwrap();
    frames.advance(&[clips]).unwrap().0
}

#[test]
fn pose_file_headers_say_what_was_posed() {
    let Some(path) = asset("khronos/InterpolationTest/glTF-Binary/InterpolationTest.glb") else { return };
    for (args, animation) in [
        (&["--animation", "all", "--time", "0.5"][..], serde_json::json!("all")),
        (&["--animation", "none", "--time", "0.5"], serde_json::json!("none")),
        (&["--animation", "3", "--time", "0.5"], serde_json::json!(3)),
        (&["--time", "0.5"], serde_json::json!(0)),
    ] {
        let (header, numbers) = pose_file(&path, args);
        assert_eq!(header["format"], "gltf-worldpos-1");
        assert_eq!(header["source"], "InterpolationTest.glb");
        assert_eq!(header["dtype"], "<f8");
        assert_eq!(header["animation"], animation);
        assert_eq!(header["times"], serde_json::json!([0.5]));
        let parts = header["primitives"].as_array().unwrap();
        assert_eq!(parts.len(), 10);
        assert_eq!(parts.iter().map(|p| 3 * p["count"].as_u64().unwrap()).sum::<u64>(), numbers.len() as u64);
    }
}

#[test]
fn an_animation_given_by_name_is_the_one_with_its_index() {
    let Some(path) = asset("khronos/Fox/glTF-Binary/Fox.glb") else { return };
    let (by_name, a) = pose_file(&path, &["--animation", "Walk", "--time", "0.3"]);
    let (by_index, b) = pose_file(&path, &["--animation", "1", "--time", "0.3"]);
    assert_eq!((by_name, a), (by_index, b));
}

#[test]
fn wrong_arguments_and_unwritable_outputs_end_in_their_exit_codes() {
    let Some(path) = asset("khronos/Fox/glTF-Binary/Fox.glb") else { return };
    let code = |args: &[&str]| Command::new(KINORA).arg("pose").arg(&path).args(args).output().unwrap().status.code();
    let folder = tempfile::tempdir().unwrap();
    let good = folder.path().join("a.pos");
    let good = good.to_str().unwrap();
    assert_eq!(code(&["--animation", "Jump", "--output", good]), Some(2));
    assert_eq!(code(&["--time", "nan", "--output", good]), Some(2));
    assert_eq!(code(&["--time", "inf", "--output", good]), Some(2));
    assert!(!Path::new(good).exists());
    assert_eq!(code(&["--output", folder.path().to_str().unwrap()]), Some(1));
    assert_eq!(code(&["--time", "-1", "--output", good]), Some(0));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn animation_bounds_hold_every_frame_and_little_more() {
    for (file, clip) in [
        ("khronos/CesiumMan/glTF-Binary/CesiumMan.glb", 0),
        ("khronos/Fox/glTF-Binary/Fox.glb", 2),
        ("khronos/BoxAnimated/glTF-Binary/BoxAnimated.glb", 0),
    ] {
        let Some(path) = asset(file) else { return };
        let scene = Arc::new(import::from_path(&path).unwrap());
        let bounds = animation_bounds(&scene, &[ClipId(clip)]);
        let duration = scene.clips[clip as usize].duration_s;
        let mut seen = kinora::geom::Aabb::EMPTY;
        for k in 0..=50 {
            let active = ActiveClip { clip: ClipId(clip), time_s: duration * f64::from(k) / 50.0 };
            seen = seen.union(frame_bounds(&scene, active));
        }
        let slack = bounds.diagonal() * 0.01;
        assert!((seen.min - bounds.min).abs().max_element() < slack, "{file}: {seen:?} {bounds:?}");
        assert!((seen.max - bounds.max).abs().max_element() < slack, "{file}: {seen:?} {bounds:?}");
    }
}

fn frame_bounds(scene: &Scene, active: ActiveClip) -> kinora::geom::Aabb {
    let mut pose = kinora::anim::Pose::rest(scene);
    pose.evaluate(scene, &[active], &DAffine3::IDENTITY);
    scene.instances.iter().fold(kinora::geom::Aabb::EMPTY, |aabb, &instance| {
        let mut out = vec![glam::Vec3::ZERO; scene.part(instance).positions.len()];
        kinora::anim::deform(scene, &pose, instance, &mut out);
        out.into_iter().fold(aabb, kinora::geom::Aabb::grown)
    })
}

#[test]
fn parts_of_real_files_are_classed_by_what_their_clips_drive() {
    use MotionClass::{Deforming, Rigid, Static};
    for (file, expected) in [
        ("khronos/CesiumMan/glTF-Binary/CesiumMan.glb", &[Deforming][..]),
        ("khronos/CesiumMilkTruck/glTF-Binary/CesiumMilkTruck.glb", &[Rigid, Rigid, Static, Static, Static]),
        ("khronos/AnimatedMorphCube/glTF-Binary/AnimatedMorphCube.glb", &[Deforming]),
        ("khronos/Duck/glTF-Binary/Duck.glb", &[Static]),
    ] {
        let Some(path) = asset(file).filter(|p| p.exists()) else { continue };
        let mut classes = classify(&import::from_path(&path).unwrap());
        classes.sort_unstable();
        let mut expected = expected.to_vec();
        expected.sort_unstable();
        assert_eq!(classes, expected, "{file}");
    }
}
