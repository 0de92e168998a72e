//! What the user does to the [`Player`].

use super::{
    input::{Action, Button, Drag, Input},
    request::StillFile,
    scrub::ScrubBar,
    state::{Command, Player},
    view::View,
};
use crate::render::Shading;

/// Wheel pixels are reported as notches by the window; this many lines make one.
const LARGEST_TURN: f64 = 2.0;

impl Player {
    /// Takes in what the window reports.
    pub(super) fn handle(&mut self, now_s: f64, input: Input) {
        match input {
            Input::Key(key) => {
                if let Some(action) = key.action() {
                    self.act(now_s, action);
                }
            }
            Input::Shift(down) => self.pointer.shift = down,
            Input::Pointer { x, y } => self.pointer_moved(now_s, x, y),
            Input::Button(button, true) => self.begin_drag(now_s, button),
            Input::Button(_, false) => self.end_drag(now_s),
            Input::Wheel(notches) => self.move_camera(now_s, |orbit| orbit.zoom(notches)),
            Input::Resized(width, height) => {
                self.size = (width, height);
                self.moved_s = now_s;
                self.touch();
            }
            Input::Dropped(file) => {
                self.say(now_s, format!("opening {} ...", file.display()), false);
                self.commands.push_back(Command::Open(file));
            }
        }
    }

    /// Does what a key means.
    pub(super) fn act(&mut self, now_s: f64, action: Action) {
        self.touch();
        match action {
            Action::TogglePause => self.clock.set_paused(now_s, !self.clock.is_paused()),
            Action::Step(frames) => self.clock.step(now_s, frames),
            Action::ChangeSpeed(direction) => self.clock.change_speed(now_s, direction),
            Action::Reverse => self.clock.set_speed(now_s, -self.clock.speed()),
            Action::NormalSpeed => self.clock.set_speed(now_s, 1.0),
            Action::Rewind => self.clock.seek(now_s, 0.0),
            Action::NextClips => {
                self.stage.playlist.advance();
                self.clips_changed(now_s);
            }
            Action::NextShading => {
                let place = Shading::ALL.iter().position(|&s| s == self.shading);
                self.shading = Shading::ALL[place.map_or(0, |p| (p + 1) % Shading::ALL.len())];
                self.picture_changes(now_s);
            }
            Action::NextStructure => {
                self.stage.structure = (self.stage.structure + 1) % self.structures.len();
                self.picture_changes(now_s);
            }
            Action::NextCamera => {
                if let View::Free(orbit) = self.view {
                    self.parked = Some(orbit);
                }
                self.view = self.view.next(self.stage.cameras.len(), self.parked);
            }
            Action::FrameAll => self.view = View::Framed,
            Action::Screenshot => self.order_still(now_s, StillFile::Numbered(self.still_stem())),
            Action::ToggleOverlay => self.layers.overlay = !self.layers.overlay,
            Action::ToggleHelp => self.layers.help = !self.layers.help,
            Action::Back if self.layers.help => self.layers.help = false,
            Action::Back | Action::Quit => self.script.close(),
        }
    }

    /// The scene's name, as the beginning of a picture's.
    fn still_stem(&self) -> String {
        let file = &self.stage.scene.file;
        let stem = file.rsplit_once('.').map_or(file.as_str(), |(stem, _)| stem);
        let plain: String =
            stem.chars().map(|c| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' }).collect();
        if plain.is_empty() { "kinora".to_owned() } else { plain }
    }

    /// The scrub bar of the window as it is.
    pub(super) fn bar(&self) -> ScrubBar {
        let side = |pixels: u32| i32::try_from(pixels).unwrap_or(i32::MAX);
        let scale = super::overlay::text_scale(self.size.0, self.size.1);
        ScrubBar::new(side(self.size.0), side(self.size.1), scale)
    }

    /// True when the pointer is where the bar takes hold.
    pub(super) fn is_on_bar(&self) -> bool {
        self.clock.duration_s() > 0.0 && self.bar().is_hit(self.pointer.x, self.pointer.y)
    }

    fn begin_drag(&mut self, now_s: f64, button: Button) {
        if self.pointer.drag.is_some() {
            return;
        }
        let drag = Drag::begin(button, self.pointer.shift, self.is_on_bar());
        self.pointer.drag = Some(drag);
        if drag == Drag::Scrub {
            self.pointer.resumes = !self.clock.is_paused();
            self.scrub(now_s);
        }
    }

    fn end_drag(&mut self, now_s: f64) {
        if self.pointer.drag.take() == Some(Drag::Scrub) && self.pointer.resumes {
            self.clock.set_paused(now_s, false);
        }
    }

    fn scrub(&mut self, now_s: f64) {
        let time_s = self.bar().time_at(self.pointer.x, self.clock.duration_s());
        self.clock.hold(now_s, time_s);
        self.moved_s = now_s;
        self.touch();
    }

    fn pointer_moved(&mut self, now_s: f64, x: f64, y: f64) {
        let was_on_bar = self.is_on_bar();
        let unit = f64::from(self.size.1.max(1));
        let part = |from: f64, to: f64| ((to - from) / unit).clamp(-LARGEST_TURN, LARGEST_TURN);
        let (dx, dy) = (part(self.pointer.x, x), part(self.pointer.y, y));
        (self.pointer.x, self.pointer.y) = (x, y);
        match self.pointer.drag {
            Some(Drag::Turn) => self.move_camera(now_s, |orbit| orbit.turn(dx, dy)),
            Some(Drag::Pan) => self.move_camera(now_s, |orbit| orbit.pan(dx, dy)),
            Some(Drag::Scrub) => self.scrub(now_s),
            None if was_on_bar != self.is_on_bar() => self.touch(),
            None => {}
        }
    }

    /// Moves the free camera, which begins where the picture was seen from.
    fn move_camera(&mut self, now_s: f64, change: impl FnOnce(&mut super::orbit::Orbit)) {
        let Some(picture) = &self.picture else { return };
        change(self.view.free(&picture.view, picture.bounds));
        self.moved_s = now_s;
    }
}
