//! Collision: what touches what, and when, against answers in whole numbers.

mod cases;
mod whole;

use std::hint::black_box;

use rayon::prelude::*;

use super::Options;
use crate::{
    collide::{
        Continuous, box_pairs, boxes_meet, closest_on_triangle, ray_box, sweep_box, triangle_contact,
        triangle_distance, triangle_meets_box, triangle_meets_capsule, triangle_meets_sphere, triangles_meet,
    },
    geom::{Aabb, Ray},
    report::{
        Bound, Cell, Check, Column, Monitor, ReportError, Role, Table, grouped,
        measure::{Samples, Stopwatch},
        reference::wilson,
    },
};
use cases::{Dice, Motion, PAIRS, Pair, UNIT, cuboid, placed, step};
use whole::{Ratio, Whole};

const COLUMNS: &[Column] = &[
    Column::new("question", "question", Role::Id, 0),
    Column::new("kind", "kind", Role::Id, 0),
    Column::new("cases", "cases", Role::Id, 0),
    Column::new("ns", "ns a query", Role::Sooner, 0),
    Column::new("spread", "± [%]", Role::Note, 0),
    Column::new("count", "queries", Role::Note, 0),
    Column::new("meet", "meet", Role::Note, 0),
    Column::new("missed", "missed", Role::Less, 0),
    Column::new("missed_below", "fewer in 10^9 than", Role::Note, 0),
    Column::new("false_contacts", "false", Role::Less, 0),
    Column::new("false_contacts_below", "fewer in 10^9 than", Role::Note, 0),
    Column::new("false_most", "false, at most [%]", Role::Note, 0),
    Column::new("late", "late", Role::Less, 0),
    Column::new("error", "largest error", Role::Less, 3),
    Column::new("error_most", "at most", Role::Note, 0),
    Column::new("error_of", "error of", Role::Note, 0),
];

/// What is promised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// No wrong answer.
    Exact,
    /// No contact is missed, and none is late.
    Conservative,
    /// Decided in f64.
    Lossy,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Conservative => "conservative",
            Self::Lossy => "lossy",
        }
    }
}

/// What one answer came to.
#[derive(Clone, Copy, Debug, Default)]
struct Outcome {
    due: bool,
    found: bool,
    is_late: bool,
    error: f64,
}

impl Outcome {
    fn decided(due: bool, found: bool) -> Self {
        Self { due, found, ..Self::default() }
    }
}

