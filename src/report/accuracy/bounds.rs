//! What every point may err at most.

use super::{
    quest::Class,
    rays::{Errors, RayRow},
};
use crate::{
    geom::{Forms, Precision},
    report::{Bound, Check, Column, Role, Table, reference::wilson},
};

const EXACT: Precision = Precision::Exact;
const FAST: Precision = Precision::Fast;

/// The most that a form of rays may err.
#[derive(Clone, Copy, Debug)]
struct Allowed {
    name: &'static str,
    /// Nodes and leaves.
    forms: [Precision; 2],
    /// Mistakes among ordinary rays, a ray.
    ordinary: f64,
    /// Mistakes among rays aimed at edges and corners, a ray.
    aimed: f64,
    /// Relative error of t at right triangles, in u, for 99.9 of 100.
    t: f64,
}

/// One row a form; measured values lie well below, on every scene of the report.
const ALLOWED: &[Allowed] = &[
    Allowed { name: "exact", forms: [EXACT, EXACT], ordinary: 0.0, aimed: 0.0, t: 1.0 },
    Allowed { name: "fast nodes", forms: [FAST, EXACT], ordinary: 1e-3, aimed: 0.05, t: 1.0 },
    Allowed { name: "fast triangles", forms: [EXACT, FAST], ordinary: 1e-2, aimed: 0.75, t: 1e4 },
    Allowed { name: "fast nodes, triangles", forms: [FAST, FAST], ordinary: 1e-2, aimed: 0.75, t: 1e4 },
];

const COLUMNS: &[Column] = &[
    Column::new("precision", "precision", Role::Id, 0),
    Column::new("ordinary", "wrong answers, ordinary rays", Role::Note, 6),
    Column::new("aimed", "wrong answers, rays at edges and corners", Role::Note, 6),
    Column::new("t_error_p999", "t error, p99.9 [u]", Role::Note, 0),
];

/// The bounds as a table.
pub(super) fn table() -> Table {
    let mut table = Table::new("bounds", "What each form may err at most", COLUMNS).with_note(
        "Shares of all rays of a class. `--check` fails when a conservative point errs at all, or when the lower end of a lossy point's confidence \
         interval passes its bound. Exact t, u and v are correctly rounded, which is held ray by ray.",
    );
    for a in ALLOWED {
        table.push(vec![a.name.into(), a.ordinary.into(), a.aimed.into(), a.t.into()]);
    }
    table
}

fn allowed(forms: Forms) -> Option<&'static Allowed> {
    ALLOWED.iter().find(|a| a.forms == [forms.nodes, forms.leaves])
}

/// True for rays that are hard on purpose.
pub(super) fn is_aimed(class: Class) -> bool {
    match class {
        Class::Common(_) => false,
        Class::Edges => true,
        Class::Inside(aim) => crate::report::closed::Aim::AT_EDGES.contains(&aim),
    }
}

/// Rows that err more than they may.
pub(super) fn checks(rows: &[RayRow]) -> Vec<Check> {
    let exact = rows.iter().filter(|r| r.is_exact());
    let errors = |of: fn(&Errors) -> u64| exact.clone().map(|r| of(&r.errors)).sum::<u64>() as f64;
    let none = Bound::Exactly(0.0);
    let mut checks = vec![
        Check::new("conservative points: wrong answers", none, errors(Errors::mistakes)),
        Check::new("conservative points: leaks of closed meshes", none, errors(|e| e.leaks.unwrap_or(0))),
        Check::new("conservative points: t, u or v not correctly rounded", none, errors(|e| e.inexact)),
        Check::new("conservative points: zeros of u and v lost", none, errors(|e| e.lost_zeros)),
    ];
    for a in ALLOWED.iter().filter(|a| a.forms != [EXACT, EXACT]) {
        let of_form = || rows.iter().filter(|r| allowed(r.forms).is_some_and(|b| b.name == a.name));
        let worst = |aimed: bool| {
            let rows = of_form().filter(|r| is_aimed(r.class) == aimed);
            rows.map(|r| wilson(r.errors.mistakes(), r.errors.rays).0).reduce(f64::max)
        };
        let t = of_form().filter_map(|r| r.errors.t[1]).reduce(f64::max);
        let claim = |what: &str| format!("{}: {what}", a.name);
        checks.extend([
            Check::new(claim("wrong answers a ray, ordinary rays"), Bound::AtMost(a.ordinary), worst(false)),
            Check::new(claim("wrong answers a ray, at edges and corners"), Bound::AtMost(a.aimed), worst(true)),
            Check::new(claim("error of t, p99.9 [u]"), Bound::AtMost(a.t), t),
        ]);
    }
    checks
}
