//! Files that are already there: refused, replaced, or kept when they are finished.

use std::path::Path;

use kinora::output::{Expected, Stamp, Target, Unfit, check_film, check_still};
use rayon::prelude::*;

use super::plan::Plan;
use crate::cli::{error::CliError, settings::Settings};

/// The frames that are still to be rendered, in order.
///
/// # Errors
/// A usage error when files exist and neither `--resume` nor `--overwrite` was given.
pub(super) fn remaining(plan: &Plan, settings: &Settings) -> Result<Vec<u64>, CliError> {
    if plan.overwrite {
        return Ok(plan.frames.clone());
    }
    if !plan.resume {
        refuse_existing(plan)?;
        return Ok(plan.frames.clone());
    }
    if let Target::Film(path, format) = &plan.target {
        let unfit = check_film(path, *format, &expected(plan, &plan.film.stamp, plan.film.frames));
        report(path, &unfit);
        return Ok(if unfit.is_ok() { Vec::new() } else { plan.frames.clone() });
    }
    Ok(settings.pool.install(|| plan.frames.par_iter().copied().filter(|&f| !is_finished(plan, f)).collect()))
}

fn refuse_existing(plan: &Plan) -> Result<(), CliError> {
    let existing = || plan.frames.iter().filter_map(|&f| plan.target.file(f)).filter(|p| p.symlink_metadata().is_ok());
    let Some(first) = existing().next() else { return Ok(()) };
    let count = if plan.target.holds_all_frames() { 1 } else { existing().count() };
    let more =
        if count > 1 { format!(", and {} more of the {} frames", count - 1, plan.frames.len()) } else { String::new() };
    Err(CliError::usage(format!(
        "{}: exists{more}; use --resume to keep what is finished, or --overwrite",
        first.display()
    )))
}

fn is_finished(plan: &Plan, frame: u64) -> bool {
    let (Target::Sequence(_, format) | Target::Still(_, format)) = &plan.target else { return false };
    let Some(path) = plan.target.file(frame) else { return false };
    let stamp = Stamp::of_frame(&plan.settings, frame);
    let unfit = check_still(&path, *format, &expected(plan, &stamp, 1));
    report(&path, &unfit);
    unfit.is_ok()
}

fn expected<'a>(plan: &Plan, stamp: &'a Stamp, frames: u64) -> Expected<'a> {
    Expected { stamp, width: plan.size.0, height: plan.size.1, frames }
}

fn report(path: &Path, unfit: &Result<(), Unfit>) {
    match unfit {
        Ok(()) => tracing::info!("{}: finished, kept", path.display()),
        Err(Unfit::Missing) => {}
        Err(why) => tracing::info!("{}: {why}; rendered anew", path.display()),
    }
}
