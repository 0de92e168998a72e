//! Speed by class for a scene, and growth over size.

use super::rows::{GrowthRow, Tables};
use crate::report::{Bars, Chart, Line, Lines, Plot, RayClass};

/// Single and packet rates of one scene.
pub(super) fn rates(scene: &str, tables: &Tables) -> Vec<Plot> {
    // Brute force is thousands of times slower: its mark would press the others together.
    let rows: Vec<_> = tables.rays.iter().filter(|r| r.scene == scene && r.structure != "list").collect();
    let mut groups: Vec<String> = Vec::new();
    for row in &rows {
        if !groups.contains(&row.structure) {
            groups.push(row.structure.clone());
        }
    }
    let line = |(class, packet): (RayClass, bool)| {
        let of_class = rows.iter().filter(|r| r.class == class);
        let points = of_class.filter_map(|r| {
            let place = groups.iter().position(|g| *g == r.structure)?;
            Some((place as f64, r.rate(if packet { &r.packet } else { &r.single })?))
        });
        let kind = if packet { "packets" } else { "single" };
        Line {
            name: format!("{}, {kind}", class.name()),
            points: points.collect(),
            color: class as usize,
            mark: usize::from(packet),
        }
    };
    let kinds = RayClass::ALL.iter().flat_map(|&class| [(class, false), (class, true)]);
    let lines: Vec<Line> = kinds.map(line).filter(|l| !l.points.is_empty()).collect();
    if lines.is_empty() {
        return Vec::new();
    }
    let chart = Chart::Bars(Bars { groups, y: "million rays a second".into(), lines });
    vec![Plot::new(format!("rates-{scene}"), format!("Rays: {scene}"), chart)]
}

/// Build, memory, refit and ray cost over the number of triangles.
pub(super) fn growth(tables: &Tables) -> Vec<Plot> {
    type Value = fn(&GrowthRow) -> Option<f64>;
    let plots: [(&str, &str, &str, Value); 5] = [
        ("growth-build", "Build time", "milliseconds", |r| r.build.median().map(|s| s * 1e3)),
        ("growth-memory", "Memory", "bytes a triangle", |r| {
            r.stats.map(|s| s.total_bytes as f64 / r.triangles.max(1) as f64)
        }),
        ("growth-refit", "Refit time", "milliseconds", |r| r.refit.median().map(|s| s * 1e3)),
        ("growth-primary", "A primary ray", "nanoseconds", |r| r.ns(&r.primary)),
        ("growth-diffuse", "A diffuse ray", "nanoseconds", |r| r.ns(&r.diffuse)),
    ];
    let plot = |(name, title, y, value): (&str, &str, &str, Value)| {
        // Lines keep their colours in all plots.
        let mut lines: Vec<Line> = Vec::new();
        for row in &tables.growth {
            if lines.iter().all(|l| l.name != row.structure) {
                lines.push(Line::new(lines.len(), row.structure.clone(), Vec::new()));
            }
        }
        for row in &tables.growth {
            let Some(value) = value(row) else { continue };
            let point = (row.triangles as f64, value);
            lines.iter_mut().filter(|l| l.name == row.structure).for_each(|l| l.points.push(point));
        }
        lines.retain(|l| !l.points.is_empty());
        let chart = Chart::Lines(Lines { x: "triangles".into(), y: y.into(), lines });
        Plot::new(name, format!("{title} over the number of triangles"), chart)
    };
    plots.into_iter().map(plot).collect()
}
