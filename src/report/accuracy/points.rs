//! Every point over all scenes and rays: what it costs, how it errs, and whether another one beats it.

use super::{
    bounds::is_aimed,
    pareto::{competes, non_dominated},
    point::label,
    quest::Class,
    rays::{Errors, RayRow},
};
use crate::{
    geom::Forms,
    report::{Cell, Chart, Column, Dot, Plot, RayClass, Role, Scatter, Table, measure::Samples, reference::wilson},
};

const COLUMNS: &[Column] = &[
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("nodes", "node format", Role::Id, 0),
    Column::new("precision", "precision", Role::Id, 0),
    Column::new("cast", "cast", Role::Id, 0),
    Column::new("kind", "kind", Role::Note, 0),
    Column::new("relative", "time of a ray", Role::Sooner, 2),
    Column::new("relative_aimed", "at edges", Role::Sooner, 2),
    Column::new("ns_primary", "primary [ns]", Role::Sooner, 0),
    Column::new("ns_shadow", "shadow [ns]", Role::Sooner, 0),
    Column::new("ns_diffuse", "diffuse [ns]", Role::Sooner, 0),
    Column::new("bytes_per_triangle", "bytes a triangle", Role::Less, 1),
    Column::new("count", "rays judged", Role::Note, 0),
    Column::new("missed", "missed", Role::Less, 0),
    Column::new("missed_below", "in 10^9, at most", Role::Note, 0),
    Column::new("false_hits", "false", Role::Less, 0),
    Column::new("false_hits_below", "in 10^9, at most", Role::Note, 0),
    Column::new("wrong", "wrong triangle", Role::Less, 0),
    Column::new("wrong_below", "in 10^9, at most", Role::Note, 0),
    Column::new("leaks", "leaks", Role::Less, 0),
    Column::new("leaks_below", "in 10^9, at most", Role::Note, 0),
    Column::new("aimed", "wrong at edges [%]", Role::Less, 4),
    Column::new("t_error_p999", "t error, p99.9 [u]", Role::Less, 2),
    Column::new("t_error_max", "t error, max [u]", Role::Less, 1),
    Column::new("uv_error_max", "u, v error, max [u]", Role::Less, 1),
    Column::new("not_rounded", "not correctly rounded", Role::Less, 0),
    Column::new("worth", "worth its cost by", Role::Note, 0),
];

/// A point over all of its rows.
#[derive(Clone, Debug)]
pub(super) struct PointRow {
    structure: String,
    nodes: &'static str,
    forms: Forms,
    cast: &'static str,
    /// Time over that of exact single rays of `bvh2`, the geometric mean: of ordinary rays, and of those at edges and corners.
    relative: [Option<f64>; 2],
    /// Primary, shadow and diffuse rays, the median over scenes.
    ns: [Option<f64>; 3],
    bytes_per_triangle: Option<f64>,
    errors: Errors,
    /// Rays that may leak.
    inside: u64,
    /// Rays at edges and corners, and mistakes among them.
    aimed: [u64; 2],
}

impl PointRow {
    fn new(rows: &[RayRow], of: &[&RayRow]) -> Self {
        let first = of[0];
        let ns = [RayClass::Primary, RayClass::Shadow, RayClass::Diffuse]
            .map(|class| median(of.iter().filter(|r| r.class == Class::Common(class)).filter_map(|r| r.ns())));
        let relative = [false, true].map(|aimed| {
            let ratios = of.iter().filter(|r| is_aimed(r.class) == aimed).filter_map(|r| over_plain(rows, r));
            let logs: Vec<f64> = ratios.map(libm::log).collect();
            (!logs.is_empty()).then(|| libm::exp(logs.iter().sum::<f64>() / logs.len() as f64))
        });
        let aimed = || of.iter().filter(|r| is_aimed(r.class)).map(|r| &r.errors);
        Self {
            structure: first.structure.clone(),
            nodes: first.nodes,
            forms: first.forms,
            cast: first.cast(),
            relative,
            ns,
            bytes_per_triangle: median(of.iter().map(|r| r.bytes_per_triangle)),
            errors: of.iter().fold(Errors::default(), |sum, r| sum.and(&r.errors)),
            inside: of.iter().filter(|r| r.errors.leaks.is_some()).map(|r| r.errors.rays).sum(),
            aimed: [aimed().map(|e| e.rays).sum(), aimed().map(Errors::mistakes).sum()],
        }
    }