/// A question on some cases.
#[derive(Clone, Debug)]
pub(super) struct ContactRow {
    question: String,
    kind: Kind,
    cases: String,
    seconds: Samples,
    count: u64,
    meet: u64,
    missed: u64,
    false_contacts: u64,
    late: u64,
    error: f64,
    /// The share of queries that may be false contacts.
    false_most: f64,
    /// What `error` is of, and its bound.
    error_of: Option<(&'static str, f64)>,
}

impl ContactRow {
    fn cells(&self) -> Vec<Cell> {
        let below = |n: u64| wilson(n, self.count).1 * 1e9;
        vec![
            self.question.clone().into(),
            self.kind.name().into(),
            self.cases.clone().into(),
            self.seconds.median().map(|s| s * 1e9 / self.count.max(1) as f64).into(),
            self.seconds.spread().into(),
            self.count.into(),
            self.meet.into(),
            self.missed.into(),
            below(self.missed).into(),
            self.false_contacts.into(),
            below(self.false_contacts).into(),
            (self.false_most * 100.0).into(),
            (self.kind == Kind::Conservative).then_some(self.late).into(),
            self.error_of.map(|_| self.error).into(),
            self.error_of.map(|(_, most)| most).into(),
            self.error_of.map(|(of, _)| of).into(),
        ]
    }
}

/// The rows as they are written.
pub(super) fn table(rows: &[ContactRow]) -> Table {
    let mut table = Table::new("contacts", "Collision: exact, conservative and lossy answers", COLUMNS).with_note(
        "Every answer is compared with one in whole numbers that shares nothing with `collide`. Missed: the two share a point, and it was not found. False: they share none. An exact \
         question is decided right for every input. A conservative one misses nothing and is never late, and may report what only comes near: nearer than the tolerance, as a rule; its cases \
         meet at one known moment, or stay apart by a known way. A lossy one works in f64. The true rate of an error is below the number behind its count with 95 % confidence; times are of one thread.",
    );
    for row in rows {
        table.push(row.cells());
    }
    table
}

/// In a sentence.
pub(super) fn in_short(rows: &[ContactRow]) -> String {
    let sum = |kind: Kind, of: fn(&ContactRow) -> u64| rows.iter().filter(|r| r.kind == kind).map(of).sum::<u64>();
    let exact = sum(Kind::Exact, |r| r.count);
    let steps = sum(Kind::Conservative, |r| r.meet);
    format!(
        "**Collision:** {} wrong of {} exact decisions; {} missed and {} late of {} contacts over a step, {} of {} steps without contact reported.",
        sum(Kind::Exact, |r| r.missed + r.false_contacts),
        grouped(exact),
        sum(Kind::Conservative, |r| r.missed),
        sum(Kind::Conservative, |r| r.late),
        grouped(steps),
        grouped(sum(Kind::Conservative, |r| r.false_contacts)),
        grouped(sum(Kind::Conservative, |r| r.count) - steps),
    )
}

/// What collision must show.
pub(super) fn checks(rows: &[ContactRow]) -> Vec<Check> {
    let of = |kind: Kind| rows.iter().filter(move |r| r.kind == kind);
    let sum = |kind: Kind, count: fn(&ContactRow) -> u64| of(kind).map(count).reduce(|a, b| a + b).map(|n| n as f64);
    let none = Bound::Exactly(0.0);
    let over = |share: fn(&ContactRow) -> Option<f64>| rows.iter().filter_map(share).reduce(f64::max);
    let false_share = |r: &ContactRow| {
        let least = if r.false_contacts == 0 { 0.0 } else { wilson(r.false_contacts, r.count).0 };
        (r.kind == Kind::Conservative).then_some(least - r.false_most)
    };
    vec![
        Check::new("exact collision: wrong answers", none, sum(Kind::Exact, |r| r.missed + r.false_contacts)),
        Check::new("conservative collision: contacts missed", none, sum(Kind::Conservative, |r| r.missed)),
        Check::new("conservative collision: contacts reported late", none, sum(Kind::Conservative, |r| r.late)),
        Check::new("conservative collision: false contacts beyond their bound", Bound::AtMost(0.0), over(false_share)),
        Check::new("lossy collision: wrong answers", none, sum(Kind::Lossy, |r| r.missed + r.false_contacts)),
        Check::new(
            "collision: error over its bound",
            Bound::AtMost(1.0),
            over(|r| r.error_of.map(|(_, most)| r.error / most)),
        ),
    ]
}

/// All questions on all cases.
///
/// # Errors
/// When `monitor` ends it.
pub(super) fn measure(options: &Options, monitor: &mut dyn Monitor) -> Result<Vec<ContactRow>, ReportError> {
    let mut bench = Bench { options, monitor, rows: Vec::new() };
    bench.triangles()?;
    bench.boxes()?;
    bench.distances()?;
    bench.steps()?;
    Ok(bench.rows)
}

struct Bench<'a> {
    options: &'a Options,
    monitor: &'a mut dyn Monitor,
    rows: Vec<ContactRow>,
}

/// Relative errors are given in these: 2^-53.
const F64_UNIT: f64 = f64::EPSILON / 2.0;

