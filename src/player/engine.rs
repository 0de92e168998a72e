//! From a request to a picture: the frame loop and the renderer behind the window.

use std::{
    path::PathBuf,
    sync::{Arc, atomic::AtomicBool},
    time::Instant,
};

use glam::DAffine3;

use super::{
    adapt::traced_size,
    clock::frame_number,
    request::{FrameTimes, Picture, Shot, StillJob, ViewSpec},
    still,
    worker::Engine,
};
use crate::{
    anim::{ActiveClip, animation_bounds},
    dynamics::{FrameConfig, FrameLoop, LoopCounts, StageTimes},
    geom::Aabb,
    output::Unfinished,
    render::{CameraView, Film, RenderSettings, Renderer},
    scene::{ClipId, Scene},
    simd::SimdLevel,
    world::World,
};

/// Samples a pixel at which a picture that stands still is left alone.
const REFINED_SAMPLES: u32 = 64;
/// Samples a pixel of one refining pass: few, so that more and more of the picture is soon seen.
const PASS_SAMPLES: u32 = 2;

/// Traces on behalf of the window.
#[derive(Debug)]
pub(super) struct TraceEngine {
    config: FrameConfig,
    simd: SimdLevel,
    still_samples: u32,
    unfinished: Unfinished,
    stage: Option<Stage>,
    renderer: Renderer,
    film: Film,
    sum: Vec<[f32; 4]>,
    summed: u32,
    spent: Vec<Vec<u8>>,
}

/// A scene in a frame loop, and what was found out about it.
#[derive(Debug)]
struct Stage {
    scene: Arc<Scene>,
    structure: Arc<str>,
    frames: FrameLoop,
    clips: Vec<ActiveClip>,
    made: Option<Made>,
    framed: Option<(Arc<[ClipId]>, Aabb)>,
}

/// The last world and what it was made for.
#[derive(Clone, Debug)]
struct Made {
    clips: Arc<[ClipId]>,
    time_s: f64,
    world: Arc<World>,
}

impl Stage {
    fn new(config: &FrameConfig, shot: &Shot) -> Result<Self, String> {
        let config = FrameConfig { accel: shot.structure.to_string(), ..config.clone() };
        let mut frames = FrameLoop::new(config).map_err(|e| e.to_string())?;
        frames.add(Arc::clone(&shot.scene), DAffine3::IDENTITY);
        Ok(Self {
            scene: Arc::clone(&shot.scene),
            structure: Arc::clone(&shot.structure),
            frames,
            clips: Vec::new(),
            made: None,
            framed: None,
        })
    }

    /// The world at the shot's time; made anew only when that differs from the last.
    fn world(&mut self, shot: &Shot) -> Result<(Arc<World>, StageTimes), String> {
        if let Some(made) = &self.made
            && made.clips == shot.clips
            && made.time_s.to_bits() == shot.time_s.to_bits()
        {
            return Ok((Arc::clone(&made.world), StageTimes::default()));
        }
        // The loop reuses the last world's buffers when nobody holds it.
        self.made = None;
        self.clips.clear();
        self.clips.extend(shot.clips.iter().map(|&clip| ActiveClip { clip, time_s: shot.time_s }));
        let (world, times) = self.frames.advance(&[&self.clips]).map_err(|e| e.to_string())?;
        self.made = Some(Made { clips: Arc::clone(&shot.clips), time_s: shot.time_s, world: Arc::clone(&world) });
        Ok((world, times))
    }

    fn view(&mut self, shot: &Shot, world: &World) -> CameraView {
        match shot.view {
            ViewSpec::Fixed(view) => view,
            ViewSpec::Node(node) => {
                CameraView::at_node(&self.scene, world.actor_pose(0), node).unwrap_or_else(|| self.framed(shot))
            }
            ViewSpec::Framed => self.framed(shot),
        }
    }

    fn framed(&mut self, shot: &Shot) -> CameraView {
        let bounds = match &self.framed {
            Some((clips, bounds)) if *clips == shot.clips => *bounds,
            _ => {
                let bounds = animation_bounds(&self.scene, &shot.clips);
                self.framed = Some((Arc::clone(&shot.clips), bounds));
                bounds
            }
        };
        CameraView::framing(bounds, shot.width as f32 / shot.height as f32)
    }
}

/// One pass over the film and how long it took.
#[derive(Clone, Copy)]
struct Pass {
    times: FrameTimes,
    rays: u64,
    view: CameraView,
    bounds: Aabb,
}

