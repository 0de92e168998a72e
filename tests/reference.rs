//! The references against each other and against rational arithmetic.
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
    report::{
        meshes,
        reference::{Reference, Tally, Truth, exact},
    },
    simd::SimdLevel,
};
use proptest::{collection::vec, prelude::*};
use trace::{Mesh, Random, closest, exact_closest};

/// Any finite number, weighted towards small integers, halves, and the ends of the range.
fn any_coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => (-3_i8..=3).prop_map(f32::from),
        4 => -2.0_f32..2.0,
        1 => any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |f| f.is_finite()),
        1 => prop::sample::select(vec![0.0, -0.0, 1e-45, f32::MIN_POSITIVE, f32::MAX, f32::MIN, 1e-38, 1e30]),
    ]
}

/// Numbers of one scale, which meet more often.
fn plain_coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![3 => (-4_i8..=4).prop_map(f32::from), 2 => -4.0_f32..4.0]
}

fn point(coordinate: impl Strategy<Value = f32> + 'static) -> impl Strategy<Value = Vec3> {
    let coordinate = coordinate.boxed();
    (coordinate.clone(), coordinate.clone(), coordinate).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

fn range() -> impl Strategy<Value = (f32, f32)> {
    prop_oneof![
        3 => Just((0.0, f32::INFINITY)),
        1 => (0_u8..4, 0_u8..8).prop_map(|(a, b)| (f32::from(a), f32::from(b))),
        1 => prop::sample::select(vec![(f32::NAN, 1.0), (0.0, f32::NAN), (-1.0, 2.0), (f32::INFINITY, f32::INFINITY)]),
    ]
}

/// Triangles, t and weights as they are rounded; t in f64 need only be close.
fn same(a: Option<&Truth>, b: Option<&Truth>) -> Result<(), TestCaseError> {
    prop_assert_eq!(a.is_some(), b.is_some());
    let (Some(a), Some(b)) = (a, b) else { return Ok(()) };
    prop_assert_eq!(a.t_rounded, b.t_rounded);
    prop_assert!((a.t - b.t).abs() <= 1e-12 * b.t.abs(), "{} {}", a.t, b.t);
    prop_assert_eq!(a.accepted.len(), b.accepted.len());
    for (a, b) in a.accepted.iter().zip(&b.accepted) {
        prop_assert_eq!((a.prim, a.rounded), (b.prim, b.rounded));
        prop_assert!((a.u - b.u).abs() < 1e-12 && (a.v - b.v).abs() < 1e-12);
    }
    Ok(())
}

fn agree(mesh: &Mesh, ray: &Ray) -> Result<(), TestCaseError> {
    let exact = exact::closest(ray, &mesh.prims());
    let reference = Reference::new(&mesh.prims());
    same(reference.closest(ray).as_ref(), exact.as_ref())?;
    prop_assert_eq!(reference.blocked(ray), exact.is_some());
    prop_assert_eq!(exact::blocked(ray, &mesh.prims()), exact.is_some());
    // The rational tracer knows of no malformed rays.
    if !(ray.t_near.is_nan() || ray.t_far.is_nan() || ray.t_near.is_infinite()) {
        let rational = exact_closest(ray, mesh);
        let first = exact.map(|t| (t.accepted[0].prim, t.t_rounded, t.accepted[0].rounded));
        prop_assert_eq!(rational.map(|h| (h.prim, h.t, [h.u, h.v])), first);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn both_references_and_rationals_agree_on_any_finite_input(
        corners in vec([point(any_coordinate()), point(any_coordinate()), point(any_coordinate())], 1..9),
        origin in point(any_coordinate()),
        dir in point(any_coordinate()),
        (t_near, t_far) in range(),
    ) {
        agree(&Mesh::soup(&corners), &Ray { origin, dir, t_near, t_far })?;
    }

    #[test]
    fn both_references_and_rationals_agree_on_shared_corners_and_edges(
        positions in vec(point(plain_coordinate()), 6),
        indices in vec([0_u32..6, 0_u32..6, 0_u32..6], 1..14),
        origin in point(plain_coordinate()),
        weights in [0_u8..3, 0_u8..3, 0_u8..3],
        (t_near, t_far) in range(),
    ) {
        let mesh = Mesh { positions, indices };
        let corners = mesh.corners(0);
        let sum = f32::from(weights.iter().sum::<u8>().max(1));
        let target = (0..3).map(|i| corners[i] * (f32::from(weights[i]) / sum)).sum::<Vec3>();
        agree(&mesh, &Ray { origin, dir: target - origin, t_near, t_far })?;
    }
}

/// Rays from inside and outside at corners and points of edges; every other one passes exactly through a corner.
fn aimed(mesh: &Mesh, count: usize) -> Vec<Ray> {
    let mut random = Random(5);
    let snap = |p: Vec3| (p * 4096.0).round() / 4096.0;
    let aim = |i: usize| {
        let corners = mesh.corners(random.below(mesh.indices.len()));
        let origin = snap(random.vec3() * if i % 4 < 2 { 0.3 } else { 2.5 });
        let weight = if i.is_multiple_of(2) { 0.0 } else { random.unit() * 0.5 + 0.5 };
        Ray::new(origin, corners[0] + (corners[1] - corners[0]) * weight - origin)
    };
    (0..count).map(aim).collect()
}

/// A closed mesh whose corners are multiples of 2^-12, so that differences are exact.
fn sphere(triangles: usize) -> Mesh {
    let subject = meshes::dented_sphere(triangles);
    let snap = |p: &Vec3| (*p * 4096.0).round() / 4096.0;
    Mesh { positions: subject.positions.iter().map(snap).collect(), indices: subject.indices }
}

#[test]
fn every_structure_is_right_on_rays_aimed_at_corners_and_edges() {
    let mesh = sphere(2000);
    let rays = aimed(&mesh, 1500);
    let truths = Reference::new(&mesh.prims()).all_closest(&rays);
    for &kind in AccelKind::ALL {
        let accel = AccelSpec::new(kind).build(&mesh.prims()).expect("a mesh builds");
        let count = if kind == AccelKind::List { 150 } else { rays.len() };
        let mut tally = Tally::default();
        for (truth, hit) in truths.iter().zip(closest(&accel, &mesh.prims(), &rays[..count], SimdLevel::best())) {
            tally.add(truth.as_ref(), hit.as_ref());
        }
        assert_eq!([tally.mistakes(), tally.inexact, tally.lost_zeros], [0; 3], "{kind}: {tally:?}");
        assert!(tally.uv_max <= 1.0 && tally.ties > tally.rays / 5, "{kind}: {} ties", tally.ties);
    }
}
