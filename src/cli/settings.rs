//! The common options, checked.

use std::sync::Arc;

use kinora::{
    accel::Precision,
    dynamics::{FrameConfig, RebuildPolicy},
    simd::SimdLevel,
};
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{args::CommonArgs, error::CliError, logs::Verbosity, values::SimdChoice};

/// What every command may rely on.
#[derive(Debug)]
pub(crate) struct Settings {
    /// The program's own pool; all parallel work is installed into it.
    pub(crate) pool: Arc<ThreadPool>,
    /// Structure over triangles, with settings.
    pub(crate) accel: String,
    /// Structure over groups.
    pub(crate) top: String,
    /// How exact answers are.
    pub(crate) precision: Precision,
    /// SIMD level that this machine has.
    pub(crate) simd: SimdLevel,
    /// How much to print.
    pub(crate) verbosity: Verbosity,
}

impl Settings {
    /// Checks the common options.
    ///
    /// # Errors
    /// A usage error naming the option or environment variable.
    pub(crate) fn check(args: &CommonArgs) -> Result<Self, CliError> {
        let threads = threads(args.threads)?;
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("kinora-{i}"))
            .build()
            .map_err(|e| CliError::failed(format!("cannot start {threads} threads: {e}")))?;
        Ok(Self {
            pool: Arc::new(pool),
            accel: args.accel.to_string(),
            top: args.top.name().to_owned(),
            precision: args.precision,
            simd: simd(args.simd)?,
            verbosity: args.verbosity(),
        })
    }

    /// Number of worker threads.
    pub(crate) fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Settings of a frame loop over these.
    pub(crate) fn frame_config(&self, policy: RebuildPolicy) -> FrameConfig {
        FrameConfig {
            accel: self.accel.clone(),
            top: self.top.clone(),
            policy,
            forms: self.precision.into(),
            pool: Arc::clone(&self.pool),
        }
    }
}

fn simd(choice: SimdChoice) -> Result<SimdLevel, CliError> {
    let best = SimdLevel::best();
    match choice {
        SimdChoice::Auto => Ok(best),
        SimdChoice::Level(level) if level.is_available() => Ok(level),
        SimdChoice::Level(level) => {
            Err(CliError::usage(format!("--simd {level}: this machine has no {level}; the best it has is {best}")))
        }
    }
}

/// Most threads that can be asked for.
const MAX_THREADS: usize = 4096;

fn threads(flag: Option<usize>) -> Result<usize, CliError> {
    let check = |n: usize, what: &str| match n {
        1..=MAX_THREADS => Ok(n),
        _ => Err(CliError::usage(format!("{what}: {n} threads; expected 1 to {MAX_THREADS}"))),
    };
    if let Some(n) = flag {
        return check(n, "--threads");
    }
    if let Some(text) = env("KINORA_THREADS") {
        let n =
            text.trim().parse().map_err(|_| CliError::usage(format!("KINORA_THREADS: `{text}` is not a number")))?;
        return check(n, "KINORA_THREADS");
    }
    // A scheduler's grant that makes no sense is not the user's mistake here: fall through.
    let granted = env("SLURM_CPUS_PER_TASK")
        .and_then(|t| t.trim().parse().ok())
        .or_else(|| env("HQ_CPUS").map(|t| core_count(&t)));
    match granted {
        Some(n @ 1..=MAX_THREADS) => Ok(n),
        _ => Ok(std::thread::available_parallelism().map_or(1, usize::from)),
    }
}

/// Number of cores in a list such as `0,1,4-7`.
fn core_count(list: &str) -> usize {
    let one = |item: &str| match item.split_once('-') {
        Some((a, b)) => match (a.trim().parse::<usize>(), b.trim().parse::<usize>()) {
            (Ok(a), Ok(b)) if a <= b => b - a + 1,
            _ => 0,
        },
        None => usize::from(item.trim().parse::<usize>().is_ok()),
    };
    list.split(',').map(one).sum()
}

/// An environment variable that is set, not empty and UTF-8.
pub(crate) fn env(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|v| !v.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn core_lists_are_counted_not_read_as_numbers() {
        assert_eq!(core_count("3"), 1);
        assert_eq!(core_count("0,1,4-7"), 6);
        assert_eq!(core_count("x"), 0);
        assert_eq!(core_count("7-4"), 0);
    }
}
