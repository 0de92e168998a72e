use proptest::prelude::*;

use super::{super::wide::One, *};
use crate::{
    geom::exact::{side, slope},
    simd::Lanes,
};

/// The start in one lane, beside the normal as a surface has it, and whether f32 did.
fn departed(corners: [Vec3; 3], u: f32, v: f32, dir: Vec3) -> (Vec3, Vec3, bool) {
    let lanes = corners.map(V3::<One>::splat);
    let patch = Patch::new(lanes, One::splat(u), One::splat(v));
    let point = patch.blend3(lanes);
    let n_geom = patch.cross.unit_or(V3::splat(Vec3::Y));
    let departure = Departure::new(&patch, point, 1);
    (departure.origin(n_geom, V3::splat(dir)).only(), n_geom.only(), departure.thin == 0)
}

fn unit() -> impl Strategy<Value = f32> {
    prop_oneof![5 => -1.0_f32..1.0, 1 => Just(0.0), 1 => Just(1.0), 1 => Just(-1.0)]
}

fn vector() -> impl Strategy<Value = Vec3> {
    [unit(), unit(), unit()].prop_map(Vec3::from)
}

fn weights() -> impl Strategy<Value = (f32, f32)> {
    prop_oneof![
        4 => (0.0_f32..1.0, 0.0_f32..1.0).prop_map(|(u, v)| if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) }),
        1 => prop::sample::select(vec![(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (1e-9, 1e-30)]),
        1 => (0.0_f32..1.0).prop_map(|u| (u, 0.0)),
        1 => (0.0_f32..1.0).prop_map(|u| (u, 1.0 - u)),
    ]
}

/// Triangles from equilateral to needles, from a millimetre's tenth to ten thousand kilometres, some far from the origin,
/// some with one corner much farther than the others.
fn triangle() -> impl Strategy<Value = [Vec3; 3]> {
    let far = prop_oneof![2 => Just(0.0_f32), 1 => 0.0_f32..100.0, 1 => 1e3_f32..1e5];
    (vector(), vector(), vector(), 0..7_i32, -4..8_i32, vector(), far, 0..6_i32).prop_map(
        |(a, b, c, thin, scale, shift, far, stretch)| {
            let c = a + (b - a) * 0.7 + (c - a) * 10.0_f32.powi(-thin);
            let a = a * 10.0_f32.powi(stretch);
            [a, b, c].map(|p| (p + shift * far) * 10.0_f32.powi(scale))
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn starts_lie_on_the_side_that_the_ray_leaves_to(
        corners in triangle(),
        (u, v) in weights(),
        dir in vector(),
        tilt in prop_oneof![Just(1.0_f32), (1..8_i32).prop_map(|k| 10.0_f32.powi(-k))],
    ) {
        let solid = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().any(|axis| slope(&corners, axis) != 0);
        prop_assume!(solid);
        let (_, n, _) = departed(corners, u, v, dir);
        // Down to grazing.
        let graze = dir - n * dir.dot(n) * (1.0 - tilt);
        for dir in [dir, -dir, graze, -graze] {
            let (start, n, in_f32) = departed(corners, u, v, dir);
            let found = side(&corners, start);
            if in_f32 {
                prop_assert_eq!(found, if dir.dot(n) < 0.0 { -1 } else { 1 }, "{:?} from {:?}", dir, start);
            } else {
                prop_assert_eq!(found, if slope(&corners, dir) < 0 { -1 } else { 1 }, "{:?} from {:?}", dir, start);
            }
        }
    }

    #[test]
    fn starts_are_near_those_of_the_exact_way(corners in triangle(), (u, v) in weights(), dir in vector()) {
        let (start, n, in_f32) = departed(corners, u, v, dir);
        if !in_f32 || dir.dot(n).abs() <= 1e-3 {
            return Ok(());
        }
        let exact = leave(&corners, u, v, dir);
        let largest = corners.iter().fold(0.0, |most: f32, c| most.max(c.abs().max_element()));
        let longest = (corners[1] - corners[0]).length().max((corners[2] - corners[0]).length());
        // Both draw inwards by at most 16 errors, of the point here and of a corner there, slanted by up to the sine allowed.
        prop_assert!(start.distance(exact) <= (64.0 * 16.0 * 4e-6 * largest).min(2.0 * longest), "{} {}", start, exact);
    }
}

#[test]
fn most_triangles_are_left_in_f32() {
    let mut state = 1_u32;
    let mut number = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 8_388_608.0 - 1.0
    };
    let mut thin = 0;
    for _ in 0..1000 {
        let corners: [Vec3; 3] = std::array::from_fn(|_| Vec3::new(number(), number(), number()));
        thin += usize::from(!departed(corners, 0.3, 0.3, Vec3::Y).2);
    }
    assert!(thin < 20, "{thin} of 1000");
}

#[test]
fn a_weight_that_is_rounded_off_a_far_corner_is_paid_for() {
    // Near the edge opposite to a corner that is a million times farther than the others.
    let corners = [Vec3::new(1e6, 1.3e6, 0.7e6), Vec3::new(0.3, 0.1, 0.2), Vec3::new(-0.4, 0.9, 0.1)];
    for i in 0..1000 {
        let u = 0.3 + 0.0001 * i as f32;
        let v = (1.0 - u).next_down();
        for dir in [Vec3::Z, Vec3::NEG_Z] {
            let (start, n, _) = departed(corners, u, v, dir);
            assert_eq!(side(&corners, start), if dir.dot(n) < 0.0 { -1 } else { 1 });
        }
    }
}
