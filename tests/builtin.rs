//! The built-in scenes are what the generator makes, import without a word, and loop without a seam.

#[path = "../examples/make_scenes/scenes/mod.rs"]
mod scenes;

use kinora::{
    anim::{ActiveClip, Pose, deform},
    glam::{DAffine3, DVec3, Vec3},
    scene::{ClipId, NodeId, Scene, builtin},
};
use sha2::{Digest, Sha256};

fn load(name: &str) -> Scene {
    builtin::load(name).expect("built-in scenes are valid")
}

/// The pose of the scene's only clip at `time_s`.
fn pose_at(scene: &Scene, time_s: f64) -> Pose {
    let mut pose = Pose::rest(scene);
    pose.evaluate(scene, &[ActiveClip { clip: ClipId(0), time_s }], &DAffine3::IDENTITY);
    pose
}

/// World-space vertices of every part.
fn vertices(scene: &Scene, pose: &Pose) -> Vec<Vec3> {
    let mut all = Vec::new();
    for &instance in &scene.instances {
        let first = all.len();
        all.resize(first + scene.part(instance).positions.len(), Vec3::ZERO);
        deform(scene, pose, instance, &mut all[first..]);
    }
    all
}

fn node(scene: &Scene, name: &str) -> NodeId {
    let index = scene.nodes.iter().position(|n| n.name == name).expect("the node is there");
    NodeId(u32::try_from(index).expect("few nodes"))
}

#[test]
#[cfg_attr(debug_assertions, ignore = "takes a minute without optimisation; the release tests run it")]
fn committed_files_are_what_the_generator_makes() {
    for (name, made) in scenes::all() {
        let committed = builtin::bytes(name).expect("every generated scene is built in");
        assert!(made == committed, "animations/{name}.glb differs; run the make_scenes example");
    }
}

#[test]
fn sources_name_every_file_with_its_hash() {
    let sources = include_str!("../animations/SOURCES.md");
    for name in builtin::names() {
        let hash = Sha256::digest(builtin::bytes(name).expect("names are known"));
        let hash = hash.iter().fold(String::new(), |text, byte| text + &format!("{byte:02x}"));
        let row = sources.lines().find(|line| line.contains(&format!("`{name}.glb`")));
        assert!(row.is_some_and(|row| row.contains(&hash)), "{name}: no row with {hash}");
    }
}

#[test]
fn files_stay_small() {
    let sizes: Vec<usize> = builtin::names().iter().filter_map(|name| builtin::bytes(name)).map(<[u8]>::len).collect();
    assert!(sizes.iter().all(|&size| size < 2_000_000), "{sizes:?}");
    assert!(sizes.iter().sum::<usize>() < 4_500_000, "{sizes:?}");
}

#[test]
fn every_scene_imports_without_warnings() {
    for name in builtin::names() {
        let scene = load(name);
        assert_eq!(scene.file, format!("builtin:{name}"));
        assert!(scene.warnings.is_empty(), "{name}: {:?}", scene.warnings);
        assert!(scene.extensions_ignored.is_empty(), "{name}: {:?}", scene.extensions_ignored);
        assert_eq!(scene.clips.len(), 1, "{name}");
        assert!(scene.clips[0].disabled.is_none(), "{name}");
        assert_eq!(scene.clips[0].channels.len(), scene.clips[0].channel_count, "{name}");
        assert_eq!(scene.cameras.len(), 1, "{name}");
    }
}

#[test]
fn scenes_hold_what_they_are_there_to_show() {
    let part_of = |scene: &Scene, name: &str| {
        let mesh = scene.meshes.iter().find(|m| m.name == name).expect("the mesh is there");
        mesh.parts[0].clone()
    };
    let walk = load("walk");
    let figure = part_of(&walk, "figure");
    assert!((8_000..14_000).contains(&figure.triangles.len()), "{}", figure.triangles.len());
    assert_eq!(figure.influences.map(|i| i.per_vertex), Some(4));
    assert_eq!(walk.skins[0].joints.len(), 23);
    let cloth = part_of(&load("cloth"), "cloth");
    assert!(cloth.triangles.len() > 10_000 && cloth.targets.len() == 3 && cloth.influences.is_some());
    let explode = load("explode");
    assert!((20_000..80_000).contains(&part_of(&explode, "flake").triangles.len()));
    assert!(explode.skins[0].joints.len() > 1000);
    assert_eq!(load("tumble").instances.len(), 144 + 2);
}

