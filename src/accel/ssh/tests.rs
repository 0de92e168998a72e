#![expect(
    clippy::cast_possible_truncation,
    clippy::float_cmp,
    reason = "roundings are wanted; planes are compared bit for bit"
)]

use glam::Vec3;
use proptest::prelude::*;

use super::{
    Ssh, SshConfig,
    choose::choose,
    narrow::Narrow,
    node::{MAX_TRIANGLES, Side, Word},
    packet, traverse,
};
use crate::{
    accel::{Accel, AccelConfig, AccelKind, BuildError, TravRay},
    geom::{Aabb, Ray, Triangles},
    simd::{Simd, SimdLevel, Task, dispatch},
};

fn mesh(count: usize, seed: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 8_388_608.0 - 1.0
    };
    let mut positions = Vec::new();
    for _ in 0..count {
        let center = Vec3::new(next(), next(), next());
        positions.extend((0..3).map(|_| center + 0.1 * Vec3::new(next(), next(), next())));
    }
    let indices = (0..u32::try_from(count).unwrap()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    (positions, indices)
}

fn config(settings: &[(&str, &str)]) -> SshConfig {
    let mut config = SshConfig::default();
    for (key, value) in settings {
        config.set(key, value).unwrap();
    }
    config
}

fn build<A: Accel<Config = SshConfig>>(positions: &[Vec3], indices: &[[u32; 3]], settings: &[(&str, &str)]) -> A {
    let prims = Triangles { positions, indices, topology_epoch: 0 };
    let ssh = A::build(&prims, &config(settings)).unwrap();
    ssh.validate(&prims).unwrap();
    ssh
}

#[test]
fn words_keep_what_is_put_into_them() {
    for (order, pair) in [(0, 0), (1, 77), (2, MAX_TRIANGLES - 1)] {
        for side in Side::ALL {
            let mut word = Word::inner(pair, order);
            word.set_side(side);
            assert_eq!((word.index(), word.order(), word.side()), (pair, usize::from(order), side));
            assert!(!word.is_leaf() && !word.is_none());
            let mut leaf = Word::leaf(pair);
            leaf.set_side(side);
            assert_eq!((leaf.index(), leaf.side()), (pair, side));
            assert!(leaf.is_leaf() && !leaf.is_none());
        }
    }
    assert!(Word::NONE.is_leaf() && Word::NONE.is_none());
}

/// The part of a ray along one axis inside a half-space, by definition.
fn exact(origin: f64, dir: f64, side: Side, plane: f64, [near, far]: [f64; 2]) -> Option<[f64; 2]> {
    let inside = |x: f64| if side.is_upper() { x <= plane } else { x >= plane };
    if dir == 0.0 {
        return inside(origin).then_some([near, far]);
    }
    let t = (plane - origin) / dir;
    // One unit further along the ray tells which part is inside.
    let kept = if inside(origin + dir * (t + 1.0)) { [near.max(t), far] } else { [near, far.min(t)] };
    (kept[0] <= kept[1]).then_some(kept)
}

/// What each kernel makes of a plane: singly in f32 and f64, and in packets.
struct Cut<'a> {
    ray: &'a TravRay,
    side: Side,
    plane: f32,
}

impl Task for Cut<'_> {
    type Output = [Option<[f64; 2]>; 3];

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let [fast, wide] = traverse::cut_once(self.ray, self.plane, self.side);
        [fast, wide, packet::cut_once::<S>(self.ray, self.plane, self.side)]
    }
}

