use proptest::prelude::*;

use super::*;

fn unit() -> impl Strategy<Value = f32> {
    prop_oneof![4 => -1.0_f32..1.0, 1 => Just(0.0), 1 => Just(1.0), 1 => Just(-1.0)]
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

/// Scales from a millimetre's thousandth to planets, and the ends of f32.
fn scale() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => (-10_i32..18).prop_map(|k| 10.0_f32.powi(k)),
        1 => prop::sample::select(vec![1e-44, 1e-38, 1e-30, 1e30, 1e37]),
    ]
}

/// Triangles of every shape down to needles, near and far from the origin.
fn triangle() -> impl Strategy<Value = [Vec3; 3]> {
    let shape = (vector(), vector(), vector(), 0..9_i32);
    (shape, scale(), vector(), prop_oneof![2 => Just(0.0_f32), 1 => 0.0_f32..100.0, 1 => 1e3_f32..1e5]).prop_map(
        |((a, b, c, thin), scale, shift, far)| {
            let c = a + (b - a) * 0.7 + (c - a) * 10.0_f32.powi(-thin);
            [a, b, c].map(|p| (p + shift * far) * scale)
        },
    )
}

/// A direction nearly in the plane: an edge's, tilted by as little as f32 can.
fn grazing(corners: &[Vec3; 3], along: f32, tilt: f32) -> Vec3 {
    let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
    let length = e1.abs().max_element();
    let dir = (e1 + (e2 - e1) * along) / length;
    let normal = (e1 / length).cross(e2 / length).normalize_or_zero();
    dir + normal * tilt
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn starts_lie_on_the_side_that_the_ray_leaves_to(
        corners in triangle(),
        (u, v) in weights(),
        dir in vector(),
        (along, tilt) in (0.0_f32..1.0, prop_oneof![Just(0.0_f32), (1..9_i32).prop_map(|k| 10.0_f32.powi(-k))]),
    ) {
        prop_assume!(corners.iter().all(|c| c.is_finite()));
        let solid = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().any(|axis| slope(&corners, axis) != 0);
        prop_assume!(solid);
        let graze = grazing(&corners, along, tilt);
        for dir in [dir, -dir, graze, -graze] {
            let start = leave(&corners, u, v, dir);
            let due = if slope(&corners, dir) < 0 { -1 } else { 1 };
            prop_assert_eq!(side(&corners, start), due, "{:?} from {:?}", dir, start);
        }
    }

    #[test]
    fn starts_stay_close_to_the_point(corners in triangle(), (u, v) in weights(), dir in vector()) {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let cross = (b - a).cross(c - a).length();
        let longest = (b - a).length().max((c - a).length()).max((c - b).length());
        let largest = corners.iter().fold(0.0, |most: f32, c| most.max(c.abs().max_element()));
        // As high as it is wide by a thousandth: needles may need more.
        if !(largest < 1e37 && largest > 1e-30 && cross > longest * longest * 1e-3) {
            return Ok(());
        }
        let point = a + (b - a) * f64::from(u) + (c - a) * f64::from(v);
        let start = leave(&corners, u, v, dir).as_dvec3();
        // Sixteen errors of up to 4 units in the last place along each axis, and the slant towards the middle.
        let wanted = 16.0 * 3.0 * 5e-7 * f64::from(largest);
        let height = cross / longest;
        prop_assert!((start - point).length() <= (wanted * longest / height * 3.0).min(longest) + 4e-6 * f64::from(largest));
    }
}

#[test]
fn a_floor_is_left_upwards_and_downwards_by_little() {
    let corners = [Vec3::new(-10.0, 0.0, -10.0), Vec3::new(-10.0, 0.0, 10.0), Vec3::new(10.0, 0.0, -10.0)];
    let above = leave(&corners, 0.25, 0.25, Vec3::Y);
    let below = leave(&corners, 0.25, 0.25, Vec3::new(1.0, -1e-9, 0.0));
    assert!(above.y > 0.0 && above.y < 1e-7, "{above}");
    assert!(below.y < 0.0 && below.y > -1e-7, "{below}");
    assert_eq!((above.x, above.z), (-5.0, -5.0));
}

#[test]
fn points_on_edges_are_drawn_inwards() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Z];
    for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (0.0, 0.3)] {
        let start = leave(&corners, u, v, Vec3::NEG_Y);
        assert!(start.x > 1e-8 && start.z > 1e-8 && start.x + start.z < 1.0 - 1e-8, "{start}");
        assert!(start.y < 0.0);
    }
}

#[test]
fn triangles_without_sides_are_left_from_the_point() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
    assert_eq!(leave(&corners, 0.5, 0.0, Vec3::Y).y.to_bits(), 0);
    assert!(!leave(&[Vec3::NAN, Vec3::X, Vec3::Y], 0.1, 0.2, Vec3::Z).is_finite());
}
