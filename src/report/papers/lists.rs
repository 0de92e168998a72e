//! The sorted lists' table 1, and how tests, events and time grow with the number of objects (the paper's figures 3 to 10).

use super::{
    Options,
    boxes::{OverBoxes, Run, Structure},
    published::{LISTS, ListScene},
};
use crate::{
    report::{
        Bound, Cell, Chart, Check, Column, Line, Lines, Monitor, Plot, ReportError, Role, Table, papers::spd::RaySet,
    },
    scene::spd::SpdKind,
};

const TABLE: &[Column] = &[
    Column::new("model", "model", Role::Note, 0),
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("objects", "objects", Role::Note, 0),
    Column::new("paper_objects", "(paper)", Role::Note, 0),
    Column::new("set", "rays", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("rays", "rays cast", Role::Note, 0),
    Column::new("hits_per_ray", "hits a ray", Role::Note, 2),
    Column::new("paper_minimum", "(paper: minimum)", Role::Note, 2),
    Column::new("fewest_tests_per_ray", "fewest tests a ray", Role::Note, 2),
    Column::new("tests_per_ray", "tests a ray", Role::Less, 2),
    Column::new("paper_tests_per_ray", "(paper)", Role::Note, 2),
    Column::new("events_per_ray", "events a ray", Role::Less, 1),
    Column::new("paper_events_per_ray", "(paper)", Role::Note, 1),
    Column::new("us_per_ray", "µs a ray", Role::Sooner, 2),
    Column::new("time_over_naive", "time over naive", Role::Note, 2),
    Column::new("paper_time_over_naive", "(paper)", Role::Note, 2),
];

const GROWTH: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("objects", "objects", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("rays", "rays cast", Role::Note, 0),
    Column::new("fewest_tests_per_ray", "fewest tests a ray", Role::Note, 2),
    Column::new("tests_per_ray", "tests a ray", Role::Less, 2),
    Column::new("events_per_ray", "events a ray", Role::Less, 1),
    Column::new("skips_per_ray", "events skipped a ray", Role::Less, 1),
    Column::new("steps_per_ray", "cells a ray", Role::Less, 1),
    Column::new("us_per_ray", "µs a ray", Role::Sooner, 2),
];

/// The scenes of the growth figures: database, the paper's name, its two figures, size factors.
const FIGURES: [(SpdKind, &str, [u32; 2], &[u32]); 4] = [
    (SpdKind::Balls, "Sphereflakes", [3, 4], &[1, 2, 3, 4]),
    (SpdKind::Tree, "Tree", [5, 6], &[2, 4, 6, 8, 10, 12]),
    (SpdKind::Gears, "Gears", [7, 8], &[1, 2, 3, 4, 5, 6]),
    (SpdKind::Tetra, "Tetrahedron", [9, 10], &[1, 2, 3, 4, 5, 6, 7, 8]),
];

/// Numbers of objects between which the slope of events is taken.
const SLOPE_FROM: usize = 50;

/// A structure at one size.
struct Point {
    kind: SpdKind,
    structure: Structure,
    objects: usize,
    run: Run,
}

/// Table 1.
///
/// # Errors
/// When `monitor` ends it or a scene or structure cannot be made.
pub(super) fn table(options: Options, monitor: &mut dyn Monitor) -> Result<(Table, Vec<Check>), ReportError> {
    let mut table = Table::new("lists", "Sorted lists: table 1", TABLE).with_note(
        "Spheres, cones and polygons as they are. The paper's lists are flat; its set of rays is not known, and its minimum is the hits a ray. The \
         fewest tests are the boxes that a ray enters before it ends, which is what boxes alone allow: lists reach it for rays that look for the \
         nearest hit, while shadow rays end at any hit. The paper's figure of 1955 times more intersections for the uniform grid is that of testing \
         every object (821 / 0.42). Its 28 Bezier patches of the teapot are triangles here. Time includes making and shading the rays.",
    );
    let mut excess = 0.0_f64;
    for row in LISTS.iter().filter(|row| !options.quick || row.objects < 300) {
        let (kind, size) = scene(row);
        let over = OverBoxes::new(kind, size)?;
        for (set, name) in [(RaySet::Primary, "primary"), (RaySet::All, "all")] {
            monitor.begin(&format!("lists: {}: {name} rays", over.name()))?;
            let naive = over.run(Structure::Naive, set, options)?;
            for structure in [Structure::Naive, Structure::Flat, Structure::Tree, Structure::Grid30] {
                let run = if structure == Structure::Naive { naive } else { over.run(structure, set, options)? };
                if set == RaySet::Primary && structure.is_list() {
                    excess = excess.max((run.tests() - run.fewest).abs());
                }
                table.push(cells(row, &over, name, structure, &run, &naive));
            }
        }
    }
    let claim = "lists: tests a primary ray beyond the fewest that boxes allow";
    Ok((table, vec![Check::new(claim, Bound::Exactly(0.0), excess)]))
}

/// The database and size factor of a scene of the paper.
fn scene(row: &ListScene) -> (SpdKind, u32) {
    let kind = match &row.scene[..3] {
        "Sph" => SpdKind::Balls,
        "Tet" => SpdKind::Tetra,
        _ => return (SpdKind::Teapot, 1),
    };
    let size = (1..kind.max_size()).find(|&size| kind.object_count(size) == row.objects as u64);
    (kind, size.unwrap_or(1))
}

fn cells(row: &ListScene, over: &OverBoxes, set: &str, structure: Structure, run: &Run, naive: &Run) -> Vec<Cell> {
    let flat = structure == Structure::Flat;
    let paper = |value: f64| Cell::from(flat.then_some(value));
    let all = run.rays.all();
    vec![
        row.scene.into(),
        over.name().into(),
        over.objects().into(),
        row.objects.into(),
        set.into(),
        structure.name().into(),
        all.rays.into(),
        run.per_ray(all.hits).into(),
        row.minimum.into(),
        run.fewest.into(),
        run.tests().into(),
        paper(row.tests),
        Cell::from(structure.is_list().then(|| run.per_ray(run.counts.events))),
        paper(row.events),
        (run.seconds * 1e6).into(),
        (run.seconds / naive.seconds).into(),
        paper(row.ms / row.naive_ms),
    ]
}

/// The figures as a table and plots.
///
/// # Errors
/// When `monitor` ends it or a scene or structure cannot be made.
pub(super) fn growth(
    options: Options,
    monitor: &mut dyn Monitor,
) -> Result<(Table, Vec<Plot>, Vec<Check>), ReportError> {
    let mut table = Table::new("lists-growth", "Sorted lists: growth (figures 3 to 10)", GROWTH).with_note(
        "All rays: from the eye, to lights, reflected and refracted. The paper's grid has 30 x 30 x 30 cells; the second follows Woo's rule at density 10. \
         A grid tests an object again in every cell where it meets it.",
    );
    let mut points = Vec::new();
    for (kind, _, _, sizes) in FIGURES {
        let sizes = sizes.iter().filter(|&&size| !options.quick || kind.object_count(size) < 1500);
        for &size in sizes {
            let over = OverBoxes::new(kind, size)?;
            monitor.begin(&format!("growth: {}", over.name()))?;
            for structure in [Structure::Flat, Structure::Tree, Structure::Grid30, Structure::GridWoo] {
                let run = over.run(structure, RaySet::All, options)?;
                table.push(growth_cells(&over, structure, &run));
                points.push(Point { kind, structure, objects: over.objects(), run });
            }
        }
    }
    let checks = vec![
        Check::new(
            "lists: slope of events a ray over objects, log-log, flat, spheres",
            Bound::Between(0.9, 1.1),
            slope(&points, SpdKind::Balls, Structure::Flat),
        ),
        Check::new(
            "lists: slope of events a ray over objects, log-log, flat, tetrahedra",
            Bound::Between(0.9, 1.1),
            slope(&points, SpdKind::Tetra, Structure::Flat),
        ),
        Check::new(
            "lists: slope of events a ray over objects, log-log, hierarchy, tetrahedra",
            Bound::AtMost(0.3),
            slope(&points, SpdKind::Tetra, Structure::Tree),
        ),
    ];
    Ok((table, plots(&points), checks))
}

fn growth_cells(over: &OverBoxes, structure: Structure, run: &Run) -> Vec<Cell> {
    let c = &run.counts;
    let list = |count: u64| Cell::from(structure.is_list().then(|| run.per_ray(count)));
    vec![
        over.kind().name().into(),
        over.objects().into(),
        structure.name().into(),
        run.rays.all().rays.into(),
        run.fewest.into(),
        run.tests().into(),
        list(c.events),
        list(c.skips),
        Cell::from((c.steps > 0).then(|| run.per_ray(c.steps))),
        (run.seconds * 1e6).into(),
    ]
}

/// The exponent with which events a ray grow.
fn slope(points: &[Point], kind: SpdKind, structure: Structure) -> Option<f64> {
    let mut of = points.iter().filter(|p| p.kind == kind && p.structure == structure && p.objects >= SLOPE_FROM);
    let (first, last) = (of.next()?, of.next_back()?);
    let log = |p: &Point| (libm::log(p.objects as f64), libm::log(p.run.per_ray(p.run.counts.events)));
    let ((x0, y0), (x1, y1)) = (log(first), log(last));
    Some((y1 - y0) / (x1 - x0))
}

fn plots(points: &[Point]) -> Vec<Plot> {
    let mut plots = Vec::new();
    let of = |kind, structure| points.iter().filter(move |p| p.kind == kind && p.structure == structure);
    for (kind, name, [timings, tests], _) in FIGURES {
        let lines = |value: fn(&Run) -> f64| -> Vec<Line> {
            let shown = [Structure::Tree, Structure::Flat, Structure::Grid30, Structure::GridWoo];
            let line = |(i, s): (usize, Structure)| {
                let points = of(kind, s).map(|p| (p.objects as f64, value(&p.run)));
                Line::new(i, s.name(), points.collect())
            };
            shown.into_iter().enumerate().map(line).collect()
        };
        let chart = |y: &str, lines| Chart::Lines(Lines { x: "objects".into(), y: y.into(), lines });
        plots.push(Plot::new(
            format!("lists-figure-{timings}"),
            format!("Figure {timings} of ours: {name}, time"),
            chart("µs a ray", lines(|r| r.seconds * 1e6)),
        ));
        let mut counted = lines(Run::tests);
        let fewest = of(kind, Structure::Tree).map(|p| (p.objects as f64, p.run.fewest));
        counted.push(Line::new(counted.len(), "fewest by boxes", fewest.collect()));
        plots.push(Plot::new(
            format!("lists-figure-{tests}"),
            format!("Figure {tests} of ours: {name}, intersection tests"),
            chart("tests a ray", counted),
        ));
    }
    let line = |(i, (kind, structure)): (usize, (SpdKind, Structure))| {
        let points = of(kind, structure).map(|p| (p.objects as f64, p.run.per_ray(p.run.counts.events)));
        let name = format!("{}, {}", kind.name(), structure.name());
        Line { mark: i % 2, ..Line::new(i / 2, name, points.collect()) }
    };
    let both = FIGURES.iter().flat_map(|f| [(f.0, Structure::Flat), (f.0, Structure::Tree)]);
    let lines = both.enumerate().map(line).collect();
    let chart = Chart::Lines(Lines { x: "objects".into(), y: "events a ray".into(), lines });
    plots.push(Plot::new("lists-events", "Events a ray, flat lists and hierarchy", chart));
    plots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_scenes_are_found_by_their_numbers_of_objects() {
        for row in LISTS.iter().filter(|r| r.scene != "Teapot") {
            let (kind, size) = scene(row);
            assert_eq!(kind.object_count(size), row.objects as u64, "{}", row.scene);
        }
    }
}