#[test]
fn clips_end_in_the_pose_they_begin_with() {
    for name in builtin::names() {
        let scene = load(name);
        let (first, last) = (pose_at(&scene, 0.0), pose_at(&scene, scene.clips[0].duration_s));
        for (a, b) in vertices(&scene, &first).iter().zip(vertices(&scene, &last)) {
            assert!(a.distance(b) <= 1e-6, "{name}: {a} and {b}");
        }
    }
}

#[test]
fn poses_are_finite_and_stay_on_the_stage() {
    for name in builtin::names() {
        let scene = load(name);
        for step in 0..=12 {
            let pose = pose_at(&scene, scene.clips[0].duration_s * f64::from(step) / 12.0);
            for p in vertices(&scene, &pose) {
                assert!(p.is_finite() && p.length() < 5.0, "{name} at {step}/12: {p}");
            }
        }
    }
}

#[test]
fn planted_toes_move_with_the_belt() {
    let scene = load("walk");
    for (toes, strike) in [("ToesL", 0.0), ("ToesR", 0.5)] {
        let id = node(&scene, toes);
        let place = |time_s: f64| pose_at(&scene, time_s).world_from_node(id).translation;
        let at_rest = place(strike + 0.2);
        for step in 12..=56 {
            let since = f64::from(step) / 100.0;
            let on_belt = place(strike + since) + DVec3::Z * (since - 0.2);
            assert!(on_belt.distance(at_rest) < 2e-3, "{toes} {since} s after its strike: {on_belt}, not {at_rest}");
        }
    }
}

#[test]
fn no_foot_sinks_into_the_belt() {
    let scene = load("walk");
    let figure = *scene.instances.iter().find(|i| scene.meshes[i.mesh.index()].name == "figure").expect("it is there");
    let mut out = vec![Vec3::ZERO; scene.part(figure).positions.len()];
    for step in 0..60 {
        deform(&scene, &pose_at(&scene, f64::from(step) / 60.0), figure, &mut out);
        let lowest = out.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
        assert!((-0.012..0.012).contains(&lowest), "at {step}/60 s the lowest point is at {lowest}");
    }
}

#[test]
fn tumbling_solids_keep_apart_in_sight() {
    let scene = load("tumble");
    let solids: Vec<NodeId> =
        (0u32..).zip(&scene.nodes).filter(|(_, n)| n.mesh.is_some()).map(|(i, _)| NodeId(i)).collect();
    let mut least = f64::INFINITY;
    for step in 0..108 {
        let pose = pose_at(&scene, f64::from(step) * 0.05);
        let places: Vec<DVec3> = solids.iter().map(|&n| pose.world_from_node(n).translation).collect();
        let in_sight: Vec<DVec3> = places.into_iter().filter(|p| p.y > 0.03 && p.length() > 0.2).collect();
        for (i, a) in in_sight.iter().enumerate() {
            for b in &in_sight[i + 1..] {
                least = least.min(a.distance(*b));
            }
        }
    }
    // Two solids touch, at worst, when their centres are 0.14 m apart; most pairs are then still clear.
    assert!(least > 0.09, "two solids come within {least} m");
}

#[test]
fn an_unknown_name_is_answered_with_the_known_ones() {
    let message = builtin::load("nope").expect_err("there is no such scene").to_string();
    assert!(
        message.contains("builtin:nope") && builtin::names().iter().all(|name| message.contains(name)),
        "{message}"
    );
}
