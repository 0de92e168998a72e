use glam::Vec3;
use proptest::prelude::*;

use super::{Compact, node::Steps};
use crate::{
    accel::{
        Accel, Refit,
        bvh8::{
            Bvh8Config,
            node::{EightNode, Link},
            tree::Tree8,
        },
        wide::WIDTH,
    },
    geom::{Aabb, Triangles},
    simd::{Lanes, Simd, SimdLevel, Task, dispatch},
};

/// The planes of a node as vectors, against those read one by one.
struct Planes<'a>(&'a Steps);

impl Task for Planes<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self) -> bool {
        let mut same = true;
        for axis in 0..3 {
            for side in 0..2 {
                let mut row = [0.0; WIDTH];
                self.0.planes::<S>(axis, side).store(&mut row);
                for (child, plane) in row.into_iter().enumerate() {
                    let other = self.0.plane(axis, side, child);
                    same &= plane.to_bits() == other.to_bits() || plane.is_nan() && other.is_nan();
                }
            }
        }
        same
    }
}

/// Numbers of every size, many of them close together.
fn number() -> impl Strategy<Value = f32> {
    let near = (-4_i32..5).prop_map(|steps| {
        let mut number = 1000.0_f32;
        (0..steps.abs()).for_each(|_| number = if steps > 0 { number.next_up() } else { number.next_down() });
        number
    });
    let any = any::<u32>().prop_map(f32::from_bits).prop_filter("finite", |x| x.is_finite());
    let special =
        prop::sample::select(vec![0.0, f32::MAX, f32::MIN, f32::MIN_POSITIVE, f32::from_bits(1), 1e37, -3e38]);
    prop_oneof![-10.0_f32..10.0, -1e-38_f32..1e-38, near, any, special]
}

fn moderate() -> impl Strategy<Value = f32> {
    prop_oneof![-10.0_f32..10.0, -1e-38_f32..1e-38, 999.999_f32..1000.001, -1e30_f32..1e30]
}

fn boxes<N: Strategy<Value = f32> + 'static>(number: fn() -> N) -> impl Strategy<Value = [Aabb; WIDTH]> {
    let point = move || prop::array::uniform3(number()).prop_map(Vec3::from);
    let flat = (0.0_f32..8.0, 0.0_f32..8.0).prop_map(|(x, z)| Vec3::new(x, 0.5, z));
    let some = prop_oneof![
        (point(), point()).prop_map(|(a, b)| Aabb::from_points([a, b])),
        (flat.clone(), flat).prop_map(|(a, b)| Aabb::from_points([a, b])),
        point().prop_map(|a| Aabb::from_points([a])),
        Just(Aabb::EMPTY),
    ];
    prop::collection::vec(some, WIDTH).prop_map(|boxes| std::array::from_fn(|i| boxes[i]))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn boxes_that_are_read_contain_those_that_were_written(boxes in boxes(number)) {
        let mut node = Steps::new([Link::NONE; WIDTH]);
        node.set_aabbs(&boxes);
        for (child, aabb) in boxes.iter().enumerate() {
            prop_assert_eq!(node.present() >> child & 1 == 0, aabb.is_empty());
            for axis in (0..3).filter(|_| !aabb.is_empty()) {
                let (low, high) = (node.plane(axis, 0, child), node.plane(axis, 1, child));
                prop_assert!(low.is_nan() || low <= aabb.min[axis], "{} above {:?}", low, aabb);
                prop_assert!(high.is_nan() || high >= aabb.max[axis], "{} below {:?}", high, aabb);
            }
        }
        prop_assert_eq!(node.check(&boxes), Ok(()));
        for level in SimdLevel::available() {
            prop_assert!(dispatch(level, Planes(&node)), "{}", level);
        }
    }

    /// Not more than two steps of the least that 8 bits allow, and what rounding takes.
    #[test]
    fn boxes_that_are_read_are_little_larger(boxes in boxes(moderate)) {
        let around = boxes.iter().fold(Aabb::EMPTY, |all, &aabb| all.union(aabb));
        let mut node = Steps::new([Link::NONE; WIDTH]);
        node.set_aabbs(&boxes);
        for (child, aabb) in boxes.iter().enumerate().filter(|(_, aabb)| !aabb.is_empty()) {
            for axis in 0..3 {
                let extent = f64::from(around.max[axis]) - f64::from(around.min[axis]);
                let slack = extent * (2.0 / 127.0) + f64::from(around.reach()) * 2.0_f64.powi(-23) + 1e-37;
                prop_assert!(f64::from(aabb.min[axis]) - f64::from(node.plane(axis, 0, child)) <= slack);
                prop_assert!(f64::from(node.plane(axis, 1, child)) - f64::from(aabb.max[axis]) <= slack);
            }
        }
    }
}

fn grid(side: u16, phase: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let at = |i: u16| Vec3::new(f32::from(i % side), f32::from(i / side), f32::from(i % 7) * 0.3 * phase);
    let quads = (0..side * side).filter(|i| i % side + 1 < side && i / side + 1 < side).map(u32::from);
    let row = u32::from(side);
    let triangles = quads.flat_map(|i| [[i, i + 1, i + row], [i + 1, i + row + 1, i + row]]);
    ((0..side * side).map(at).collect(), triangles.collect())
}

fn tree(prims: &Triangles<'_>) -> Tree8<Compact> {
    Tree8::build(prims, &Bvh8Config::default()).unwrap()
}

#[test]
fn a_triangle_takes_at_most_thirty_bytes() {
    let (positions, indices) = grid(100, 1.0);
    let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
    assert!(tree(&prims).stats().total_bytes <= 30 * indices.len());
}

#[test]
fn refits_find_triangles_that_come_and_go() {
    // More nodes than one task takes.
    let (mut positions, indices) = grid(160, 1.0);
    let build = |positions: &[Vec3]| tree(&Triangles { positions, indices: &indices, topology_epoch: 0 });
    let built = build(&positions);
    assert!(built.nodes.len() > 600, "{}", built.nodes.len());
    let mut out = built.clone();
    let mut refitted = |positions: &[Vec3]| {
        let prims = Triangles { positions, indices: &indices, topology_epoch: 0 };
        assert_eq!(built.refit_into(&mut out, &prims), Refit::Done);
        out.validate(&prims).unwrap();
        (out.bounds, out.decay())
    };
    let whole = refitted(&positions);
    for (i, bad) in [(0, f32::NAN), (25_599, f32::INFINITY), (7000, f32::NEG_INFINITY)] {
        positions[i].y = bad;
        refitted(&positions);
    }
    let nothing = vec![Vec3::NAN; positions.len()];
    assert!(refitted(&nothing).0.is_empty());
    // Sums of coordinates overflow, coordinates do not.
    let huge: Vec<_> = grid(160, 1.0).0.iter().map(|p| *p * 2e36).collect();
    refitted(&huge);
    assert_eq!(refitted(&grid(160, 1.0).0), whole);
}

#[test]
fn one_thread_and_four_make_the_same_nodes() {
    let ((positions, indices), moved) = (grid(160, 1.0), grid(160, 0.4).0);
    let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
    let built = tree(&prims);
    let refitted = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut out = built.clone();
        pool.install(|| built.refit_into(&mut out, &Triangles { positions: &moved, ..prims }));
        (out.nodes.clone(), out.decay().to_bits())
    };
    assert_eq!(refitted(1), refitted(4));
}
