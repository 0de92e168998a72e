//! A frame's parts: `frame/<scene>/<accel>/advance` (pose, deform, refit, top level) and
//! `frame/<scene>/<accel>/rays` (1280 x 720 primary rays, one a pixel, each hit followed by a shadow ray), on two
//! threads. `KINORA_BENCH_FILES` may name further files, separated by colons.
#![allow(missing_docs, reason = "a bench")]

use std::{path::Path, sync::Arc, time::Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use kinora::{
    anim::ActiveClip,
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy},
    geom::{Forms, Ray},
    glam::{DAffine3, Vec3},
    scene::{ClipId, Scene, builtin, import},
    simd::{Simd, SimdLevel, Task, dispatch},
    world::World,
};
use rayon::prelude::*;

const SIZE: (u32, u32) = (1280, 720);

/// The scenes that are there, each with the number of a clip.
fn scenes() -> Vec<(String, Scene, u32)> {
    let shared = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/assets"));
    let files = [
        ("man", "khronos/CesiumMan/glTF-Binary/CesiumMan.glb", 0),
        ("fox", "khronos/Fox/glTF-Binary/Fox.glb", 1),
        ("knight", "kaykit/Knight.glb", 72),
        ("truck", "khronos/CesiumMilkTruck/glTF-Binary/CesiumMilkTruck.glb", 0),
    ];
    let own = builtin::names().iter().filter_map(|&name| Some((name.to_owned(), builtin::load(name).ok()?, 0)));
    let shared = files
        .into_iter()
        .filter_map(|(name, file, clip)| Some((name.to_owned(), import::from_path(&shared.join(file)).ok()?, clip)));
    let more = std::env::var("KINORA_BENCH_FILES").unwrap_or_default();
    let more = more.split(':').filter_map(|file| {
        let name = Path::new(file).file_stem()?.to_str()?.to_owned();
        Some((name, import::from_path(Path::new(file)).ok()?, 0))
    });
    own.chain(shared).chain(more).collect()
}

/// Rows of a picture of the world, from the front and a little above.
struct Rows<'a> {
    world: &'a World,
    rows: std::ops::Range<u32>,
}

impl Task for Rows<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self) -> usize {
        let bounds = self.world.bounds();
        let eye = bounds.center() + Vec3::new(0.5, 0.3, 1.0).normalize() * bounds.diagonal() * 1.5;
        let forward = (bounds.center() - eye).normalize();
        let right = forward.cross(Vec3::Y).normalize();
        let up = right.cross(forward);
        let light = Vec3::new(0.3, 1.0, 0.4);
        let mut lit = 0;
        for (y, x) in self.rows.flat_map(|y| (0..SIZE.0).map(move |x| (y, x))) {
            let across = (x as f32 + 0.5 - 0.5 * SIZE.0 as f32) / SIZE.1 as f32 * 0.7;
            let along = (0.5 * SIZE.1 as f32 - y as f32 - 0.5) / SIZE.1 as f32 * 0.7;
            let ray = Ray::new(eye, forward + right * across + up * along);
            if let Some(hit) = self.world.nearest_hit::<S>(&ray) {
                let shadow = Ray { t_near: 1e-3, ..Ray::new(ray.at(hit.t), light) };
                lit += usize::from(!self.world.is_blocked::<S>(&shadow));
            }
        }
        lit
    }
}

fn trace(world: &World) -> usize {
    let bands = (0..SIZE.1 / 16).into_par_iter().map(|band| band * 16..band * 16 + 16);
    bands.map(|rows| dispatch(SimdLevel::best(), Rows { world, rows })).sum()
}

fn frames(c: &mut Criterion) {
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool"));
    for (name, scene, clip) in scenes() {
        let mut group = c.benchmark_group(format!("frame/{name}/bvh2"));
        group.sample_size(20);
        let still = scene.clips.is_empty();
        let duration = scene.clips.get(clip as usize).map_or(1.0, |clip| clip.duration_s).max(0.1);
        let config = FrameConfig {
            accel: "bvh2".into(),
            top: "bvh2".into(),
            policy: RebuildPolicy::Async,
            forms: Forms::EXACT,
            pool: pool.clone(),
        };
        let mut frames = FrameLoop::new(config).expect("known names");
        frames.add(Arc::new(scene), DAffine3::IDENTITY);
        let mut frame = 0_u32;
        let mut advance = || {
            if still {
                return frames.advance(&[]).expect("a frame").0;
            }
            frame += 1;
            let clip = [ActiveClip { clip: ClipId(clip), time_s: (f64::from(frame) / 30.0) % duration }];
            frames.advance(&[&clip]).expect("a frame").0
        };
        let began = Instant::now();
        let world = advance();
        let (triangles, groups) = (world.triangle_count(), world.group_count());
        eprintln!("{name}: {triangles} triangles, {groups} groups, first frame in {:?}", began.elapsed());
        group.bench_function("advance", |b| b.iter(&mut advance));
        group.bench_function("rays", |b| b.iter(|| pool.install(|| trace(&world))));
        group.finish();
    }
}

criterion_group!(benches, frames);
criterion_main!(benches);
