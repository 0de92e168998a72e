//! Which points are worth their cost.

use super::{images::ImageRow, point::label, quest::Class, rays::RayRow, skin::SkinRow};
use crate::{
    geom::Forms,
    report::{Cell, Chart, Column, Dot, Plot, Role, Scatter, Table, closed::Aim, reference::wilson},
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("of", "of", Role::Id, 0),
    Column::new("cost", "cost", Role::Id, 0),
    Column::new("error", "error", Role::Id, 0),
    Column::new("point", "point", Role::Id, 0),
    Column::new("nodes", "node format", Role::Note, 0),
    Column::new("precision", "precision", Role::Note, 0),
    Column::new("cost_value", "cost, value", Role::Note, 1),
    Column::new("error_value", "error, value", Role::Note, 3),
    Column::new("non_dominated", "non-dominated", Role::Note, 0),
];

/// A number with its name, and where it is drawn.
#[derive(Clone, Debug, PartialEq)]
struct Value {
    name: &'static str,
    number: f64,
    /// A rate is drawn at the upper end of its confidence interval.
    drawn: f64,
}

impl Value {
    fn new(name: &'static str, value: f64) -> Self {
        Self { name, number: value, drawn: value }
    }

    /// Of `events` in `trials`, in 10^9.
    fn rate(name: &'static str, events: u64, trials: u64) -> Self {
        let number = events as f64 * 1e9 / trials.max(1) as f64;
        Self { name, number, drawn: wilson(events, trials).1 * 1e9 }
    }
}

/// Something that costs and errs.
#[derive(Clone, Debug)]
pub(super) struct Spot {
    scene: String,
    /// What it may be compared within: a class of rays, pictures, vertices.
    of: String,
    point: String,
    nodes: &'static str,
    forms: Forms,
    costs: Vec<Value>,
    errors: Vec<Value>,
    /// Rays judged, or 1.
    weight: u64,
    is_drawn: bool,
}

/// All rows that have both a cost and an error.
pub(super) fn spots(rays: &[RayRow], images: &[ImageRow], skins: &[SkinRow]) -> Vec<Spot> {
    let rays = rays.iter().filter_map(of_rays);
    rays.chain(images.iter().filter_map(of_image)).chain(skins.iter().filter_map(of_skin)).collect()
}

fn of_rays(row: &RayRow) -> Option<Spot> {
    let e = &row.errors;
    let mut errors = vec![Value::rate("wrong answers in 10^9", e.mistakes(), e.rays)];
    errors.extend(e.leaks.map(|n| Value::rate("leaks in 10^9", n, e.rays)));
    errors.extend(e.t[2].map(|t| Value::new("largest error of t [u]", t)));
    errors.extend(e.t[2].map(|_| Value::new("largest error of u, v [u]", e.uv_max)));
    Some(Spot {
        scene: row.scene.clone(),
        of: row.class.name(),
        point: format!("{} {}, {}", row.structure, label(row.forms), row.cast()),
        nodes: row.nodes,
        forms: row.forms,
        costs: vec![Value::new("ns a ray", row.ns()?), Value::new("bytes a triangle", row.bytes_per_triangle)],
        errors,
        weight: e.rays,
        is_drawn: matches!(row.class, Class::Edges | Class::Inside(Aim::Edges)),
    })
}

fn of_image(row: &ImageRow) -> Option<Spot> {
    let (of, samples) = if row.is_sampling() {
        ("sampling", format!(", {} samples", row.samples))
    } else {
        ("pictures", String::new())
    };
    let d = &row.difference;
    Some(Spot {
        scene: row.scene.clone(),
        of: of.to_owned(),
        point: format!("{} {}{samples}", row.structure, label(row.forms)),
        nodes: "",
        forms: row.forms,
        costs: vec![Value::new("ms a frame", row.frame.median()? * 1e3)],
        errors: vec![
            Value::new("RMSE", d.rmse),
            Value::new("mean FLIP", d.flip),
            Value::new("differing pixels", d.pixels as f64),
        ],
        weight: 1,
        is_drawn: true,
    })
}

fn of_skin(row: &SkinRow) -> Option<Spot> {
    Some(Spot {
        scene: row.scene.clone(),
        of: "vertices".to_owned(),
        point: label(row.forms),
        nodes: "",
        forms: row.forms,
        costs: vec![Value::new("ms a frame of deforming", row.deform.median()? * 1e3)],
        errors: vec![Value::new("largest error over size", row.max), Value::new("RMS error over size", row.rms)],
        weight: 1,
        is_drawn: false,
    })
}

/// For each point (cost, error): true when no other is at least as good in both and better in one.
pub(super) fn non_dominated(points: &[(f64, f64)]) -> Vec<bool> {
    let beats = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
    points.iter().map(|p| !points.iter().any(|q| beats(q, p))).collect()
}

/// True when a point judged enough rays to stand beside one that judged `most`: the errors of a few say little.
pub(super) fn competes(rays: u64, most: u64) -> bool {
    rays.saturating_mul(20) >= most
}

/// Spots that may be compared, by one cost and one error.
struct Front<'a> {
    spots: Vec<&'a Spot>,
    costs: Vec<&'a Value>,
    errors: Vec<&'a Value>,
    best: Vec<bool>,
}