    fn name(&self) -> String {
        format!("{} {}", self.structure, label(self.forms))
    }

    fn is_exact(&self) -> bool {
        self.forms == Forms::EXACT
    }

    /// The share of wrong answers, as counted and as it may be at most.
    fn share(&self) -> [f64; 2] {
        let (n, of) = (self.errors.mistakes(), self.errors.rays);
        [n as f64 / of.max(1) as f64, wilson(n, of).1]
    }

    fn cells(&self, worth: &str) -> Vec<Cell> {
        let e = &self.errors;
        let counted = |n: u64, of: u64| [Cell::from(n), Cell::from(wilson(n, of).1 * 1e9)];
        let mut cells: Vec<Cell> = vec![
            self.structure.clone().into(),
            self.nodes.into(),
            label(self.forms).into(),
            self.cast.into(),
            if self.is_exact() { "conservative" } else { "lossy" }.into(),
        ];
        cells.extend(self.relative.map(Cell::from));
        cells.extend(self.ns.map(Cell::from));
        cells.extend([self.bytes_per_triangle.into(), e.rays.into()]);
        cells.extend([e.false_misses, e.false_hits, e.wrong].into_iter().flat_map(|n| counted(n, e.rays)));
        let leaks = e.leaks.filter(|_| self.inside > 0);
        cells.extend(leaks.map_or([Cell::Absent, Cell::Absent], |n| counted(n, self.inside)));
        let [aimed, wrong] = self.aimed;
        cells.push((aimed > 0).then(|| 100.0 * wrong as f64 / aimed as f64).into());
        cells.extend([e.t[1].into(), e.t[2].into(), e.t[2].map(|_| e.uv_max).into(), e.t[2].map(|_| e.inexact).into()]);
        cells.push(if worth.is_empty() { Cell::Absent } else { worth.into() });
        cells
    }
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut samples = Samples::default();
    values.for_each(|v| samples.push(v));
    samples.median()
}

/// A row's time over that of exact single rays of `bvh2` on the same rays.
fn over_plain(rows: &[RayRow], row: &RayRow) -> Option<f64> {
    let is_plain = |r: &&RayRow| {
        r.structure == "bvh2" && r.is_exact() && !r.packets && r.scene == row.scene && r.class == row.class
    };
    Some(row.ns()? / rows.iter().find(is_plain)?.ns()?)
}

/// All points, in the order of their first rows.
pub(super) fn points(rows: &[RayRow]) -> Vec<PointRow> {
    let mut groups: Vec<Vec<&RayRow>> = Vec::new();
    let same = |a: &RayRow, b: &RayRow| a.structure == b.structure && a.forms == b.forms && a.packets == b.packets;
    for row in rows {
        match groups.iter_mut().find(|g| same(g[0], row)) {
            Some(group) => group.push(row),
            None => groups.push(vec![row]),
        }
    }
    groups.iter().map(|of| PointRow::new(rows, of)).collect()
}

