//! H7: rays that graze a tessellated plane at 10^-1 to 10^-7 rad.
//!
//! **The bound.** With edges e1, e2, s = origin - v0 and direction d, `t = T / D`, `T = e2 . (s x e1)`, `D = e1 . (d x e2)`. A
//! determinant is a sum of six products of three components. Let every component of e1, e2, s and d be off by a relative error of
//! at most u: each product is then off by at most 3u of its size (to first order), so T is off by `3u perm(T)` where perm is the
//! sum of the products' sizes, and t by
//!
//! ```text
//! |dt| / t  <=  3 u (perm(T) / |T| + perm(D) / |D|)  =  3 u K
//! ```
//!
//! K is the condition number of the question. An evaluation in floating point of unit u adds two roundings a product and three for the
//! sum, and the differences one: `9 u K` bounds the whole. At an angle a the condition number is about 1 / a.
//!
//! `exact` takes the inputs as they are and rounds t once: its error is at most u = 2^-24, whatever K. `fast` in f32 must stay
//! within `9 u K` where it hits the right triangle.

use kinora::{
    accel::{AccelKind, AccelSpec},
    geom::Ray,
    glam::{DVec3, Vec3},
    report::reference::Reference,
    simd::SimdLevel,
};

use crate::{
    fast::FAST,
    meshes::{mapped, plane},
    trace::{Mesh, Random, closest},
    trial::{Trial, count},
};

/// Unit of f32's relative errors.
const U: f64 = 1.0 / 16_777_216.0;

/// Two directions in the plane and its normal: a rotation with rational entries, so that no coordinate is spared.
const FRAME: [Vec3; 3] = [Vec3::new(0.36, 0.48, -0.8), Vec3::new(0.8, -0.6, 0.0), Vec3::new(-0.48, -0.64, -0.6)];

fn tilted(n: u32) -> Mesh {
    mapped(&plane(n), |p| FRAME[0] * p.x + FRAME[1] * p.y)
}

/// Rays of length 1 that meet the plane at this angle, from both sides.
fn grazing(angle: f64, first: usize, len: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let target = FRAME[0] * (random.unit() * 0.9) + FRAME[1] * (random.unit() * 0.9);
        let along = DVec3::from(FRAME[0]) * f64::from(random.unit()) + DVec3::from(FRAME[1]) * f64::from(random.unit());
        let side = if i.is_multiple_of(2) { angle } else { -angle };
        let dir = (along.normalize() * libm::cos(angle) - DVec3::from(FRAME[2]) * libm::sin(side)).as_vec3();
        Ray::new(target - dir, dir)
    };
    (first..first + len).map(ray).collect()
}

/// The sum of the sizes of the products of `a . (b x c)`, and its value.
fn volume(a: DVec3, b: DVec3, c: DVec3) -> (f64, f64) {
    let minor = |i: usize, j: usize| (b[i] * c[j]).abs() + (b[j] * c[i]).abs();
    let permanent = (a[0] * minor(1, 2)).abs() + (a[1] * minor(2, 0)).abs() + (a[2] * minor(0, 1)).abs();
    (permanent, a.dot(b.cross(c)).abs())
}

/// The condition number K of t.
pub(crate) fn condition(ray: &Ray, corners: &[Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (e1, e2, s, d) = (b - a, c - a, ray.origin.as_dvec3() - a, ray.dir.as_dvec3());
    let ((tp, t), (dp, det)) = (volume(e2, s, e1), volume(e1, d, e2));
    tp / t + dp / det
}

#[test]
fn h07_grazing_rays_are_answered_exactly() {
    let mesh = tilted(count(256, 48, 12) as u32);
    for k in 1..=7 {
        let angle = 1.0 / libm::exp10(f64::from(k));
        let name = format!("H7 10^-{k} rad");
        let trial = Trial { name: &name, mesh: &mesh, rays: count(300_000, 1_500, 30), refitted: true };
        trial.run(|first, len| grazing(angle, first, len));
    }
}

#[test]
fn h07_the_error_of_t_is_one_rounding_whatever_the_condition() {
    let mesh = tilted(48);
    let reference = Reference::new(&mesh.prims());
    let accel = AccelSpec::new(AccelKind::Bvh2).build(&mesh.prims()).expect("it builds");
    for k in 1..=7 {
        let rays = grazing(1.0 / libm::exp10(f64::from(k)), 0, count(100_000, 20_000, 200));
        let hits = closest(&accel, &mesh.prims(), &rays, SimdLevel::best());
        let (mut worst, mut largest, mut met): (f64, f64, usize) = (0.0, 0.0, 0);
        for (ray, hit) in rays.iter().zip(&hits) {
            let (Some(truth), Some(hit)) = (reference.closest(ray), hit) else { continue };
            let error = (f64::from(hit.t) - truth.t).abs() / truth.t / U;
            let condition = condition(ray, &mesh.corners(hit.prim.0 as usize));
            assert!(error <= 1.0 + 1e-6, "{ray:?}: t is off by {error} u");
            assert!(error <= 9.0 * condition, "{ray:?}: {error} u at a condition number of {condition}");
            (worst, largest, met) = (worst.max(error), largest.max(condition), met + 1);
        }
        println!("H7, 10^-{k} rad: {met} hits, condition numbers up to {largest:.3e}, t off by at most {worst:.3} u");
        assert!(met > rays.len() / 2, "{met} of {}", rays.len());
    }
}

/// Möller and Trumbore's test in f32: 7 roundings in each product of D, 8 in each of T, and two for the quotient, so
/// `8 u K + 2 u`, which is below `9 u K`.
#[test]
fn h07_the_error_of_t_in_fast_stays_within_the_condition_number() {
    let mesh = tilted(48);
    let reference = Reference::new(&mesh.prims());
    let accel = AccelSpec::new(AccelKind::Bvh2).build(&mesh.prims()).expect("it builds");
    for k in 1..=7 {
        let rays = grazing(1.0 / libm::exp10(f64::from(k)), 0, count(100_000, 20_000, 500));
        let mut hits = vec![None; rays.len()];
        accel
            .closest_hits_as(&mesh.prims(), &rays, 1, SimdLevel::best(), FAST, &mut hits)
            .expect("the default float mode");
        let (mut worst, mut share, mut right): (f64, f64, usize) = (0.0, 0.0, 0);
        for (ray, hit) in rays.iter().zip(&hits) {
            let (Some(truth), Some(hit)) = (reference.closest(ray), hit) else { continue };
            if truth.find(hit.prim).is_none() {
                continue;
            }
            let error = (f64::from(hit.t) - truth.t).abs() / truth.t / U;
            let bound = 9.0 * condition(ray, &mesh.corners(hit.prim.0 as usize));
            assert!(error <= bound, "{ray:?}: {error} u, {bound} u allowed");
            (worst, share, right) = (worst.max(error), share.max(error / bound), right + 1);
        }
        println!("H7, 10^-{k} rad, fast: {right} right hits, t off by at most {worst:.3e} u, {share:.3} of the bound");
    }
}
