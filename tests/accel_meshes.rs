//! Every structure against brute force on the shared meshes, and after long chains of refits.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "small numbers"
)]

mod common;
#[path = "common/trace.rs"]
mod trace;

use std::path::Path;

use kinora::{
    accel::{AccelKind, AccelSpec, AnyAccel, Refit},
    anim::{Pose, deform},
    geom::Ray,
    glam::{DAffine3, Vec3},
    scene::import,
    simd::SimdLevel,
};
use trace::{Mesh, Random, closest, in_packets, occluded};

/// Every triangle of a file's rest pose.
fn load(path: &Path) -> Mesh {
    let scene = import::from_path(path).expect("the shared mesh is valid");
    let mut pose = Pose::rest(&scene);
    pose.evaluate(&scene, &[], &DAffine3::IDENTITY);
    let mut mesh = Mesh::default();
    for &instance in &scene.instances {
        let part = scene.part(instance);
        let base = mesh.positions.len();
        mesh.positions.resize(base + part.positions.len(), Vec3::ZERO);
        deform(&scene, &pose, instance, &mut mesh.positions[base..]);
        mesh.indices.extend(part.triangles.iter().map(|t| t.map(|i| i + base as u32)));
    }
    mesh
}

/// Rays from around the mesh at corners, edges and faces, and from its surface in any direction.
fn rays(mesh: &Mesh, count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    let bounds = kinora::geom::Aabb::from_points(mesh.positions.iter().copied());
    let size = bounds.diagonal();
    let ray = |i: usize| {
        let [a, b, c] = mesh.corners(random.below(mesh.indices.len()));
        let target = [a, (a + b) * 0.5, (a + b + c) / 3.0][i % 3];
        let away = random.vec3();
        if i % 4 == 3 {
            Ray::new(target + away * (1e-4 * size), random.vec3())
        } else {
            Ray::new(target + away * size, -away)
        }
    };
    (0..count).map(ray).collect()
}

/// `accel` gives the answers of `list`, alone and in packets, at the best level.
fn agrees(what: &str, accel: &AnyAccel, mesh: &Mesh, rays: &[Ray]) {
    let prims = mesh.prims();
    accel.validate(&prims).unwrap_or_else(|v| panic!("{what}: {v:?}"));
    let list = AccelSpec::new(AccelKind::List).build(&prims).expect("the mesh builds");
    let level = SimdLevel::best();
    let due = closest(&list, &prims, rays, level);
    let hits = closest(accel, &prims, rays, level);
    for (i, (hit, due)) in hits.iter().zip(&due).enumerate() {
        assert_eq!(hit, due, "{what}: ray {i} {:?}", rays[i]);
    }
    let blocked: Vec<_> = due.iter().map(Option::is_some).collect();
    assert_eq!(occluded(accel, &prims, rays, level), blocked, "{what}: occlusion");
    assert_eq!(in_packets(accel, &prims, rays, level), (due, blocked), "{what}: packets");
}

/// More rays where code is compiled to be fast.
fn count(least: usize) -> usize {
    if cfg!(debug_assertions) { least } else { 8 * least }
}

#[test]
fn shared_meshes_are_answered_like_brute_force() {
    let Some(dir) = common::shared_dir() else { return };
    for (file, least) in [("dragon_res4.glb", 24), ("dragon_res3.glb", 8), ("bunny.glb", 6)] {
        let mesh = load(&dir.join("assets/meshes").join(file));
        let rays = rays(&mesh, count(least), 5);
        for &kind in AccelKind::ALL.iter().filter(|&&k| k != AccelKind::List) {
            let accel = AccelSpec::new(kind).build(&mesh.prims()).expect("the mesh builds");
            agrees(&format!("{file}, {kind}"), &accel, &mesh, &rays);
        }
    }
}

/// A closed sheet of `n` x `n` squares that folds, twists and swells with the phase, and comes back after one.
fn sheet(n: u32, phase: f32) -> Mesh {
    // A triangle wave: no system mathematics, and exactly periodic.
    let wave = |x: f32| 4.0 * (x - (x + 0.5).floor()).abs() - 1.0;
    let position = |i: u32, j: u32| {
        let (s, t) = (i as f32 / n as f32, j as f32 / n as f32);
        let fold = wave(phase + 0.25) * 2.0;
        let height = wave(s * 2.0 + phase) * wave(t * 1.5 - phase) * (1.0 + fold.abs());
        Vec3::new(s * (1.0 + fold) + t * wave(phase), t * (2.0 - fold), height)
    };
    let positions = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))).map(|(i, j)| position(i, j)).collect();
    let square = |i: u32, j: u32| {
        let a = j * (n + 1) + i;
        [[a, a + 1, a + n + 1], [a + 1, a + n + 2, a + n + 1]]
    };
    let indices = (0..n).flat_map(|j| (0..n).flat_map(move |i| square(i, j))).collect();
    Mesh { positions, indices }
}

#[test]
fn answers_stay_those_of_brute_force_over_300_frames_of_refit() {
    const FRAMES: u32 = 300;
    let start = sheet(24, 0.0);
    for &kind in AccelKind::ALL {
        let mut accel = AccelSpec::new(kind).build(&start.prims()).expect("the sheet builds");
        let mut next = accel.clone();
        for frame in 1..=FRAMES {
            let mesh = sheet(24, frame as f32 / 100.0);
            if accel.refit_into(&mut next, &mesh.prims()) == Refit::NeedsRebuild {
                break;
            }
            std::mem::swap(&mut accel, &mut next);
            accel.validate(&mesh.prims()).unwrap_or_else(|v| panic!("{kind}, frame {frame}: {v:?}"));
            if frame % 60 == 0 || frame == FRAMES - 1 {
                agrees(&format!("{kind}, frame {frame}"), &accel, &mesh, &rays(&mesh, count(20), u64::from(frame)));
            }
        }
    }
}
