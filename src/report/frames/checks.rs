//! What the runs must show.

use super::{refits::RefitRow, tables::Played};
use crate::{
    dynamics::RebuildPolicy,
    report::{Bound, Check, measure::Samples},
};

/// Most of a rebuilt frame's trace time that a frame may take: the median, and the share of 99 in 100.
const OVER_REBUILT: [(f64, f64); 2] = [(0.5, 1.2), (0.99, 1.5)];

/// Bounds on the runs.
pub(super) fn checks(plays: &[Played], refits: &[RefitRow]) -> Vec<Check> {
    let differences: usize = plays.iter().map(Played::differences).sum();
    let mut checks =
        vec![Check::new("frames that answer otherwise under another policy", Bound::Exactly(0.0), differences as f64)];
    for play in plays.iter().filter(|play| play.defeats_refit() == Some(true)) {
        for policy in play.runs.iter().map(|run| run.policy).filter(|p| is_kept_good(*p)) {
            checks.extend(against_rebuilt(play, policy));
            checks.extend(never_waits(play, policy));
        }
    }
    checks.extend(refit_checks(refits));
    checks
}

fn is_kept_good(policy: RebuildPolicy) -> bool {
    !matches!(policy, RebuildPolicy::Refit | RebuildPolicy::Rebuild)
}

fn against_rebuilt(play: &Played, policy: RebuildPolicy) -> Vec<Check> {
    let ratios = play.run(policy).zip(play.run(RebuildPolicy::Rebuild)).map(|(run, fresh)| run.against(fresh));
    let check = |(share, most): (f64, f64)| {
        let claim = format!("{}: trace under `{policy}` / rebuilt, {} % of the frames", play.scene, share * 100.0);
        Check::new(claim, Bound::AtMost(most), ratios.as_ref().and_then(|r| r.quantile(share)))
    };
    OVER_REBUILT.map(check).to_vec()
}

/// A frame that waited for a build would take as long as one that builds.
fn never_waits(play: &Played, policy: RebuildPolicy) -> Option<Check> {
    let built = play.run(RebuildPolicy::Rebuild)?.each(|f| f.times.refit.as_secs_f64()).median()?;
    let run = play.run(policy)?;
    let later = super::run::Series(run.frames.iter().skip(1).map(|f| f.times.refit.as_secs_f64()).collect());
    let claim = format!("{}: refit under `{policy}` / a build, 99 % of the frames", play.scene);
    Some(Check::new(claim, Bound::AtMost(0.5), later.quantile(0.99).map(|p99| p99 / built)))
}

/// Structures that are the default of the library or of the program.
const REFITTED: [&str; 2] = ["bvh2", "bvh8"];

fn refit_checks(refits: &[RefitRow]) -> Vec<Check> {
    let mut checks = Vec::new();
    for structure in REFITTED {
        let (mut builds, mut memory) = (Samples::default(), Samples::default());
        for row in refits.iter().filter(|row| row.structure == structure) {
            let Some(refit) = row.refit.median() else { continue };
            builds.push(row.build.1 / refit);
            memory.push(refit / row.memory_s);
        }
        let least = builds.values().iter().copied().reduce(f64::min);
        let claim = format!("fastest build / refit of `{structure}`, the worst scene");
        checks.push(Check::new(claim, Bound::AtLeast(4.0), least));
        let claim = format!("refit of `{structure}` / memory alone, the median scene");
        checks.push(Check::new(claim, Bound::AtMost(2.0), memory.median()));
    }
    checks
}
