//! The leaf test against rational arithmetic: hits, order and every rounding.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "common/trace.rs"]
mod trace;

use kinora::{
    accel::{AccelKind, AccelSpec},
    geom::Ray,
    glam::Vec3,
    simd::SimdLevel,
};
use proptest::{collection::vec, prelude::*};
use trace::{Mesh, closest, exact_closest};

/// Any finite number, weighted towards small integers, halves, and the ends of the range.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => (-3_i8..=3).prop_map(f32::from),
        3 => (-8_i8..=8).prop_map(|i| f32::from(i) * 0.25),
        4 => -2.0_f32..2.0,
        1 => any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |f| f.is_finite()),
        1 => prop::sample::select(vec![0.0, -0.0, 1e-45, -1e-45, f32::MIN_POSITIVE, f32::MAX, f32::MIN, 1e-38, 1e30]),
    ]
}

/// Numbers of one scale, which meet more often.
fn plain() -> impl Strategy<Value = f32> {
    prop_oneof![3 => (-4_i8..=4).prop_map(f32::from), 2 => -4.0_f32..4.0]
}

fn point(coordinate: impl Strategy<Value = f32> + 'static) -> impl Strategy<Value = Vec3> {
    let coordinate = coordinate.boxed();
    (coordinate.clone(), coordinate.clone(), coordinate).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

fn range() -> impl Strategy<Value = (f32, f32)> {
    prop_oneof![
        3 => Just((0.0, f32::INFINITY)),
        1 => (0.0_f32..2.0, 0.0_f32..4.0),
        1 => (0_u8..4, 0_u8..8).prop_map(|(a, b)| (f32::from(a), f32::from(b))),
    ]
}

fn agrees(mesh: &Mesh, ray: &Ray) -> Result<(), TestCaseError> {
    let due = exact_closest(ray, mesh);
    for &kind in AccelKind::ALL {
        let accel = AccelSpec::new(kind).build(&mesh.prims()).expect("a small mesh builds");
        for level in SimdLevel::available() {
            let hit = closest(&accel, &mesh.prims(), std::slice::from_ref(ray), level)[0];
            prop_assert_eq!(hit, due, "{} at {}", kind, level);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn hits_equal_the_rational_answer_for_any_finite_input(
        corners in vec([point(coordinate()), point(coordinate()), point(coordinate())], 1..4),
        origin in point(coordinate()),
        dir in point(coordinate()),
        (t_near, t_far) in range(),
    ) {
        agrees(&Mesh::soup(&corners), &Ray { origin, dir, t_near, t_far })?;
    }

    #[test]
    fn hits_equal_the_rational_answer_on_shared_edges_and_grids(
        positions in vec(point(plain()), 5),
        indices in vec([0_u32..5, 0_u32..5, 0_u32..5], 1..8),
        origin in point(plain()),
        weights in [0_u8..3, 0_u8..3, 0_u8..3],
        (t_near, t_far) in range(),
    ) {
        // Aimed at a vertex, a point of an edge or one inside of the first triangle, as well as f32 can.
        let mesh = Mesh { positions, indices };
        let corners = mesh.corners(0);
        let sum = f32::from(weights.iter().sum::<u8>().max(1));
        let target = (0..3).map(|i| corners[i] * (f32::from(weights[i]) / sum)).sum::<Vec3>();
        agrees(&mesh, &Ray { origin, dir: target - origin, t_near, t_far })?;
    }
}

/// An exact tie between a triangle and one that a grazing ray meets a hair later.
#[test]
fn differences_beyond_f64_order_hits() {
    let tip = f32::from_bits(1);
    // Two triangles through the axis at z = 0; the second is tilted by one denormal.
    let flat = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(3.0, -1.0, 0.0), Vec3::new(-1.0, 3.0, 0.0)];
    let tilted = [Vec3::new(-1.0, -1.0, tip), Vec3::new(3.0, -1.0, tip), Vec3::new(-1.0, 3.0, tip)];
    let ray = Ray::new(Vec3::new(0.1, 0.1, 1e20), -Vec3::Z);
    for (corners, first) in [([flat, tilted], 1), ([tilted, flat], 0), ([flat, flat], 0)] {
        let mesh = Mesh::soup(&corners);
        for &kind in AccelKind::ALL {
            let accel = AccelSpec::new(kind).build(&mesh.prims()).expect("two triangles build");
            let hit = closest(&accel, &mesh.prims(), &[ray], SimdLevel::best())[0];
            assert_eq!(hit.map(|h| h.prim.0), Some(first), "{kind}");
            assert_eq!(hit.map(|h| h.t), Some(1e20), "{kind}");
        }
    }
}
