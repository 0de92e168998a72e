#![expect(clippy::cast_possible_truncation, reason = "tests are small")]

use glam::{DAffine3, DQuat, DVec3, Vec3};
use proptest::prelude::*;

use super::*;
use crate::{
    accel::{AnyHit, Closest, PACKET},
    geom::{PrimId, Ray},
    simd::{Lanes, Simd, SimdLevel, Task, dispatch},
};

/// The bits of a hit and whether there is any.
type Answer = (Option<[u32; 4]>, bool);

/// What every triangle says, one after the other.
fn listed(prims: &Triangles<'_>, ray: &TravRay) -> Answer {
    let mut best = Closest::new(ray);
    (0..prims.len() as u32).for_each(|p| best.offer(ray, prims, PrimId(p), &AnyHit));
    let bits = best.hit(ray).map(|h| [h.prim.0, h.t.to_bits(), h.u.to_bits(), h.v.to_bits()]);
    (bits, bits.is_some())
}

fn bits_of(best: &Closest, ray: &TravRay) -> Option<[u32; 4]> {
    best.hit(ray).map(|h| [h.prim.0, h.t.to_bits(), h.u.to_bits(), h.v.to_bits()])
}

/// What the tree answers to rays, each by itself and as packets.
struct Walked<'a> {
    tree: &'a RigidTree,
    place: &'a RigidPlace,
    prims: &'a Triangles<'a>,
    rays: &'a [TravRay],
}

impl Task for Walked<'_> {
    type Output = [Vec<Answer>; 2];

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self { tree, place, prims, rays } = self;
        let (mut single, mut packed) = (Vec::new(), Vec::new());
        for rays in rays.chunks(S::F::LEN) {
            let mut bests = [Closest::new(&rays[0]); PACKET];
            for (ray, best) in rays.iter().zip(&mut bests) {
                *best = Closest::new(ray);
                tree.closest::<S, _>(place, prims, ray, best, &AnyHit);
                single.push((bits_of(best, ray), tree.occluded::<S, _>(place, prims, ray, &AnyHit)));
                *best = Closest::new(ray);
            }
            let active = (1 << rays.len()) - 1;
            let reach = prims.positions.iter().fold(0.0, |reach: f32, p| reach.max(p.abs().max_element()));
            let mut packet = RigidPacket::new::<S>(rays, reach);
            let blocked = tree.occluded_packet::<S, _>(place, prims, (rays, &packet), active, &[AnyHit; PACKET]);
            tree.closest_packet::<S, _>(place, prims, (rays, &mut packet), active, &mut bests, &[AnyHit; PACKET]);
            packed.extend((0..rays.len()).map(|i| (bits_of(&bests[i], &rays[i]), blocked >> i & 1 == 1)));
        }
        [single, packed]
    }
}

fn walked(tree: &RigidTree, place: &RigidPlace, prims: &Triangles<'_>, rays: &[TravRay]) -> Vec<Vec<Answer>> {
    SimdLevel::available().flat_map(|level| dispatch(level, Walked { tree, place, prims, rays })).collect()
}

/// As `anim` places vertices.
fn placed(matrix: &DAffine3, p: Vec3) -> Vec3 {
    let (m, p) = (matrix.matrix3, p.as_dvec3());
    (m.x_axis * p.x + m.y_axis * p.y + m.z_axis * p.z + matrix.translation).as_vec3()
}

#[test]
fn nothing_is_walked_where_nothing_is() {
    let none = Triangles { positions: &[], indices: &[], topology_epoch: 0 };
    let tree = RigidTree::build(&none).unwrap();
    let place = RigidPlace::new(&tree, &DAffine3::IDENTITY, Aabb::EMPTY, false);
    let ray = TravRay::new(&Ray::new(Vec3::ZERO, Vec3::X)).unwrap();
    assert!(walked(&tree, &place, &none, &[ray; 5]).iter().all(|answers| answers[..] == [(None, false); 5]));
}

proptest! {
    /// Rays at vertices and edges, far from the origin and at any scale: where a margin too small would lose hits.
    #[test]
    fn a_tree_in_the_parts_space_answers_as_the_triangles_in_the_world_do(
        corners in prop::collection::vec(prop::array::uniform3(-8_i8..9), 3..60),
        turn in prop::array::uniform4(-4_i8..5),
        scale in prop::array::uniform3(prop_oneof![1_i8..4, -3_i8..0]),
        power in -12_i32..13,
        shift in prop::array::uniform3(prop_oneof![Just(0.0_f64), -3.0_f64..3.0, -1e6_f64..1e6]),
        rays in prop::collection::vec((0_usize..60, 0_usize..60, prop::array::uniform3(-3_i8..4), any::<bool>()), 1..24),
    ) {
        let part: Vec<Vec3> = corners.iter().map(|c| Vec3::from(c.map(f32::from)) * 0.37).collect();
        let indices: Vec<[u32; 3]> =
            (0..part.len() as u32).map(|i| [0, 1, 2].map(|k| (i * (k + 1) + 5 * k) % part.len() as u32)).collect();
        let q = DQuat::from_array(turn.map(f64::from));
        let q = if q.length() > 0.0 { q.normalize() } else { DQuat::IDENTITY };
        let scale = DVec3::from(scale.map(f64::from)) * 2.0_f64.powi(power);
        let matrix = DAffine3::from_scale_rotation_translation(scale, q, DVec3::from(shift));
        let world: Vec<Vec3> = part.iter().map(|&p| placed(&matrix, p)).collect();
        let local = Triangles { positions: &part, indices: &indices, topology_epoch: 0 };
        let prims = Triangles { positions: &world, indices: &indices, topology_epoch: 0 };
        let tree = RigidTree::build(&local).unwrap();
        let bounds = Aabb::from_points(world.iter().copied());
        let place = RigidPlace::new(&tree, &matrix, bounds, false);
        let size = bounds.extent().max_element().max(1e-30);
        let mut cast = Vec::new();
        for (a, b, off, through) in rays {
            // At a vertex or the middle of two, along an axis or not, from near or far.
            let (a, b) = (world[a % world.len()], world[b % world.len()]);
            let target = if through { a } else { (a + b) * 0.5 };
            let off = Vec3::from(off.map(f32::from));
            let origin = target + off * size;
            let dir = if off == Vec3::ZERO { b - a } else { target - origin };
            cast.extend(TravRay::new(&Ray::new(origin, dir)));
        }
        let expected: Vec<_> = cast.iter().map(|ray| listed(&prims, ray)).collect();
        for answers in walked(&tree, &place, &prims, &cast) {
            prop_assert_eq!(&answers, &expected);
        }
    }
}
