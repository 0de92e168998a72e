//! What is played: actors on their clips, frame by frame.

use std::{path::Path, sync::Arc};

use super::made;
use crate::{
    anim::ActiveClip,
    dynamics::{FrameConfig, FrameError, FrameLoop, RebuildPolicy},
    geom::{Aabb, Forms},
    glam::{DAffine3, DVec3, Vec3},
    report::ReportError,
    scene::{ClipId, Scene, builtin},
};

/// Frames a second of the clips of scenes.
const FPS: f64 = 60.0;

/// Rigid bodies of the largest hail.
const BODIES: usize = 10_000;

/// Frames that the keys of a sequence become.
const FRAMES: u32 = 300;

/// A scene at a place, on a clip.
#[derive(Clone, Debug)]
struct Actor {
    scene: Arc<Scene>,
    place: DAffine3,
    clip: Option<usize>,
    /// Where in the clip it begins, in seconds.
    begin_s: f64,
    /// Seconds of the clip that a frame takes.
    step_s: f64,
}

/// Actors and how many frames they play.
#[derive(Clone, Debug)]
pub struct Play {
    /// Its name in the rows.
    pub name: String,
    /// Frames played.
    pub frames: u32,
    actors: Vec<Actor>,
}

impl Play {
    /// A scene's first clip at 60 frames a second, from its beginning, again and again.
    pub fn scene(name: impl Into<String>, scene: Arc<Scene>) -> Self {
        let clip = first_clip(&scene);
        let actor = Actor { scene, place: DAffine3::IDENTITY, clip, begin_s: 0.0, step_s: 1.0 / FPS };
        Self { name: name.into(), frames: FRAMES, actors: vec![actor] }
    }

    /// Triangles whose vertices are known at equally spaced times: 300 frames in straight lines between them.
    ///
    /// # Errors
    /// When there are no positions, not equally many at all times, or an index out of range.
    pub fn sequence(
        name: impl Into<String>,
        positions: &[Vec<Vec3>],
        indices: Vec<[u32; 3]>,
    ) -> Result<Self, ReportError> {
        let name = name.into();
        let scene = made::sequence(&name, positions, indices)?;
        let step_s = (positions.len() - 1) as f64 / f64::from(FRAMES - 1);
        let actor =
            Actor { clip: first_clip(&scene), scene: Arc::new(scene), place: DAffine3::IDENTITY, begin_s: 0.0, step_s };
        Ok(Self { name, frames: FRAMES, actors: vec![actor] })
    }

    /// `count` copies of a scene in rows, each at another time of one of its clips.
    pub fn crowd(name: impl Into<String>, scene: &Arc<Scene>, count: usize) -> Self {
        let clips: Vec<usize> = (0..scene.clips.len()).filter(|&i| scene.clips[i].disabled.is_none()).collect();
        let spacing = 1.1 * spread(scene);
        let columns = libm::ceil((count as f64).sqrt()).max(1.0);
        let actor = |i: usize| {
            let clip = (!clips.is_empty()).then(|| clips[i % clips.len()]);
            let duration = clip.map_or(0.0, |c| scene.clips[c].duration_s);
            let (row, column) = (libm::floor(i as f64 / columns), i as f64 % columns);
            Actor {
                scene: scene.clone(),
                place: DAffine3::from_translation(DVec3::new(column * spacing, 0.0, row * spacing)),
                clip,
                begin_s: duration * (i as f64 * 0.618_034 % 1.0),
                step_s: 1.0 / FPS,
            }
        };
        Self { name: name.into(), frames: FRAMES / 5, actors: (0..count).map(actor).collect() }
    }

    /// What is played when nothing is asked for: the built-in scenes, a crowd, and of the assets beside the checkout those that are there.
    ///
    /// # Errors
    /// When a scene does not load.
    pub fn defaults(quick: bool) -> Result<Vec<Self>, ReportError> {
        let mut plays = vec![];
        if quick {
            plays.push(Self::scene("builtin:walk", Arc::new(builtin::load("walk")?)).shortened(20));
            plays.push(Self::scene("burst", Arc::new(made::burst(20_000))).shortened(60));
            plays.push(Self::crowd("crowd of 50", &Arc::new(made::reed(24)), 50).shortened(10));
            return Ok(plays);
        }
        for name in builtin::names() {
            plays.push(Self::scene(format!("builtin:{name}"), Arc::new(builtin::load(name)?)));
        }
        plays.push(Self::scene("burst", Arc::new(made::burst(200_000))));
        plays.push(Self::crowd("crowd of 500", &Arc::new(made::reed(48)), 500));
        let bodies = Arc::new(builtin::load("tumble")?);
        let copies = BODIES.div_ceil(bodies.instances.len());
        plays.push(Self::crowd("10,000 rigid bodies", &bodies, copies));
        let shared = |path: &str| Path::new("../shared/assets").join(path);
        let man = shared("khronos/CesiumMan/glTF-Binary/CesiumMan.glb");
        for (name, path) in [("CesiumMan", man), ("Knight", shared("kaykit/Knight.glb"))] {
            if path.is_file() {
                plays.push(Self::scene(name, Arc::new(crate::scene::import::from_path(&path)?)));
            }
        }
        Ok(plays)
    }

