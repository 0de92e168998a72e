//! H3: a unit mesh moved by 2^k together with the camera: no hit is lost, and the error grows as 2^k only.

use kinora::{
    accel::{AccelKind, AccelSpec},
    geom::Ray,
    glam::{DVec3, Vec3},
    simd::SimdLevel,
};

use crate::{
    fast::FAST,
    h07_grazing::condition,
    meshes::{icosphere, mapped},
    trace::{Random, closest, closest_as},
    trial::{Trial, count},
};

/// Rays from near the centre, moved with the mesh; also from outside.
fn rays(shift: Vec3, first: usize, len: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let outside = i % 4 == 3;
        let origin = random.vec3() * if outside { 3.0 } else { 0.125 };
        let dir = if outside { random.vec3() * 0.5 - origin } else { random.vec3() };
        Ray::new(origin + shift, dir)
    };
    (first..first + len).map(ray).collect()
}

/// Ranges of k, by what fast may miss there.
fn distance(k: u32) -> &'static str {
    match k {
        0..16 => "near",
        16..19 => "far",
        _ => "farthest",
    }
}

#[test]
fn h03_answers_stay_exact_however_far_the_mesh_is() {
    let base = icosphere(count(5, 3, 1) as u32);
    for k in (0..24).step_by(count(1, 1, 4)) {
        // Not along a diagonal of the axes only.
        let shift = Vec3::new(1.0, -1.0, 0.5) * (1_u32 << k) as f32;
        let mesh = mapped(&base, |p| p + shift);
        let name = format!("H3 {}, 2^{k}", distance(k));
        let trial = Trial { name: &name, mesh: &mesh, rays: count(100_000, 600, 30), refitted: true };
        trial.run(|first, len| rays(shift, first, len));
    }
}

/// Both the vertices and the origin are rounded to units in the last place of 2^k: half a unit along each axis, so a
/// point moves by at most 0.87 of 2^(k-23). Rays from near the centre of a sphere meet it at less than 20 degrees from the
/// normal, so the distance changes by at most `2 * 0.87 / cos 20` of that, and the rounding of t adds 2^-24.
#[test]
fn h03_the_error_grows_no_faster_than_the_distance() {
    let base = icosphere(3);
    let accel = AccelSpec::new(AccelKind::Bvh2).build(&base.prims()).expect("it builds");
    let near: Vec<Ray> =
        (0..2000).map(|i| Random(i).vec3()).filter(|d| d.length() > 0.1).map(|d| Ray::new(Vec3::ZERO, d)).collect();
    let due = closest(&accel, &base.prims(), &near, SimdLevel::best());
    let mut worst_unit: f64 = 0.0;
    for k in 0..24 {
        let shift = Vec3::new(1.0, -1.0, 0.5) * (1_u32 << k) as f32;
        let mesh = mapped(&base, |p| p + shift);
        let moved: Vec<Ray> = near.iter().map(|r| Ray { origin: r.origin + shift, ..*r }).collect();
        let accel = AccelSpec::new(AccelKind::Bvh2).build(&mesh.prims()).expect("it builds");
        let hits = closest(&accel, &mesh.prims(), &moved, SimdLevel::best());
        let unit = libm::exp2(f64::from(k) - 23.0);
        let mut worst: f64 = 0.0;
        for ((ray, due), hit) in near.iter().zip(&due).zip(&hits) {
            // From 2^20 on the mesh is a heap of steps as large as its triangles, open where the origin lies in a step.
            let (Some(due), Some(hit)) = (due, hit) else {
                assert!(k >= 20 && due.is_some(), "a ray is lost at 2^{k}");
                continue;
            };
            let length = DVec3::length(ray.dir.as_dvec3());
            worst = worst.max((f64::from(hit.t) - f64::from(due.t)).abs() * length / unit);
        }
        println!("H3, 2^{k}: distance off by {worst:.2} units in the last place of 2^{k}");
        if k < 19 {
            worst_unit = worst_unit.max(worst);
        }
    }
    assert!(worst_unit <= 2.0 * 0.87 / 0.93 + 1.0, "{worst_unit}");
}

/// As above, and the test's own error `9 u K` of t besides (see `h07_grazing`), which does not grow with the distance: the vertices are subtracted
/// from the origin first, exactly where both lie far away.
#[test]
fn h03_the_error_in_fast_grows_no_faster_than_the_distance() {
    let base = icosphere(3);
    let near: Vec<Ray> =
        (0..2000).map(|i| Random(i).vec3()).filter(|d| d.length() > 0.1).map(|d| Ray::new(Vec3::ZERO, d)).collect();
    let bvh2 = AccelSpec::new(AccelKind::Bvh2);
    let accel = bvh2.build(&base.prims()).expect("it builds");
    let due = closest(&accel, &base.prims(), &near, SimdLevel::best());
    for k in 0..19 {
        let shift = Vec3::new(1.0, -1.0, 0.5) * (1_u32 << k) as f32;
        let mesh = mapped(&base, |p| p + shift);
        let moved: Vec<Ray> = near.iter().map(|r| Ray { origin: r.origin + shift, ..*r }).collect();
        let accel = bvh2.build(&mesh.prims()).expect("it builds");
        let hits = closest_as(&accel, &mesh.prims(), &moved, SimdLevel::best(), FAST);
        let unit = libm::exp2(f64::from(k) - 23.0);
        let (mut worst, mut met): (f64, usize) = (0.0, 0);
        for ((ray, due), hit) in moved.iter().zip(&due).zip(&hits) {
            let (Some(due), Some(hit)) = (due, hit) else { continue };
            let length = DVec3::length(ray.dir.as_dvec3());
            let error = (f64::from(hit.t) - f64::from(due.t)).abs() * length;
            let own = 9.0
                * libm::exp2(-24.0)
                * condition(ray, &mesh.corners(hit.prim.0 as usize))
                * f64::from(hit.t)
                * length;
            assert!(error <= (2.0 * 0.87 / 0.93 + 1.0) * unit + own, "2^{k}: off by {error}, {ray:?}");
            (worst, met) = (worst.max(error / unit), met + 1);
        }
        println!("H3, 2^{k}, fast: distance off by {worst:.2} units in the last place of 2^{k}");
        assert!(met * 50 > near.len() * 49, "2^{k}: {met} of {}", near.len());
    }
}
