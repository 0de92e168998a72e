//! Log lines on stderr.

use std::io::IsTerminal;

use tracing::level_filters::LevelFilter;
use tracing_subscriber::{Layer, filter::Targets, fmt::format::FmtSpan, layer::SubscriberExt, util::SubscriberInitExt};

/// How much is printed to stderr: -1 errors only, 0 warnings and progress, 1 and more the logs too.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Verbosity(i8);

impl Verbosity {
    /// Errors only.
    pub(crate) const QUIET: Self = Self(-1);

    /// From the number of `-v`.
    pub(crate) fn new(count: u8) -> Self {
        Self(i8::try_from(count.min(3)).unwrap_or(3))
    }

    /// False under `-q`.
    pub(crate) fn shows_progress(self) -> bool {
        self > Self::QUIET
    }

    fn filter(self) -> LevelFilter {
        match self.0 {
            ..0 => LevelFilter::ERROR,
            0 => LevelFilter::WARN,
            1 => LevelFilter::INFO,
            2 => LevelFilter::DEBUG,
            3.. => LevelFilter::TRACE,
        }
    }
}

/// Sends the library's log lines to stderr, from -vv on with the time of each stage; warnings of the window system's library only when logs are asked for.
pub(crate) fn init(verbosity: Verbosity) {
    let filter = verbosity.filter();
    let foreign = if filter > LevelFilter::WARN { filter } else { LevelFilter::ERROR };
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_span_events(if filter >= LevelFilter::DEBUG { FmtSpan::CLOSE } else { FmtSpan::NONE })
        .without_time()
        .with_target(false);
    let targets = Targets::new().with_default(filter).with_target("winit", foreign);
    tracing_subscriber::registry().with(lines.with_filter(targets)).init();
}
