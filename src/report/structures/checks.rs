//! What the rows must show.

use super::{
    limits::MEMORY,
    rows::{RayRow, Tables},
};
use crate::{
    accel::AccelKind,
    report::{Bound, Check, measure::Samples},
};

/// Bounds on the rows.
pub(super) fn checks(tables: &Tables) -> Vec<Check> {
    let in_rays: usize = tables.rays.iter().map(|r| r.differences).sum();
    let in_refits: usize = tables.builds.iter().filter_map(|r| r.refit_differences).sum();
    let in_growth: usize = tables.growth.iter().filter_map(|r| r.differences).sum();
    let broken = tables.builds.iter().map(|r| &r.violations).chain(tables.growth.iter().map(|r| &r.violations));
    let broken: usize = broken.map(Vec::len).sum();
    let peak = tables.growth.iter().filter_map(|r| r.peak).max();
    let mut checks = vec![
        Check::new("answers that differ between structures", Bound::Exactly(0.0), (in_rays + in_growth) as f64),
        Check::new("answers that differ after a refit", Bound::Exactly(0.0), in_refits as f64),
        Check::new("broken invariants after builds and refits", Bound::Exactly(0.0), broken as f64),
        Check::new(
            "memory of the process [GiB]",
            Bound::AtMost((MEMORY >> 30) as f64),
            peak.map(|p| p as f64 / f64::from(1 << 30)),
        ),
    ];
    if AccelKind::ALL.iter().any(|k| k.name() == "kdtree") {
        checks.push(Check::new(
            "`kdtree` against `bvh2`, single rays, median over scenes and classes",
            Bound::AtLeast(0.5),
            ratio(tables, "kdtree", "bvh2"),
        ));
    }
    checks
}

/// The median ratio of two structures' single-ray rates over all scenes and classes that both have.
fn ratio(tables: &Tables, of: &str, to: &str) -> Option<f64> {
    let mut ratios = Samples::default();
    for a in tables.rays.iter().filter(|r| r.structure == of) {
        let same = |b: &&RayRow| b.structure == to && b.scene == a.scene && b.class == a.class;
        let b = tables.rays.iter().find(same);
        if let (Some(x), Some(y)) = (a.rate(&a.single), b.and_then(|b| b.rate(&b.single))) {
            ratios.push(x / y);
        }
    }
    ratios.median()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{
        RayClass,
        measure::Counts,
        structures::rows::{BuildRow, GrowthRow},
    };

    fn row(structure: &str, seconds: f64) -> RayRow {
        let mut single = Samples::default();
        single.push(seconds);
        RayRow {
            scene: "s".into(),
            structure: structure.into(),
            class: RayClass::Primary,
            count: 1000,
            packet: single.clone(),
            single,
            counts: Counts::default(),
            differences: 0,
        }
    }

    fn missed(tables: &Tables) -> Vec<String> {
        checks(tables).into_iter().filter(Check::is_missed).map(|c| c.claim).collect()
    }

    #[test]
    fn rows_in_order_miss_nothing_and_each_fault_is_named() {
        let good = Tables { rays: vec![row("bvh2", 1.0), row("kdtree", 2.0)], ..Tables::default() };
        assert!(missed(&good).is_empty());
        assert_eq!(ratio(&good, "kdtree", "bvh2"), Some(0.5));
        assert_eq!(ratio(&good, "grid", "bvh2"), None);

        let mut slow = good.clone();
        slow.rays[1] = row("kdtree", 2.1);
        assert_eq!(missed(&slow).len(), 1);
        let mut bad = good.clone();
        bad.rays[1].differences = 1;
        assert_eq!(missed(&bad), ["answers that differ between structures"]);
        let mut bad = good.clone();
        bad.builds.push(BuildRow { refit_differences: Some(2), violations: vec!["x".into()], ..BuildRow::default() });
        assert_eq!(missed(&bad).len(), 2);
        let mut bad = good;
        bad.growth.push(GrowthRow { peak: Some(MEMORY + (1 << 20)), ..GrowthRow::default() });
        assert_eq!(missed(&bad), ["memory of the process [GiB]"]);
    }
}
