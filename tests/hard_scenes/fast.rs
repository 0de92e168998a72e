//! What precision `fast` may get wrong in each scene: [`FAST_BOUNDS`](kinora::report::accuracy::hard::FAST_BOUNDS), which the accuracy report prints.

use kinora::{
    geom::{Forms, Precision},
    report::{
        accuracy::hard::{Shares, fast_bound},
        reference::wilson,
    },
};

use crate::trial::Mistakes;

/// Every step in its cheapest form.
pub(crate) const FAST: Forms = Forms::all(Precision::Fast);

/// Asserts that `found` is within what is listed for the trial: where nothing is, a single mistake is one too many; else the lower end of the
/// confidence interval (95 %) must not pass the bound, which leaves room for the small samples of debug builds.
pub(crate) fn check(trial: &str, structure: &str, found: &Mistakes) {
    let most = fast_bound(trial).map_or(Shares::NONE, |b| b.most);
    let all = [
        ("missed", found.false_misses, most.missed),
        ("false", found.false_hits, most.false_hits),
        ("wrong", found.wrong, most.wrong),
    ];
    for (what, count, most) in all {
        let is_within = count == 0 || wilson(count, found.rays).0 <= most;
        assert!(is_within, "{trial}: {structure}, fast: {count} {what} of {} rays, {most} of them allowed", found.rays);
    }
}

/// The largest share of each kind of mistake among some structures, and whose it is.
pub(crate) fn worst<'a>(found: &(impl Iterator<Item = (&'a str, &'a Mistakes)> + Clone)) -> String {
    let largest = |what: &str, of: fn(&Mistakes) -> u64| {
        let share = |m: &Mistakes| of(m) as f64 / m.rays.max(1) as f64;
        let (name, most) =
            found.clone().map(|(n, m)| (n, share(m))).fold(("", 0.0), |a, b| if b.1 > a.1 { b } else { a });
        format!("{what} {:.4} %{}{name}", most * 100.0, if name.is_empty() { "" } else { " by " })
    };
    [largest("missed", |m| m.false_misses), largest("false", |m| m.false_hits), largest("wrong", |m| m.wrong)]
        .join(", ")
}
