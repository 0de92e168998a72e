//! Everything the window knows, without a window: what is played, what was asked of the render thread and what came
//! back.

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    PlayOptions, StartCamera,
    adapt::Adapt,
    clock::PlayClock,
    input::Drag,
    orbit::Orbit,
    playlist::Playlist,
    request::{Job, Picture, Report, Shot, StillFile, StillJob},
    script::{Script, Step},
    scrub,
    view::View,
};
use crate::{
    render::{CameraView, Shading},
    scene::{NodeId, Scene},
};

/// A moving picture should not take longer than this, whatever the frame limit.
const LONGEST_FRAME_S: f64 = 1.0 / 30.0;
/// A still scene is refined when the camera has rested this long.
const SETTLE_S: f64 = 0.2;
/// How long messages stay.
const NOTE_S: f64 = 3.0;
const ERROR_S: f64 = 12.0;

/// What the window has to do for the state.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Command {
    /// Have this picture written.
    Still(StillJob),
    /// Load this file and hand it to [`Player::opened`].
    Open(PathBuf),
    /// Close, with the reason when something failed.
    Quit(Result<(), String>),
}

/// A scene with what playing it needs.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub(super) scene: Arc<Scene>,
    pub(super) playlist: Playlist,
    pub(super) cameras: Vec<NodeId>,
    pub(super) ticks: Vec<f64>,
    pub(super) structure: usize,
}

impl Stage {
    fn new(scene: Arc<Scene>, playlist: Playlist, structure: usize) -> Self {
        let ticks = scrub::key_times(&scene, playlist.clips());
        Self { cameras: CameraView::nodes(&scene), ticks, playlist, structure, scene }
    }

    /// The view that a scene opens with: its first camera, else framed.
    fn first_view(&self) -> View {
        if self.cameras.is_empty() { View::Framed } else { View::File(0) }
    }
}

/// A line at the bottom that goes away by itself.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Message {
    pub(super) text: String,
    pub(super) is_error: bool,
    pub(super) until_s: f64,
}

/// The pointer and what it is doing.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pointer {
    /// Pixels to the right of the window's left edge.
    pub(super) x: f64,
    /// Pixels below its upper edge.
    pub(super) y: f64,
    /// True while Shift is down.
    pub(super) shift: bool,
    /// What the pressed button does.
    pub(super) drag: Option<Drag>,
    /// True when the clip goes on after the scrub bar is let go.
    pub(super) resumes: bool,
}

/// What is shown over the picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layers {
    /// Figures and scrub bar.
    pub(super) overlay: bool,
    /// The keys.
    pub(super) help: bool,
}

/// The player behind the window. `now_s` is seconds on one steady clock in every call.
#[derive(Debug)]
pub(super) struct Player {
    pub(super) stage: Stage,
    last_good: Option<Stage>,
    pub(super) clock: PlayClock,
    pub(super) view: View,
    pub(super) parked: Option<Orbit>,
    pub(super) shading: Shading,
    pub(super) structures: Vec<Arc<str>>,
    pub(super) size: (u32, u32),
    frame_s: f64,
    adapt: Adapt,
    posted: Option<Job>,
    posted_s: f64,
    is_in_flight: bool,
    pub(super) moved_s: f64,
    pub(super) picture: Option<Picture>,
    shown_s: VecDeque<f64>,
    pub(super) pointer: Pointer,
    pub(super) layers: Layers,
    message: Option<Message>,
    pub(super) script: Script,
    script_file: Option<PathBuf>,
    pub(super) commands: VecDeque<Command>,
    needs_redraw: bool,
}

impl Player {
    /// A player of `scene`, about to begin.
    pub(super) fn new(now_s: f64, scene: Arc<Scene>, options: &PlayOptions) -> Self {
        let mut structures: Vec<Arc<str>> = options.structures.iter().map(|s| s.as_str().into()).collect();
        let structure = structures.iter().position(|s| **s == *options.structure).unwrap_or_else(|| {
            structures.insert(0, options.structure.as_str().into());
            0
        });
        let playlist = Playlist::new(&scene, options.clips.as_deref());
        let stage = Stage::new(scene, playlist, structure);
        let mut clock = PlayClock::new(now_s, stage.playlist.duration_s(), options.speed);
        clock.restart(now_s, stage.playlist.duration_s());
        if let Some(at_s) = options.at_s {
            clock.hold(now_s, at_s);
        }
        let view = match options.camera {
            StartCamera::Auto => stage.first_view(),
            StartCamera::Framed => View::Framed,
            StartCamera::Node(node) => stage.cameras.iter().position(|&n| n == node).map_or(View::Framed, View::File),
        };
        Self {
            stage,
            last_good: None,
            clock,
            view,
            parked: None,
            shading: options.shading,
            structures,
            size: options.size,
            frame_s: 1.0 / options.fps_limit,
            adapt: Adapt::default(),
            posted: None,
            posted_s: f64::NEG_INFINITY,
            is_in_flight: false,
            moved_s: f64::NEG_INFINITY,
            picture: None,
            shown_s: VecDeque::new(),
            pointer: Pointer::default(),
            layers: Layers { overlay: true, help: false },
            message: None,
            script: Script::new(options.exit_after_s, options.screenshot.clone()),
            script_file: options.screenshot.clone(),
            commands: VecDeque::new(),
            needs_redraw: false,
        }
    }

