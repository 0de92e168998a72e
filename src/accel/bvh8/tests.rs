use glam::Vec3;
use proptest::prelude::*;

use super::{
    Bvh8, Bvh8Config, Layout,
    compact::Compact,
    format::Format,
    full::Full,
    kernel::met,
    node::{EightNode, Link},
    packet::met_together,
};
use crate::{
    accel::{
        Accel, AccelKind, AnyHit, Closest, Forms, PACKET, TravRay, slabs,
        wide::{WIDTH, refit::Store},
    },
    geom::{Aabb, Hit, Ray, Triangles},
    simd::{Simd, SimdLevel, Task, dispatch},
};

/// The children that a ray meets by every f32 and f64 test of single rays and in a packet of its own kind.
struct Met<'a, F: Format> {
    ray: &'a TravRay,
    node: &'a F::Node,
    reach: f32,
}

impl<F: Format> Task for Met<'_, F> {
    type Output = [u32; 4];

    #[inline(always)]
    fn run<S: Simd>(self) -> [u32; 4] {
        let [fast, wide] = met::<S, F>(self.ray, self.node, self.reach);
        let [all, each] = met_together::<S, F>(self.ray, self.node, self.reach);
        [fast, wide, all, each]
    }
}

/// A node whose slots hold the box in turn with boxes that nothing meets.
fn node<F: Format>(aabb: Aabb) -> F::Node {
    let mut node = F::Node::new([Link::NONE; WIDTH]);
    let mut aabbs = [Aabb::EMPTY; WIDTH];
    for aabbs in aabbs.chunks_mut(2) {
        aabbs[0] = aabb;
    }
    let mut store = F::STORE;
    store.store(0, &aabbs, &mut node);
    node
}

/// The children that a ray meets in a node of this box, in every layout.
fn met_in(level: SimdLevel, ray: &TravRay, aabb: Aabb) -> [[u32; 4]; 2] {
    let reach = aabb.reach();
    [
        dispatch(level, Met::<Full> { ray, node: &node::<Full>(aabb), reach }),
        dispatch(level, Met::<Compact> { ray, node: &node::<Compact>(aabb), reach }),
    ]
}

const HALF: u32 = 0b0101_0101;

