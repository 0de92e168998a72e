//! The primitives of collision against brute force in integers and rationals, where degenerate cases are likely.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "common/integers.rs"]
mod integers;
#[path = "common/trace.rs"]
mod trace;

use kinora::{
    collide::{
        Continuous, box_pairs, boxes_meet, closest_on_triangle, ray_box, sweep_box, triangle_contact,
        triangle_distance, triangle_meets_box, triangle_meets_capsule, triangle_meets_sphere, triangles_meet,
    },
    geom::{Aabb, Ray},
    glam::{DVec3, Vec3},
};
use num_rational::BigRational;
use num_traits::{ToPrimitive, Zero};
use proptest::{collection::vec, prelude::*};
use trace::rational;

/// Small integers, which meet often.
fn small(n: i8) -> impl Strategy<Value = Vec3> {
    [0..=n, 0..=n, 0..=n].prop_map(|v| Vec3::from(v.map(f32::from)))
}

/// Any finite number, weighted towards small integers and the ends of the range.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => (-3_i8..=3).prop_map(f32::from),
        3 => (-8_i8..=8).prop_map(|i| f32::from(i) * 0.25 + 1e6),
        3 => -2.0_f32..2.0,
        1 => any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |f| f.is_finite()),
        1 => prop::sample::select(vec![0.0, -0.0, 1e-45, -1e-45, f32::MIN_POSITIVE, f32::MAX, f32::MIN, 1e-38, 1e30]),
    ]
}

fn point() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
}

fn meet_alike(a: [Vec3; 3], b: [Vec3; 3]) -> Result<(), TestCaseError> {
    let due = integers::triangles_meet(&a, &b);
    prop_assert_eq!(triangles_meet(&a, &b), due);
    prop_assert_eq!(triangles_meet(&b, &a), due);
    prop_assert_eq!(triangle_contact(&a, &b).is_some(), due);
    Ok(())
}

/// A grid scaled by a power of two and moved.
fn placed(points: [Vec3; 3], scale: i32, offset: f32) -> [Vec3; 3] {
    points.map(|p| p * 2.0_f32.powi(scale) + offset)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn triangles_on_small_grids_meet_as_integers_say(
        n in 1_i8..=4,
        corners in [small(4), small(4), small(4), small(4), small(4), small(4)],
        scale in prop::sample::select(vec![0, 0, -140, -60, 100]),
    ) {
        let [a, b, c, d, e, f] = corners.map(|p| p.min(Vec3::splat(f32::from(n))));
        meet_alike(placed([a, b, c], scale, 0.0), placed([d, e, f], scale, 0.0))?;
    }

    #[test]
    fn any_finite_triangles_meet_as_integers_say(corners in vec(point(), 6), shared in [0_usize..6, 0_usize..6, 0_usize..6]) {
        let b = [3, 4, 5].map(|i| if shared[i - 3] < 2 { corners[shared[i - 3]] } else { corners[i] });
        meet_alike([corners[0], corners[1], corners[2]], b)?;
    }

    #[test]
    fn a_contact_lies_in_both_triangles(corners in [small(5), small(5), small(5), small(5), small(5), small(5)]) {
        let [a, b] = [[corners[0], corners[1], corners[2]], [corners[3], corners[4], corners[5]]];
        if let Some(contact) = triangle_contact(&a, &b) {
            prop_assert_eq!(usize::from(contact.dim), (contact.points.len() - 1).min(2));
            for &p in &contact.points {
                prop_assert!(distance(p, &a) < 1e-9 && distance(p, &b) < 1e-9, "{:?}", contact);
            }
            // No two are one.
            for (i, p) in contact.points.iter().enumerate() {
                prop_assert!(contact.points[..i].iter().all(|q| (*p - *q).length() > 1e-6), "{:?}", contact);
            }
        }
    }
}