    /// What should be seen now, at full size.
    pub(super) fn shot(&self, now_s: f64) -> Shot {
        Shot {
            scene: Arc::clone(&self.stage.scene),
            clips: Arc::clone(self.stage.playlist.clips()),
            time_s: self.clock.time_s(now_s),
            view: self.view.spec(&self.stage.cameras),
            shading: self.shading,
            structure: Arc::clone(&self.structures[self.stage.structure]),
            width: self.size.0,
            height: self.size.1,
        }
    }

    /// The next job for the render thread, if it is time for one.
    pub(super) fn next_job(&mut self, now_s: f64) -> Option<Job> {
        if self.size.0 == 0 || self.size.1 == 0 {
            return None;
        }
        let runs = self.clock.is_running();
        if runs && (self.is_in_flight || now_s < self.posted_s + self.frame_s) {
            return None;
        }
        let shot = self.shot(now_s);
        let moves = runs || now_s < self.moved_s + SETTLE_S;
        let job = if moves { Job::Draft(shot, self.adapt.divisor()) } else { Job::Refine(shot) };
        let is_posted = match (&self.posted, &job) {
            // What a draft taught about the divisor is for the next motion.
            (Some(Job::Draft(posted, _)), Job::Draft(shot, _)) => posted == shot,
            (posted, job) => posted.as_ref() == Some(job),
        };
        if is_posted {
            return None;
        }
        self.is_in_flight = moves;
        self.posted_s = now_s;
        self.posted = Some(job.clone());
        Some(job)
    }

    /// When to look again even if nothing happens.
    pub(super) fn wake_s(&self, now_s: f64) -> Option<f64> {
        let frame_s = (self.clock.is_running() && !self.is_in_flight).then_some(self.posted_s + self.frame_s);
        let settle_s = Some(self.moved_s + SETTLE_S).filter(|&s| s > now_s);
        let message_s = self.message.as_ref().map(|m| m.until_s);
        [frame_s, settle_s, message_s, self.script.due_s()].into_iter().flatten().reduce(f64::min)
    }

    /// Takes in what the render thread says; the memory of the picture that was shown before, to hand back.
    pub(super) fn report(&mut self, now_s: f64, report: Report) -> Option<Vec<u8>> {
        match report {
            Report::Picture(picture) => return self.show(now_s, *picture),
            Report::Failed(reason) => self.job_failed(now_s, reason),
            Report::Still(result) => self.still_done(now_s, result),
        }
        None
    }

    fn show(&mut self, now_s: f64, picture: Picture) -> Option<Vec<u8>> {
        self.is_in_flight = false;
        self.needs_redraw = true;
        if Arc::ptr_eq(&picture.shot.scene, &self.stage.scene) {
            self.last_good = Some(self.stage.clone());
        }
        let times = &picture.times;
        let is_draft = self.posted.as_ref().is_some_and(|job| matches!(job, Job::Draft(..)));
        if is_draft && picture.shot.shading == self.shading {
            let fixed_s = (times.stages.pose + times.stages.deform + times.stages.refit).as_secs_f64();
            let budget_s = self.frame_s.max(LONGEST_FRAME_S);
            self.adapt.record(picture.divisor, fixed_s, times.trace.as_secs_f64(), budget_s);
        }
        self.shown_s.push_back(now_s);
        while self.shown_s.front().is_some_and(|&first| first < now_s - 1.0) {
            self.shown_s.pop_front();
        }
        self.script.picture_shown(now_s);
        self.picture.replace(picture).map(|old| old.rgba)
    }

    fn job_failed(&mut self, now_s: f64, reason: String) {
        self.is_in_flight = false;
        let Some(good) = self.last_good.take() else {
            self.commands.push_back(Command::Quit(Err(reason)));
            return;
        };
        let same = Arc::ptr_eq(&good.scene, &self.stage.scene) && good.structure == self.stage.structure;
        if same {
            // The same scene and structure worked before: show what there is and wait for the user.
            self.clock.set_paused(now_s, true);
        } else {
            self.replace_stage(now_s, good);
        }
        self.say(now_s, reason, true);
    }

    fn still_done(&mut self, now_s: f64, result: Result<PathBuf, String>) {
        let is_script = matches!((&result, &self.script_file), (Ok(path), Some(file)) if path == file);
        match result {
            Ok(path) => {
                if is_script {
                    self.script_file = None;
                    self.script.shot_done();
                }
                self.say(now_s, format!("wrote {}", path.display()), false);
            }
            // A script has nobody to read a message.
            Err(reason) if self.script.is_shooting() => self.commands.push_back(Command::Quit(Err(reason))),
            Err(reason) => self.say(now_s, reason, true),
        }
    }

