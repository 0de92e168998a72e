use glam::{DVec3, Vec3};
use proptest::prelude::*;

use super::*;
use crate::{
    geom::{Aabb, Ray},
    scene::spd::{SpdKind, SpdShape},
};

fn vector(size: f64) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
}

fn sphere() -> impl Strategy<Value = SpdShape> {
    (vector(2.0), 0.1..2.0).prop_map(|(center, radius)| SpdShape::Sphere { center, radius })
}

fn cone() -> impl Strategy<Value = SpdShape> {
    let ends = (vector(2.0), vector(2.0)).prop_filter("apart", |(a, b)| a.distance(*b) > 0.1);
    (ends, 0.05..1.0, 0.05..=1.0).prop_map(|((base, apex), base_radius, share)| SpdShape::Cone {
        base,
        base_radius,
        apex,
        apex_radius: base_radius * share,
    })
}

/// From a point around the shapes through one near them.
fn line() -> impl Strategy<Value = SolidRay> {
    (vector(6.0), vector(2.5))
        .prop_filter("a direction", |(a, b)| a.distance(*b) > 0.1)
        .prop_map(|(origin, target)| SolidRay { origin, dir: target - origin, t_near: 0.0, t_far: f64::INFINITY })
}

/// Signed distance, roughly, from a round shape's whole surface; and whether the surface exists there.
fn implicit(shape: &SpdShape, p: DVec3) -> (f64, bool) {
    match *shape {
        SpdShape::Sphere { center, radius } => (p.distance(center) - radius, true),
        SpdShape::Cone { base, base_radius, apex, apex_radius } => {
            let axis = (apex - base).normalize();
            let (up, height) = ((p - base).dot(axis), base.distance(apex));
            let radius = base_radius + (apex_radius - base_radius) * up / height;
            (p.distance(base + axis * up) - radius, (0.0..=height).contains(&up) && radius >= 0.0)
        }
        _ => unreachable!("round shapes only"),
    }
}

/// The first crossing by walking along the ray in small steps, with the least |distance| seen: crossings closer than a
/// step are lost.
fn marched(shape: &SpdShape, ray: &SolidRay) -> (Option<f64>, f64) {
    const STEPS: u32 = 4000;
    let at = |i: u32| 3.0 * f64::from(i) / f64::from(STEPS);
    let value = |t: f64| implicit(shape, ray.at(t)).0;
    let mut least = f64::INFINITY;
    for i in 0..STEPS {
        let (mut low, mut high) = (at(i), at(i + 1));
        least = least.min(value(high).abs());
        if (value(low) < 0.0) == (value(high) < 0.0) {
            continue;
        }
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            if (value(low) < 0.0) == (value(middle) < 0.0) { low = middle } else { high = middle }
        }
        if implicit(shape, ray.at(low)).1 {
            return (Some(low), least);
        }
    }
    (None, least)
}

fn check_round(shape: &SpdShape, ray: &SolidRay) -> Result<(), TestCaseError> {
    let solid = Solid::new(shape);
    let found = solid.hit(ray, Sides::Both);
    let (due, _) = marched(shape, ray);
    if let Some(hit) = found {
        let p = ray.at(hit.t);
        let (distance, exists) = implicit(shape, p);
        prop_assert!(distance.abs() < 1e-9, "{distance} off the surface");
        prop_assert!(exists || implicit(shape, p + ray.dir * 1e-9).1 || implicit(shape, p - ray.dir * 1e-9).1);
        prop_assert!((hit.n_geom.length() - 1.0).abs() < 1e-9);
        prop_assert!(implicit(shape, p + hit.n_geom * 1e-3).0 > implicit(shape, p - hit.n_geom * 1e-3).0);
    }
    match (found, due) {
        (Some(hit), Some(t)) if (hit.t - t).abs() < 1e-9 => {}
        // Two crossings within a step of the march, or an end of the mantle within its accuracy.
        (Some(hit), _) if due.is_none_or(|t| hit.t < t) => {
            let step = 3.0 / 4000.0;
            let (before, after) = (ray.at(hit.t - 1e-9), ray.at(hit.t + 1e-9));
            let at_end = implicit(shape, before).1 != implicit(shape, after).1;
            let near = SolidRay { t_near: hit.t + 1e-12, ..*ray };
            let next = solid.hit(&near, Sides::Both);
            prop_assert!(
                at_end
                    || hit.t > 3.0
                    || next.is_some_and(|n| n.t - hit.t < step)
                    || is_grazing(shape, ray, hit.t, step),
                "{hit:?} where marching finds {due:?}"
            );
        }
        (None, None) => {}
        (found, due) => {
            let t = due.unwrap_or(0.0);
            let at_end = implicit(shape, ray.at(t - 1e-9)).1 != implicit(shape, ray.at(t + 1e-9)).1;
            prop_assert!(at_end, "{found:?} where marching finds {due:?}");
        }
    }
    Ok(())
}