impl TraceEngine {
    /// An engine that makes loops of `config` (but for the structure, which each shot names) and writes stills of
    /// `still_samples` samples a pixel.
    pub(super) fn new(config: FrameConfig, simd: SimdLevel, still_samples: u32, unfinished: Unfinished) -> Self {
        Self {
            config,
            simd,
            still_samples,
            unfinished,
            stage: None,
            renderer: Renderer::default(),
            film: Film::new(0, 0),
            sum: Vec::new(),
            summed: 0,
            spent: Vec::new(),
        }
    }

    fn stage(&mut self, shot: &Shot) -> Result<&mut Stage, String> {
        let fits = |s: &Stage| Arc::ptr_eq(&s.scene, &shot.scene) && s.structure == shot.structure;
        match self.stage.take().filter(fits) {
            Some(stage) => Ok(self.stage.insert(stage)),
            None => Ok(self.stage.insert(Stage::new(&self.config, shot)?)),
        }
    }

    /// Traces samples `first .. first + count` of a shot into the film, at the window's size over `divisor`; `None`
    /// when stopped.
    fn trace(
        &mut self,
        shot: &Shot,
        divisor: u32,
        (first, count): (u32, u32),
        stop: &AtomicBool,
    ) -> Result<Option<Pass>, String> {
        let settings = RenderSettings {
            shading: shot.shading,
            samples: count,
            first_sample: first,
            seed: 0,
            frame: frame_number(shot.time_s),
            simd: self.simd,
        };
        let pool = Arc::clone(&self.config.pool);
        let stage = self.stage(shot)?;
        let (world, stages) = stage.world(shot)?;
        let view = stage.view(shot, &world);
        let begun = Instant::now();
        let (width, height) = traced_size(shot.width, shot.height, divisor);
        self.film.resize(width, height);
        let Self { renderer, film, .. } = self;
        let rays =
            pool.install(|| renderer.render_until(&world, &view, &settings, film, stop)).map_err(|e| e.to_string())?;
        let times = FrameTimes { stages, trace: begun.elapsed() };
        Ok(rays.map(|rays| Pass { times, rays, view, bounds: world.bounds() }))
    }

    /// The film as a picture.
    fn picture(&mut self, shot: &Shot, pass: Pass, divisor: u32, samples: u32) -> Picture {
        let mut rgba = self.spent.pop().unwrap_or_default();
        let film = &self.film;
        self.config.pool.install(|| film.to_srgb8(&mut rgba));
        Picture {
            rgba,
            width: self.film.width,
            height: self.film.height,
            shot: shot.clone(),
            divisor,
            samples,
            is_final: samples >= REFINED_SAMPLES,
            times: pass.times,
            rays: pass.rays,
            counts: self.stage.as_ref().map_or_else(LoopCounts::default, |s| s.frames.counts()),
            view: pass.view,
            bounds: pass.bounds,
        }
    }

    /// Adds the film, the mean of `count` samples, to the sum and puts the mean of all of them into the film.
    fn accumulate(&mut self, count: u32) {
        if self.summed == 0 {
            self.sum.clear();
            self.sum.resize(self.film.color.len(), [0.0; 4]);
        }
        self.summed += count;
        let (weight, all) = (count as f32, self.summed as f32);
        for (sum, color) in self.sum.iter_mut().zip(&mut self.film.color) {
            for (sum, color) in sum.iter_mut().zip(color) {
                *sum += *color * weight;
                *color = *sum / all;
            }
        }
    }
}

impl Engine for TraceEngine {
    fn draft(&mut self, shot: &Shot, divisor: u32, stop: &AtomicBool) -> Result<Option<Picture>, String> {
        let pass = self.trace(shot, divisor, (0, 1), stop)?;
        Ok(pass.map(|pass| self.picture(shot, pass, divisor, 1)))
    }

    fn refine(&mut self, shot: &Shot, restart: bool, stop: &AtomicBool) -> Result<Option<Picture>, String> {
        if restart {
            self.summed = 0;
        }
        // A picture of one sample is soonest there. That sample, the pixel's centre, is none of the pattern's.
        let count = if restart { 1 } else { PASS_SAMPLES.min(REFINED_SAMPLES - self.summed) };
        let Some(pass) = self.trace(shot, 1, (self.summed, count), stop)? else { return Ok(None) };
        if restart {
            return Ok(Some(self.picture(shot, pass, 1, count)));
        }
        self.accumulate(count);
        Ok(Some(self.picture(shot, pass, 1, self.summed)))
    }

    fn still(&mut self, job: &StillJob) -> Result<PathBuf, String> {
        // A refinement goes on afterwards from its sum, which this leaves alone.
        self.trace(&job.shot, 1, (0, self.still_samples), &AtomicBool::new(false))?;
        let mut rgba = self.spent.pop().unwrap_or_default();
        let film = &self.film;
        self.config.pool.install(|| film.to_srgb8(&mut rgba));
        let written = still::write(&job.file, &rgba, self.film.width, self.film.height, &self.unfinished);
        self.spent.push(rgba);
        written
    }

