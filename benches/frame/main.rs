//! Whole frames without encoding: pose, deform, refit and a 1280 x 720 picture with shadows, one sample, automatic camera, all cores.
//!
//! `cargo bench --bench frame -- [SCENE]... [--threads N] [--frames N]` prints a row a scene: medians of each stage, and the median, the 99th
//! percentile and the greatest of whole frames, in milliseconds of wall time. A SCENE is a name below, a file, or `FILE#CLIP`; without any, all below.
#![allow(missing_docs, reason = "a bench")]

mod figure;

use std::{
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use kinora::{
    anim::{ActiveClip, animation_bounds},
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy, StageTimes},
    geom::Forms,
    glam::DAffine3,
    render::{CameraView, Film, RenderSettings, Renderer},
    scene::{ClipId, NodeId, Scene, builtin, import},
};

const SIZE: (u32, u32) = (1280, 720);

/// Frames a second of the clip.
const RATE: f64 = 30.0;

/// Frames that are made before the first that counts.
const WARM: u32 = 5;

type Failure = Box<dyn std::error::Error>;

fn shared(file: &str) -> String {
    format!("{}/../shared/assets/{file}", env!("CARGO_MANIFEST_DIR"))
}

/// The named scenes: built-in ones, files of the shared folder (`FILE#CLIP`) and a figure of 100,000 triangles.
fn named() -> Vec<(&'static str, String)> {
    let own = ["walk", "cloth", "explode", "tumble"].map(|name| (name, format!("builtin:{name}")));
    let others = [
        ("man", shared("khronos/CesiumMan/glTF-Binary/CesiumMan.glb")),
        ("knight", shared("kaykit/Knight.glb#Walking_A")),
        ("figure", "figure".to_owned()),
    ];
    own.into_iter().chain(others).collect()
}

fn load(source: &str) -> Result<(Scene, u32), Failure> {
    if source == "figure" {
        let file = tempfile::Builder::new().suffix(".glb").tempfile()?;
        std::fs::write(file.path(), figure::glb(100_000))?;
        return Ok((import::from_path(file.path())?, 0));
    }
    if let Some(name) = source.strip_prefix("builtin:") {
        return Ok((builtin::load(name)?, 0));
    }
    let (file, clip) = source.split_once('#').unwrap_or((source, ""));
    let scene = import::from_path(Path::new(file))?;
    let clip = if clip.is_empty() { Some(0) } else { scene.clips.iter().position(|c| c.name == clip) };
    Ok((scene, u32::try_from(clip.ok_or("there is no such clip")?)?))
}

/// Durations of one stage, in milliseconds.
#[derive(Default)]
struct Times(Vec<f64>);

impl Times {
    fn push(&mut self, time: Duration) {
        self.0.push(time.as_secs_f64() * 1e3);
    }

    /// The least that a share of all do not exceed.
    fn quantile(&self, share: f64) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let rank = (share * sorted.len() as f64).ceil().max(1.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in a list")]
        sorted.get(rank as usize - 1).copied().unwrap_or(f64::NAN)
    }
}

fn play(name: &str, source: &str, threads: usize, count: u32) -> Result<(), Failure> {
    let (scene, clip) = load(source)?;
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?);
    let duration = scene.clips.get(clip as usize).map_or(0.0, |clip| clip.duration_s);
    let triangles = scene.triangles_drawn();
    let config = FrameConfig {
        accel: "bvh8".into(),
        top: "bvh2".into(),
        policy: RebuildPolicy::Async,
        forms: Forms::EXACT,
        pool: pool.clone(),
    };
    let scene = Arc::new(scene);
    let node: Option<NodeId> = CameraView::nodes(&scene).into_iter().next();
    let clips: &[ClipId] = if duration > 0.0 { &[ClipId(clip)] } else { &[] };
    let framed = CameraView::framing(animation_bounds(&scene, clips), SIZE.0 as f32 / SIZE.1 as f32);
    let mut frames = FrameLoop::new(config)?;
    frames.add(scene.clone(), DAffine3::IDENTITY);
    let mut renderer = pool.install(|| Renderer::new(&[scene]));
    let mut film = Film::new(SIZE.0, SIZE.1);
    let mut rays = 0;
    let [mut deform, mut refit, mut trace, mut whole]: [Times; 4] = Default::default();
    for frame in 0..count + WARM {
        let time_s = if duration > 0.0 { f64::from(frame) / RATE % duration } else { 0.0 };
        let clips: &[ActiveClip] = if duration > 0.0 { &[ActiveClip { clip: ClipId(clip), time_s }] } else { &[] };
        let begun = Instant::now();
        let (world, times): (_, StageTimes) = frames.advance(&[clips])?;
        let made = Instant::now();
        let seen = node.map(|n| CameraView::at_node(world.actor_scene(0), world.actor_pose(0), n));
        let camera = seen.flatten().unwrap_or(framed);
        let settings = RenderSettings { frame: u64::from(frame), ..RenderSettings::default() };
        rays = pool.install(|| renderer.render(&world, &camera, &settings, &mut film))?;
        if frame >= WARM {
            deform.push(times.pose + times.deform);
            refit.push(times.refit + times.sort);
            trace.push(made.elapsed());
            whole.push(begun.elapsed());
        }
    }
    let [median, p99, most] = [0.5, 0.99, 1.0].map(|share| whole.quantile(share));
    println!(
        "{name:<10} {triangles:>9} {rays:>9} {:>8.2} {:>8.2} {:>8.2} | {median:>8.2} {p99:>8.2} {most:>8.2} {:>7.1}",
        deform.quantile(0.5),
        refit.quantile(0.5),
        trace.quantile(0.5),
        1e3 / median
    );
    Ok(())
}

fn main() -> Result<(), Failure> {
    let mut asked = Vec::new();
    let (mut threads, mut count) = (std::thread::available_parallelism()?.get(), 150);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--bench" => (),
            "--threads" => threads = args.next().ok_or("--threads: how many?")?.parse()?,
            "--frames" => count = args.next().ok_or("--frames: how many?")?.parse()?,
            name => asked.push(name.to_owned()),
        }
    }
    let named = named();
    let scenes: Vec<(String, String)> = if asked.is_empty() {
        named.iter().map(|(name, source)| ((*name).to_owned(), source.clone())).collect()
    } else {
        let source = |name: &String| named.iter().find(|(n, _)| n == name).map_or(name.clone(), |(_, s)| s.clone());
        asked.iter().map(|name| (name.clone(), source(name))).collect()
    };
    println!(
        "{:<10} {:>9} {:>9} {:>8} {:>8} {:>8} | {:>8} {:>8} {:>8} {:>7}   ms, {threads} threads, {count} frames",
        "scene", "triangles", "rays", "deform", "refit", "trace", "frame", "p99", "most", "1/s"
    );
    for (name, source) in scenes {
        let file = source.split('#').next().unwrap_or_default();
        if file.contains("/../shared/") && !Path::new(file).is_file() {
            println!("{name:<10} left out: {file} is not there");
            continue;
        }
        play(&name, &source, threads, count).map_err(|e| format!("{name}: {e}"))?;
    }
    Ok(())
}