impl Bench<'_> {
    fn count(&self) -> usize {
        if self.options.quick { 4_000 } else { 400_000 }
    }

    /// Asks all cases on one thread, some times, and compares the answers with `judge`.
    fn row<C: Sync, A: Send + Sync>(
        &mut self,
        (question, kind, name): (&str, Kind, &str),
        cases: &[C],
        ask: impl Fn(&C) -> A,
        judge: impl Fn(&C, &A) -> Outcome + Sync,
    ) -> Result<&mut ContactRow, ReportError> {
        self.monitor.begin(&format!("collision: {question}, {name}"))?;
        let mut answers: Vec<A> = cases.iter().map(&ask).collect();
        let mut seconds = Samples::default();
        for _ in 0..self.options.repeats() {
            let watch = Stopwatch::thread();
            answers.clear();
            answers.extend(cases.iter().map(|case| ask(black_box(case))));
            seconds.push(watch.seconds());
        }
        let outcomes: Vec<Outcome> = cases.par_iter().zip(&answers).map(|(case, answer)| judge(case, answer)).collect();
        let count = |of: fn(&Outcome) -> bool| outcomes.iter().filter(|o| of(o)).count() as u64;
        self.rows.push(ContactRow {
            question: question.to_owned(),
            kind,
            cases: name.to_owned(),
            seconds,
            count: cases.len() as u64,
            meet: count(|o| o.due),
            missed: count(|o| o.due && !o.found),
            false_contacts: count(|o| !o.due && o.found),
            late: count(|o| o.is_late),
            error: outcomes.iter().map(|o| o.error).fold(0.0, f64::max),
            false_most: 0.0,
            error_of: None,
        });
        Ok(self.rows.last_mut().unwrap_or_else(|| unreachable!("just pushed")))
    }

    fn triangles(&mut self) -> Result<(), ReportError> {
        for (set, (name, make)) in PAIRS.into_iter().enumerate() {
            let pairs: Vec<Pair> = (0..self.count()).map(|i| make(&mut Dice::new(set as u64, i))).collect();
            let cases: Vec<_> = pairs.into_iter().map(|pair| (pair, pair.map(|t| t.map(placed)))).collect();
            let due = |&([a, b], _): &(Pair, _)| whole::triangles_meet(a, b);
            let of = |question| (question, Kind::Exact, name);
            self.row(
                of("triangles_meet"),
                &cases,
                |(_, [a, b])| triangles_meet(a, b),
                |c, &found| Outcome::decided(due(c), found),
            )?;
            self.row(
                of("triangle_contact"),
                &cases,
                |(_, [a, b])| triangle_contact(a, b).is_some(),
                |c, &found| Outcome::decided(due(c), found),
            )?;
        }
        let cases: Vec<_> = (0..self.count())
            .map(|i| {
                let mut d = Dice::new(20, i);
                let n = if i % 2 == 0 { 3 } else { 300 };
                let (triangle, solid) = (d.triangle([0; 3], n), cuboid(&mut d, n, n));
                (triangle, solid, triangle.map(placed), aabb(&solid))
            })
            .collect();
        self.row(
            ("triangle_meets_box", Kind::Exact, "half of them on a grid of 7^3"),
            &cases,
            |(.., triangle, solid)| triangle_meets_box(triangle, solid),
            |(triangle, solid, ..), &found| Outcome::decided(solid.meets_triangle(*triangle), found),
        )?;
        Ok(())
    }

    fn boxes(&mut self) -> Result<(), ReportError> {
        const GRID: &str = "on a grid of 17^3";
        let cases: Vec<_> = (0..self.count())
            .map(|i| {
                let mut d = Dice::new(30, i);
                let pair = [(); 2].map(|()| cuboid(&mut d, 8, 6));
                let motion = d.point(12);
                let to = d.below(4);
                (pair, motion, to, pair.each_ref().map(aabb), placed(motion))
            })
            .collect();
        self.row(
            ("boxes_meet", Kind::Exact, GRID),
            &cases,
            |(.., [a, b], _)| boxes_meet(a, b),
            |([a, b], ..), &found| Outcome::decided(a.meets(b), found),
        )?;
        let error = ("time of first and last contact, relative, in 2^-53", 5.0);
        self.row(
            ("sweep_box", Kind::Exact, GRID),
            &cases,
            |(.., [a, b], motion)| sweep_box(a, *motion, b).map(|p| [p.enter, p.exit]),
            |([a, b], motion, ..), found| passage(a.sweep(*motion, b, 0, Some(1)), *found),
        )?
        .error_of = Some(error);
        let rays: Vec<_> = cases
            .iter()
            .filter(|c| c.1 != [0; 3])
            .map(|&([a, b], way, to, ..)| {
                let to = (to > 0).then_some(to);
                #[expect(clippy::cast_precision_loss, reason = "below 4")]
                let t_far = to.map_or(f32::INFINITY, |t| t as f32);
                ((a.min, b, way, to), Ray { t_far, ..Ray::new(placed(a.min), placed(way)) }, aabb(&b))
            })
            .collect();
        self.row(
            ("ray_box", Kind::Exact, GRID),
            &rays,
            |(_, ray, solid)| ray_box(ray, solid).map(|p| [p.enter, p.exit]),
            |&((from, solid, way, to), ..), found| {
                passage(Whole { min: from, max: from }.sweep(way, &solid, 0, to), *found)
            },
        )?
        .error_of = Some(error);
        self.pairs()
    }

    /// All pairs among some boxes; a query is a pair that could meet.
    fn pairs(&mut self) -> Result<(), ReportError> {
        self.monitor.begin("collision: box_pairs")?;
        let n = if self.options.quick { 500 } else { 5_000 };
        let all: Vec<Whole> = (0..n).map(|i| cuboid(&mut Dice::new(40, i), 60, 8)).collect();
        let boxes: Vec<Aabb> = all.iter().map(aabb).collect();
        let mut found = Vec::new();
        let mut seconds = Samples::default();
        for _ in 0..self.options.repeats() {
            let watch = Stopwatch::thread();
            found = box_pairs(black_box(&boxes));
            seconds.push(watch.seconds());
        }
        #[expect(clippy::cast_possible_truncation, reason = "some thousands")]
        let due: Vec<[u32; 2]> = (0..n)
            .flat_map(|i| (i + 1..n).map(move |j| (i, j)))
            .filter(|&(i, j)| all[i].meets(&all[j]))
            .map(|(i, j)| [i as u32, j as u32])
            .collect();
        let without = |a: &[[u32; 2]], b: &[[u32; 2]]| a.iter().filter(|p| b.binary_search(p).is_err()).count() as u64;
        self.rows.push(ContactRow {
            question: "box_pairs".to_owned(),
            kind: Kind::Exact,
            cases: format!("all pairs of {n} boxes"),
            seconds,
            count: (n * (n - 1) / 2) as u64,
            meet: due.len() as u64,
            missed: without(&due, &found),
            false_contacts: without(&found, &due),
            late: 0,
            error: 0.0,
            false_most: 0.0,
            error_of: None,
        });
        Ok(())
    }

    fn distances(&mut self) -> Result<(), ReportError> {
        for (set, (name, make)) in PAIRS.into_iter().enumerate().filter(|(i, _)| matches!(i, 0 | 2)) {
            let cases: Vec<_> = (0..self.count() / 4)
                .map(|i| {
                    let mut d = Dice::new(50 + set as u64, i);
                    let pair = make(&mut d);
                    let radius = d.below(if set == 2 { 4 } else { 700 });
                    (pair, radius, pair.map(|t| t.map(placed)))
                })
                .collect();
            let of = |question| (question, Kind::Lossy, name);
            // 2^-45 of the largest coordinate.
            let error = ("distance, over the largest coordinate, in 2^-53", 256.0);
            self.row(
                of("triangle_distance"),
                &cases,
                |(.., [a, b])| triangle_distance(a, b).map(|n| n.distance),
                |([a, b], ..), &found| distance(whole::of_triangles(*a, *b), found, &[a, b]),
            )?
            .error_of = Some(error);
            self.row(
                of("closest_on_triangle"),
                &cases,
                |(.., [a, b])| closest_on_triangle(a[0], b).map(|n| n.distance),
                |([a, b], ..), &found| Outcome {
                    // It decides nothing.
                    error: distance(whole::from_triangle(a[0], *b), found, &[a, b]).error,
                    ..Outcome::default()
                },
            )?
            .error_of = Some(error);
            #[expect(clippy::cast_precision_loss, reason = "below 2^24")]
            let size = |radius: i64| radius as f32 * UNIT;
            self.row(
                ("triangle_meets_sphere", Kind::Exact, name),
                &cases,
                |(_, radius, [a, b])| triangle_meets_sphere(b, a[0], size(*radius)),
                |([a, b], radius, _), &found| {
                    Outcome::decided(whole::from_triangle(a[0], *b).is_within(*radius), found)
                },
            )?;
            self.row(
                ("triangle_meets_capsule", Kind::Exact, name),
                &cases,
                |(_, radius, [a, b])| triangle_meets_capsule(b, a[0], a[1], size(*radius)),
                |([a, b], radius, _), &found| {
                    let apart = whole::segment_from_triangle([a[0], a[1]], *b);
                    Outcome::decided(apart.is_within(*radius), found)
                },
            )?;
        }
        Ok(())
    }

    fn steps(&mut self) -> Result<(), ReportError> {
        /// Cases, what they do, and the share that may be reported falsely: of edges, of faces.
        const SETS: [(&str, Motion, [f64; 2]); 4] = [
            ("meet at one moment", Motion::Meets, [0.0; 2]),
            ("stay on their sides of a plane, 2^-44 or more apart", Motion::StaysApart(-44), [1e-3; 2]),
            ("pass by a border by 2^-10 of its size", Motion::PassesBy(-10), [1e-3; 2]),
            ("pass by a border by 2^-34 of its size", Motion::PassesBy(-34), [1e-2, 0.75]),
        ];
        for is_face in [true, false] {
            let what = if is_face { "vertex_face" } else { "edge_edge" };
            for (set, (name, motion, most)) in SETS.into_iter().enumerate() {
                let set = 60 + 2 * set as u64 + u64::from(is_face);
                let cases: Vec<_> =
                    (0..self.count() / 4).map(|i| step(&mut Dice::new(set, i), is_face, motion)).collect();
                for tolerance in [1e-6, 1e-9] {
                    let settings = Continuous { tolerance, ..Continuous::default() };
                    let row = self.row(
                        (&format!("Continuous::{what}, tolerance {tolerance:e}"), Kind::Conservative, name),
                        &cases,
                        |s| {
                            if s.is_face {
                                settings.vertex_face(&s.start, &s.end)
                            } else {
                                settings.edge_edge(&s.start, &s.end)
                            }
                        },
                        |s, found| Outcome {
                            due: s.due.is_some(),
                            found: found.is_some(),
                            is_late: s.due.zip(*found).is_some_and(|(due, found)| found.time > due),
                            error: s.due.zip(*found).map_or(0.0, |(due, found)| (due - found.time) * 1e9),
                        },
                    )?;
                    row.false_most = most[usize::from(is_face)];
                    // They come nearer by a 64th or more of a step, so the tolerance and what rounding adds last that long.
                    let early = ("time, early, in 10^-9 of the step", 70.0 * tolerance * 1e9);
                    row.error_of = (motion == Motion::Meets).then_some(early);
                }
            }
        }
        Ok(())
    }
}