/// True when the line is on the same side of the whole surface within a step before and after `t`.
fn is_grazing(shape: &SpdShape, ray: &SolidRay, t: f64, step: f64) -> bool {
    let side = |t: f64| implicit(shape, ray.at(t)).0 < 0.0;
    side(t - step) == side(t + step)
}

/// Points of a shape's surface.
fn samples(shape: &SpdShape) -> Vec<DVec3> {
    let around = |i: u32| {
        let angle = f64::from(i) * std::f64::consts::TAU / 64.0;
        (libm::cos(angle), libm::sin(angle))
    };
    match shape {
        SpdShape::Sphere { center, radius } => (0..64)
            .flat_map(|i| (0..64).map(move |j| (around(i), around(j))))
            .map(|((c, s), (d, r))| *center + DVec3::new(c * r, s * r, d) * *radius)
            .chain(
                [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|a| [*center + a * *radius, *center - a * *radius]),
            )
            .collect(),
        SpdShape::Cone { base, base_radius, apex, apex_radius } => {
            let (right, up) = (*apex - *base).normalize().any_orthonormal_pair();
            let ring = |center: DVec3, radius: f64| {
                (0..64).map(around).map(move |(c, s)| center + (right * c + up * s) * radius)
            };
            ring(*base, *base_radius).chain(ring(*apex, *apex_radius)).collect()
        }
        SpdShape::Polygon(corners) => corners.to_vec(),
        SpdShape::Patch { corners, .. } => corners.to_vec(),
    }
}

fn holds(aabb: Aabb, p: DVec3) -> bool {
    aabb.min.as_dvec3().cmple(p).all() && p.cmple(aabb.max.as_dvec3()).all()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 64 } else { 400 }))]

    #[test]
    fn spheres_are_hit_where_marching_finds_them(shape in sphere(), ray in line()) {
        check_round(&shape, &ray)?;
    }

    #[test]
    fn cones_are_hit_where_marching_finds_them(shape in cone(), ray in line()) {
        check_round(&shape, &ray)?;
    }

    #[test]
    fn boxes_hold_their_objects_closely(shape in prop_oneof![sphere(), cone()]) {
        let aabb = Solid::new(&shape).aabb();
        let points = samples(&shape);
        prop_assert!(points.iter().all(|&p| holds(aabb, p)));
        let least = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let most = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        // 64 points around a circle come within 0.13 % of its radius of any side.
        let slack = 3e-3;
        prop_assert!((aabb.min.as_dvec3() - least).abs().max_element() < slack, "{aabb:?} {least}");
        prop_assert!((aabb.max.as_dvec3() - most).abs().max_element() < slack, "{aabb:?} {most}");
    }

    #[test]
    fn hits_on_the_front_are_those_against_the_normal(shape in prop_oneof![sphere(), cone()], ray in line()) {
        let solid = Solid::new(&shape);
        let front = solid.hit(&ray, Sides::Front);
        let mut from = ray;
        let mut due = None;
        while let Some(hit) = solid.hit(&from, Sides::Both) {
            if hit.n_geom.dot(ray.dir) < 0.0 {
                due = Some(hit);
                break;
            }
            from.t_near = hit.t.next_up();
        }
        prop_assert_eq!(front, due);
    }

    #[test]
    fn ranges_are_closed(shape in prop_oneof![sphere(), cone()], ray in line()) {
        let solid = Solid::new(&shape);
        if let Some(hit) = solid.hit(&ray, Sides::Both) {
            prop_assert_eq!(solid.hit(&SolidRay { t_far: hit.t, ..ray }, Sides::Both), Some(hit));
            prop_assert_eq!(solid.hit(&SolidRay { t_far: hit.t.next_down(), ..ray }, Sides::Both), None);
            prop_assert_eq!(solid.hit(&SolidRay { t_near: hit.t, ..ray }, Sides::Both), Some(hit));
        }
    }

    #[test]
    fn a_polygon_of_three_corners_and_a_patch_agree(corners in prop::array::uniform3(vector(2.0)), ray in line()) {
        let [a, b, c] = corners;
        prop_assume!((b - a).cross(c - a).length() > 1e-3);
        let patch = Solid::new(&SpdShape::Patch { corners, normals: [DVec3::Z; 3] });
        let polygon = Solid::new(&SpdShape::Polygon(Box::new(corners)));
        let (one, two) = (patch.hit(&ray, Sides::Both), polygon.hit(&ray, Sides::Both));
        prop_assert_eq!(one.is_some(), two.is_some());
        if let (Some(one), Some(two)) = (one, two) {
            prop_assert!((one.t - two.t).abs() < 1e-9 * (1.0 + one.t) && one.n_geom.distance(two.n_geom) < 1e-12);
        }
    }

    #[test]
    fn points_of_a_gear_are_inside_as_its_outline_winds_around_them(x in -1.0..1.0, y in -1.0..1.0) {
        let scene = SpdKind::Gears.generate(1).expect("a valid size");
        let SpdShape::Polygon(corners) = &scene.objects[1].shape else { panic!("a face") };
        prop_assert_eq!(corners.len(), 144);
        let p = DVec3::new(x, y, corners[0].z);
        let turn: f64 = (0..144)
            .map(|i| {
                let (a, b) = (corners[i] - p, corners[(i + 1) % 144] - p);
                libm::atan2(a.x * b.y - a.y * b.x, a.x * b.x + a.y * b.y)
            })
            .sum();
        let ray = SolidRay { origin: p + DVec3::Z, dir: DVec3::NEG_Z, t_near: 0.0, t_far: 9.0 };
        prop_assert_eq!(Solid::new(&scene.objects[1].shape).hit(&ray, Sides::Front).is_some(), turn > 3.0);
    }
}

