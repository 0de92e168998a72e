//! The first page.

use std::fmt::Write;

use super::{
    point::label,
    rays::{Errors, RayRow},
};
use crate::{
    geom::Forms,
    report::{grouped, reference::wilson},
};

/// Paragraphs for a reader who knows nothing of the report; `others` are sentences on what is not rays.
pub(super) fn summary(rows: &[RayRow], others: &[String]) -> Vec<String> {
    vec![
        "This report says what each shortcut buys and what it costs. A ray is asked what it meets first. In `exact` precision the answer is \
         that of exact arithmetic, rounded once; every other precision names the steps that take a cheaper form. All of them \
         answer the same rays, and every single answer is compared with one found by other means: integers of any size, or f64 with error bounds and \
         integers in doubt."
            .to_owned(),
        headline(rows),
        in_short(rows),
        others.iter().map(|o| format!("- {o}")).collect::<Vec<_>>().join("\n"),
        "How to read it: *ns a ray* is the time of one thread; an answer is *wrong* when a ray misses what it should hit, hits what it should miss, or finds a \
         triangle that is not the first. No wrong answer in n rays does not mean none ever: the *at most* column is the rate that \
         a run like this rules out with 95 % confidence. Errors of t are in u = 2^-24 of t (a correct rounding errs by at most 1). \
         The table of structures gives the same by point, over all scenes; by scene and class of rays it stands in `accuracy.json`. The plots set cost against error; points that another one \
         beats in both are grey, and one that never erred stands at the rate that its rays rule out."
            .to_owned(),
    ]
}

fn headline(rows: &[RayRow]) -> String {
    let exact = Sum::of(rows.iter().filter(|r| r.is_exact()));
    format!(
        "**Exact: {} wrong of {} answers** ({} structures; {} leaks of closed meshes, {} answers not correctly rounded). That bounds the true rate below {} in 10^9.",
        exact.mistakes,
        grouped(exact.rays),
        structures(rows),
        exact.leaks,
        exact.inexact,
        in_billion(wilson(exact.mistakes, exact.rays).1),
    )
}

fn structures(rows: &[RayRow]) -> usize {
    let mut names: Vec<&str> = rows.iter().map(|r| r.structure.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names.len()
}

/// A line a precision, over all structures that have it.
fn in_short(rows: &[RayRow]) -> String {
    let mut out = "| precision | time of a ray over exact | answers | wrong | at most, in 10^9 | of rays at edges: wrong [%] | t error, worst median [u] | t error, max [u] |\n\
                   |---|---:|---:|---:|---:|---:|---:|---:|"
        .to_owned();
    let mut seen: Vec<Forms> = Vec::new();
    for row in rows {
        if !seen.contains(&row.forms) {
            seen.push(row.forms);
        }
    }
    for forms in seen {
        let of = || rows.iter().filter(|r| r.forms == forms);
        let all = Sum::of(of());
        let aimed = Sum::of(of().filter(|r| super::bounds::is_aimed(r.class)));
        let share = 100.0 * aimed.mistakes as f64 / aimed.rays.max(1) as f64;
        let dash = || "-".to_owned();
        let _ = write!(
            out,
            "\n| {} | {} | {} | {} | {} | {share:.4} | {} | {} |",
            label(forms),
            ratio(rows, forms).map_or_else(dash, |r| format!("{r:.2}")),
            grouped(all.rays),
            grouped(all.mistakes),
            in_billion(wilson(all.mistakes, all.rays).1),
            all.median.map_or_else(dash, |t| format!("{t:.2}")),
            all.max.map_or_else(dash, |t| format!("{t:.1}")),
        );
    }
    out
}

/// The median, over scenes, classes and structures, of a ray's time in some forms over that of the exact ones.
fn ratio(rows: &[RayRow], forms: Forms) -> Option<f64> {
    let same = |a: &RayRow, b: &RayRow| {
        a.scene == b.scene && a.class == b.class && a.structure == b.structure && a.packets == b.packets
    };
    let over = |row: &RayRow| {
        let exact = rows.iter().find(|r| r.is_exact() && same(r, row))?;
        Some(row.ns()? / exact.ns()?)
    };
    let mut ratios: Vec<f64> = rows.iter().filter(|r| r.forms == forms).filter_map(over).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 10^9")]
fn in_billion(rate: f64) -> String {
    let n = rate * 1e9;
    if n < 100.0 { format!("{n:.1}") } else { grouped(n.round() as u64) }
}

/// Counts of several rows together.
#[derive(Default)]
struct Sum {
    rays: u64,
    mistakes: u64,
    leaks: u64,
    inexact: u64,
    median: Option<f64>,
    max: Option<f64>,
}

impl Sum {
    fn of<'a>(rows: impl Iterator<Item = &'a RayRow>) -> Self {
        let mut sum = Self::default();
        for row in rows {
            let Errors { rays, leaks, inexact, t, .. } = &row.errors;
            sum.rays += rays;
            sum.mistakes += row.errors.mistakes();
            sum.leaks += leaks.unwrap_or(0);
            sum.inexact += inexact;
            sum.median = sum.median.into_iter().chain(t[0]).reduce(f64::max);
            sum.max = sum.max.into_iter().chain(t[2]).reduce(f64::max);
        }
        sum
    }
}