fn aabb(solid: &Whole) -> Aabb {
    Aabb { min: placed(solid.min), max: placed(solid.max) }
}

/// Compares two ends of a range; the error in 2^-53.
fn passage(due: Option<[Ratio; 2]>, found: Option<[f64; 2]>) -> Outcome {
    let error = |(due, found): (Ratio, f64)| {
        let due = due.value();
        if due == 0.0 { found.abs() / f64::MIN_POSITIVE } else { ((found - due) / due).abs() / F64_UNIT }
    };
    let errors = due.zip(found).map(|(due, found)| due.into_iter().zip(found).map(error).fold(0.0, f64::max));
    Outcome { error: errors.unwrap_or(0.0), ..Outcome::decided(due.is_some(), found.is_some()) }
}

/// Compares a distance with a squared one; the error over the largest coordinate, in 2^-53. They meet where it is 0.
fn distance(due: Ratio, found: Option<f64>, triangles: &[&[[i64; 3]; 3]]) -> Outcome {
    let due = libm::sqrt(due.value()) * f64::from(UNIT);
    let found = found.unwrap_or(f64::NAN);
    let largest = triangles.iter().copied().flatten().flatten().map(|x| x.abs()).max().unwrap_or(0);
    let error = (found - due).abs() / (largest.max(1) as f64 * f64::from(UNIT)) / F64_UNIT;
    Outcome { error: if error.is_nan() { f64::INFINITY } else { error }, ..Outcome::decided(due == 0.0, found == 0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Quiet;

    #[test]
    fn every_answer_is_that_of_whole_numbers_and_cases_of_both_kinds_occur() {
        let rows = measure(&Options::new(true), &mut Quiet).expect("nothing ends it");
        for check in checks(&rows) {
            assert!(!check.is_missed() && check.value.is_some(), "{check}");
        }
        let decides = |r: &&ContactRow| r.kind != Kind::Conservative && r.question != "closest_on_triangle";
        for r in rows.iter().filter(decides) {
            let is_mixed = r.meet > 0 && (r.meet < r.count || r.cases == "sharing an edge");
            assert!(is_mixed, "{}, {}: {} of {} meet", r.question, r.cases, r.meet, r.count);
        }
        let steps = rows.iter().filter(|r| r.kind == Kind::Conservative);
        assert!(steps.filter(|r| r.meet == r.count).count() == 4);
    }

    #[test]
    fn a_wrong_late_or_inaccurate_answer_misses_a_bound() {
        let cases = [(true, true), (false, false)];
        let options = Options::new(true);
        let missed = |kind: Kind, judge: fn(&(bool, bool), &bool) -> Outcome| {
            let mut bench = Bench { options: &options, monitor: &mut Quiet, rows: Vec::new() };
            let row = bench.row(("q", kind, "c"), &cases, |c| c.1, judge).expect("nothing ends it");
            row.error_of = Some(("e", 1.0));
            checks(&bench.rows).iter().filter(|c| c.is_missed()).count()
        };
        for kind in [Kind::Exact, Kind::Conservative, Kind::Lossy] {
            assert_eq!(missed(kind, |c, &found| Outcome::decided(c.0, found)), 0);
            assert_eq!(missed(kind, |c, _| Outcome::decided(c.0, false)), 1, "{kind:?}, missed");
            assert_eq!(missed(kind, |c, _| Outcome::decided(c.0, true)), 1, "{kind:?}, false");
            assert_eq!(missed(kind, |c, &found| Outcome { error: 2.0, ..Outcome::decided(c.0, found) }), 1);
        }
        assert_eq!(missed(Kind::Conservative, |c, &f| Outcome { is_late: true, ..Outcome::decided(c.0, f) }), 1);
    }
}