fn fronts(spots: &[Spot]) -> Vec<Front<'_>> {
    let mut keys: Vec<(&str, &str, &str, &str)> = Vec::new();
    for s in spots {
        for (cost, error) in s.costs.iter().flat_map(|c| s.errors.iter().map(move |e| (c.name, e.name))) {
            let key = (s.scene.as_str(), s.of.as_str(), cost, error);
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
    }
    keys.into_iter().map(|key| Front::new(spots, key)).collect()
}

impl<'a> Front<'a> {
    fn new(spots: &'a [Spot], (scene, of, cost, error): (&str, &str, &str, &str)) -> Self {
        let mut front = Self { spots: Vec::new(), costs: Vec::new(), errors: Vec::new(), best: Vec::new() };
        let of_kind = || spots.iter().filter(|s| s.scene == scene && s.of == of);
        let most = of_kind().map(|s| s.weight).max().unwrap_or(0);
        for s in of_kind().filter(|s| competes(s.weight, most)) {
            let named = |values: &'a [Value], name: &str| values.iter().find(|v| v.name == name);
            if let (Some(cost), Some(error)) = (named(&s.costs, cost), named(&s.errors, error)) {
                front.spots.push(s);
                front.costs.push(cost);
                front.errors.push(error);
            }
        }
        let points = front.costs.iter().zip(&front.errors).map(|(c, e)| (c.number, e.number));
        front.best = non_dominated(&points.collect::<Vec<_>>());
        front
    }

    /// Where every point errs alike there is nothing to see.
    fn is_telling(&self) -> bool {
        let first = self.errors[0].number;
        self.errors.iter().any(|e| e.number.total_cmp(&first).is_ne())
    }

    fn plot(&self) -> Plot {
        let dots = (0..self.spots.len()).map(|i| Dot {
            name: self.spots[i].point.clone(),
            at: (self.costs[i].number, self.errors[i].drawn),
            is_best: self.best[i],
            mark: usize::from(self.spots[i].forms != Forms::EXACT),
        });
        let (cost, error, spot) = (self.costs[0].name, self.errors[0].name, self.spots[0]);
        let is_rate = error.ends_with("10^9");
        let y = if is_rate { format!("{error}, at most (95 %)") } else { error.to_owned() };
        Plot::new(
            short(&format!("pareto {} {} {cost} {error}", spot.scene, spot.of)),
            format!("{}, {}", spot.scene, spot.of),
            Chart::Scatter(Scatter { x: cost.to_owned(), y, dots: dots.collect() }),
        )
    }
}

/// All points with their marks.
pub(super) fn table(spots: &[Spot]) -> Table {
    let mut table = Table::new("pareto", "Which points are worth their cost, by scene", COLUMNS).in_json_only().with_note(
        "A point is non-dominated when no other point of the same scene and kind costs at most as much and errs at most as much, and is better in one of both. \
         There is no single score: a point that is dominated here may be the best by another cost or error. Points that judged less than a twentieth of the rays are left out.",
    );
    for front in fronts(spots) {
        for (i, spot) in front.spots.iter().enumerate() {
            table.push(vec![
                spot.scene.clone().into(),
                spot.of.clone().into(),
                front.costs[i].name.into(),
                front.errors[i].name.into(),
                spot.point.clone().into(),
                if spot.nodes.is_empty() { Cell::Absent } else { spot.nodes.into() },
                label(spot.forms).into(),
                front.costs[i].number.into(),
                front.errors[i].number.into(),
                Cell::Flag(front.best[i]),
            ]);
        }
    }
    table
}

/// What is drawn by scene: the first cost of a kind against these errors.
const DRAWN: [&str; 2] = ["wrong answers in 10^9", "mean FLIP"];

/// Plots by scene, of rays at edges and of pictures, where the error tells points apart.
pub(super) fn plots(spots: &[Spot]) -> Vec<Plot> {
    let drawn: Vec<Spot> = spots.iter().filter(|s| s.is_drawn).cloned().collect();
    let is_asked = |f: &&Front<'_>| DRAWN.contains(&f.errors[0].name) && f.costs[0].name == f.spots[0].costs[0].name;
    fronts(&drawn).iter().filter(is_asked).filter(|f| f.spots.len() > 2 && f.is_telling()).map(Front::plot).collect()
}

/// Letters and digits, with dashes between words.
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
    fn points_are_compared_within_their_scene_kind_cost_and_error_only() {
        let spot = |scene: &str, of: &str, cost: f64, error: f64| Spot {
            scene: scene.to_owned(),
            of: of.to_owned(),
            point: format!("{cost}"),
            nodes: "slabs",
            forms: Forms::EXACT,
            costs: vec![Value::new("ns", cost)],
            errors: vec![Value::new("u", error)],
            weight: 1,
            is_drawn: true,
        };
        let spots = [
            spot("a", "rays", 1.0, 1.0),
            spot("a", "rays", 2.0, 2.0),
            spot("b", "rays", 2.0, 2.0),
            spot("a", "x", 9.0, 9.0),
        ];
        let table = table(&spots);
        let marks: Vec<&Cell> = table.column("non_dominated").collect();
        assert_eq!(marks, [&Cell::Flag(true), &Cell::Flag(false), &Cell::Flag(true), &Cell::Flag(true)]);
        assert!(plots(&spots).is_empty());
    }

    #[test]
    fn file_names_are_words() {
        assert_eq!(short("largest error of t [u]"), "largest-error-of-t-u");
    }
}