#[test]
fn rays_that_pass_a_box_by_miss_it() {
    let aabb = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    for level in SimdLevel::available() {
        for (origin, dir, due) in [
            (Vec3::new(0.3, 0.4, 5.0), Vec3::new(0.01, 0.02, -1.0), HALF),
            (Vec3::new(0.3, 0.4, 5.0), Vec3::new(0.5, 0.01, -1.0), 0),
            (Vec3::new(0.3, 0.4, 5.0), Vec3::new(0.01, 0.02, 1.0), 0),
            (Vec3::new(0.5, 0.5, 0.5), Vec3::new(0.3, -0.2, 0.1), HALF),
        ] {
            let ray = TravRay::new(&Ray::new(origin, dir)).unwrap();
            assert_eq!(met_in(level, &ray, aabb), [[due; 4]; 2], "{origin} {dir} at {level}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// The point is exact, and the ray enters along x where it leaves along y: no slack but the test's own.
    #[test]
    fn a_box_that_a_ray_touches_in_one_point_is_met(
        origin in prop::array::uniform3(-100_i8..100),
        dir in prop::array::uniform3(prop_oneof![-100_i8..0, 1_i8..101]),
        t in 1_u8..64,
        sizes in prop::array::uniform3(1_u8..100),
        scale in -20_i32..20,
    ) {
        let scale = f32::from_bits(((127 + scale) << 23).cast_unsigned());
        let (origin, dir) = (Vec3::from(origin.map(f32::from)) * scale, Vec3::from(dir.map(f32::from)));
        let touched = origin + dir * scale * f32::from(t);
        let size = Vec3::from(sizes.map(f32::from)) * dir.signum() * Vec3::new(1.0, -1.0, 1.0);
        let aabb = Aabb::from_points([touched, touched + size * scale]);
        let ray = TravRay::new(&Ray { t_far: f32::from(t) * scale, ..Ray::new(origin, dir) }).unwrap();
        prop_assume!(slabs::fits(&ray, aabb.reach()));
        for level in SimdLevel::available() {
            prop_assert_eq!(met_in(level, &ray, aabb), [[HALF; 4]; 2], "{}", level);
        }
    }

    /// Directions of all sizes, some along an axis: the point is rounded, so the box is grown by a place.
    #[test]
    fn a_box_around_a_point_of_a_ray_is_met(
        origin in prop::array::uniform3(-1e3_f32..1e3),
        dir in prop::array::uniform3(prop_oneof![Just(0.0_f32), -1e3_f32..1e3, -1e-6_f32..1e-6, -1e-16_f32..1e-16]),
        t in 0_u8..64,
        grow in prop::array::uniform3(0.0_f32..1.0),
    ) {
        let t = f32::from(t) * 0.25;
        prop_assume!(dir.iter().any(|d| d.abs() > 0.0) && dir.iter().all(|&d| d == 0.0 || d.abs() > 1e-17));
        let ray = TravRay::new(&Ray { t_far: t, ..Ray::new(Vec3::from(origin), Vec3::from(dir)) }).unwrap();
        // t is a multiple of a quarter, so the point is off by one rounding of the sum.
        let range = ray.range();
        let near = (range.origin.as_dvec3() + range.dir.as_dvec3() * f64::from(t)).as_vec3();
        let aabb = Aabb {
            min: Vec3::new(near.x.next_down(), near.y.next_down(), near.z.next_down()),
            max: Vec3::new(near.x.next_up(), near.y.next_up(), near.z.next_up()) + Vec3::from(grow),
        };
        prop_assume!(slabs::fits(&ray, aabb.reach()));
        for level in SimdLevel::available() {
            prop_assert_eq!(met_in(level, &ray, aabb), [[HALF; 4]; 2], "{}", level);
        }
    }
}

/// The compact tree.
fn compact(prims: &Triangles<'_>) -> Bvh8 {
    let tree = Bvh8::build(prims, &Bvh8Config { layout: Layout::Compact, ..Bvh8Config::default() }).unwrap();
    tree.validate(prims).unwrap();
    tree
}

/// The closest hit of a ray and whether it is blocked, asked for by itself.
struct Alone<'a> {
    tree: &'a Bvh8,
    prims: &'a Triangles<'a>,
    ray: &'a TravRay,
}

impl Task for Alone<'_> {
    type Output = (Option<Hit>, bool);

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self { tree, prims, ray } = self;
        let mut best = Closest::new(ray);
        tree.closest::<S, _, _>(prims, ray, &mut best, &AnyHit, &mut ());
        (best.hit(ray), tree.occluded::<S, _, _>(prims, ray, &AnyHit, &mut ()))
    }
}

/// The same of many rays, together or not.
struct Batch<'a> {
    tree: &'a Bvh8,
    prims: &'a Triangles<'a>,
    rays: &'a [Ray],
    packet: usize,
}