#[test]
fn a_ray_through_a_shared_edge_meets_one_of_its_polygons() {
    let square = |x: f64, y: f64| {
        let corner = |i: f64, j: f64| DVec3::new(x + i, y + j, 0.0);
        Solid::new(&SpdShape::Polygon(Box::new([
            corner(0.0, 0.0),
            corner(1.0, 0.0),
            corner(1.0, 1.0),
            corner(0.0, 1.0),
        ])))
    };
    let squares: Vec<_> = (0..9).map(|i| square(f64::from(i % 3), f64::from(i / 3))).collect();
    for i in 1..12 {
        for j in 1..12 {
            let origin = DVec3::new(f64::from(i) * 0.25, f64::from(j) * 0.25, 2.0);
            let ray = SolidRay { origin, dir: DVec3::NEG_Z, t_near: 0.0, t_far: 9.0 };
            let met = squares.iter().filter(|s| s.hit(&ray, Sides::Front).is_some()).count();
            assert_eq!(met, 1, "{origin}");
        }
    }
}

#[test]
fn objects_without_area_and_rays_along_planes_are_misses() {
    let flat = Solid::new(&SpdShape::Polygon(Box::new([DVec3::ZERO, DVec3::X, DVec3::X * 2.0])));
    let square = Solid::new(&SpdShape::Polygon(Box::new([DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y])));
    let through = Ray::new(Vec3::new(0.5, 0.0, 1.0), Vec3::NEG_Z);
    let along = Ray::new(Vec3::new(-1.0, 0.5, 0.0), Vec3::X);
    for corners in [&[][..], &[DVec3::Y]] {
        let nothing = Solid::new(&SpdShape::Polygon(corners.into()));
        assert_eq!(nothing.hit(&SolidRay::from(&through), Sides::Both), None);
    }
    assert_eq!(flat.hit(&SolidRay::from(&through), Sides::Both), None);
    assert_eq!(square.hit(&SolidRay::from(&along), Sides::Both), None);
    let cylinder = SpdShape::Cone { base: DVec3::ZERO, base_radius: 1.0, apex: DVec3::Z, apex_radius: 1.0 };
    let inside = Ray::new(Vec3::new(0.5, 0.0, -1.0), Vec3::Z);
    assert_eq!(Solid::new(&cylinder).hit(&SolidRay::from(&inside), Sides::Both), None);
}
