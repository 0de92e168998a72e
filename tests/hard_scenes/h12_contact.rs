//! H12: resting gaps of 0 and 1 to 8 ulp either way, bullets through thin plates, parallel edges, and the shared queries over a step.
//!
//! Pass: triangles are decided exactly, and no contact over a step is missed or comes late.

use kinora::{
    collide::{Continuous, triangle_contact, triangles_meet},
    glam::{DVec3, Vec3},
};

use crate::{ccd, common, trace::Random};

const SCALES: [f32; 5] = [1e-3, 1.0, 1000.0, 1e5, 1e-30];

fn ulps(value: f32, n: i32) -> f32 {
    f32::from_bits(value.to_bits().wrapping_add_signed(n))
}

fn wide<const N: usize>(points: [Vec3; N]) -> [DVec3; N] {
    points.map(Vec3::as_dvec3)
}

/// A box's lower face above a table, as two triangles each.
fn resting(size: f32, gap: i32) -> ([[Vec3; 3]; 2], [[Vec3; 3]; 2]) {
    let face = |low: f32, high: f32, z: f32| {
        let [a, b, c, d] = [(low, low), (high, low), (high, high), (low, high)].map(|(x, y)| Vec3::new(x, y, z));
        [[a, b, c], [a, c, d]]
    };
    (face(-size, 2.0 * size, size), face(0.0, size, ulps(size, gap)))
}

#[test]
fn resting_faces_touch_at_no_gap_and_at_no_other() {
    for size in SCALES {
        for gap in -8..=8 {
            let (table, foot) = resting(size, gap);
            let met = table.iter().any(|a| foot.iter().any(|b| triangles_meet(a, b)));
            assert_eq!(met, gap == 0, "size {size}, gap {gap} ulp");
            if gap == 0 {
                assert!(table.iter().any(|a| foot.iter().any(|b| triangle_contact(a, b).is_some_and(|c| c.dim == 2))));
            }
        }
    }
}

#[test]
fn a_vertex_that_comes_down_by_ulps_is_not_missed() {
    let settings = Continuous { tolerance: 0.0, ..Continuous::default() };
    for size in SCALES {
        let (table, _) = resting(size, 0);
        for from in -8..=8 {
            for to in -8..=8 {
                let at = |gap: i32| Vec3::new(0.5 * size, 0.25 * size, ulps(size, gap)).as_dvec3();
                let (start, end) = (at(from), at(to));
                let height = f64::from(size);
                let crosses = (start.z >= height && end.z <= height) || (start.z <= height && end.z >= height);
                let first = if start.z == end.z { 0.0 } else { (start.z - height) / (start.z - end.z) };
                let found = table.iter().filter_map(|face| {
                    let [a, b, c] = wide(*face);
                    settings.vertex_face(&[start, a, b, c], &[end, a, b, c])
                });
                let earliest = found.map(|i| i.time).reduce(f64::min);
                // An ulp of f32 is far above what f64 cannot tell: here nothing is reported for nothing.
                assert_eq!(earliest.is_some(), crosses, "size {size}, from {from} to {to} ulp");
                assert!(earliest.is_none_or(|t| t <= first && t >= first - 1e-6), "{earliest:?} for {first}");
            }
        }
    }
}

