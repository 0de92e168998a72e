//! What exact answers cost, by kind of rays.

use std::fmt::Write;

use super::{bounds::is_aimed, quest::Class, rays::RayRow};
use crate::{
    geom::Precision,
    report::{Column, Role, Table},
};

/// What exact is to cost over the fastest at most.
const DUE: f64 = 1.10;

const COLUMNS: &[Column] = &[
    Column::new("rays", "rays", Role::Id, 0),
    Column::new("cast", "cast", Role::Id, 0),
    Column::new("scenes", "scenes", Role::Note, 0),
    Column::new("over_fast", "exact over fast, same structure: median", Role::Note, 2),
    Column::new("over_fast_most", "most", Role::Note, 2),
    Column::new("over_fastest", "fastest exact over fastest of all: median", Role::Note, 2),
    Column::new("over_fastest_most", "most", Role::Note, 2),
    Column::new("within_due", "at most 1.1", Role::Note, 0),
];

/// One class of rays, cast alone or in packets, over all scenes.
struct Cost {
    class: Class,
    packets: bool,
    scenes: usize,
    /// Exact over fast nodes and triangles in the same structure, ascending.
    over_fast: Vec<f64>,
    /// The fastest exact point over the fastest of all, a scene each, ascending.
    over_fastest: Vec<f64>,
}

impl Cost {
    fn of(rows: &[RayRow], class: Class, packets: bool) -> Self {
        let own = || rows.iter().filter(move |r| r.class == class && r.packets == packets);
        let mut scenes: Vec<&str> = Vec::new();
        for row in own() {
            if !scenes.contains(&row.scene.as_str()) {
                scenes.push(&row.scene);
            }
        }
        let is_fast = |row: &&RayRow| row.forms.nodes == Precision::Fast && row.forms.leaves == Precision::Fast;
        let over_fast = own().filter(is_fast).filter_map(|fast| {
            let exact = own().find(|r| r.is_exact() && r.scene == fast.scene && r.structure == fast.structure)?;
            Some(exact.ns()? / fast.ns()?)
        });
        let over_fastest = scenes.iter().filter_map(|scene| {
            let least = |exact: bool| {
                let of_scene = own().filter(|r| r.scene == *scene && (r.is_exact() || !exact));
                of_scene.filter_map(RayRow::ns).reduce(f64::min)
            };
            Some(least(true)? / least(false)?)
        });
        let (over_fast, over_fastest) = (ascending(over_fast), ascending(over_fastest));
        Self { class, packets, scenes: scenes.len(), over_fast, over_fastest }
    }

    fn cast(&self) -> &'static str {
        if self.packets { "packets" } else { "single" }
    }

    /// Whether an ordinary class costs no more than is due.
    fn is_within(&self) -> Option<bool> {
        if is_aimed(self.class) { None } else { Some(median(&self.over_fastest)? <= DUE) }
    }
}

