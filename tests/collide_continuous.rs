//! Continuous detection: nothing is missed, nothing comes late, little is reported for nothing.
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

#[path = "common/ccd.rs"]
mod ccd;
mod common;

#[path = "common/trace.rs"]
mod trace;

use std::time::Instant;

use kinora::{collide::Continuous, glam::DVec3};
use trace::Random;

/// The published method reports 222 of 6,844 such queries for nothing.
const FALSE_POSITIVES: f64 = 0.002;

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

/// Corners within a unit cube that move together by up to a tenth and against each other by less.
fn ordinary_step(random: &mut Random) -> ([DVec3; 4], [DVec3; 4]) {
    let mut vector = |size: f64| random.vec3().as_dvec3() * size;
    let start = [vector(0.5), vector(0.5), vector(0.5), vector(0.5)];
    let motion = vector(0.1);
    let end =
        [start[0] + motion + vector(0.1), start[1] + vector(0.02), start[2] + vector(0.02), start[3] + vector(0.02)];
    (start, end)
}

/// Whether the reported contact is one beyond doubt: the four corners turn from one side to the other around it, well inside of both.
fn is_sure(start: &[DVec3; 4], end: &[DVec3; 4], time: f64, weights: &[f64]) -> bool {
    let volume = |t: f64| {
        let [a, b, c, d] = std::array::from_fn(|i| start[i] + (end[i] - start[i]) * t);
        (a - d).dot((b - d).cross(c - d))
    };
    volume(time - 1e-6) * volume(time + 1e-6) < 0.0 && weights.iter().all(|w| (1e-4..=1.0 - 1e-4).contains(w))
}

#[test]
fn ordinary_motion_is_hardly_ever_reported_for_nothing() {
    let settings = Continuous::default();
    let mut random = Random(21);
    let (mut asked, mut reported, mut doubtful) = (0, 0, 0);
    while asked < 20_000 {
        let (start, end) = ordinary_step(&mut random);
        let within = |corners: &[usize]| {
            let all = corners.iter().flat_map(|&i| [start[i], end[i]]);
            all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
        };
        let overlap = |a: (DVec3, DVec3), b: (DVec3, DVec3)| a.0.cmple(b.1).all() && b.0.cmple(a.1).all();
        if overlap(within(&[0]), within(&[1, 2, 3])) {
            asked += 1;
            if let Some(impact) = settings.vertex_face(&start, &end) {
                reported += 1;
                let [u, v] = impact.place;
                doubtful += usize::from(!is_sure(&start, &end, impact.time, &[u, v, 1.0 - u - v]));
            }
        }
        if overlap(within(&[0, 1]), within(&[2, 3])) {
            asked += 1;
            if let Some(impact) = settings.edge_edge(&start, &end) {
                reported += 1;
                doubtful += usize::from(!is_sure(&start, &end, impact.time, &impact.place));
            }
        }
    }
    println!("{asked} asked, {reported} reported, {doubtful} of them not surely contacts");
    assert!(reported > 100);
    assert!(doubtful * 1000 <= asked - reported, "{doubtful} of {asked}");
}