#[test]
fn bullets_do_not_pass_thin_plates() {
    let settings = Continuous::default();
    let mut random = Random(3);
    for thickness in [0.0, 1e-6, 1e-3] {
        for speed in [1.0, 1e3, 1e6, 1e9] {
            for _ in 0..200 {
                // Through the diagonal of a square, where two triangles must not leave a gap, in one of its halves, or at a corner.
                let along = (random.unit() * 0.5 + 0.5).clamp(0.0, 1.0);
                let target = match random.below(4) {
                    0 => Vec3::new(along, along, 0.0),
                    1 => Vec3::new(along, along * 0.5, 0.0),
                    2 => Vec3::new(0.0, along, 0.0),
                    _ => Vec3::ZERO,
                }
                .as_dvec3();
                let way = (random.vec3() + Vec3::new(0.0, 0.0, -2.0)).as_dvec3() * speed;
                // The middle of the step is at the target, up to rounding that stays inside of the plate's thickness or is nil.
                let (start, end) = (target - way, target + way);
                let inside = (start + end) * 0.5 == target;
                let squares = [0.0, thickness].map(|z| {
                    let corner = |x: f64, y: f64| DVec3::new(x, y, z);
                    let [a, b, c, d] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
                    [[a, b, c], [a, c, d]]
                });
                let found: Vec<_> = squares
                    .iter()
                    .flatten()
                    .filter_map(|&[a, b, c]| settings.vertex_face(&[start, a, b, c], &[end, a, b, c]))
                    .collect();
                if inside {
                    assert!(!found.is_empty(), "through {target} by {way}");
                    assert!(found.iter().any(|i| i.time <= 0.5), "{found:?}");
                }
            }
        }
    }
}

#[test]
fn crossing_edges_of_thin_things_do_not_pass_each_other() {
    let settings = Continuous::default();
    let mut random = Random(8);
    for speed in [1.0, 1e3, 1e6] {
        for _ in 0..300 {
            // Both edges pass through one point in the middle of the step; all numbers are dyadic.
            let grid = |random: &mut Random| (random.vec3() * 64.0).round().as_dvec3() / 16.0;
            let (way_a, way_b) = (grid(&mut random), grid(&mut random));
            let along = [random.below(9) as f64 / 8.0, random.below(9) as f64 / 8.0];
            let a = [way_a * -along[0], way_a * (1.0 - along[0])];
            let b = [way_b * -along[1], way_b * (1.0 - along[1])];
            let motion = grid(&mut random) * speed;
            let start = [a[0] - motion, a[1] - motion, b[0] + motion, b[1] + motion];
            let end = [a[0] + motion, a[1] + motion, b[0] - motion, b[1] - motion];
            let impact = settings.edge_edge(&start, &end);
            assert!(impact.is_some_and(|i| i.time <= 0.5), "{impact:?}: {start:?} {end:?}");
        }
    }
}

#[test]
fn parallel_edges_meet_when_they_do() {
    let settings = Continuous { tolerance: 0.0, ..Continuous::default() };
    for along in [DVec3::X, DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.125, -0.5, 1024.0)] {
        let across = along.any_orthogonal_vector() * 0.5;
        // Side by side, end to end, and past the end by a half; from a distance on either side.
        for (shift, overlaps) in [(0.0, true), (0.5, true), (1.0, true), (-1.0, true), (1.5, false), (-1.5, false)] {
            let a = [DVec3::ZERO, along];
            let b = a.map(|p| p + along * shift);
            let start = [a[0], a[1], b[0] + across, b[1] + across];
            let end = [a[0], a[1], b[0] - across, b[1] - across];
            let impact = settings.edge_edge(&start, &end);
            assert_eq!(impact.is_some(), overlaps, "shift {shift} of {along}: {impact:?}");
            assert!(impact.is_none_or(|i| i.time <= 0.5 && i.time > 0.499), "{impact:?}");
            // The second edge turned round is the same edge.
            let turned =
                settings.edge_edge(&[start[0], start[1], start[3], start[2]], &[end[0], end[1], end[3], end[2]]);
            assert_eq!(turned.is_some(), overlaps);
            // On one line, towards each other.
            let late = a.map(|p| p + along * 3.0);
            let met = settings.edge_edge(&[a[0], a[1], late[0], late[1]], &[late[0], late[1], a[0], a[1]]);
            assert!(met.is_some_and(|i| i.time <= 1.0 / 3.0 && i.time > 0.33), "{met:?}");
        }
    }
}

#[test]
fn the_shared_queries_over_a_step_are_not_missed() {
    let Some(shared) = common::shared_dir() else { return };
    let settings = Continuous::default();
    let missed: Vec<_> =
        ccd::queries(&shared).into_iter().filter(|q| q.meets && q.ask(&settings).is_none()).map(|q| q.name).collect();
    assert!(missed.is_empty(), "{missed:?}");
}