impl Task for Batch<'_> {
    type Output = (Vec<Option<Hit>>, Vec<bool>);

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self { tree, prims, rays, packet } = self;
        let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
        tree.closest_all::<S>(prims, rays, packet, Forms::EXACT, &mut hits);
        tree.occluded_all::<S>(prims, rays, packet, Forms::EXACT, &mut blocked);
        (hits, blocked)
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    /// Some rays run along axes, some are too steep for f32, some are none.
    #[test]
    fn batches_of_rays_find_what_each_finds_alone(
        corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-8_i8..8)), 0..80),
        rays in prop::collection::vec(
            (prop::array::uniform3(-12_i8..12), prop::array::uniform3(-3_i8..4), prop_oneof![12 => Just(1.0_f32), 1 => Just(1e-30), 1 => Just(f32::NAN)]),
            0..60,
        ),
        start in prop::option::of(prop::array::uniform3(-12_i8..12)),
        tilt in prop::option::of(prop::array::uniform3(2.0_f32..9.0)),
        range in prop_oneof![Just([0.0, f32::INFINITY]), prop::array::uniform2(0_u8..9).prop_map(|t| t.map(|t| f32::from(t) * 0.5))],
    ) {
        let point = |p: [i8; 3]| Vec3::from(p.map(f32::from)) * 0.5;
        let positions: Vec<_> = corners.iter().flatten().map(|&p| point(p)).collect();
        let indices: Vec<_> = (0..).step_by(3).take(corners.len()).map(|i| [i, i + 1, i + 2]).collect();
        let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
        let tree = Bvh8::build(&prims, &Bvh8Config::default()).unwrap();
        let compact = compact(&prims);
        // All from one point, or into one octant, or neither.
        let ray = |&(o, d, scale): &([i8; 3], [i8; 3], f32)| {
            let origin = point(start.unwrap_or(o));
            let dir = point(d) + tilt.map_or(Vec3::ZERO, Vec3::from);
            Ray { t_near: range[0], t_far: range[1], ..Ray::new(origin, dir * scale) }
        };
        let rays: Vec<_> = rays.iter().map(ray).collect();
        for level in SimdLevel::available() {
            for packet in [1, 5, PACKET] {
                let (hits, blocked) = dispatch(level, Batch { tree: &tree, prims: &prims, rays: &rays, packet });
                let other = dispatch(level, Batch { tree: &compact, prims: &prims, rays: &rays, packet });
                prop_assert_eq!((&hits, &blocked), (&other.0, &other.1), "{} {}, compact", level, packet);
                for (i, ray) in rays.iter().enumerate() {
                    let alone = TravRay::new(ray).map(|ray| dispatch(level, Alone { tree: &tree, prims: &prims, ray: &ray }));
                    prop_assert_eq!((hits[i], blocked[i]), alone.unwrap_or((None, false)), "{} {} {:?}", level, packet, ray);
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    /// Rays at edges and corners, at sheets a few numbers apart and at triangles that are there twice: what f32 cannot tell.
    #[test]
    fn doubtful_rays_of_packets_find_what_each_finds_alone(
        corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-1.0_f32..1.0)), 2..24),
        copies in prop::collection::vec((0_usize..24, -3_i8..4), 0..24),
        rays in prop::collection::vec((0_usize..48, 0_usize..3, prop_oneof![Just(0.0_f32), Just(0.5), Just(1.0), 0.0_f32..1.0], 0.95_f32..1.05), 16..33),
        spread in prop_oneof![Just(0.0_f32), Just(0.01)],
        ends in prop::option::of((0_usize..33, prop::bool::ANY)),
    ) {
        let mut triangles: Vec<[Vec3; 3]> =
            corners.iter().map(|t| t.map(|[x, y, z]| Vec3::new(0.3 * x, 0.3 * y, 3.0 + 0.3 * z))).collect();
        for &(of, steps) in &copies {
            let beside = |mut p: Vec3| {
                (0..steps.abs()).for_each(|_| p.z = if steps > 0 { p.z.next_up() } else { p.z.next_down() });
                p
            };
            triangles.push(triangles[of % triangles.len()].map(beside));
        }
        let positions: Vec<_> = triangles.iter().flatten().copied().collect();
        let indices: Vec<_> = (0..).step_by(3).take(triangles.len()).map(|i| [i, i + 1, i + 2]).collect();
        let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
        let tree = Bvh8::build(&prims, &Bvh8Config::default()).unwrap();
        let compact = compact(&prims);
        let alone = |ray: &Ray, level| {
            let ray = TravRay::new(ray);
            ray.map_or((None, false), |ray| dispatch(level, Alone { tree: &tree, prims: &prims, ray: &ray }))
        };
        let mut rays: Vec<_> = rays
            .iter()
            .map(|&(of, side, part, length)| {
                let triangle = triangles[of % triangles.len()];
                let (a, b, c) = (triangle[side], triangle[(side + 1) % 3], triangle[(side + 2) % 3]);
                // A third of the rays go through the inside.
                let b = if of % 3 == 0 { b * 0.7 + c * 0.3 } else { b };
                let origin = Vec3::new(-1.5, -1.5, 0.0) + Vec3::splat(spread) * length;
                Ray::new(origin, (a * part + b * (1.0 - part) - origin) * length)
            })
            .collect();
        // Ranges that begin or end at a hit.
        if let Some((number, is_far)) = ends
            && let (Some(hit), _) = alone(&rays[number % rays.len()], SimdLevel::best())
        {
            for ray in &mut rays {
                (ray.t_near, ray.t_far) = if is_far { (0.0, hit.t) } else { (hit.t, f32::INFINITY) };
            }
        }
        for level in SimdLevel::available() {
            let expected: Vec<_> = rays.iter().map(|ray| alone(ray, level)).collect();
            for packet in [1, PACKET] {
                let (hits, blocked) = dispatch(level, Batch { tree: &tree, prims: &prims, rays: &rays, packet });
                let other = dispatch(level, Batch { tree: &compact, prims: &prims, rays: &rays, packet });
                prop_assert_eq!((&hits, &blocked), (&other.0, &other.1), "{} {}, compact", level, packet);
                for (i, ray) in rays.iter().enumerate() {
                    prop_assert_eq!((hits[i], blocked[i]), expected[i], "{} {} {:?}", level, packet, ray);
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// Rays from nearly one place in all directions, short and long, through triangles so long that each ray comes by more nodes than it can note. Where
    /// short rays end there is a small triangle.
    #[test]
    fn scattered_rays_of_packets_find_what_each_finds_alone(
        corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-100_i8..100)), 60..400),
        rays in prop::collection::vec((prop::array::uniform3(-2_i8..3), prop::array::uniform3(-50_i8..51), 0_u8..4), 20..40),
        size in prop_oneof![Just(1.0_f32), Just(0.1), Just(0.01)],
    ) {
        // The second and third corner near the first, as far as the size says.
        let corner = |t: &[[i8; 3]; 3], i: usize| {
            let at = |i: usize| Vec3::from(t[i].map(f32::from));
            at(0) + if i > 0 { at(i) * size } else { Vec3::ZERO }
        };
        let ends = [f32::INFINITY, 2.0, 0.5, 0.25];
        let ray = |&(o, d, end): &([i8; 3], [i8; 3], u8)| Ray {
            t_far: ends[usize::from(end)],
            ..Ray::new(Vec3::from(o.map(f32::from)), Vec3::from(d.map(f32::from)))
        };
        let rays: Vec<_> = rays.iter().map(ray).collect();
        let mut positions: Vec<_> = corners.iter().flat_map(|t| [corner(t, 0), corner(t, 1), corner(t, 2)]).collect();
        for ray in rays.iter().filter(|ray| ray.t_far < f32::INFINITY) {
            let end = ray.origin + ray.dir * ray.t_far;
            positions.extend([end, end + Vec3::new(0.25, -0.25, 0.125), end + Vec3::new(-0.25, 0.125, 0.5)]);
        }
        let indices: Vec<_> = (0..).step_by(3).take(positions.len() / 3).map(|i| [i, i + 1, i + 2]).collect();
        let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
        let tree = Bvh8::build(&prims, &Bvh8Config::default()).unwrap();
        for level in SimdLevel::available() {
            for packet in [7, PACKET] {
                let (hits, blocked) = dispatch(level, Batch { tree: &tree, prims: &prims, rays: &rays, packet });
                for (i, ray) in rays.iter().enumerate() {
                    let alone = TravRay::new(ray).map(|ray| dispatch(level, Alone { tree: &tree, prims: &prims, ray: &ray }));
                    prop_assert_eq!((hits[i], blocked[i]), alone.unwrap_or((None, false)), "{} {} {:?}", level, packet, ray);
                }
            }
        }
    }
}

#[test]
fn nodes_are_few_and_mostly_full() {
    let corner = |i: u16| Vec3::new(f32::from(i % 40), f32::from(i / 40), f32::from(i % 7) * 0.1);
    let positions: Vec<_> = (0..1600).flat_map(|i| [corner(i), corner(i) + Vec3::X, corner(i) + Vec3::Y]).collect();
    let indices: Vec<_> = (0..1600).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
    let stats = Bvh8::build(&prims, &Bvh8Config::default()).unwrap().stats();
    let inner = stats.nodes - stats.leaves;
    assert!(inner * 4 < stats.leaves, "{stats:?}");
    let binary = AccelKind::Bvh2.build(&[("leaf".to_owned(), "4".to_owned())], &prims).unwrap().stats();
    assert_eq!(stats.leaves, binary.leaves);
}
