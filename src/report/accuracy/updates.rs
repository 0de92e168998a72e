//! Ways to bring a structure to the next pose.

use super::{
    Options, Source,
    point::label,
    quest::{Class, Quest},
};
use crate::{
    accel::{AnyAccel, Refit},
    geom::{Forms, Triangles},
    glam::Vec3,
    report::{
        Bound, Cell, Check, Column, Monitor, ReportError, Role, Table, grouped,
        measure::{Answer, Caster, Samples},
        reference::wilson,
    },
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("nodes", "node format", Role::Id, 0),
    Column::new("policy", "update", Role::Id, 0),
    Column::new("precision", "precision", Role::Id, 0),
    Column::new("rays", "rays", Role::Id, 0),
    Column::new("update_ms", "update [ms a frame]", Role::Sooner, 3),
    Column::new("ns_per_ray", "ns a ray", Role::Sooner, 0),
    Column::new("bytes_per_triangle", "bytes a triangle", Role::Less, 1),
    Column::new("count", "rays judged", Role::Note, 0),
    Column::new("mistakes", "wrong answers", Role::Less, 0),
    Column::new("mistakes_below", "fewer in 10^9 than", Role::Note, 0),
    Column::new("not_rounded", "not correctly rounded", Role::Less, 0),
    Column::new("differences", "answers unlike a fresh build's", Role::Less, 0),
    Column::new("violations", "bound violations", Role::Less, 0),
    Column::new("sah_ratio", "SAH cost over a fresh build's", Role::Less, 3),
    Column::new("visits_ratio", "visits over a fresh build's", Role::Less, 3),
    Column::new("note", "note", Role::Note, 0),
];

/// How old a structure's topology may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Policy {
    /// Built anew for every frame.
    Rebuild,
    /// Built a frame ago and refitted.
    Refit,
    /// Built when the motion began and refitted ever since.
    Kept,
}

impl Policy {
    const ALL: [Self; 3] = [Self::Rebuild, Self::Refit, Self::Kept];

    fn name(self) -> &'static str {
        match self {
            Self::Rebuild => "rebuild",
            Self::Refit => "refit, one frame old",
            Self::Kept => "refit, topology of the first frame",
        }
    }
}

/// A structure brought to the pose in one way, on one class of rays.
#[derive(Clone, Debug)]
pub(super) struct UpdateRow {
    scene: String,
    structure: String,
    nodes: &'static str,
    policy: Policy,
    forms: Forms,
    class: String,
    update: Samples,
    seconds: Samples,
    bytes_per_triangle: f64,
    rays: u64,
    mistakes: u64,
    inexact: u64,
    differences: u64,
    violations: Vec<String>,
    sah_ratio: Option<f64>,
    visits_ratio: Option<f64>,
}

impl UpdateRow {
    fn cells(&self) -> Vec<Cell> {
        vec![
            self.scene.clone().into(),
            self.structure.clone().into(),
            self.nodes.into(),
            self.policy.name().into(),
            label(self.forms).into(),
            self.class.clone().into(),
            self.update.median().map(|s| s * 1e3).into(),
            self.seconds.median().map(|s| s * 1e9 / self.rays.max(1) as f64).into(),
            self.bytes_per_triangle.into(),
            self.rays.into(),
            self.mistakes.into(),
            (wilson(self.mistakes, self.rays).1 * 1e9).into(),
            self.inexact.into(),
            self.differences.into(),
            self.violations.len().into(),
            self.sah_ratio.into(),
            self.visits_ratio.into(),
            (!self.violations.is_empty()).then(|| self.violations.join("; ")).into(),
        ]
    }
}

/// The rows as they are written.
pub(super) fn table(rows: &[UpdateRow]) -> Table {
    let mut table = Table::new("updates", "Updates by scene and class of rays", COLUMNS)
        .in_json_only()
        .with_note("As `update_points`, not added up.");
    for row in rows {
        table.push(row.cells());
    }
    table
}

