#![expect(clippy::cast_possible_truncation, reason = "tests are small")]

use glam::Vec3;
use proptest::prelude::*;

use super::*;
use crate::simd::{Simd, SimdLevel, Task, dispatch};

struct Met<'a> {
    nodes: &'a [Eight],
    from: [f32; 3],
    dir: [f32; 3],
    margin: [f32; 3],
    reach: f32,
    limit: f32,
}

struct Seen<S: Simd> {
    words: Vec<u32>,
    limit: f32,
    level: std::marker::PhantomData<S>,
}

impl<S: Simd> OneVisit for Seen<S> {
    fn limit(&self) -> f32 {
        self.limit
    }

    fn leaf<T: Simd>(&mut self, word: u32) -> bool {
        self.words.push(word & !LEAF);
        false
    }
}

impl<S: Simd> ManyVisit<S> for Seen<S> {
    fn open(&self) -> u32 {
        u32::MAX
    }

    fn limit(&self) -> S::F {
        S::F::splat(self.limit)
    }

    fn leaf(&mut self, word: u32, mask: u32) {
        assert_eq!(mask, S::F::ALL, "all rays are one");
        self.words.push(word & !LEAF);
    }

    fn few(&mut self, _word: u32, _mask: u32) -> bool {
        false
    }
}

impl Task for Met<'_> {
    /// The leaves that a ray meets, and a packet of equal rays; `None` where nothing is proven.
    type Output = [Option<Vec<u32>>; 2];

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self { nodes, from, dir, margin, reach, limit } = self;
        let seen = || Seen::<S> { words: Vec::new(), limit, level: std::marker::PhantomData };
        let one = EightRay::new::<S>(from, dir, margin, reach, 0.0).map(|ray| {
            let mut seen = seen();
            walk_one::<S, _>(nodes, &ray, 0, &mut seen);
            seen.words
        });
        let splat = |v: [f32; 3]| v.map(S::F::splat);
        let rays = EightPacket::<S>::new(splat(from), splat(dir), margin, reach, S::F::splat(0.0));
        assert!(rays.fits() == 0 || rays.fits() == S::F::ALL);
        let many = (rays.fits() != 0).then(|| {
            let mut seen = seen();
            walk_many(nodes, &rays, S::F::ALL, &mut seen);
            seen.words
        });
        [one, many]
    }
}

/// Two levels over at most 64 boxes.
fn tree(boxes: &[Aabb]) -> Vec<Eight> {
    let mut nodes = vec![Eight::EMPTY];
    for (slot, own) in boxes.chunks(EIGHT).enumerate() {
        let mut node = Eight::EMPTY;
        for (i, aabb) in own.iter().enumerate() {
            node.put(i, aabb, LEAF | (slot * EIGHT + i) as u32);
        }
        let all = own.iter().fold(Aabb::EMPTY, |all, aabb| all.union(*aabb));
        let number = nodes.len() as u32;
        nodes[0].put(slot, &all, number);
        nodes.push(node);
    }
    nodes
}

fn reach(boxes: &[Aabb]) -> f32 {
    boxes.iter().fold(0.0, |reach, aabb| reach.max(aabb.reach()))
}

#[test]
fn leaves_come_nearest_first_and_empty_boxes_never() {
    let at = |x: f32| Aabb { min: Vec3::X * x, max: Vec3::X * x + 0.5 };
    let boxes = [at(5.0), Aabb::EMPTY, at(1.0), at(9.0), at(-3.0), at(3.0), at(7.0), at(4.0), at(2.0)];
    let nodes = tree(&boxes);
    for level in SimdLevel::available() {
        let (from, dir) = ([0.0, 0.2, 0.2], [1.0, 0.0, -0.0]);
        let met = dispatch(level, Met { nodes: &nodes, from, dir, margin: [0.0; 3], reach: 9.5, limit: 8.0 });
        for words in met {
            let mut words = words.unwrap();
            assert_eq!(words.iter().filter(|&&word| word != 8).collect::<Vec<_>>(), [&2, &5, &7, &0, &6], "{level}");
            words.sort_unstable();
            assert_eq!(words, [0, 2, 5, 6, 7, 8], "{level}");
        }
    }
}

#[test]
fn rays_that_nothing_is_proven_for_are_told_apart() {
    let nodes = tree(&[Aabb { min: Vec3::ZERO, max: Vec3::ONE }]);
    let odd = [
        ([0.0; 3], [1e30, 0.0, 0.0], [0.0; 3]),
        ([0.0; 3], [1e-30, 0.0, 0.0], [0.0; 3]),
        ([0.0; 3], [0.0; 3], [0.0; 3]),
        ([0.0; 3], [f32::NAN, 1.0, 1.0], [0.0; 3]),
        ([0.0, 1e30, 0.0], [1.0; 3], [0.0; 3]),
        ([0.0; 3], [1.0; 3], [f32::INFINITY, 0.0, 0.0]),
        ([0.0; 3], [1.0; 3], [0.0, f32::NAN, 0.0]),
    ];
    for level in SimdLevel::available() {
        for (from, dir, margin) in odd {
            let met = dispatch(level, Met { nodes: &nodes, from, dir, margin, reach: 1.0, limit: 8.0 });
            let is_nan = dir[0].is_nan();
            assert!(is_nan || met == [None, None], "{level} {from:?} {dir:?} {margin:?}: {met:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    /// Numbers are such that the point is exact, and the line is moved away from it by the whole margin.
    #[test]
    fn a_box_around_a_point_near_the_line_is_met(
        origin in prop::array::uniform3(-100_i8..100),
        dir in prop::array::uniform3(-100_i8..101),
        tiny in prop::array::uniform3(0_u8..3),
        t in 0_u8..64,
        sizes in prop::array::uniform3(0_u8..100),
        corner in prop::array::uniform3(any::<bool>()),
        power in -30_i32..31,
        margin in prop::array::uniform3(-3_i8..4),
    ) {
        let scale = 2.0_f32.powi(power);
        let dir = Vec3::from(std::array::from_fn(|i| if tiny[i] == 0 { 0.0 } else { f32::from(dir[i]) }));
        prop_assume!(dir != Vec3::ZERO);
        let origin = Vec3::from(origin.map(f32::from));
        let touched = (origin + dir * f32::from(t)) * scale;
        let size = Vec3::from(sizes.map(f32::from)) * Vec3::from(corner.map(|c| if c { 1.0 } else { -1.0 })) * scale;
        let aabb = Aabb::from_points([touched, touched + size]);
        let margin = Vec3::from(margin.map(f32::from)) * scale;
        let from = origin * scale + margin;
        let nodes = tree(&[aabb]);
        for level in SimdLevel::available() {
            let met = dispatch(level, Met {
                nodes: &nodes,
                from: from.into(),
                dir: (dir * scale).into(),
                margin: margin.abs().into(),
                reach: reach(&[aabb]),
                limit: f32::from(t),
            });
            for words in met {
                prop_assert!(words.is_none_or(|words| words == [0]), "{}", level);
            }
        }
    }
}
