//! A crowd and a hail of bodies: 500 skinned characters, each on its own clip and time with cross-fades, or 10,000 rigid
//! instances of a few meshes; what each stage of a frame takes, and a picture of the last one.
//!
//! `cargo run --release --example crowd [FILE.glb] [FOLDER]`: without a file, or with `-`, the characters are those of the built-in walk;
//! `crowd.png` and `hail.png` go into the folder.

use std::{path::Path, sync::Arc, time::Duration};

use kinora::{
    anim::{ActiveClip, Fade},
    dynamics::{FrameConfig, FrameLoop, Playing, RebuildPolicy, StageTimes},
    geom::{Forms, Ray},
    glam::{DAffine3, DVec3, Vec3},
    rayon::ThreadPoolBuilder,
    render::{CameraView, Film, RenderSettings, Renderer},
    scene::{ClipId, Scene, builtin, import},
    simd::SimdLevel,
    world::World,
};

const CHARACTERS: usize = 500;
const BODIES: usize = 10_000;
const FRAMES: u32 = 60;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let character = match std::env::args().nth(1).filter(|file| file != "-") {
        Some(file) => import::from_path(Path::new(&file))?,
        None => builtin::load("walk")?,
    };
    let folder = std::env::args().nth(2);
    let picture = |name: &str| folder.as_ref().map(|folder| Path::new(folder).join(name));
    crowd(&Arc::new(character), picture("crowd.png").as_deref())?;
    hail(&Arc::new(builtin::load("tumble")?), picture("hail.png").as_deref())
}

fn frame_loop() -> Result<FrameLoop, Box<dyn std::error::Error>> {
    let pool = Arc::new(ThreadPoolBuilder::new().build()?);
    let (accel, top) = ("bvh2".into(), "bvh2".into());
    Ok(FrameLoop::new(FrameConfig { accel, top, policy: RebuildPolicy::Async, forms: Forms::EXACT, pool })?)
}

/// Place `i` of a square of `count`, `spacing` apart.
fn place(i: usize, count: usize, spacing: f64) -> DAffine3 {
    let side = (count as f64).sqrt().ceil();
    DAffine3::from_translation(DVec3::new(i as f64 % side * spacing, 0.0, (i as f64 / side).floor() * spacing))
}

/// Every character walks on its own clip and fades into another time of the next one, again and again.
fn crowd(scene: &Arc<Scene>, picture: Option<&Path>) -> Result<(), Box<dyn std::error::Error>> {
    let clips: Vec<ClipId> =
        (0..).map(ClipId).zip(&scene.clips).filter(|(_, clip)| clip.disabled.is_none()).map(|(id, _)| id).collect();
    let mut frames = frame_loop()?;
    for i in 0..CHARACTERS {
        frames.add(scene.clone(), place(i, CHARACTERS, 2.0));
    }
    let at = |clip: usize, time_s: f64| {
        let clip = clips[clip % clips.len()];
        let duration = scene.clips[clip.0 as usize].duration_s.max(1e-9);
        ActiveClip { clip, time_s: time_s % duration }
    };
    let mut times = Vec::new();
    for frame in 0..FRAMES {
        let time_s = f64::from(frame) / 30.0;
        let both: Vec<[[ActiveClip; 1]; 2]> = (0..CHARACTERS)
            .map(|i| [[at(i, time_s + i as f64 * 0.37)], [at(i + 1, time_s + i as f64 * 0.37 + 0.6)]])
            .collect();
        let playing: Vec<Playing<'_>> = (0..CHARACTERS)
            .map(|i| {
                let alpha = (time_s + i as f64 * 0.05) % 1.0;
                Playing { clips: &both[i][1], fade: Some(Fade { from: &both[i][0], alpha }) }
            })
            .collect();
        let (world, stages) = frames.advance_playing(&playing)?;
        times.push(stages);
        if frame + 1 == FRAMES {
            println!("{CHARACTERS} characters, {} triangles, {} groups", world.triangle_count(), world.group_count());
            cast(&world)?;
            paint(&world, picture)?;
        }
    }
    report(&times);
    println!("{:?}\n", frames.counts());
    Ok(())
}

