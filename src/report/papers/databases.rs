//! The databases' published ray counts, and a uniform grid's tests and cells, beside ours.

use super::{
    Options,
    boxes::{OverBoxes, Structure},
    published::GRIDS,
    spd::{PIXELS, RayCounts, RaySet, Rules, published::HAVRAN},
};
use crate::{
    report::{Bound, Cell, Check, Column, Monitor, ReportError, Role, Table},
    scene::spd::SpdKind,
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("objects", "objects", Role::Note, 0),
    Column::new("primary_hits", "primary hits", Role::Note, 0),
    Column::new("paper_primary_hits", "(published)", Role::Note, 0),
    Column::new("primary_percent", "off [%]", Role::Note, 2),
    Column::new("shadow", "shadow rays", Role::Note, 0),
    Column::new("paper_shadow", "(published)", Role::Note, 0),
    Column::new("shadow_percent", "off [%]", Role::Note, 2),
    Column::new("secondary", "secondary rays", Role::Note, 0),
    Column::new("paper_secondary", "(published)", Role::Note, 0),
    Column::new("secondary_percent", "off [%]", Role::Note, 2),
    Column::new("grid_tests", "grid: tests a ray", Role::Less, 2),
    Column::new("paper_grid_tests", "(published)", Role::Note, 2),
    Column::new("grid_cells", "grid: cells a ray", Role::Less, 2),
    Column::new("paper_grid_cells", "(published)", Role::Note, 2),
];

/// The table and its bounds.
///
/// # Errors
/// When `monitor` ends it or a scene or structure cannot be made.
pub(super) fn measure(options: Options, monitor: &mut dyn Monitor) -> Result<(Table, Vec<Check>), ReportError> {
    let mut table = Table::new("databases", "Standard Procedural Databases: ray counts", COLUMNS).with_note(
        "513 x 513 rays from the eye at default sizes, after the rules inferred from the published counts (Havran and Sixta, 1999). The grid follows \
         Woo's rule at density 10, as theirs.",
    );
    let quick = |kind| matches!(kind, SpdKind::Tetra | SpdKind::Balls);
    let (mut primary, mut others) = (0.0_f64, 0.0_f64);
    for (kind, published) in HAVRAN.iter().filter(|(kind, _)| !options.quick || quick(*kind)) {
        let over = OverBoxes::new(*kind, kind.default_size())?;
        monitor.begin(&format!("databases: {}", over.name()))?;
        let picture = (PIXELS, RaySet::All);
        let (rays, grid) = if options.quick {
            (over.rays(picture, Rules::Havran), None)
        } else {
            let run = over.picture(Structure::GridWoo, picture, 0, Rules::Havran)?;
            (run.rays, Some([run.tests(), run.per_ray(run.counts.steps)]))
        };
        let [off_primary, off_shadow, off_secondary] = off(&rays, published);
        primary = primary.max(off_primary.abs());
        others = others.max(off_shadow.abs()).max(off_secondary.abs());
        table.push(cells(&over, &rays, published, grid));
    }
    let checks = vec![
        Check::new("databases: primary hits off the published ones, at most [%]", Bound::AtMost(0.5), primary),
        Check::new("databases: shadow and secondary rays off, at most [%]", Bound::AtMost(14.0), others),
    ];
    Ok((table, checks))
}

/// By how many percent primary hits, shadow rays and secondary rays are off.
fn off(ours: &RayCounts, due: &RayCounts) -> [f64; 3] {
    let off = |a: u64, b: u64| if a == b { 0.0 } else { 100.0 * (a as f64 / b as f64 - 1.0) };
    [
        off(ours.primary.hits, due.primary.hits),
        off(ours.shadow.rays, due.shadow.rays),
        off(ours.secondary.rays, due.secondary.rays),
    ]
}

fn cells(over: &OverBoxes, rays: &RayCounts, due: &RayCounts, grid: Option<[f64; 2]>) -> Vec<Cell> {
    let [primary, shadow, secondary] = off(rays, due);
    let paper = GRIDS.iter().find(|g| g.0 == over.kind().name()).filter(|_| grid.is_some());
    vec![
        over.name().into(),
        over.objects().into(),
        rays.primary.hits.into(),
        due.primary.hits.into(),
        primary.into(),
        rays.shadow.rays.into(),
        due.shadow.rays.into(),
        shadow.into(),
        rays.secondary.rays.into(),
        due.secondary.rays.into(),
        secondary.into(),
        grid.map(|g| g[0]).into(),
        paper.map(|g| g.1).into(),
        grid.map(|g| g[1]).into(),
        paper.map(|g| g.2).into(),
    ]
}
