//! Renders one still of a glTF file with the library alone, and says how long tracing took.
//!
//! `cargo run --release --example still -- SCENE OUT.png [WIDTHxHEIGHT] [SAMPLES] [SHADING] [TIME] [CLIP] [REPEAT] [THREADS]`

use std::{path::Path, sync::Arc, time::Instant};

use glam::DAffine3;
use kinora::{
    anim::{ActiveClip, animation_bounds},
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy},
    geom::Forms,
    render::{CameraView, Film, RenderSettings, Renderer, Shading},
    scene::{ClipId, import},
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let arg = |i: usize, default: &str| args.get(i).cloned().unwrap_or_else(|| default.to_owned());
    let scene = Arc::new(import::from_path(Path::new(&arg(0, "scene.glb")))?);
    let size = arg(2, "1280x720");
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let (width, height): (u32, u32) = (width.parse()?, height.parse()?);
    let shading = arg(4, "direct");
    let shading = Shading::ALL.into_iter().find(|s| s.name() == shading).ok_or("unknown shading")?;
    let settings = RenderSettings { shading, samples: arg(3, "1").parse()?, ..RenderSettings::default() };
    let clip = ClipId(arg(6, "0").parse()?);
    let clips = [ActiveClip { clip, time_s: arg(5, "0").parse()? }];
    let clips = if clip.index() < scene.clips.len() { &clips[..] } else { &[] };

    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(arg(8, "2").parse()?).build()?);
    let config = FrameConfig {
        accel: "bvh2".into(),
        top: "bvh2".into(),
        policy: RebuildPolicy::Refit,
        forms: Forms::EXACT,
        pool: pool.clone(),
    };
    let mut frames = FrameLoop::new(config)?;
    frames.add(scene.clone(), DAffine3::IDENTITY);
    let (world, _) = frames.advance(&[clips])?;
    let moving: Vec<ClipId> = clips.iter().map(|c| c.clip).collect();
    let file_camera =
        CameraView::nodes(&scene).first().and_then(|&n| CameraView::at_node(&scene, world.actor_pose(0), n));
    let camera = file_camera
        .unwrap_or_else(|| CameraView::framing(animation_bounds(&scene, &moving), width as f32 / height as f32));
    let prepare = Instant::now();
    let mut renderer = Renderer::new(&[scene]);
    let prepare = prepare.elapsed();
    let mut film = Film::new(width, height);
    let mut rgba = Vec::new();
    for _ in 0..arg(7, "1").parse()? {
        let start = Instant::now();
        let rays = pool.install(|| renderer.render(&world, &camera, &settings, &mut film))?;
        let traced = start.elapsed();
        pool.install(|| film.to_srgb8(&mut rgba));
        let encoded = start.elapsed().saturating_sub(traced);
        eprintln!("prepared in {prepare:.1?}, {rays} rays in {traced:.1?}, sRGB in {encoded:.1?}");
    }
    image::save_buffer(arg(1, "still.png"), &rgba, width, height, image::ColorType::Rgba8)?;
    Ok(())
}