/// Copies of a scene of rigid bodies, out of step, as many as make [`BODIES`] instances.
fn hail(scene: &Arc<Scene>, picture: Option<&Path>) -> Result<(), Box<dyn std::error::Error>> {
    let mut frames = frame_loop()?;
    let copies = BODIES.div_ceil(scene.instances.len());
    for i in 0..copies {
        frames.add(scene.clone(), place(i, copies, 12.0));
    }
    let mut times = Vec::new();
    for frame in 0..FRAMES {
        let duration = scene.clips[0].duration_s;
        let clips: Vec<[ActiveClip; 1]> = (0..copies)
            .map(|i| [ActiveClip { clip: ClipId(0), time_s: (f64::from(frame) / 30.0 + i as f64 * 0.61) % duration }])
            .collect();
        let clips: Vec<&[ActiveClip]> = clips.iter().map(|clip| &clip[..]).collect();
        let (world, stages) = frames.advance(&clips)?;
        times.push(stages);
        if frame + 1 == FRAMES {
            let (instances, triangles) = (world.instances().len(), world.triangle_count());
            println!("{instances} instances, {triangles} triangles, {} groups", world.group_count());
            cast(&world)?;
            paint(&world, picture)?;
        }
    }
    report(&times);
    println!("{:?}", frames.counts());
    Ok(())
}

/// A picture's rays from above: how many hit.
fn cast(world: &World) -> Result<(), Box<dyn std::error::Error>> {
    let bounds = world.bounds();
    let eye = bounds.center() + Vec3::new(0.4, 1.0, 0.6) * bounds.diagonal();
    let ray = |i: u16| {
        let at = Vec3::new(f32::from(i % 128) / 127.0, 0.2, f32::from(i / 128) / 127.0);
        Ray::new(eye, bounds.min + bounds.extent() * at - eye)
    };
    let rays: Vec<Ray> = (0..128 * 128).map(ray).collect();
    let mut hits = vec![None; rays.len()];
    let began = std::time::Instant::now();
    world.hit_all(&rays, SimdLevel::best(), &mut hits)?;
    let rate = rays.len() as f64 / began.elapsed().as_secs_f64() / 1e6;
    println!("{} of {} rays hit, {rate:.2} Mrays/s by one thread", hits.iter().flatten().count(), rays.len());
    Ok(())
}

/// The whole of a world, into a file if there is one to be.
fn paint(world: &World, file: Option<&Path>) -> Result<(), Box<dyn std::error::Error>> {
    let Some(file) = file else { return Ok(()) };
    let (width, height) = (1280, 720);
    let back = Vec3::new(0.3, 0.35, 0.8);
    let camera = CameraView::framing_from(world.bounds(), width as f32 / height as f32, back);
    let (mut renderer, mut film, mut rgba) = (Renderer::default(), Film::new(width, height), Vec::new());
    let settings = RenderSettings::default();
    // The first one prepares textures.
    renderer.render(world, &camera, &settings, &mut film)?;
    let began = std::time::Instant::now();
    let rays = renderer.render(world, &camera, &settings, &mut film)?;
    println!("{rays} rays of a picture of {width} x {height} in {:.1?}", began.elapsed());
    film.to_srgb8(&mut rgba);
    image::save_buffer(file, &rgba, width, height, image::ColorType::Rgba8)?;
    Ok(())
}

fn report(times: &[StageTimes]) {
    let median = |of: fn(&StageTimes) -> Duration| {
        let mut all: Vec<f64> = times.iter().skip(1).map(|t| of(t).as_secs_f64() * 1e3).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    println!(
        "pose {:.2} ms, deform {:.2} ms, refit {:.2} ms, of which sort {:.2} ms (medians of {} frames)",
        median(|t| t.pose),
        median(|t| t.deform),
        median(|t| t.refit),
        median(|t| t.sort),
        times.len() - 1,
    );
}