    /// Takes the scene of a dropped file, or says why there is none; what plays goes on then.
    pub(super) fn opened(&mut self, now_s: f64, file: &Path, result: Result<Arc<Scene>, String>) {
        match result {
            Ok(scene) => {
                let playlist = Playlist::new(&scene, None);
                let stage = Stage::new(Arc::clone(&scene), playlist, self.stage.structure);
                let warnings = match scene.warnings.len() {
                    0 => String::new(),
                    1 => ", 1 warning".to_owned(),
                    count => format!(", {count} warnings"),
                };
                self.say(now_s, format!("opened {}{warnings}", file.display()), false);
                self.replace_stage(now_s, stage);
            }
            Err(reason) => self.say(now_s, reason, true),
        }
    }

    fn replace_stage(&mut self, now_s: f64, stage: Stage) {
        if !Arc::ptr_eq(&stage.scene, &self.stage.scene) {
            self.view = stage.first_view();
            self.parked = None;
            self.clock.restart(now_s, stage.playlist.duration_s());
            self.clock.set_paused(now_s, false);
        }
        self.stage = stage;
        self.picture_changes(now_s);
    }

    /// Clips were exchanged: starts them and finds their key times.
    pub(super) fn clips_changed(&mut self, now_s: f64) {
        let playlist = &self.stage.playlist;
        self.stage.ticks = scrub::key_times(&self.stage.scene, playlist.clips());
        self.clock.restart(now_s, playlist.duration_s());
        self.picture_changes(now_s);
    }

    /// Frames will cost something else from now on: first a coarse one, also while paused.
    pub(super) fn picture_changes(&mut self, now_s: f64) {
        self.adapt.forget();
        self.moved_s = now_s;
    }

    /// Shows a line for a while.
    pub(super) fn say(&mut self, now_s: f64, text: String, is_error: bool) {
        let until_s = now_s + if is_error { ERROR_S } else { NOTE_S };
        self.message = Some(Message { text, is_error, until_s });
        self.needs_redraw = true;
    }

    /// The message in force.
    pub(super) fn message(&self) -> Option<&Message> {
        self.message.as_ref()
    }

    /// Does what time brings: messages go, the script goes on.
    pub(super) fn tick(&mut self, now_s: f64) {
        if self.message.as_ref().is_some_and(|m| now_s >= m.until_s) {
            self.message = None;
            self.needs_redraw = true;
        }
        match self.script.step(now_s, self.is_refined(now_s)) {
            Some(Step::Shoot(file)) => self.order_still(now_s, StillFile::Exact(file)),
            Some(Step::Quit) => self.commands.push_back(Command::Quit(Ok(()))),
            None => {}
        }
    }

    /// True when the picture shown stands still and has all its samples.
    fn is_refined(&self, now_s: f64) -> bool {
        let done = |p: &Picture| p.is_final && p.divisor == 1 && p.samples > 1 && p.shot == self.shot(now_s);
        !self.clock.is_running() && self.picture.as_ref().is_some_and(done)
    }

    /// Orders a picture of what is shown.
    pub(super) fn order_still(&mut self, now_s: f64, file: StillFile) {
        let shot = match &self.picture {
            // While it runs, the picture on the screen is what the user saw when pressing the key.
            Some(picture) if self.clock.is_running() => Shot { time_s: picture.shot.time_s, ..self.shot(now_s) },
            _ => self.shot(now_s),
        };
        self.commands.push_back(Command::Still(StillJob { shot, file }));
    }

    /// The next thing to do for the state.
    pub(super) fn next_command(&mut self) -> Option<Command> {
        self.commands.pop_front()
    }

    /// Asks for the window to be drawn anew.
    pub(super) fn touch(&mut self) {
        self.needs_redraw = true;
    }

    /// True once after something visible changed.
    pub(super) fn take_redraw(&mut self) -> bool {
        std::mem::take(&mut self.needs_redraw)
    }

    /// True when there is a picture to show.
    pub(super) fn has_picture(&self) -> bool {
        self.picture.is_some()
    }

    /// Pictures a second over the last second.
    pub(super) fn fps(&self, now_s: f64) -> f64 {
        let mut recent = self.shown_s.iter().filter(|&&s| s >= now_s - 1.0);
        let Some(first) = recent.next() else { return 0.0 };
        let (more, last) = recent.fold((0.0, first), |(count, _), last| (count + 1.0, last));
        if last > first { more / (last - first) } else { 0.0 }
    }

    /// Size of the window in pixels.
    pub(super) fn size(&self) -> (u32, u32) {
        self.size
    }

    /// The window is there, with a size that need not be the one asked for.
    pub(super) fn opened_window(&mut self, now_s: f64, width: u32, height: u32) {
        self.size = (width, height);
        self.clock.restart_wall(now_s);
    }

    /// What the window is called.
    pub(super) fn title(&self) -> String {
        format!("{} - kinora", self.stage.scene.file)
    }
}
