//! H5: needles, a fan of slivers, and triangles without area, which are never hit.

use kinora::{
    accel::AccelKind,
    geom::{Forms, Ray},
    glam::{DVec3, Vec3},
    simd::SimdLevel,
};

use crate::{
    fast::{self, FAST},
    trace::{Mesh, Random, closest_as},
    trial::{Mistakes, Trial, candidates, count},
};

/// Needles of aspect 10^3 to 10^7 in all directions, every fourth triangle without area.
fn needles(count: usize) -> Mesh {
    let mut random = Random(11);
    let triangle = |i: usize| {
        let (a, dir) = (random.vec3(), random.vec3());
        let across = dir.cross(random.vec3());
        let aspect = 10.0_f32.powi(3 + (i % 5) as i32);
        match i % 16 {
            3 => [a, a, a + dir],
            7 => [a, a + dir, a],
            11 => [a; 3],
            // In one line, exactly.
            15 => [0, 1, 2].map(|k| Vec3::new(1.0, 2.0, -1.0) * k as f32 * 0.25),
            _ => [a, a + dir, a + dir * 0.5 + across / (aspect * across.length().max(0.1))],
        }
    };
    Mesh::soup(&(0..count).map(triangle).collect::<Vec<_>>())
}

fn has_no_area(prim: usize) -> bool {
    prim % 4 == 3
}

/// A disc of slivers around the origin, in a plane that is tilted to every axis.
fn fan(count: u32) -> Mesh {
    let (a, b) = (DVec3::new(0.8, 0.48, 0.36), DVec3::new(0.0, 0.6, -0.8));
    let rim = |i: u32| {
        let angle = f64::from(i) / f64::from(count) * std::f64::consts::TAU;
        (a * libm::cos(angle) + b * libm::sin(angle)).as_vec3()
    };
    let positions = std::iter::once(Vec3::ZERO).chain((0..count).map(rim)).collect();
    Mesh { positions, indices: (0..count).map(|i| [0, i + 1, (i + 1) % count + 1]).collect() }
}

/// Rays at corners, at points of edges and at the insides of triangles, from all around.
fn rays_at(mesh: &Mesh, first: usize, len: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let [a, b, c] = mesh.corners(random.below(mesh.indices.len()));
        let along = random.unit() * 0.5 + 0.5;
        let target = match i % 4 {
            0 => a,
            1 => a + (b - a) * along,
            2 => c + (a - c) * along,
            _ => (a + b + c) / 3.0,
        };
        let away = random.vec3();
        Ray::new(target + away * 2.0, -away)
    };
    (first..first + len).map(ray).collect()
}

#[test]
fn h05_needles_are_answered_exactly_and_triangles_without_area_never_hit() {
    let mesh = needles(count(20_000, 4_000, 400));
    let total = count(1_000_000, 10_000, 100);
    let trial = Trial { name: "H5 needles", mesh: &mesh, rays: total, refitted: true };
    trial.run(|first, len| rays_at(&mesh, first, len));
    let rays = rays_at(&mesh, 0, total.min(50_000));
    for candidate in candidates(&mesh, false).iter().filter(|c| !c.slow || c.kind == AccelKind::Events) {
        let rays = if candidate.slow { &rays[..rays.len().min(500)] } else { &rays[..] };
        for forms in [Forms::EXACT, FAST] {
            let hits = closest_as(&candidate.accel, &mesh.prims(), rays, SimdLevel::best(), forms);
            let mut found = Mistakes { rays: rays.len() as u64, ..Mistakes::default() };
            for hit in hits.into_iter().flatten() {
                found.false_hits += u64::from(has_no_area(hit.prim.0 as usize));
                assert!(hit.t.is_finite() && hit.u.is_finite() && hit.v.is_finite());
            }
            if forms == FAST {
                println!("H5 area: {}, fast: {} hits of triangles without area", candidate.name, found.false_hits);
                fast::check("H5 area", &candidate.name, &found);
            } else {
                assert_eq!(found.false_hits, 0, "{}: triangles without area", candidate.name);
            }
        }
    }
}

#[test]
fn h05_a_fan_of_slivers_is_answered_exactly() {
    let mesh = fan(count(10_000, 10_000, 500) as u32);
    let trial = Trial { name: "H5 fan", mesh: &mesh, rays: count(5_000, 60, 20), refitted: true };
    trial.run(|first, len| rays_at(&mesh, first, len));
}
