//! Whether answers have the same bits however they are computed.

use rayon::prelude::*;

use super::{
    Options, Source,
    point::{Point, label},
    quest::Quest,
    rays::{affordable, walks_packets},
};
use crate::{
    geom::Forms,
    report::{
        Bound, Cell, Check, Column, Monitor, ReportError, Role, Table,
        measure::{Answer, Caster},
        reference::wilson,
    },
    simd::SimdLevel,
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("precision", "precision", Role::Id, 0),
    Column::new("varied", "varied", Role::Id, 0),
    Column::new("answers", "answers compared", Role::Note, 0),
    Column::new("differences", "differences", Role::Less, 0),
];

/// Answers of one point compared with those that it should equal.
#[derive(Clone, Debug)]
pub(super) struct SameRow {
    scene: String,
    structure: String,
    forms: Forms,
    varied: String,
    answers: u64,
    differences: u64,
}

/// The rows as they are written.
pub(super) fn table(rows: &[SameRow]) -> Table {
    let note = "As `same_points`, not added up.";
    let mut table = Table::new("same", "Same bits, by scene and structure", COLUMNS).in_json_only().with_note(note);
    for r in rows {
        table.push(vec![
            r.scene.clone().into(),
            r.structure.clone().into(),
            label(r.forms).into(),
            r.varied.clone().into(),
            r.answers.into(),
            Cell::Count(r.differences),
        ]);
    }
    table
}

const POINT_COLUMNS: &[Column] = &[
    Column::new("precision", "precision", Role::Id, 0),
    Column::new("varied", "varied", Role::Id, 0),
    Column::new("answers", "answers compared", Role::Note, 0),
    Column::new("differences", "differences", Role::Less, 0),
    Column::new("below", "in 10^9, at most", Role::Note, 0),
];

/// Every precision over all scenes and structures.
pub(super) fn points(rows: &[SameRow]) -> Table {
    let mut table = Table::new("same_points", "Same bits: levels, packets, threads, structures", POINT_COLUMNS).with_note(
        "Triangle, t, u and v are compared bit for bit with the answers of single rays on one thread at the report's SIMD level; for structures, with \
         those of the first one. `exact` promises no difference anywhere; `fast` promises that for one level and structure only, so its rows show what \
         it gives up.",
    );
    let mut sums: Vec<(Forms, &str, u64, u64)> = Vec::new();
    for r in rows {
        match sums.iter_mut().find(|s| s.0 == r.forms && s.1 == r.varied) {
            Some((_, _, answers, differences)) => {
                *answers += r.answers;
                *differences += r.differences;
            }
            None => sums.push((r.forms, &r.varied, r.answers, r.differences)),
        }
    }
    sums.sort_by_key(|s| label(s.0));
    for (forms, varied, answers, differences) in sums {
        let below = wilson(differences, answers).1 * 1e9;
        table.push(vec![label(forms).into(), varied.into(), answers.into(), differences.into(), below.into()]);
    }
    table
}

/// What exact answers must show.
pub(super) fn checks(rows: &[SameRow]) -> Vec<Check> {
    let exact = rows.iter().filter(|r| r.forms == Forms::EXACT);
    let differ = exact.map(|r| r.differences).sum::<u64>() as f64;
    vec![Check::new("exact: answers that depend on level, packets, threads or structure", Bound::Exactly(0.0), differ)]
}

/// Compares all points of a scene.
///
/// # Errors
/// When `monitor` ends it.
pub(super) fn measure(
    source: &Source,
    quests: &[Quest],
    options: &Options,
    monitor: &mut dyn Monitor,
) -> Result<Vec<SameRow>, ReportError> {
    let mut rows = Vec::new();
    let mut first: Vec<(Forms, Vec<Vec<Answer>>)> = Vec::new();
    for spec in &options.specs {
        monitor.begin(&format!("{}: {spec}: same bits", source.name))?;
        let Ok(accel) = spec.build(&source.prims()) else { continue };
        for Point { forms, .. } in Point::all(spec) {
            let caster = Caster { accel: &accel, prims: source.prims(), simd: options.simd, forms };
            let base = answers(&caster, quests, options, false);
            let mut push = |varied: String, found: &[Vec<Answer>], base: &[Vec<Answer>]| {
                let (answers, differences) = compared(found, base);
                let (scene, structure) = (source.name.clone(), spec.to_string());
                rows.push(SameRow { scene, structure, forms, varied, answers, differences });
            };
            for (varied, found) in variations(&caster, quests, options) {
                push(varied, &found, &base);
            }
            match first.iter().find(|f| f.0 == forms) {
                Some((_, of_first)) => push("structure".to_owned(), &base, of_first),
                None => first.push((forms, base)),
            }
        }
    }
    Ok(rows)
}

/// The answers to a part of all rays of every class, which is the same for all callers of a structure.
fn answers(caster: &Caster<'_>, quests: &[Quest], options: &Options, packets: bool) -> Vec<Vec<Answer>> {
    let ask = |quest: &Quest| {
        let n = affordable(caster, quest, options.budget() / 32);
        let mut out = vec![Answer::MISS; n.min(quest.rays.len())];
        caster.cast(&quest.rays[..out.len()], quest.class.ask(), packets, &mut out);
        out
    };
    quests.iter().map(ask).collect()
}

fn variations(caster: &Caster<'_>, quests: &[Quest], options: &Options) -> Vec<(String, Vec<Vec<Answer>>)> {
    let mut found = Vec::new();
    for simd in SimdLevel::available() {
        let at = Caster { simd, ..*caster };
        if simd != caster.simd {
            found.push((format!("{} kernels", simd.name()), answers(&at, quests, options, false)));
        }
        if walks_packets(caster.accel) {
            found.push((format!("packets, {} kernels", simd.name()), answers(&at, quests, options, true)));
        }
    }
    let threads = rayon::current_num_threads();
    found.push((format!("{threads} threads"), in_parallel(caster, quests, options)));
    found
}

/// The same rays split among the threads of the current pool.
fn in_parallel(caster: &Caster<'_>, quests: &[Quest], options: &Options) -> Vec<Vec<Answer>> {
    let ask = |quest: &Quest| {
        let n = affordable(caster, quest, options.budget() / 32).min(quest.rays.len());
        quest.rays[..n].par_chunks(61).flat_map_iter(|rays| caster.answers(rays, quest.class.ask())).collect()
    };
    quests.iter().map(ask).collect()
}

/// How many answers both have, and how many of them differ.
fn compared(a: &[Vec<Answer>], b: &[Vec<Answer>]) -> (u64, u64) {
    let pairs = || a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b));
    (pairs().count() as u64, pairs().filter(|(a, b)| a != b).count() as u64)
}