/// A number of a point with its name: what it is, and what of it is drawn.
struct Measure(&'static str, fn(&PointRow) -> Option<[f64; 2]>);

/// A cost and an error that points are compared by.
struct Trade {
    name: &'static str,
    cost: Measure,
    error: Measure,
}

const TRADES: [Trade; 4] = [
    Trade { name: "time and wrong answers", cost: TIME, error: WRONG },
    Trade { name: "time and error of t", cost: TIME, error: OF_T },
    Trade { name: "bytes and wrong answers", cost: BYTES, error: WRONG },
    Trade { name: "bytes and error of t", cost: BYTES, error: OF_T },
];

const TIME: Measure = Measure("time of a ray over that of bvh2, exact, single", |p| p.relative[0].map(|x| [x, x]));
const BYTES: Measure = Measure("bytes a triangle", |p| p.bytes_per_triangle.map(|x| [x, x]));
const WRONG: Measure = Measure("wrong answers in 10^9, at most (95 %)", |p| Some(p.share().map(|s| s * 1e9)));
const OF_T: Measure = Measure("largest error of t [u]", |p| p.errors.t[2].map(|t| [t, t]));

impl Trade {
    /// Points that have both, with cost, error, where the error is drawn, and whether no other point beats it.
    ///
    /// Points that judged few rays are left out: their counts say little. Packets, which answer ordinary rays only, stand by themselves.
    fn front<'a>(&self, points: &'a [PointRow], cast: &str) -> Vec<(&'a PointRow, f64, [f64; 2], bool)> {
        let of_cast = || points.iter().filter(|p| p.cast == cast);
        let most = of_cast().map(|p| p.errors.rays).max().unwrap_or(0);
        let both = |p: &'a PointRow| Some((p, (self.cost.1)(p)?[0], (self.error.1)(p)?));
        let found: Vec<_> = of_cast().filter(|p| competes(p.errors.rays, most)).filter_map(both).collect();
        let best = non_dominated(&found.iter().map(|f| (f.1, f.2[0])).collect::<Vec<_>>());
        found.into_iter().zip(best).map(|((p, cost, error), best)| (p, cost, error, best)).collect()
    }

    fn plot(&self, points: &[PointRow]) -> Option<Plot> {
        let dots = self.front(points, "single").into_iter().map(|(p, cost, [_, drawn], is_best)| Dot {
            name: p.name(),
            at: (cost, drawn),
            is_best,
            mark: usize::from(!p.is_exact()),
        });
        let dots: Vec<Dot> = dots.collect();
        let chart = Scatter { x: self.cost.0.to_owned(), y: self.error.0.to_owned(), dots };
        let name = format!("points-{}", self.name.replace(' ', "-"));
        (chart.dots.len() > 2)
            .then(|| Plot::new(name, format!("All scenes, single rays: {}", self.name), Chart::Scatter(chart)))
    }
}

/// The points as they are written.
pub(super) fn table(points: &[PointRow]) -> Table {
    let mut table = Table::new("points", "Every structure and form, over all scenes and rays", COLUMNS)
        .with_note(
            "All points answer the same rays, and every answer is judged by `report::reference`. A *conservative* point takes no shortcut that could change an answer; a *lossy* one names the \
             steps that do. *Time of a ray* is relative to single exact rays of `bvh2`, the geometric mean over scenes and classes of ordinary rays (packets: over those that come in packets), and over rays at edges and corners. \
             Nanoseconds are of one thread, the median over scenes. Structures that test every triangle, or nearly, answer fewer rays.",
        )
        .with_note(
            "*Missed*: something is met, nothing was found. *False*: the reverse. *Wrong triangle*: not among those met first (of several met at the same t, each is right). *Leaks*: rays from inside a \
             closed mesh that meet nothing. Behind each count stands the rate that it rules out with 95 % confidence (Wilson's score interval). Errors of t are relative, those of u and v absolute, in u = \
             2^-24; a correct rounding errs by at most 1 and 0.5. *Worth its cost by*: no other point costs at most as much and errs at most as much, and is better in one of both; single rays and packets compete \
             by themselves, and points that judged less than a twentieth of the rays do not.",
        );
    for (i, point) in points.iter().enumerate() {
        let is_best =
            |t: &&Trade| t.front(points, point.cast).iter().any(|f| f.3 && std::ptr::eq(f.0, &raw const points[i]));
        let worth: Vec<&str> = TRADES.iter().filter(is_best).map(|t| t.name).collect();
        table.push(point.cells(&worth.join("; ")));
    }
    table
}

/// A plot for each cost and error.
pub(super) fn plots(points: &[PointRow]) -> Vec<Plot> {
    TRADES.iter().filter_map(|t| t.plot(points)).collect()
}
