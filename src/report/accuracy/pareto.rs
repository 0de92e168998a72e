//! Which points are worth their cost.

use super::rays::RayRow;
use crate::{
    geom::Forms,
    report::{Cell, Chart, Column, Dot, Plot, Role, Scatter, Table, reference::wilson},
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("rays", "rays", Role::Id, 0),
    Column::new("cost", "cost", Role::Id, 0),
    Column::new("error", "error", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("nodes", "node format", Role::Id, 0),
    Column::new("precision", "precision", Role::Id, 0),
    Column::new("cast", "cast", Role::Id, 0),
    Column::new("cost_value", "cost, value", Role::Note, 1),
    Column::new("error_value", "error, value", Role::Note, 3),
    Column::new("non_dominated", "non-dominated", Role::Note, 0),
];

/// What a point costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cost {
    NsPerRay,
    BytesPerTriangle,
}

impl Cost {
    const ALL: [Self; 2] = [Self::NsPerRay, Self::BytesPerTriangle];

    fn name(self) -> &'static str {
        match self {
            Self::NsPerRay => "ns a ray",
            Self::BytesPerTriangle => "bytes a triangle",
        }
    }

    fn of(self, row: &RayRow) -> Option<f64> {
        match self {
            Self::NsPerRay => row.ns(),
            Self::BytesPerTriangle => Some(row.bytes_per_triangle),
        }
    }
}

/// What is wrong with a point's answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Measure {
    Mistakes,
    Leaks,
    TMax,
    UvMax,
}

impl Measure {
    const ALL: [Self; 4] = [Self::Mistakes, Self::Leaks, Self::TMax, Self::UvMax];

    fn name(self) -> &'static str {
        match self {
            Self::Mistakes => "wrong answers in 10^9",
            Self::Leaks => "leaks in 10^9",
            Self::TMax => "largest error of t [u]",
            Self::UvMax => "largest error of u, v [u]",
        }
    }

    /// The rate of an event is as it was found; what it may be at most is drawn.
    fn of(self, row: &RayRow) -> Option<f64> {
        let e = &row.errors;
        let rate = |n: u64| n as f64 * 1e9 / e.rays.max(1) as f64;
        match self {
            Self::Mistakes => Some(rate(e.mistakes())),
            Self::Leaks => e.leaks.map(rate),
            Self::TMax => e.t[2],
            Self::UvMax => e.t[2].map(|_| e.uv_max),
        }
    }

    /// Where the point is drawn: a rate at the upper end of its confidence interval.
    fn drawn(self, row: &RayRow) -> Option<f64> {
        let high = |n: u64| wilson(n, row.errors.rays).1 * 1e9;
        match self {
            Self::Mistakes => Some(high(row.errors.mistakes())),
            Self::Leaks => row.errors.leaks.map(high),
            Self::TMax | Self::UvMax => self.of(row),
        }
    }
}

/// For each point (cost, error): true when no other is at least as good in both and better in one.
fn non_dominated(points: &[(f64, f64)]) -> Vec<bool> {
    let beats = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
    points.iter().map(|p| !points.iter().any(|q| beats(q, p))).collect()
}

/// A group of points that may be compared: one scene, one class, one cost and one measure.
struct Front<'a> {
    cost: Cost,
    measure: Measure,
    rows: Vec<&'a RayRow>,
    points: Vec<(f64, f64)>,
    best: Vec<bool>,
}

fn fronts(rows: &[RayRow]) -> Vec<Front<'_>> {
    let mut groups: Vec<(String, String)> = Vec::new();
    for row in rows {
        let group = (row.scene.clone(), row.class.name());
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    let mut fronts = Vec::new();
    for (scene, class) in &groups {
        let of_group: Vec<&RayRow> = rows.iter().filter(|r| r.scene == *scene && r.class.name() == *class).collect();
        for (cost, measure) in Cost::ALL.into_iter().flat_map(|c| Measure::ALL.map(|m| (c, m))) {
            let with = of_group.iter().filter_map(|&r| Some((r, (cost.of(r)?, measure.of(r)?))));
            let (rows, points): (Vec<&RayRow>, Vec<(f64, f64)>) = with.unzip();
            if !rows.is_empty() {
                let best = non_dominated(&points);
                fronts.push(Front { cost, measure, rows, points, best });
            }
        }
    }
    fronts
}

/// All points with their marks.
pub(super) fn table(rows: &[RayRow]) -> Table {
    let mut table = Table::new("pareto", "Which points are worth their cost", COLUMNS).with_note(
        "A point is non-dominated when no other point on the same rays costs at most as much and errs at most as much, and is better in one of both. \
         There is no single score: a point that is dominated here may be the best by another cost or error.",
    );
    for front in fronts(rows) {
        for ((row, point), &best) in front.rows.iter().zip(&front.points).zip(&front.best) {
            table.push(vec![
                row.scene.clone().into(),
                row.class.name().into(),
                front.cost.name().into(),
                front.measure.name().into(),
                row.structure.clone().into(),
                row.nodes.into(),
                super::point::label(row.forms).into(),
                row.cast().into(),
                point.0.into(),
                point.1.into(),
                Cell::Flag(best),
            ]);
        }
    }
    table
}

/// A plot of each scene, class of rays aimed at edges or from inside, cost and measure.
pub(super) fn plots(rows: &[RayRow]) -> Vec<Plot> {
    fronts(rows).iter().filter(|f| f.points.len() > 2 && f.is_telling()).map(Front::plot).collect()
}

impl Front<'_> {
    /// Where every point errs alike there is nothing to see.
    fn is_telling(&self) -> bool {
        let first = self.points[0].1;
        self.points.iter().any(|p| p.1.total_cmp(&first).is_ne())
    }

    fn plot(&self) -> Plot {
        let dot = |((row, point), &best): ((&&RayRow, &(f64, f64)), &bool)| {
            let single = if row.packets { ", packets" } else { "" };
            Dot {
                name: format!("{} {}{single}", row.structure, super::point::label(row.forms)),
                at: (point.0, self.measure.drawn(row).unwrap_or(point.1)),
                is_best: best,
                mark: usize::from(row.forms != Forms::EXACT),
            }
        };
        let dots = self.rows.iter().zip(&self.points).zip(&self.best).map(dot).collect();
        let y = match self.measure {
            Measure::Mistakes | Measure::Leaks => format!("{}, at most (95 %)", self.measure.name()),
            Measure::TMax | Measure::UvMax => self.measure.name().to_owned(),
        };
        let (scene, class) = (&self.rows[0].scene, self.rows[0].class.name());
        Plot::new(
            format!("pareto {scene} {class} {} {}", short(self.cost.name()), short(self.measure.name())),
            format!("{scene}, {class}"),
            Chart::Scatter(Scatter { x: self.cost.name().to_owned(), y, dots }),
        )
    }
}

/// Letters and digits only, for file names.
fn short(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty());
    words.collect::<Vec<_>>().join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_dominated_by_one_that_is_better_in_one_and_not_worse_in_the_other() {
        let points = [(1.0, 5.0), (2.0, 3.0), (2.0, 4.0), (3.0, 3.0), (4.0, 0.0), (4.0, 0.0)];
        assert_eq!(non_dominated(&points), [true, true, false, false, true, true]);
        assert_eq!(non_dominated(&[(f64::NAN, 0.0), (1.0, 0.0)]), [true, true]);
    }

    #[test]
    fn file_names_are_words() {
        assert_eq!(short("largest error of t [u]"), "largest-error-of-t-u");
    }
}