    fn recycle(&mut self, rgba: Vec<u8>) {
        self.spent.push(rgba);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{dynamics::RebuildPolicy, player::request::StillFile, render::Shading, scene::import};

    /// A triangle that slides to the right within a second.
    const SCENE: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "animations": [{"samplers": [{"input": 1, "output": 2}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1, 0, 0], "max": [1, 2, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
            {"bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 8},
            {"buffer": 0, "byteOffset": 44, "byteLength": 24}],
        "buffers": [{"byteLength": 68, "uri": "data:application/octet-stream;base64,AACAvwAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAAEAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAA="}]}"#;

    static GO: AtomicBool = AtomicBool::new(false);

    fn engine() -> TraceEngine {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        let config = FrameConfig {
            accel: "list".to_owned(),
            top: "list".to_owned(),
            policy: RebuildPolicy::default(),
            forms: crate::geom::Forms::EXACT,
            pool: Arc::new(pool),
        };
        TraceEngine::new(config, SimdLevel::best(), 1, Unfinished::default())
    }

    fn shot(width: u32, height: u32) -> Shot {
        Shot {
            scene: Arc::new(import::from_bytes("a.gltf", SCENE.as_bytes(), &mut |_| Err(String::new())).unwrap()),
            clips: [ClipId(0)].into(),
            time_s: 0.3,
            view: ViewSpec::Framed,
            shading: Shading::Direct,
            structure: "bvh2".into(),
            width,
            height,
        }
    }

    #[test]
    fn refinement_ends_with_the_picture_of_all_samples_in_one_go() {
        let shot = shot(10, 8);
        let (mut engine, mut other) = (engine(), engine());
        let mut at_once = |samples| {
            let pass = other.trace(&shot, 1, (0, samples), &GO).unwrap().unwrap();
            other.picture(&shot, pass, 1, samples).rgba
        };
        let one = at_once(1);
        let mut picture = engine.refine(&shot, true, &GO).unwrap().unwrap();
        assert_eq!((picture.samples, &picture.rgba), (1, &one), "the first is that of one sample");
        let folder = tempfile::tempdir().unwrap();
        while !picture.is_final {
            if picture.samples == 32 {
                let stopped = engine.refine(&shot, false, &AtomicBool::new(true)).unwrap();
                assert!(stopped.is_none());
                let still = StillJob { shot: shot.clone(), file: StillFile::Exact(folder.path().join("a.png")) };
                engine.still(&still).unwrap();
            }
            picture = engine.refine(&shot, false, &GO).unwrap().unwrap();
        }
        assert_eq!(picture.samples, REFINED_SAMPLES);
        let expected = at_once(REFINED_SAMPLES);
        let worst = picture.rgba.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(1), "{worst:?}");
        assert_ne!(picture.rgba, one);
    }

    #[test]
    fn draft_has_the_size_of_its_divisor_and_reuses_memory() {
        let shot = shot(17, 9);
        let mut engine = engine();
        let picture = engine.draft(&shot, 2, &GO).unwrap().unwrap();
        assert_eq!((picture.width, picture.height, picture.rgba.len()), (9, 5, 4 * 9 * 5));
        let memory = picture.rgba.as_ptr();
        engine.recycle(picture.rgba);
        assert_eq!(engine.draft(&shot, 2, &GO).unwrap().unwrap().rgba.as_ptr(), memory);
    }

    #[test]
    fn structure_and_scene_may_change_and_pictures_do_not_depend_on_the_past() {
        let first = shot(8, 5);
        let mut engine = engine();
        let bvh2 = engine.draft(&first, 1, &GO).unwrap().unwrap().rgba;
        let list = engine.draft(&Shot { structure: "list".into(), ..first.clone() }, 1, &GO).unwrap().unwrap().rgba;
        assert_eq!(bvh2, list);
        let rest = engine.draft(&Shot { clips: [].into(), ..first.clone() }, 1, &GO).unwrap().unwrap().rgba;
        assert_ne!(bvh2, rest);
        assert_eq!(engine.draft(&shot(8, 5), 1, &GO).unwrap().unwrap().rgba, bvh2, "the same scene loaded again");
        let wrong = engine.draft(&Shot { structure: "no such".into(), ..first.clone() }, 1, &GO);
        assert!(wrong.is_err_and(|reason| reason.contains("no such")));
        assert_eq!(engine.draft(&first, 1, &GO).unwrap().unwrap().rgba, bvh2);
    }
}
