use glam::Vec3;
use proptest::prelude::*;

use super::{
    kernel::met,
    node::{Node, Word},
    packet::met_together,
};
use crate::{
    accel::{TravRay, slabs, ssh::choose::size, wide::WIDTH},
    geom::{Aabb, Ray},
    simd::{Simd, SimdLevel, Task, dispatch},
};

struct Met<'a, const K: usize> {
    ray: &'a TravRay,
    node: &'a Node<K>,
    reach: f32,
}

impl<const K: usize> Task for Met<'_, K> {
    type Output = [u32; 4];

    #[inline(always)]
    fn run<S: Simd>(self) -> [u32; 4] {
        let [fast, wide] = met::<S, K>(self.ray, self.node, self.reach);
        let [all, each] = met_together::<S, K>(self.ray, self.node);
        [fast, wide, all, each]
    }
}

/// A node whose slots hold the box in turn with nothing; the planes of slot 2 i are those that serve best within the i-th inherited box.
fn node<const K: usize>(aabb: &Aabb, inherited: &[Aabb; 4]) -> Node<K> {
    let mut node = Node::new();
    for (i, inherited) in inherited.iter().enumerate() {
        node.set_word(2 * i, Word::leaf(i));
        node.take(2 * i, aabb, &Node::<K>::choose(aabb, inherited));
    }
    node
}

const HALF: u32 = 0b0101_0101;
const _: () = assert!(WIDTH == 8);

fn grown(aabb: Aabb, low: Vec3, high: Vec3) -> Aabb {
    Aabb { min: aabb.min - low, max: aabb.max + high }
}

#[test]
fn rays_are_cut_by_the_planes_that_are_kept() {
    let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    // Space above on all axes: upper planes are kept, and rays that pass below are not culled.
    let inherited = [grown(unit, Vec3::ZERO, Vec3::ONE); 4];
    let below = TravRay::new(&Ray::new(Vec3::new(-5.0, 0.5, -0.5), Vec3::X)).unwrap();
    let above = TravRay::new(&Ray::new(Vec3::new(-5.0, 0.5, 1.5), Vec3::X)).unwrap();
    for level in SimdLevel::available() {
        let (three, four) = (node::<3>(&unit, &inherited), node::<4>(&unit, &inherited));
        assert_eq!(dispatch(level, Met { ray: &below, node: &three, reach: 8.0 }), [HALF; 4], "{level}");
        assert_eq!(dispatch(level, Met { ray: &above, node: &three, reach: 8.0 }), [0; 4], "{level}");
        assert_eq!(dispatch(level, Met { ray: &above, node: &four, reach: 8.0 }), [0; 4], "{level}");
    }
    // Space on both sides of z: four planes keep both.
    let inherited = [grown(unit, Vec3::Z, Vec3::Z); 4];
    for level in SimdLevel::available() {
        let four = node::<4>(&unit, &inherited);
        assert_eq!(dispatch(level, Met { ray: &below, node: &four, reach: 8.0 }), [0; 4], "{level}");
        assert_eq!(dispatch(level, Met { ray: &above, node: &four, reach: 8.0 }), [0; 4], "{level}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    /// The point is exact, and the ray enters along x where it leaves along y: no slack but the test's own.
    #[test]
    fn a_box_that_a_ray_touches_in_one_point_is_met(
        origin in prop::array::uniform3(-100_i8..100),
        dir in prop::array::uniform3(prop_oneof![-100_i8..0, 1_i8..101]),
        t in 1_u8..64,
        sizes in prop::array::uniform3(1_u8..100),
        more in prop::array::uniform4(prop::array::uniform6(0_u8..100)),
    ) {
        let (origin, dir) = (Vec3::from(origin.map(f32::from)), Vec3::from(dir.map(f32::from)));
        let touched = origin + dir * f32::from(t);
        let size = Vec3::from(sizes.map(f32::from)) * dir.signum() * Vec3::new(1.0, -1.0, 1.0);
        let aabb = Aabb::from_points([touched, touched + size]);
        let inherited = more.map(|more| {
            let [a, b, c, d, e, f] = more.map(f32::from);
            grown(aabb, Vec3::new(a, b, c), Vec3::new(d, e, f))
        });
        let ray = TravRay::new(&Ray { t_far: f32::from(t), ..Ray::new(origin, dir) }).unwrap();
        let reach = aabb.reach();
        prop_assume!(slabs::fits(&ray, reach));
        for level in SimdLevel::available() {
            let three = dispatch(level, Met { ray: &ray, node: &node::<3>(&aabb, &inherited), reach });
            prop_assert_eq!(three, [HALF; 4], "{}", level);
            let four = dispatch(level, Met { ray: &ray, node: &node::<4>(&aabb, &inherited), reach });
            prop_assert_eq!(four, [HALF; 4], "{}", level);
        }
    }

    #[test]
    fn four_planes_leave_no_more_than_three(
        low in prop::array::uniform3(0.0_f32..4.0),
        high in prop::array::uniform3(0.0_f32..4.0),
        sizes in prop::array::uniform3(0.1_f32..4.0),
    ) {
        let tight = Aabb { min: Vec3::ZERO, max: Vec3::from(sizes) };
        let inherited = grown(tight, Vec3::from(low), Vec3::from(high));
        let (three, four) = (Node::<3>::choose(&tight, &inherited), Node::<4>::choose(&tight, &inherited));
        prop_assert!(size(&four.inherited) <= size(&three.inherited));
        prop_assert!(four.inherited.contains(tight) && inherited.contains(four.inherited));
        prop_assert!(three.inherited.contains(tight) && inherited.contains(three.inherited));
    }
}
