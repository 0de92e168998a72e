//! Every structure and form on the rays of one scene.

use super::{
    Options, Source,
    point::{Point, label},
    quest::{Class, Quest},
};
use crate::{
    accel::{AccelKind, AnyAccel, PACKET},
    geom::Forms,
    report::{
        Cell, Column, Monitor, ReportError, Role, Table,
        measure::{Answer, Caster, Samples},
        reference::{Tally, wilson},
    },
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("rays", "rays", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("nodes", "node format", Role::Id, 0),
    Column::new("precision", "precision", Role::Id, 0),
    Column::new("cast", "cast", Role::Id, 0),
    Column::new("kind", "kind", Role::Note, 0),
    Column::new("triangles", "triangles", Role::Note, 0),
    Column::new("count", "rays judged", Role::Note, 0),
    Column::new("ns_per_ray", "ns a ray", Role::Sooner, 0),
    Column::new("spread", "± [%]", Role::Note, 0),
    Column::new("bytes_per_triangle", "bytes a triangle", Role::Less, 1),
    Column::new("false_misses", "false misses", Role::Less, 0),
    Column::new("false_misses_below", "fewer in 10^9 than", Role::Note, 0),
    Column::new("false_misses_above", "and more than", Role::Note, 0),
    Column::new("false_hits", "false hits", Role::Less, 0),
    Column::new("false_hits_below", "fewer in 10^9 than", Role::Note, 0),
    Column::new("false_hits_above", "and more than", Role::Note, 0),
    Column::new("wrong_triangles", "wrong triangles", Role::Less, 0),
    Column::new("wrong_triangles_below", "fewer in 10^9 than", Role::Note, 0),
    Column::new("wrong_triangles_above", "and more than", Role::Note, 0),
    Column::new("leaks", "leaks", Role::Less, 0),
    Column::new("leaks_below", "fewer in 10^9 than", Role::Note, 0),
    Column::new("leaks_above", "and more than", Role::Note, 0),
    Column::new("ties", "ties", Role::Note, 0),
    Column::new("t_error_median", "t error, median [u]", Role::Less, 3),
    Column::new("t_error_p999", "t error, p99.9 [u]", Role::Less, 2),
    Column::new("t_error_max", "t error, max [u]", Role::Less, 2),
    Column::new("uv_error_max", "u, v error, max [u]", Role::Less, 2),
    Column::new("not_rounded", "not correctly rounded", Role::Less, 0),
    Column::new("lost_zeros", "zeros lost", Role::Less, 0),
];

/// A structure and form on one class of rays.
#[derive(Clone, Debug)]
pub(super) struct RayRow {
    pub(super) scene: String,
    pub(super) class: Class,
    pub(super) structure: String,
    pub(super) nodes: &'static str,
    pub(super) forms: Forms,
    pub(super) packets: bool,
    pub(super) triangles: usize,
    pub(super) seconds: Samples,
    pub(super) bytes_per_triangle: f64,
    pub(super) errors: Errors,
}

/// What a tally comes to.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Errors {
    pub(super) rays: u64,
    pub(super) ties: u64,
    pub(super) false_misses: u64,
    pub(super) false_hits: u64,
    pub(super) wrong: u64,
    pub(super) leaks: Option<u64>,
    pub(super) inexact: u64,
    pub(super) lost_zeros: u64,
    pub(super) uv_max: f64,
    /// Median, p99.9 and maximum.
    pub(super) t: [Option<f64>; 3],
}

impl Errors {
    fn new(tally: &Tally, leaks: Option<u64>) -> Self {
        Self {
            rays: tally.rays,
            ties: tally.ties,
            false_misses: tally.false_misses,
            false_hits: tally.false_hits,
            wrong: tally.wrong,
            leaks,
            inexact: tally.inexact,
            lost_zeros: tally.lost_zeros,
            uv_max: tally.uv_max,
            t: tally.t_quantiles([0.5, 0.999, 1.0]),
        }
    }

