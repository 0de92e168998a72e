//! `kinora collide`: steps an animation and prints contact events, one JSON object a line.

mod between;
mod line;
mod pairs;

use std::sync::Arc;

use clap::{ArgAction, Args, builder::TypedValueParser};
use kinora::{
    accel::Precision,
    collide::{
        CollideError, CollisionConfig, CollisionWorld, ContactEvent, ContactLevel, ContactOptions, ContactPhase,
        ContactTracker, Continuous, PartId, Snapshot, TrianglePair,
    },
    glam::DAffine3,
    output::{Fps, FrameList, Unfinished},
    scene::{ClipId, Scene},
};

use super::{
    error::CliError,
    scene::{self, ANIMATION_HELP, SCENE_HELP},
    settings::Settings,
    signals::Signals,
    stdout, values,
};
use between::Between;
use line::Line;
use pairs::Pairs;

/// Arguments of `collide`.
#[derive(Debug, Args)]
pub(crate) struct CollideArgs {
    #[arg(value_name = "SCENE", help = SCENE_HELP)]
    scene: Option<String>,
    #[arg(long, value_name = "INDEX|NAME|all|none", help = ANIMATION_HELP)]
    animation: Option<String>,
    /// Frames, in commas: A, A..=B, A-B, A..B (without B), A-BxSTEP [default: the whole animation]
    #[arg(long, value_name = "LIST", value_parser = frames, allow_hyphen_values = true)]
    frames: Option<FrameList>,
    /// Frames a second; frame k is the moment k/fps seconds. A number or a fraction such as 30000/1001
    #[arg(long, value_name = "N", default_value_t = Fps::DEFAULT, allow_hyphen_values = true)]
    fps: Fps,
    /// Also contacts within each deforming part; triangles that share a vertex, or vertices at one place of the rest pose, are left out
    #[arg(long = "self")]
    within: bool,
    /// Only contacts between what is at or below node A and what is at or below node B; may be given several times
    #[arg(long, value_name = "A,B", action = ArgAction::Append)]
    pairs: Vec<String>,
    /// What begins, persists and ends: contacts of parts or of single triangles
    #[arg(long, value_name = "LEVEL", default_value = "part", value_parser = level())]
    level: ContactLevel,
    /// Also contacts between frames, vertices moving along straight lines: none is missed, and `toi_s` is never late
    #[arg(long)]
    continuous: bool,
    /// How far apart beyond --min-separation, in the scene's units, may still be reported as touching between frames: what it takes to miss nothing
    #[arg(long, value_name = "LENGTH", default_value_t = Continuous::default().tolerance, requires = "continuous")]
    tolerance: f64,
    /// Distance, in the scene's units, up to which things count as touching between frames
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0, requires = "continuous")]
    min_separation: f64,
}

fn frames(text: &str) -> Result<FrameList, String> {
    text.parse()
}

fn level() -> impl TypedValueParser<Value = ContactLevel> {
    values::named([("part", ContactLevel::Part), ("triangle", ContactLevel::Triangle)])
}

impl From<CollideError> for CliError {
    fn from(error: CollideError) -> Self {
        match error {
            CollideError::Build(error) => error.into(),
            _ => Self::failed(error.to_string()),
        }
    }
}

/// Prints the events.
///
/// # Errors
/// A usage error for wrong options or an unreadable scene; a failure when a pose is beyond f32 or stdout cannot be written; the signal that came.
pub(crate) fn run(args: &CollideArgs, settings: &Settings) -> Result<(), CliError> {
    if settings.precision == Precision::Fast {
        return Err(CliError::usage("--precision fast: collisions are exact"));
    }
    for (option, value) in [("--tolerance", args.tolerance), ("--min-separation", args.min_separation)] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(CliError::usage(format!("{option} {value}: expected a length of 0 or more")));
        }
    }
    let signals = Signals::watch(&Unfinished::default())?;
    let scene = Arc::new(scene::load(args.scene.as_deref(), settings)?);
    let clips = scene::select_clips(&scene, args.animation.as_deref())?;
    let list = match &args.frames {
        Some(list) => list.clone(),
        None => FrameList::whole(scene::duration(&scene, &clips), args.fps).map_err(CliError::usage)?,
    };
    let pairs = Pairs::new(&args.pairs, &scene)?;
    settings.pool.install(|| Steps::new(args, settings, scene, clips, pairs)?.run(list.frames(), &signals))
}

/// Frame after frame.
struct Steps<'a> {
    args: &'a CollideArgs,
    scene: Arc<Scene>,
    clips: Vec<ClipId>,
    pairs: Pairs,
    world: CollisionWorld,
    tracker: ContactTracker,
}

impl<'a> Steps<'a> {
    fn new(
        args: &'a CollideArgs,
        settings: &Settings,
        scene: Arc<Scene>,
        clips: Vec<ClipId>,
        pairs: Pairs,
    ) -> Result<Self, CliError> {
        let (accel, top) = (settings.accel.clone(), settings.top.clone());
        let mut world = CollisionWorld::new(&CollisionConfig { accel, top, rays: false, contacts: true })?;
        world.add_scene(scene.clone(), DAffine3::IDENTITY)?;
        Ok(Self { args, scene, clips, pairs, world, tracker: ContactTracker::new(args.level) })
    }

    fn run(&mut self, frames: &[u64], signals: &Signals) -> Result<(), CliError> {
        let mut last: Option<Step> = None;
        for &frame in frames {
            signals.check()?;
            let step = self.step(frame, last.as_ref())?;
            last = Some(step);
        }
        Ok(())
    }

    /// Poses a frame and prints its events.
    fn step(&mut self, frame: u64, last: Option<&Step>) -> Result<Step, CliError> {
        let time_s = self.args.fps.time_s(frame);
        let object = kinora::collide::ObjectId(0);
        self.world.set_time(object, &scene::at_time(&self.clips, time_s))?;
        let snapshot = self.world.snapshot()?;
        let paths: Vec<_> = snapshot.parts().map(|part| (part.path(), part.mesh_part(), part.copy())).collect();
        let accept = |a: PartId, b: PartId| {
            let node = |part: PartId| self.scene.instances[part.index()].node;
            self.pairs.accept(node(a), node(b))
        };
        let options = ContactOptions { within: self.args.within, accept: Some(&accept), ..ContactOptions::default() };
        let mut contacts = snapshot.contacts(&options)?;
        let met = contacts.iter().map(|c| c.pair).collect();
        let between = if self.args.continuous {
            let settings = Continuous {
                tolerance: self.args.tolerance,
                min_separation: self.args.min_separation,
                ..Continuous::default()
            };
            Some(Between::new(last, &snapshot, time_s, &options, &settings, self.args.level, &mut contacts)?)
        } else {
            None
        };
        let events = self.tracker.update(&contacts);
        let mut text = Vec::new();
        for event in &events {
            let toi_s = between.as_ref().map(|b| b.toi_s(event));
            Line { frame, time_s, event, paths: &paths, toi_s }.write(&mut text)?;
        }
        stdout::write(&text)?;
        Ok(Step { snapshot, time_s, met })
    }
}

/// What the next frame needs of this one.
struct Step {
    snapshot: Snapshot,
    time_s: f64,
    /// What met in it.
    met: Vec<TrianglePair>,
}

/// Whether an event is the end of a contact.
fn is_end(event: &ContactEvent) -> bool {
    event.phase == ContactPhase::End
}