fn ascending(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

fn median(ascending: &[f64]) -> Option<f64> {
    ascending.get(ascending.len() / 2).copied()
}

/// All classes, in the order of their first rows.
fn costs(rows: &[RayRow]) -> Vec<Cost> {
    let mut kinds: Vec<(Class, bool)> = Vec::new();
    for row in rows {
        if !kinds.contains(&(row.class, row.packets)) {
            kinds.push((row.class, row.packets));
        }
    }
    kinds.into_iter().map(|(class, packets)| Cost::of(rows, class, packets)).collect()
}

/// A row for each class of rays.
pub(super) fn table(rows: &[RayRow]) -> Table {
    let mut table = Table::new("exact_cost", "What exact costs, by class of rays", COLUMNS).with_note(
        "Time of a ray, one thread, all points in turn in one run. *Same structure*: exact over fast nodes and triangles, the median over scenes and structures. \
         *Fastest*: of all structures the fastest exact one over the fastest point of any precision, the median over scenes. At most 1.1 is aimed at; a class beyond it says \
         no, whatever the median over all classes. Rays that ask for the closest hit have its t, u and v correctly rounded, which costs most where nearly every ray hits. Rays at edges and corners are hard on purpose: what is in doubt there is decided by integers, \
         and fast may err on three quarters of them.",
    );
    for cost in costs(rows) {
        table.push(vec![
            cost.class.name().into(),
            cost.cast().into(),
            cost.scenes.into(),
            median(&cost.over_fast).into(),
            cost.over_fast.last().copied().into(),
            median(&cost.over_fastest).into(),
            cost.over_fastest.last().copied().into(),
            cost.is_within().into(),
        ]);
    }
    table
}

/// A sentence: which classes of ordinary rays cost more than is aimed at.
pub(super) fn in_short(rows: &[RayRow]) -> Option<String> {
    let costs: Vec<Cost> = costs(rows).into_iter().filter(|cost| !is_aimed(cost.class)).collect();
    let with_ratio = |cost: &Cost| Some((median(&cost.over_fastest)?, cost.class.name(), cost.cast()));
    let ratios: Vec<_> = costs.iter().filter_map(with_ratio).collect();
    let least = ratios.iter().map(|r| r.0).reduce(f64::min)?;
    let most = ratios.iter().map(|r| r.0).reduce(f64::max)?;
    let mut out = format!(
        "**Cost of exact:** the fastest exact structure takes {least:.2} to {most:.2} of the time of the fastest of any precision, by class of ordinary rays;"
    );
    let beyond: Vec<_> = ratios.iter().filter(|r| r.0 > DUE).collect();
    if beyond.is_empty() {
        out.push_str(" 1.10 is aimed at and kept.");
    } else {
        out.push_str(" 1.10 is aimed at and missed by");
        for (i, (ratio, class, cast)) in beyond.iter().enumerate() {
            let _ = write!(out, "{} {class} rays, {cast} ({ratio:.2})", if i > 0 { "," } else { "" });
        }
        out.push('.');
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geom::Forms,
        report::{RayClass, accuracy::rays::Errors, measure::Samples},
    };

    fn row(structure: &str, class: RayClass, forms: Forms, seconds: f64) -> RayRow {
        of_class(structure, Class::Common(class), forms, seconds)
    }

    fn of_class(structure: &str, class: Class, forms: Forms, seconds: f64) -> RayRow {
        let mut samples = Samples::default();
        samples.push(seconds);
        RayRow {
            scene: "scene".to_owned(),
            class,
            structure: structure.to_owned(),
            nodes: "",
            forms,
            packets: false,
            triangles: 1,
            seconds: samples,
            bytes_per_triangle: 0.0,
            errors: Errors { rays: 100, ..Errors::default() },
        }
    }

    #[test]
    fn a_class_beyond_the_aim_is_named_and_the_fastest_of_any_structure_counts() {
        let fast = Forms::from(Precision::Fast);
        let rows = [
            row("bvh2", RayClass::Primary, Forms::EXACT, 2.0),
            row("bvh2", RayClass::Primary, fast, 1.0),
            row("bvh8", RayClass::Primary, Forms::EXACT, 1.25),
            row("bvh8", RayClass::Primary, fast, 1.0),
            row("bvh2", RayClass::Ao, Forms::EXACT, 1.0),
            row("bvh2", RayClass::Ao, fast, 1.0),
            row("bvh8", RayClass::Ao, fast, 2.0),
            of_class("bvh2", Class::Edges, Forms::EXACT, 8.0),
            of_class("bvh2", Class::Edges, fast, 1.0),
        ];
        let costs = costs(&rows);
        assert_eq!(costs.len(), 3);
        assert_eq!((costs[0].over_fastest.clone(), costs[0].is_within()), (vec![1.25], Some(false)));
        assert_eq!(costs[0].over_fast, [1.25, 2.0]);
        assert_eq!((costs[1].over_fastest.clone(), costs[1].is_within()), (vec![1.0], Some(true)));
        assert_eq!((costs[2].over_fastest.clone(), costs[2].is_within()), (vec![8.0], None));
        let said = in_short(&rows).unwrap();
        assert!(said.contains("missed by primary rays, single (1.25)."), "{said}");
        assert!(in_short(&rows[4..]).unwrap().contains("kept"));
        assert_eq!(in_short(&[]), None);
    }
}