const POINT_COLUMNS: &[Column] = &[
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("nodes", "node format", Role::Id, 0),
    Column::new("policy", "update", Role::Id, 0),
    Column::new("update_ratio", "update over a rebuild", Role::Sooner, 3),
    Column::new("ray_ratio", "ray over a fresh build's", Role::Sooner, 2),
    Column::new("visits_ratio", "visits over a fresh build's", Role::Less, 3),
    Column::new("sah_ratio", "SAH cost over a fresh build's", Role::Less, 3),
    Column::new("count", "rays judged", Role::Note, 0),
    Column::new("mistakes", "wrong answers", Role::Less, 0),
    Column::new("mistakes_below", "in 10^9, at most", Role::Note, 0),
    Column::new("not_rounded", "not correctly rounded", Role::Less, 0),
    Column::new("differences", "unlike a fresh build's", Role::Less, 0),
    Column::new("violations", "bound violations", Role::Less, 0),
];

/// The geometric mean of ratios; `None` without any.
fn mean(ratios: impl Iterator<Item = f64>) -> Option<f64> {
    let logs: Vec<f64> = ratios.filter(|r| *r > 0.0 && r.is_finite()).map(libm::log).collect();
    (!logs.is_empty()).then(|| libm::exp(logs.iter().sum::<f64>() / logs.len() as f64))
}

/// Every structure and policy over all scenes and rays.
pub(super) fn points(rows: &[UpdateRow]) -> Table {
    let mut table = Table::new("update_points", "Updates: rebuild, refit, old topology", POINT_COLUMNS).with_note(
        "A refit keeps the tree and computes its bounds anew; however old the topology, it costs time, never answers. The motion is a frame of the scene's \
         first clip, or everything since it began; for meshes, a wave. Exact answers after each update are compared with those of a fresh build bit for bit, and judged. Structures that cannot \
         refit are built anew. Ratios are geometric means over scenes, of primary rays and rays at edges: what an update takes over a rebuild, what a ray takes and visits over a ray through a fresh build, \
         and the surface-area cost. Updates take part in the exact precision, where they must not show; fast answers change with the tree.",
    );
    let mut groups: Vec<Vec<&UpdateRow>> = Vec::new();
    for row in rows {
        match groups.iter_mut().find(|g| g[0].structure == row.structure && g[0].policy == row.policy) {
            Some(group) => group.push(row),
            None => groups.push(vec![row]),
        }
    }
    for of in groups {
        let fresh = |r: &UpdateRow| {
            let same = |f: &&UpdateRow| f.structure == r.structure && f.scene == r.scene && f.class == r.class;
            rows.iter().filter(|f| f.policy == Policy::Rebuild).find(same).cloned()
        };
        let over = |of_row: fn(&UpdateRow) -> Option<f64>| {
            mean(of.iter().filter_map(|r| Some(of_row(r)? / of_row(&fresh(r)?)?)))
        };
        let sum = |count: fn(&UpdateRow) -> u64| of.iter().map(|r| count(r)).sum::<u64>();
        let (judged, mistakes) = (sum(|r| r.rays), sum(|r| r.mistakes));
        table.push(vec![
            of[0].structure.clone().into(),
            of[0].nodes.into(),
            of[0].policy.name().into(),
            over(|r| r.update.median()).into(),
            over(|r| r.seconds.median()).into(),
            mean(of.iter().filter_map(|r| r.visits_ratio)).into(),
            mean(of.iter().filter_map(|r| r.sah_ratio)).into(),
            judged.into(),
            mistakes.into(),
            (wilson(mistakes, judged).1 * 1e9).into(),
            sum(|r| r.inexact).into(),
            sum(|r| r.differences).into(),
            sum(|r| r.violations.len() as u64).into(),
        ]);
    }
    table
}

/// In a sentence.
pub(super) fn in_short(rows: &[UpdateRow]) -> String {
    let sum = |of: fn(&UpdateRow) -> u64| grouped(rows.iter().map(of).sum());
    format!(
        "**Updates:** {} answers after rebuilds and refits, {} wrong, {} unlike those of a fresh build; {} bound violations.",
        sum(|r| r.rays),
        sum(|r| r.mistakes),
        sum(|r| r.differences),
        sum(|r| r.violations.len() as u64),
    )
}

/// What updates must show.
pub(super) fn checks(rows: &[UpdateRow]) -> Vec<Check> {
    let exact = || rows.iter().filter(|r| r.forms == Forms::EXACT);
    let none = Bound::Exactly(0.0);
    let sum = |of: fn(&UpdateRow) -> u64| exact().map(of).sum::<u64>() as f64;
    vec![
        Check::new("exact, after updates: wrong or wrongly rounded answers", none, sum(|r| r.mistakes + r.inexact)),
        Check::new("exact, after updates: answers unlike those of a fresh build", none, sum(|r| r.differences)),
        Check::new("triangles outside their nodes after updates", none, sum(|r| r.violations.len() as u64)),
    ]
}

