use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kinora::report::Monitor;

use crate::cli::{logs::Verbosity, signals::Signals};

/// Prints what is measured to stderr and ends at a signal.
#[derive(Debug)]
pub(super) struct Watching<'a> {
    signals: &'a Signals,
    shows: bool,
    bar: Option<ProgressBar>,
    last: String,
}

impl<'a> Watching<'a> {
    pub(super) fn new(signals: &'a Signals, verbosity: Verbosity) -> Self {
        let shows = verbosity.shows_progress();
        let bar = (shows && std::io::stderr().is_terminal()).then(spinner);
        Self { signals, shows, bar, last: String::new() }
    }

    /// Takes the line away.
    pub(super) fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn spinner() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.set_style(
        ProgressStyle::with_template("{elapsed} {wide_msg}").unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar
}

impl Monitor for Watching<'_> {
    fn goes_on(&mut self, what: &str) -> bool {
        if self.shows && self.last != what {
            what.clone_into(&mut self.last);
            match &self.bar {
                // Ticks come from here, not from a thread that would disturb the measurement.
                Some(bar) => bar.set_message(what.to_owned()),
                None => eprintln!("{what}"),
            }
        }
        self.signals.check().is_ok()
    }
}