    /// The same with at most so many frames; they take as much of the clips together.
    #[must_use]
    pub fn shortened(mut self, frames: u32) -> Self {
        let frames = frames.clamp(1, self.frames);
        for actor in &mut self.actors {
            actor.step_s *= f64::from(self.frames) / f64::from(frames);
        }
        Self { frames, ..self }
    }

    /// Triangles of all actors.
    pub fn triangles(&self) -> usize {
        self.actors.iter().map(|a| a.scene.triangles_drawn()).sum()
    }

    /// A loop that holds the actors.
    pub(super) fn begin(&self, config: FrameConfig) -> Result<FrameLoop, FrameError> {
        let mut frames = FrameLoop::new(config)?;
        for actor in &self.actors {
            frames.add(actor.scene.clone(), actor.place);
        }
        Ok(frames)
    }

    /// Each actor's clip at a frame.
    pub(super) fn clips(&self, frame: u32) -> Vec<Option<ActiveClip>> {
        let at = |actor: &Actor| {
            let clip = actor.clip?;
            let duration = actor.scene.clips[clip].duration_s;
            let time_s = actor.begin_s + f64::from(frame) * actor.step_s;
            // The last frame of a sequence is its last key, not its first again.
            let time_s = if time_s > duration * 1.000_001 && duration > 0.0 { time_s % duration } else { time_s };
            Some(ActiveClip { clip: ClipId(u32::try_from(clip).unwrap_or(u32::MAX)), time_s })
        };
        self.actors.iter().map(at).collect()
    }

    /// The box around all that the actors reach, as far as a few frames tell.
    pub(super) fn reach(&self, config: &FrameConfig) -> Result<Aabb, FrameError> {
        let mut config = FrameConfig { policy: RebuildPolicy::Refit, forms: Forms::EXACT, ..config.clone() };
        "bvh2".clone_into(&mut config.accel);
        let mut frames = self.begin(config)?;
        let mut all = Aabb::EMPTY;
        for frame in [0, 1, 2, 3, 4].map(|i| i * (self.frames - 1) / 4) {
            let clips = self.clips(frame);
            let clips: Vec<&[ActiveClip]> = clips.iter().map(Option::as_slice).collect();
            all = all.union(frames.advance(&clips)?.0.bounds());
        }
        Ok(all)
    }
}

/// The first clip that can be played.
fn first_clip(scene: &Scene) -> Option<usize> {
    scene.clips.iter().position(|c| c.disabled.is_none())
}

/// How wide a scene stands, in its rest pose.
fn spread(scene: &Scene) -> f64 {
    let (positions, _) = crate::report::subject::posed_at(scene, None);
    let extent = Aabb::from_points(positions.into_iter().filter(|p| p.is_finite())).extent();
    f64::from(extent.x.max(extent.z).max(0.5 * extent.y)).max(1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sequence_ends_on_its_last_key_and_a_crowd_is_out_of_step() {
        let keys = [0.0, 1.0, 4.0].map(|x| vec![Vec3::new(x, 0.0, 0.0), Vec3::Y, Vec3::Z]).to_vec();
        let play = Play::sequence("s", &keys, vec![[0, 1, 2]]).unwrap();
        let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap());
        let config = FrameConfig {
            accel: "list".into(),
            top: "list".into(),
            policy: RebuildPolicy::Refit,
            forms: Forms::EXACT,
            pool,
        };
        let mut frames = play.begin(config).unwrap();
        let mut at = |frame| {
            let clips = play.clips(frame);
            let clips: Vec<_> = clips.iter().map(Option::as_slice).collect();
            frames.advance(&clips).unwrap().0.bounds().max.x
        };
        assert_eq!((at(0), at(299)), (0.0, 4.0));
        assert!((at(224) - 2.5).abs() < 0.02, "halfway from the second key to the third");
        let crowd = Play::crowd("c", &Arc::new(made::reed(8)), 9);
        let times: Vec<f64> = crowd.clips(0).iter().map(|c| c.unwrap().time_s).collect();
        assert!(times.windows(2).all(|t| (t[0] - t[1]).abs() > 1e-3));
        assert_eq!(crowd.triangles(), 9 * made::reed(8).triangles_drawn());
    }
}