/// Distance from a point to a triangle: to the nearest of its edges, or to its plane from above its inside.
fn distance(p: DVec3, corners: &[Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let to_edge = |a: DVec3, b: DVec3| {
        let way = b - a;
        let t = if way == DVec3::ZERO { 0.0 } else { ((p - a).dot(way) / way.dot(way)).clamp(0.0, 1.0) };
        (p - a - way * t).length()
    };
    let edges = to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a));
    let normal = (b - a).cross(c - a);
    let inside = [(a, b), (b, c), (c, a)].into_iter().all(|(x, y)| (y - x).cross(p - x).dot(normal) >= 0.0);
    if inside && normal != DVec3::ZERO { edges.min(((p - a).dot(normal) / normal.length()).abs()) } else { edges }
}

/// The six faces of a box, two triangles each.
fn faces(aabb: &Aabb) -> Vec<[Vec3; 3]> {
    let corner = |i: usize| Vec3::from([0, 1, 2].map(|a| if i >> a & 1 == 0 { aabb.min[a] } else { aabb.max[a] }));
    let squares = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    squares.iter().flat_map(|s| [[s[0], s[1], s[2]], [s[0], s[2], s[3]]].map(|t| t.map(corner))).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_triangle_meets_a_box_when_it_meets_a_face_or_lies_inside(corners in [small(6), small(6), small(6)], ends in [small(6), small(6)]) {
        let aabb = Aabb { min: ends[0].min(ends[1]), max: ends[0].max(ends[1]) };
        let inside = corners[0].cmpge(aabb.min).all() && corners[0].cmple(aabb.max).all();
        let due = inside || faces(&aabb).iter().any(|face| triangles_meet(&corners, face));
        prop_assert_eq!(triangle_meets_box(&corners, &aabb), due);
        let broken = Aabb { min: aabb.min, max: Vec3::new(f32::NAN, 1.0, 1.0) };
        let everything = Aabb { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
        prop_assert!(!triangle_meets_box(&corners, &broken) && triangle_meets_box(&corners, &everything));
    }

    #[test]
    fn nearest_points_lie_where_they_should(corners in [small(5), small(5), small(5), small(5), small(5), small(5)]) {
        let [a, b] = [[corners[0], corners[1], corners[2]], [corners[3], corners[4], corners[5]]];
        let nearest = triangle_distance(&a, &b).expect("finite");
        prop_assert_eq!(nearest.distance == 0.0, triangles_meet(&a, &b));
        let [p, q] = nearest.points;
        prop_assert!(distance(p, &a) < 1e-9 && distance(q, &b) < 1e-9, "{:?}", nearest);
        prop_assert!(((q - p).length() - nearest.distance).abs() < 1e-9);
        // No point of a fine net over the one is nearer to the other.
        for i in 0..=8 {
            for j in 0..=8 - i {
                let [u, v] = [i, j].map(|k| f64::from(k) / 8.0);
                let net = |t: &[Vec3; 3]| {
                    let [x, y, z] = t.map(Vec3::as_dvec3);
                    x + (y - x) * u + (z - x) * v
                };
                prop_assert!(distance(net(&a), &b) >= nearest.distance - 1e-9);
                prop_assert!(distance(net(&b), &a) >= nearest.distance - 1e-9);
            }
        }
    }

    #[test]
    fn balls_and_capsules_are_touched_from_their_distance_on(corners in [small(5), small(5), small(5)], ends in [small(7), small(7)]) {
        let [p, q] = ends;
        let to_point = closest_on_triangle(p, &corners).expect("finite");
        prop_assert!((to_point.distance - distance(p.as_dvec3(), &corners)).abs() < 1e-9);
        let to_segment = triangle_distance(&corners, &[p, q, q]).expect("finite");
        for factor in [0.999, 1.001] {
            let radius = |d: f64| (d * factor + if factor > 1.0 { 1e-6 } else { 0.0 }) as f32;
            let touches = |d: f64| factor > 1.0 || d == 0.0;
            prop_assert_eq!(triangle_meets_sphere(&corners, p, radius(to_point.distance)), touches(to_point.distance));
            let capsule = triangle_meets_capsule(&corners, p, q, radius(to_segment.distance));
            prop_assert_eq!(capsule, touches(to_segment.distance));
        }
        prop_assert!(!triangle_meets_sphere(&corners, p, -1.0) && !triangle_meets_capsule(&corners, p, q, -1.0));
        prop_assert!(!triangle_meets_sphere(&corners, p, f32::NAN) && closest_on_triangle(Vec3::NAN, &corners).is_none());
    }
}

/// Bounds that touch often, and bad ones.
fn bound() -> impl Strategy<Value = f32> {
    prop_oneof![
        20 => (-3_i8..=3).prop_map(f32::from),
        1 => prop::sample::select(vec![-0.0, 1e-45, -1e-45, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e-38]),
    ]
}

fn bounds() -> impl Strategy<Value = Aabb> {
    ([bound(), bound(), bound()], [bound(), bound(), bound()], 0_u8..10).prop_map(|(a, b, swap)| {
        let (a, b) = (Vec3::from(a), Vec3::from(b));
        if swap == 0 { Aabb { min: a, max: b } } else { Aabb { min: a.min(b), max: a.max(b) } }
    })
}

/// The moments s with `from + s * speed` in `[low, high]`, narrowed; by rationals.
struct Moments {
    low: BigRational,
    high: Option<BigRational>,
}

impl Moments {
    fn narrow(&mut self, low: f32, high: f32, from: f32, speed: f32) -> bool {
        if speed == 0.0 {
            return low <= from && from <= high;
        }
        let at = |bound: f32| (rational(bound) - rational(from)) / rational(speed);
        let (mut enter, mut exit) = (low.is_finite().then(|| at(low)), high.is_finite().then(|| at(high)));
        if speed < 0.0 {
            (enter, exit) = (exit, enter);
        }
        if let Some(enter) = enter {
            self.low = self.low.clone().max(enter);
        }
        if let Some(exit) = exit {
            self.high = Some(self.high.take().map_or(exit.clone(), |h| h.min(exit)));
        }
        self.high.as_ref().is_none_or(|h| self.low <= *h)
    }
}

fn near(value: f64, due: &BigRational) -> bool {
    let exact = due.to_f64().expect("in range");
    (value - exact).abs() <= exact.abs() * 2.0_f64.powi(-50)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn box_pairs_are_those_of_all_against_all(boxes in vec(bounds(), 0..30)) {
        let mut due = Vec::new();
        let overlap = |a: &Aabb, b: &Aabb| (0..3).all(|i| {
            a.min[i] <= a.max[i] && b.min[i] <= b.max[i] && a.min[i] <= b.max[i] && b.min[i] <= a.max[i]
        });
        for i in 0..boxes.len() {
            for j in i + 1..boxes.len() {
                prop_assert_eq!(boxes_meet(&boxes[i], &boxes[j]), overlap(&boxes[i], &boxes[j]));
                if overlap(&boxes[i], &boxes[j]) {
                    due.push([i as u32, j as u32]);
                }
            }
        }
        prop_assert_eq!(box_pairs(&boxes), due);
    }

    #[test]
    fn rays_pass_boxes_as_rationals_say(
        aabb in bounds(),
        origin in [bound(), bound(), bound()].prop_map(Vec3::from),
        dir in [bound(), bound(), bound()].prop_map(Vec3::from),
        (t_near, t_far) in prop_oneof![Just((0.0, f32::INFINITY)), (0.0_f32..3.0, 0.0_f32..6.0)],
    ) {
        let ray = Ray { origin, dir, t_near, t_far };
        let passage = ray_box(&ray, &aabb);
        let usable = !aabb.is_empty() && origin.is_finite() && dir.is_finite() && dir != Vec3::ZERO && t_near <= t_far;
        let mut moments = Moments { low: rational(t_near), high: t_far.is_finite().then(|| rational(t_far)) };
        let due = usable && (0..3).all(|i| {
            aabb.min[i] < f32::INFINITY
                && aabb.max[i] > f32::NEG_INFINITY
                && moments.narrow(aabb.min[i], aabb.max[i], origin[i], dir[i])
        });
        prop_assert_eq!(passage.is_some(), due, "{:?} {:?} {:?}", ray, aabb, passage);
        if let Some(passage) = passage {
            prop_assert!(near(passage.enter, &moments.low), "{:?} for {}", passage, moments.low);
            if let Some(high) = &moments.high {
                prop_assert!(near(passage.exit, high) && passage.exit >= passage.enter);
            } else {
                prop_assert_eq!(passage.exit, f64::INFINITY);
            }
        }
    }

    #[test]
    fn moving_boxes_touch_as_rationals_say(
        a in bounds(),
        b in bounds(),
        motion in [bound(), bound(), bound()].prop_map(Vec3::from),
    ) {
        let finite = |x: &Aabb| x.min.is_finite() && x.max.is_finite();
        prop_assume!(finite(&a) && finite(&b));
        let passage = sweep_box(&a, motion, &b);
        let mut moments = Moments { low: BigRational::zero(), high: Some(rational(1.0)) };
        let usable = !a.is_empty() && !b.is_empty() && motion.is_finite();
        // A's upper bound reaches B's lower one, and A's lower one has not left B's upper one.
        let due = usable && (0..3).all(|i| {
            let (mut reach, mut leave) = (Moments { low: moments.low.clone(), high: moments.high.clone() }, true);
            leave &= reach.narrow(b.min[i], f32::INFINITY, a.max[i], motion[i]);
            leave &= reach.narrow(f32::NEG_INFINITY, b.max[i], a.min[i], motion[i]);
            moments = reach;
            leave
        });
        prop_assert_eq!(passage.is_some(), due, "{:?} by {:?} to {:?}: {:?}", a, motion, b, passage);
        if let Some(passage) = passage {
            prop_assert!(near(passage.enter, &moments.low), "{:?} for {}", passage, moments.low);
        }
    }
}

/// Corners on a grid at both ends of a step.
fn step(n: i8) -> impl Strategy<Value = ([Vec3; 4], [Vec3; 4])> {
    let four = move || [small(n), small(n), small(n), small(n)];
    (four(), four())
}

/// Where corners are at sixteenths of the step: exact in f32.
fn halfway(start: &[Vec3; 4], end: &[Vec3; 4], k: u8) -> [Vec3; 4] {
    std::array::from_fn(|i| start[i] + (end[i] - start[i]) * (f32::from(k) / 16.0))
}

const SETTINGS: [Continuous; 2] = [
    Continuous { tolerance: 1e-9, min_separation: 0.0, max_cells: 1 << 14 },
    // Gives up early: still nothing may be missed.
    Continuous { tolerance: 0.0, min_separation: 0.0, max_cells: 12 },
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn contacts_at_sixteenths_of_a_step_are_found_in_time((start, end) in step(3)) {
        let [from, to] = [&start, &end].map(|c| c.map(Vec3::as_dvec3));
        for settings in SETTINGS {
            let face = settings.vertex_face(&from, &to);
            let edge = settings.edge_edge(&from, &to);
            for k in 0..=16 {
                let time = f64::from(k) / 16.0;
                let [p, q, r, s] = halfway(&start, &end, k);
                if triangles_meet(&[p; 3], &[q, r, s]) {
                    prop_assert!(face.is_some_and(|i| i.time <= time), "{:?} at {}", face, time);
                }
                if triangles_meet(&[p, q, q], &[r, s, s]) {
                    prop_assert!(edge.is_some_and(|i| i.time <= time), "{:?} at {}", edge, time);
                }
            }
        }
    }

    #[test]
    fn what_is_reported_comes_near((start, end) in step(4)) {
        let settings = Continuous::default();
        let [from, to] = [&start, &end].map(|c| c.map(Vec3::as_dvec3));
        for (impact, is_face) in [(settings.vertex_face(&from, &to), true), (settings.edge_edge(&from, &to), false)] {
            let Some(impact) = impact else { continue };
            let [p, q, r, s]: [DVec3; 4] = std::array::from_fn(|i| from[i] + (to[i] - from[i]) * impact.time);
            let [x, y] = impact.place;
            let apart = if is_face { p - q - (r - q) * x - (s - q) * y } else { p + (q - p) * x - r - (s - r) * y };
            prop_assert!(apart.length() <= impact.gap + 1e-12, "{:?}: {}", impact, apart.length());
            prop_assert!(impact.gap <= settings.tolerance + 1e-12, "{:?}", impact);
            prop_assert!(x >= 0.0 && y >= 0.0 && x <= 1.0 && y <= 1.0 && (!is_face || x + y <= 1.0 + 1e-12));
        }
    }

    #[test]
    fn contacts_within_the_separation_are_found(
        (start, mut end) in step(3),
        k in 1_u8..=16,
        weights in [0_u8..=4, 0_u8..=4],
        away in [-1.0_f64..1.0, -1.0_f64..1.0, -1.0_f64..1.0],
        separation in 1e-3_f64..0.5,
    ) {
        // The vertex reaches a point of the face at a sixteenth, then all of its way is moved by no more than the separation.
        let [_, q, r, s] = halfway(&start, &end, k);
        let [u, v] = [f32::from(weights[0]) / 8.0, f32::from(weights[1]) / 8.0];
        let target = q + (r - q) * u + (s - q) * v;
        let time = f64::from(k) / 16.0;
        end[0] = target;
        let [mut from, mut to] = [&start, &end].map(|c| c.map(Vec3::as_dvec3));
        let away = DVec3::from(away).normalize_or_zero() * separation * 0.999;
        // At `time` the vertex is at the target: extend its way to the end of the step.
        to[0] = from[0] + (to[0] - from[0]) / time;
        from[0] += away;
        to[0] += away;
        let settings = Continuous { min_separation: separation, ..Continuous::default() };
        let impact = settings.vertex_face(&from, &to);
        prop_assert!(impact.is_some_and(|i| i.time <= time + 1e-12), "{:?}", impact);
        let nearer = Continuous { min_separation: 0.0, ..settings }.vertex_face(&from, &to);
        prop_assert!(nearer.is_none_or(|i| impact.is_some_and(|j| j.time <= i.time)));
    }

    #[test]
    fn scale_and_place_do_not_matter((start, end) in step(3), exponent in prop::sample::select(vec![-1000, -300, 300, 900])) {
        let settings = Continuous { tolerance: 0.0, ..Continuous::default() };
        let [from, to] = [&start, &end].map(|c| c.map(Vec3::as_dvec3));
        let due = settings.vertex_face(&from, &to);
        let scaled = |c: [DVec3; 4]| c.map(|p| p * 2.0_f64.powi(exponent));
        let impact = settings.vertex_face(&scaled(from), &scaled(to));
        prop_assert_eq!(due.is_some(), impact.is_some());
        if let (Some(due), Some(impact)) = (due, impact) {
            prop_assert!((due.time - impact.time).abs() < 1e-9, "{:?} {:?}", due, impact);
        }
    }
}

#[test]
fn what_is_not_finite_meets_nothing() {
    let face = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let settings = Continuous::default();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for corner in 0..4 {
            for axis in 0..3 {
                let start = [DVec3::splat(0.25), face[0], face[1], face[2]];
                let mut end = [DVec3::new(0.25, 0.25, -1.0), face[0], face[1], face[2]];
                assert!(settings.vertex_face(&start, &end).is_some());
                end[corner][axis] = bad;
                assert_eq!(settings.vertex_face(&start, &end), None);
                assert_eq!(settings.edge_edge(&end, &start), None);
            }
        }
    }
    let flat = [Vec3::ZERO, Vec3::X, Vec3::Y];
    assert!(triangles_meet(&flat, &flat));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let broken = [Vec3::ZERO, Vec3::new(1.0, bad, 0.0), Vec3::Y];
        assert!(!triangles_meet(&flat, &broken) && triangle_contact(&broken, &flat).is_none());
    }
}

#[test]
fn the_largest_numbers_are_answered() {
    let m = f64::MAX;
    let start = [DVec3::new(0.0, 0.0, m), DVec3::new(-m, -m, 0.0), DVec3::new(m, -m, 0.0), DVec3::new(0.0, m, 0.0)];
    let mut end = start;
    end[0].z = -m;
    let impact = Continuous::default().vertex_face(&start, &end).expect("it goes through");
    assert!(impact.time <= 0.5 && impact.time > 0.499, "{impact:?}");
    end[0].z = m / 2.0;
    assert_eq!(Continuous::default().vertex_face(&start, &end), None);
}