#[test]
fn planes_cut_rays_where_the_occupied_side_ends() {
    // Upper and lower planes, rays along and against the axis, planes behind, within and beyond the ray: the cases that the paper's figure 4
    // has the wrong way round. Zeros of both signs, and origins on the plane.
    for side in Side::ALL {
        for dir in [-2.0_f32, -1.0, -0.0, 0.0, 1.0, 2.0] {
            for (origin, plane) in (-3_i8..=3).flat_map(|o| (-3_i8..=3).map(move |p| (f32::from(o), f32::from(p)))) {
                let mut ray = Ray { origin: Vec3::splat(origin), dir: Vec3::splat(0.5), t_near: 0.5, t_far: 1.75 };
                ray.dir[side.axis()] = dir;
                let ray = TravRay::new(&ray).unwrap();
                let due = exact(origin.into(), dir.into(), side, plane.into(), [0.5, 1.75]);
                for level in SimdLevel::available() {
                    for found in dispatch(level, Cut { ray: &ray, side, plane }) {
                        let close = match (found, due) {
                            (Some(a), Some(b)) => {
                                a[0] <= b[0] && a[1] >= b[1] && b[0] - a[0] < 1e-5 && a[1] - b[1] < 1e-5
                            }
                            (a, b) => a.is_none() && b.is_none(),
                        };
                        assert!(close, "{side:?} at {plane}, {origin} + t * {dir}: {found:?}, due {due:?}");
                    }
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_point_of_a_half_space_is_cut_off(
        origin in -1e3_f32..1e3, dir in -10.0_f32..10.0, t in 0.0_f32..100.0, row in 0_usize..6,
    ) {
        let side = Side::ALL[row];
        let mut ray = Ray::new(Vec3::ZERO, Vec3::new(0.1, 0.2, 0.3));
        (ray.origin[side.axis()], ray.dir[side.axis()]) = (origin, dir);
        let ray = TravRay::new(&ray).unwrap();
        // A plane through a point of the ray: that point is in the closed half-space, to the rounding of the plane.
        let plane = (f64::from(origin) + f64::from(dir) * f64::from(t)) as f32;
        let t = (f64::from(plane) - f64::from(origin)) / f64::from(dir);
        prop_assume!(dir.abs() > 1e-6 && t >= 0.0);
        for level in SimdLevel::available() {
            for found in dispatch(level, Cut { ray: &ray, side, plane }) {
                let [near, far] = found.unwrap();
                prop_assert!(near <= t && far >= t, "{} {} {}", near, t, far);
            }
        }
    }
}

#[test]
fn of_equal_sides_the_first_is_kept() {
    let cube = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    let same = choose(&cube, &cube);
    assert_eq!((same.side, same.plane, same.useless), (Side::ALL[0], 1.0, true));
    let inner = Aabb { min: Vec3::splat(0.25), max: Vec3::splat(0.75) };
    assert_eq!(choose(&inner, &cube).side, Side::ALL[0]);
    let low = Aabb { min: Vec3::ZERO, max: Vec3::new(1.0, 0.9, 0.2) };
    let choice = choose(&low, &cube);
    assert_eq!((choice.side.axis(), choice.side.is_upper(), choice.plane, choice.useless), (2, true, 0.2, false));
    assert_eq!(choice.inherited, Aabb { min: Vec3::ZERO, max: Vec3::new(1.0, 1.0, 0.2) });
}

#[test]
fn boxes_without_area_are_cut_by_length() {
    let line = Aabb { min: Vec3::ZERO, max: Vec3::new(0.0, 0.0, 4.0) };
    let half = Aabb { min: Vec3::ZERO, max: Vec3::new(0.0, 0.0, 2.0) };
    let choice = choose(&half, &line);
    assert_eq!((choice.side.axis(), choice.plane, choice.useless), (2, 2.0, false));
}

#[test]
fn an_empty_box_leaves_nothing() {
    let cube = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    let choice = choose(&Aabb::EMPTY, &cube);
    assert_eq!(choice.plane, f32::NEG_INFINITY);
    assert!(choice.inherited.is_empty());
}

#[test]
fn nodes_take_a_quarter_of_those_of_bvh2() {
    let (positions, indices) = mesh(5000, 3);
    let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
    for cut in ["median", "sah"] {
        for leaf in ["1", "4", "8"] {
            let settings = [("build".to_owned(), cut.to_owned()), ("leaf".to_owned(), leaf.to_owned())];
            let ssh = AccelKind::Ssh.build(&settings, &prims).unwrap().stats();
            let bvh2 = AccelKind::Bvh2.build(&settings, &prims).unwrap().stats();
            assert_eq!(4 * ssh.node_bytes, bvh2.node_bytes, "{cut} {leaf}");
            assert_eq!((ssh.nodes, ssh.leaves, ssh.depth), (bvh2.nodes, bvh2.leaves, bvh2.depth), "{cut} {leaf}");
            if leaf == "1" {
                // Two nodes a triangle less the root, which has none, and its pad.
                assert_eq!(ssh.node_bytes, (2 * indices.len() - 2) * 8);
            }
        }
    }
}

#[test]
fn more_triangles_than_an_index_reaches_are_an_error() {
    // Zeroed memory that is never touched: the number is checked first.
    let indices = vec![[0; 3]; MAX_TRIANGLES + 1];
    let prims = Triangles { positions: &[Vec3::ZERO], indices: &indices, topology_epoch: 0 };
    match Ssh::build(&prims, &SshConfig::default()) {
        Err(BuildError::TooMany { structure: "ssh", limit, actual }) => {
            assert_eq!((limit, actual), ((1 << 27) - 1, 1 << 27));
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn leaves_without_planes_cull_nothing() {
    let (positions, indices) = mesh(300, 4);
    let with = build(&positions, &indices, &[("leaf", "1")]);
    let without = build(&positions, &indices, &[("leaf", "1"), ("leaf_planes", "off")]);
    let infinite = |ssh: &Narrow| ssh.pairs.iter().flat_map(|p| p.0).filter(|n| n.plane == f32::INFINITY).count();
    assert_eq!((infinite(&with), infinite(&without)), (0, 300));
    assert!(without.stats().sah_cost > with.stats().sah_cost);
}

#[test]
fn more_planes_leave_less_of_the_boxes() {
    let (positions, indices) = mesh(5000, 6);
    let [three, four] = ["3", "4"].map(|planes| -> Ssh { build(&positions, &indices, &[("planes", planes)]) });
    assert!(four.stats().sah_cost < three.stats().sah_cost, "{:?} {:?}", three.stats(), four.stats());
    assert_eq!(2 * four.stats().node_bytes, 3 * three.stats().node_bytes);
    let blocks = three.stats().leaves;
    // Seven children a node on average would be full; SAH trees fill more than four.
    assert!(three.stats().nodes - blocks < blocks / 4, "{:?}", three.stats());
}

#[test]
fn useless_planes_are_counted() {
    // Equal triangles: below the first level no plane takes anything off.
    let positions: Vec<_> = (0..16).flat_map(|_| [Vec3::ZERO, Vec3::X, Vec3::ONE]).collect();
    let indices: Vec<_> = (0..16).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let ssh: Ssh = build(&positions, &indices, &[("leaf", "1")]);
    assert_eq!(ssh.useless_planes(), 30);
    let (positions, indices) = mesh(1000, 5);
    let ssh: Ssh = build(&positions, &indices, &[("leaf", "1")]);
    assert!(ssh.useless_planes() < 200, "{}", ssh.useless_planes());
}

#[test]
fn regions_nest_and_hold_their_triangles_for_any_settings() {
    let runner = &mut proptest::test_runner::TestRunner::new(ProptestConfig {
        cases: 60,
        failure_persistence: None,
        ..ProptestConfig::default()
    });
    let cases = (0_usize..200, any::<u32>(), 1_usize..9, any::<bool>(), any::<bool>(), any::<bool>(), 0_usize..3);
    runner
        .run(&cases, |(count, seed, leaf, median, leaf_planes, rechoose, form)| {
            let (positions, indices) = mesh(count, seed);
            let settings = [
                ("leaf", leaf.to_string()),
                ("build", if median { "median" } else { "sah" }.to_owned()),
                ("leaf_planes", if leaf_planes { "on" } else { "off" }.to_owned()),
                ("refit", if rechoose { "rechoose" } else { "keep" }.to_owned()),
                ("planes", ["1", "3", "4"][form].to_owned()),
            ];
            let settings = settings.each_ref().map(|(key, value)| (*key, value.as_str()));
            let ssh: Ssh = build(&positions, &indices, &settings);
            let (moved, _) = mesh(count, seed ^ 1);
            let prims = Triangles { positions: &moved, indices: &indices, topology_epoch: 0 };
            let mut out = ssh.clone();
            ssh.refit_into(&mut out, &prims);
            prop_assert_eq!(out.validate(&prims), Ok(()));
            Ok(())
        })
        .unwrap();
}