/// Every structure brought to the pose in every way.
///
/// # Errors
/// When `monitor` ends it.
pub(super) fn measure(
    source: &Source,
    quests: &[Quest],
    options: &Options,
    monitor: &mut dyn Monitor,
) -> Result<Vec<UpdateRow>, ReportError> {
    let prims = source.prims();
    let mut rows = Vec::new();
    for spec in &options.specs {
        monitor.begin(&format!("{}: {spec}: updates", source.name))?;
        let mut update = Samples::default();
        let Ok(fresh) = update.time(|| spec.build(&prims)) else { continue };
        for policy in Policy::ALL {
            let mut made = Made { accel: fresh.clone(), update: update.clone(), policy };
            if policy != Policy::Rebuild {
                let from = if policy == Policy::Refit { &source.before } else { &source.first };
                let Some(refitted) = refit(spec, from, &prims, options.repeats()) else { continue };
                (made.accel, made.update) = refitted;
            }
            let of_interest = |q: &&Quest| q.class == Class::Edges || q.class.name() == "primary";
            for quest in quests.iter().filter(of_interest) {
                rows.push(row(source, spec.to_string(), &fresh, &made, quest, options));
            }
        }
    }
    Ok(rows)
}

/// A structure at the pose.
struct Made {
    accel: AnyAccel,
    update: Samples,
    policy: Policy,
}

/// Built over `from` and refitted to `prims`, with the times of refits to and fro; `None` when it cannot be.
fn refit(
    spec: &crate::accel::AccelSpec,
    from: &[Vec3],
    prims: &Triangles<'_>,
    repeats: usize,
) -> Option<(AnyAccel, Samples)> {
    let old = Triangles { positions: from, ..*prims };
    let mut one = spec.build(&old).ok().filter(AnyAccel::refits)?;
    let mut other = one.clone();
    let mut samples = Samples::default();
    for _ in 0..repeats.max(1) {
        let done = samples.time(|| one.refit_into(&mut other, prims));
        if done == Refit::NeedsRebuild || other.refit_into(&mut one, &old) == Refit::NeedsRebuild {
            return None;
        }
    }
    Some((other, samples))
}

fn row(
    source: &Source,
    structure: String,
    fresh: &AnyAccel,
    made: &Made,
    quest: &Quest,
    options: &Options,
) -> UpdateRow {
    let prims = source.prims();
    let caster = |accel| Caster { accel, prims, simd: options.simd, forms: Forms::EXACT };
    let (old, new) = (caster(fresh), caster(&made.accel));
    let ask = quest.class.ask();
    let quest = quest.part(super::rays::affordable(&old, quest, options.budget() / 4));
    let due = old.answers(&quest.rays, ask);
    let mut found = vec![Answer::MISS; quest.rays.len()];
    let mut seconds = Samples::default();
    for _ in 0..options.repeats() {
        seconds.push(new.cast(&quest.rays, ask, false, &mut found));
    }
    let tally = quest.judge(&found);
    let visits = |caster: &Caster<'_>| {
        let counts = caster.count(&quest.rays, ask, options.budget() / 8);
        counts.per_ray(counts.work())
    };
    let ratio = |a: f64, b: f64| (b > 0.0 && a.is_finite()).then(|| a / b);
    UpdateRow {
        scene: source.name.clone(),
        structure,
        nodes: made.accel.node_format(),
        policy: made.policy,
        forms: Forms::EXACT,
        class: quest.class.name(),
        update: made.update.clone(),
        seconds,
        bytes_per_triangle: made.accel.stats().total_bytes as f64 / prims.len().max(1) as f64,
        rays: tally.rays,
        mistakes: tally.mistakes(),
        inexact: tally.inexact,
        differences: found.iter().zip(&due).filter(|(a, b)| a != b).count() as u64,
        violations: made.accel.validate(&prims).err().map(|v| v.0).into_iter().collect(),
        sah_ratio: ratio(made.accel.stats().sah_cost, fresh.stats().sah_cost),
        visits_ratio: ratio(visits(&new), visits(&old)),
    }
}