    /// Both together; of the errors of t, the worst.
    pub(super) fn and(self, other: &Self) -> Self {
        let leaks = self.leaks.into_iter().chain(other.leaks).reduce(|a, b| a + b);
        Self {
            rays: self.rays + other.rays,
            ties: self.ties + other.ties,
            false_misses: self.false_misses + other.false_misses,
            false_hits: self.false_hits + other.false_hits,
            wrong: self.wrong + other.wrong,
            leaks,
            inexact: self.inexact + other.inexact,
            lost_zeros: self.lost_zeros + other.lost_zeros,
            uv_max: self.uv_max.max(other.uv_max),
            t: std::array::from_fn(|i| self.t[i].into_iter().chain(other.t[i]).reduce(f64::max)),
        }
    }

    /// Answers that differ in kind.
    pub(super) fn mistakes(&self) -> u64 {
        self.false_misses + self.false_hits + self.wrong
    }
}

impl RayRow {
    pub(super) fn is_exact(&self) -> bool {
        self.forms == Forms::EXACT
    }

    /// Median nanoseconds a ray.
    pub(super) fn ns(&self) -> Option<f64> {
        Some(self.seconds.median()? * 1e9 / self.errors.rays.max(1) as f64)
    }

    pub(super) fn cast(&self) -> &'static str {
        if self.packets { "packets" } else { "single" }
    }

    fn cells(&self) -> Vec<Cell> {
        let e = &self.errors;
        let ends = |events: Option<u64>| {
            let (low, high) = events.map(|n| wilson(n, e.rays)).unzip();
            let whole = |x: Option<f64>| x.map(|x| x * 1e9).into();
            [events.into(), whole(high), whole(low)]
        };
        let mut cells: Vec<Cell> = vec![
            self.scene.clone().into(),
            self.class.name().into(),
            self.structure.clone().into(),
            self.nodes.into(),
            label(self.forms).into(),
            self.cast().into(),
            if self.is_exact() { "conservative" } else { "lossy" }.into(),
            self.triangles.into(),
            e.rays.into(),
            self.ns().into(),
            self.seconds.spread().into(),
            self.bytes_per_triangle.into(),
        ];
        cells.extend([Some(e.false_misses), Some(e.false_hits), Some(e.wrong), e.leaks].into_iter().flat_map(ends));
        cells.push(e.ties.into());
        cells.extend(e.t.map(Cell::from));
        let has_weights = e.t[0].is_some();
        cells.push(has_weights.then_some(e.uv_max).into());
        cells.push(has_weights.then_some(e.inexact).into());
        cells.push(has_weights.then_some(e.lost_zeros).into());
        cells
    }
}

/// The rows as they are written.
pub(super) fn table(rows: &[RayRow]) -> Table {
    let mut table = Table::new("rays", "Rays: every structure and form, by scene and class of rays", COLUMNS)
        .in_json_only()
        .with_note(
            "All points answer the same rays, and every answer is judged by `report::reference`. A conservative point takes no shortcut that \
             could change an answer; a lossy one names the steps that do. Times are processor time of one thread, medians over repeats \
             taken in turn. Slow structures answer fewer rays, spread evenly.",
        )
        .with_note(
            "The true rate of an error lies between the two numbers behind its count with 95 % confidence (Wilson's score interval). A false \
             miss: something is met, nothing was found. A false hit: the reverse. A wrong triangle is not among those met first; of \
             several met at the same t (a tie), each is right. A leak: a ray from inside a closed mesh that meets nothing. For shadow rays, false misses are leaks of light and \
             false hits are false shadows. Errors of t are relative, those of u and v absolute, in u = 2^-24; a correct rounding has at most 1.",
        );
    for row in rows {
        table.push(row.cells());
    }
    table
}

/// A point that was built.
struct Built {
    point: Point,
    accel: AnyAccel,
}

