//! Progress on stderr: a bar with the time left on a terminal, else a line a frame.

use std::{
    io::IsTerminal,
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kinora::output::Written;

use super::logs::Verbosity;

/// Where progress goes.
#[derive(Debug)]
enum Shown {
    Nothing,
    Lines,
    Bar(ProgressBar),
}

/// Tells the user of finished frames.
#[derive(Debug)]
pub(crate) struct Progress {
    shown: Shown,
    total: usize,
    done: usize,
    start: Instant,
}

impl Progress {
    /// Begins a run of `total` frames.
    pub(crate) fn new(total: usize, verbosity: Verbosity) -> Self {
        let shown = match (verbosity.shows_progress(), std::io::stderr().is_terminal()) {
            (false, _) => Shown::Nothing,
            (true, false) => Shown::Lines,
            (true, true) => Shown::Bar(bar(total)),
        };
        Self { shown, total, done: 0, start: Instant::now() }
    }

    /// A frame is in its file.
    pub(crate) fn frame(&mut self, written: &Written) {
        self.done += 1;
        match &self.shown {
            Shown::Nothing => {}
            Shown::Lines => {
                let left = eta(self.start.elapsed(), self.done, self.total);
                let Written { frame, file, .. } = written;
                eprintln!("frame {frame} ({} of {}) {file}, {left} left", self.done, self.total);
            }
            Shown::Bar(bar) => {
                bar.set_message(written.file.clone());
                bar.inc(1);
            }
        }
    }

    /// Takes the bar away.
    pub(crate) fn end(&self) {
        if let Shown::Bar(bar) = &self.shown {
            bar.finish_and_clear();
        }
    }
}

fn bar(total: usize) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::stderr());
    let template = "{bar:30} {pos}/{len} {per_sec} ETA {eta} {wide_msg}";
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

/// Time left in words at the mean pace so far.
fn eta(elapsed: Duration, done: usize, total: usize) -> String {
    let left = elapsed.as_secs_f64() / done.max(1) as f64 * total.saturating_sub(done) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "finite and not negative; saturates")]
    let seconds = left.ceil() as u64;
    match seconds {
        0..60 => format!("{left:.1} s"),
        60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_is_given_in_fitting_units() {
        assert_eq!(eta(Duration::from_secs(2), 4, 8), "2.0 s");
        assert_eq!(eta(Duration::from_secs(10), 1, 10), "1 min 30 s");
        assert_eq!(eta(Duration::from_secs(60), 1, 91), "1 h 30 min");
        assert_eq!(eta(Duration::from_secs(60), 5, 5), "0.0 s");
    }
}
