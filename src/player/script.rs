//! What `--exit-after` and `--screenshot` do, step by step.

use std::path::PathBuf;

/// What the script wants done now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Write the picture to this file.
    Shoot(PathBuf),
    /// Close the window.
    Quit,
}

/// Asks for the screenshot once and for the end once.
#[derive(Clone, Debug, Default)]
pub(super) struct Script {
    exit_after_s: Option<f64>,
    screenshot: Option<PathBuf>,
    shown_s: Option<f64>,
    is_shooting: bool,
    is_closing: bool,
}

impl Script {
    /// Closes `exit_after_s` seconds after the first picture; writes `screenshot` before that, or when the held
    /// picture is refined.
    pub(super) fn new(exit_after_s: Option<f64>, screenshot: Option<PathBuf>) -> Self {
        Self { exit_after_s, screenshot, ..Self::default() }
    }

    /// A picture is in the window.
    pub(super) fn picture_shown(&mut self, now_s: f64) {
        self.shown_s.get_or_insert(now_s);
    }

    /// The user closes the window: the screenshot, if it is still to be written, comes first.
    pub(super) fn close(&mut self) {
        self.is_closing = true;
    }

    /// The screenshot asked for is written, or has failed.
    pub(super) fn shot_done(&mut self) {
        self.is_shooting = false;
    }

    /// The wall time at which the window closes by itself.
    pub(super) fn due_s(&self) -> Option<f64> {
        Some(self.shown_s? + self.exit_after_s?)
    }

    /// True while the screenshot is being written.
    pub(super) fn is_shooting(&self) -> bool {
        self.is_shooting
    }

    /// What to do now; `is_refined` when a held picture has all its samples.
    pub(super) fn step(&mut self, now_s: f64, is_refined: bool) -> Option<Step> {
        if self.due_s().is_some_and(|due_s| now_s >= due_s) {
            self.is_closing = true;
        }
        if self.is_shooting {
            return None;
        }
        // Before the first picture nothing could be shot, so closing then just closes.
        if self.shown_s.is_some()
            && (self.is_closing || is_refined)
            && let Some(file) = self.screenshot.take()
        {
            self.is_shooting = true;
            return Some(Step::Shoot(file));
        }
        self.is_closing.then_some(Step::Quit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shoot() -> Step {
        Step::Shoot("a.png".into())
    }

    #[test]
    fn time_counts_from_the_first_picture_and_the_screenshot_comes_before_the_end() {
        let mut script = Script::new(Some(2.0), Some("a.png".into()));
        assert_eq!(script.step(50.0, false), None);
        script.picture_shown(50.0);
        script.picture_shown(51.0);
        assert_eq!(script.step(51.9, false), None);
        assert_eq!(script.step(52.0, false), Some(shoot()));
        assert_eq!(script.step(52.1, false), None, "until it is written");
        script.shot_done();
        assert_eq!(script.step(52.2, false), Some(Step::Quit));
    }

    #[test]
    fn refined_picture_is_shot_once_and_the_window_stays() {
        let mut script = Script::new(None, Some("a.png".into()));
        script.picture_shown(1.0);
        assert_eq!(script.step(2.0, true), Some(shoot()));
        script.shot_done();
        assert_eq!(script.step(3.0, true), None);
    }

    #[test]
    fn closing_by_hand_still_writes_the_screenshot() {
        let mut script = Script::new(None, Some("a.png".into()));
        script.picture_shown(0.0);
        script.close();
        assert_eq!(script.step(0.0, false), Some(shoot()));
        script.shot_done();
        assert_eq!(script.step(0.0, false), Some(Step::Quit));
    }

    #[test]
    fn window_without_a_script_stays_until_it_is_closed() {
        let mut script = Script::default();
        script.picture_shown(0.0);
        assert_eq!(script.step(1e9, true), None);
        script.close();
        assert_eq!(script.step(1e9, true), Some(Step::Quit));
    }
}
