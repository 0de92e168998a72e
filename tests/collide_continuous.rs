//! Continuous detection: nothing is missed, nothing comes late, little is reported for nothing.

#[path = "common/ccd.rs"]
mod ccd;
mod common;

use std::time::Instant;

use kinora::collide::Continuous;

/// The published method reports 222 of 6,844 such queries for nothing.
const FALSE_POSITIVES: f64 = 0.03;

#[test]
fn the_shared_queries_have_no_false_negative_and_few_false_positives() {
    let Some(shared) = common::shared_dir() else { return };
    let queries = ccd::queries(&shared);
    let settings = Continuous::default();
    let (mut apart, mut false_positives) = (0, 0);
    let clock = Instant::now();
    for query in &queries {
        let impact = query.ask(&settings);
        assert!(impact.is_some() || !query.meets, "missed: {query:?}");
        if let Some(impact) = impact {
            assert!((0.0..=1.0).contains(&impact.time) && impact.gap >= 0.0, "{impact:?} for {query:?}");
        }
        apart += usize::from(!query.meets);
        false_positives += usize::from(!query.meets && impact.is_some());
    }
    let total = clock.elapsed();
    println!(
        "{} queries, {apart} apart, {false_positives} false positives, {:.2} µs each",
        queries.len(),
        total.as_secs_f64() * 1e6 / queries.len() as f64
    );
    assert!(queries.len() > 6000);
    assert!((false_positives as f64) <= FALSE_POSITIVES * f64::from(apart as u32), "{false_positives} of {apart}");
}
