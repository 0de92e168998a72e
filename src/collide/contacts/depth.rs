//! The shortest translation that parts two triangles.

use glam::{DVec3, Vec3};

use crate::collide::surface::unit;

/// Unit direction and length of the shortest translation of `b` after which triangles that meet share at most a rim.
///
/// The points that `b` may be moved by while it meets `a` are a convex solid whose faces lie across the normals of both and the cross
/// products of their edges; the nearest of those faces is what is looked for. Triangles in one plane, or without area, are
/// parted by the least step across it: a depth of 0. In f64; off by some 2^-48 of the triangles' size.
pub(super) fn shortest_way_out(a: &[Vec3; 3], b: &[Vec3; 3]) -> (DVec3, f64) {
    // From a corner of the one, so that distances lose nothing to a far origin.
    let origin = a[0].as_dvec3();
    let (a, b) = (a.map(|p| p.as_dvec3() - origin), b.map(|p| p.as_dvec3() - origin));
    let edges = |t: &[DVec3; 3]| [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
    let (of_a, of_b) = (edges(&a), edges(&b));
    let mut best: Option<(DVec3, f64)> = None;
    let mut look = |direction: DVec3, size: f64| {
        // Nearly parallel edges give no direction that f64 knows; others bound the way as well.
        if direction.length_squared() <= size * NEGLIGIBLE {
            return;
        }
        let Some(n) = unit(direction) else { return };
        let ((a0, a1), (b0, b1)) = (span(&a, n), span(&b, n));
        let (up, down) = ((a1 - b0).max(0.0), (b1 - a0).max(0.0));
        let found = if up <= down { (n, up) } else { (-n, down) };
        if best.is_none_or(|best| found.1 < best.1) {
            best = Some(found);
        }
    };
    for t in [&of_a, &of_b] {
        look(t[0].cross(t[1]), t[0].length_squared() * t[1].length_squared());
    }
    for x in of_a {
        for y in of_b {
            look(x.cross(y), x.length_squared() * y.length_squared());
        }
    }
    best.unwrap_or_else(|| (any_across(&of_a, &of_b), 0.0))
}

/// Squared sine of an angle that counts as none.
const NEGLIGIBLE: f64 = 1e-24;

fn span(t: &[DVec3; 3], n: DVec3) -> (f64, f64) {
    let [x, y, z] = t.map(|p| p.dot(n));
    (x.min(y).min(z), x.max(y).max(z))
}

/// A direction across everything, where all lies on one line.
fn any_across(a: &[DVec3; 3], b: &[DVec3; 3]) -> DVec3 {
    let along = a.iter().chain(b).copied().find_map(unit).unwrap_or(DVec3::Z);
    unit(along.any_orthogonal_vector()).unwrap_or(DVec3::X)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::collide::{triangle_distance, triangles_meet};

    fn triangle() -> impl Strategy<Value = [Vec3; 3]> {
        let point = || [-8_i8..=8, -8_i8..=8, -8_i8..=8].prop_map(|p| Vec3::from(p.map(f32::from)));
        [point(), point(), point()]
    }

    fn moved(t: &[Vec3; 3], by: DVec3) -> [Vec3; 3] {
        t.map(|p| (p.as_dvec3() + by).as_vec3())
    }

    proptest! {
        #[test]
        fn the_way_out_parts_the_triangles_and_no_direction_has_a_shorter_one(
            a in triangle(), b in triangle(), direction in [-8_i8..=8, -8_i8..=8, -8_i8..=8],
        ) {
            prop_assume!(triangles_meet(&a, &b));
            let (normal, depth) = shortest_way_out(&a, &b);
            prop_assert!((normal.length() - 1.0).abs() < 1e-12 && depth.is_finite() && depth >= 0.0);
            prop_assert!(!triangles_meet(&a, &moved(&b, normal * (depth + 1e-4))));
            if let Some(d) = unit(DVec3::from(direction.map(f64::from)))
                && depth > 1e-3
            {
                let inside = moved(&b, d * (depth - 1e-3));
                let apart = triangle_distance(&a, &inside).map_or(f64::INFINITY, |near| near.distance);
                prop_assert!(apart < 1e-4, "{apart} apart after {} along {d}", depth - 1e-3);
            }
        }
    }

    #[test]
    fn a_triangle_through_another_leaves_over_its_nearest_rim() {
        let flat = [Vec3::new(-4.0, -4.0, 0.0), Vec3::new(4.0, -4.0, 0.0), Vec3::new(0.0, 8.0, 0.0)];
        let upright = [Vec3::new(0.0, 0.0, -0.25), Vec3::new(0.5, 0.0, 3.0), Vec3::new(-0.5, 0.0, 3.0)];
        let (normal, depth) = shortest_way_out(&flat, &upright);
        assert!((depth - 0.25).abs() < 1e-12 && (normal - DVec3::Z).length() < 1e-12, "{normal} {depth}");
    }

    #[test]
    fn triangles_in_one_plane_and_without_area_are_parted_by_nothing() {
        let a = [Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0];
        let (normal, depth) = shortest_way_out(&a, &a.map(|p| p + Vec3::new(0.5, 0.5, 0.0)));
        assert!(depth.to_bits() == 0 && normal.z.abs().to_bits() == 1_f64.to_bits(), "{normal} {depth}");
        let point = [Vec3::ONE; 3];
        let (normal, depth) = shortest_way_out(&point, &point);
        assert!(depth == 0.0 && normal.is_normalized());
    }
}
