//! What the importer accepts is posed and deformed at a few times; nothing may panic.
#![no_main]

use kinora::{
    anim::{ActiveClip, Pose, classify, deform},
    glam::{DAffine3, Vec3},
    scene::{ClipId, import},
};
use libfuzzer_sys::fuzz_target;

/// Larger scenes only slow the search down.
const MAX_VERTICES: usize = 20_000;

fuzz_target!(|data: &[u8]| {
    let Ok(scene) = import::from_bytes("fuzz.glb", data, &mut |_| Ok(data.to_vec())) else { return };
    let vertices: usize = scene.instances.iter().map(|&i| scene.part(i).positions.len()).sum();
    if vertices > MAX_VERTICES {
        return;
    }
    let _ = classify(&scene);
    let mut pose = Pose::rest(&scene);
    let mut out = Vec::new();
    for time_s in [-1.0, 0.0, 0.3, 1.0e6] {
        let clips: Vec<_> =
            (0..scene.clips.len() as u32).map(|c| ActiveClip { clip: ClipId(c), time_s }).collect();
        pose.evaluate(&scene, &clips, &DAffine3::IDENTITY);
        for &instance in &scene.instances {
            out.clear();
            out.resize(scene.part(instance).positions.len(), Vec3::ZERO);
            deform(&scene, &pose, instance, &mut out);
        }
    }
});