/// Measures all points on all rays of a scene.
///
/// # Errors
/// When `monitor` ends it.
pub(super) fn measure(
    source: &Source,
    quests: &[Quest],
    options: &Options,
    monitor: &mut dyn Monitor,
) -> Result<Vec<RayRow>, ReportError> {
    let mut built = Vec::new();
    for spec in &options.specs {
        monitor.begin(&format!("{}: {spec}: build", source.name))?;
        let Ok(accel) = spec.build(&source.prims()) else { continue };
        let points = Point::all(spec).into_iter();
        built.extend(points.map(|point| Built { point, accel: accel.clone() }));
    }
    let mut rows = Vec::new();
    for quest in quests {
        monitor.begin(&format!("{}: {} rays", source.name, quest.class.name()))?;
        rows.extend(cast(source, quest, &built, options, monitor)?);
    }
    Ok(rows)
}

/// A point on one class of rays.
struct Turn<'a> {
    caster: Caster<'a>,
    quest: Quest,
    packets: bool,
    answers: Vec<Answer>,
    row: RayRow,
}

fn cast(
    source: &Source,
    quest: &Quest,
    built: &[Built],
    options: &Options,
    monitor: &mut dyn Monitor,
) -> Result<Vec<RayRow>, ReportError> {
    let mut turns: Vec<Turn<'_>> = built.iter().flat_map(|b| turns(source, quest, b, options)).collect();
    // The first round warms up and is not timed.
    for repeat in 0..=options.repeats() {
        monitor.begin(&format!("{}: {} rays", source.name, quest.class.name()))?;
        for turn in &mut turns {
            let seconds = turn.caster.cast(&turn.quest.rays, quest.class.ask(), turn.packets, &mut turn.answers);
            if repeat > 0 {
                turn.row.seconds.push(seconds);
            }
        }
    }
    let judged = turns.into_iter().map(|mut turn| {
        let tally = turn.quest.judge(&turn.answers);
        let leaks = quest.class.may_leak().then(|| turn.answers.iter().filter(|a| a.hit().is_none()).count() as u64);
        turn.row.errors = Errors::new(&tally, leaks);
        turn.row
    });
    Ok(judged.collect())
}

fn turns<'a>(source: &'a Source, quest: &Quest, built: &'a Built, options: &Options) -> Vec<Turn<'a>> {
    let Built { point, accel } = built;
    let caster = Caster { accel, prims: source.prims(), simd: options.simd, forms: point.forms };
    let quest = quest.part(affordable(&caster, quest, options.budget()));
    let stats = accel.stats();
    let walks = walks_packets(accel) && quest.class.comes_in_packets();
    let turn = |packets: bool| Turn {
        caster,
        quest: quest.clone(),
        packets,
        answers: vec![Answer::MISS; quest.rays.len()],
        row: RayRow {
            scene: source.name.clone(),
            class: quest.class,
            structure: point.spec.to_string(),
            nodes: accel.node_format(),
            forms: point.forms,
            packets,
            triangles: source.indices.len(),
            seconds: Samples::default(),
            bytes_per_triangle: stats.total_bytes as f64 / source.indices.len().max(1) as f64,
            errors: Errors::default(),
        },
    };
    [Some(false), walks.then_some(true)].into_iter().flatten().map(turn).collect()
}

/// True where 16 rays are walked together.
pub(super) fn walks_packets(accel: &AnyAccel) -> bool {
    matches!(accel.kind(), AccelKind::Bvh2 | AccelKind::Bvh8 | AccelKind::Ssh)
}

/// How many rays cost at most `budget`, by a sample of them.
pub(super) fn affordable(caster: &Caster<'_>, quest: &Quest, budget: u64) -> usize {
    let sample = quest.part(4 * PACKET);
    let counts = caster.count(&sample.rays, quest.class.ask(), budget / 4);
    let rays = u128::from(budget) * u128::from(counts.rays) / u128::from(counts.work().max(1));
    usize::try_from(rays).unwrap_or(usize::MAX).clamp(PACKET, quest.rays.len().max(PACKET))
}
