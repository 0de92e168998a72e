//! A tree over the triangles of a part in its own space, shared by every place that the part is at.
//!
//! A part that moves as a whole keeps its tree; a ray is brought into the part's space and meets its boxes there. Boxes only prove misses: a triangle that is
//! not ruled out is tested where it is in the world, with the very vertices that every other structure tests. So the answers are those of a tree over
//! the world's vertices, bit for bit, and a motion costs the instance's box and one matrix.
//!
//! # Why no hit is lost
//! Let `A`, `T` be the linear part and translation of `world_from_part` as the `f64` numbers they are, `p` a vertex of the part and `w` the one in the world.
//! `w = A p + T + e`, where `e` holds the roundings of four products and sums in `f64` and one rounding to `f32`:
//! `|e| <= 2^-50 (|A| |p| + |T|) + 2^-24 |w| + 2^-149`, component by component ([`RigidPlace::new`] takes bounds of `|p|` and `|w|` over the part).
//!
//! Let `N` be the matrix that was computed as the inverse of `A`, whatever its error, and `L(x) = N (x - T)`, without rounding. A hit lies at `x = o + t d`
//! in a triangle, `x = sum c_k w_k` with `c_k >= 0` of sum 1, so `L(x) = sum c_k p_k + (N A - I) sum c_k p_k + N sum c_k e_k`. The first term lies in every box
//! around the triangle in the part's space. The others are at most `|N A - I| max |p| + |N| max |e|`: the margin of the place, with the rounding of
//! `N A` added.
//!
//! `L(x) = a + t b` with `a = N (o - T)` and `b = N d`. Computed in `f64` they err by at most `2^-50 |N| (|o| + |T|)` and `2^-51 |N| |d|`, and
//! `t |d| = |x - o| <= |w| + |o|`. So the line from the computed `a` along the computed `b` passes, at the very `t` of the hit, within the margin plus
//! `2^-49 |N| (|o| + |T| + |w|)` of the box. The slabs are moved outward by that. What is left are the roundings of one difference, one reciprocal and one
//! product for each plane, `3.01 * 2^-53` of the result, which [`WIDER`] covers. A component of `b` that is 0 gives infinities of the right sign, or a NaN where the
//! origin lies on a plane: comparisons are written so that a NaN rules nothing out. Overflow is out of reach: `f32` coordinates, and `|N|` that `f64` holds, or
//! margins that are infinite and rule nothing out.

#![cfg_attr(test, expect(clippy::cast_possible_truncation, reason = "tests are small"))]

use arrayvec::ArrayVec;
use glam::{DAffine3, DMat3, DVec3};

use super::{
    BuildError, Closest, HitSink, TravRay, check_indices,
    query::is_blocked_by,
    sah::BLOCK,
    topology::{
        self, Child, Cut, MAX_DEPTH,
        wide::{WIDTH, collapse},
    },
};
use crate::{
    geom::{Aabb, PrimId, Triangles},
    simd::{Simd, Task},
};

/// Factor that makes a `t` at least what it would be without rounding: above `1 + 4 * 2^-53`.
const WIDER: f64 = 1.0 + 1.0 / (1_u64 << 48) as f64;

/// Most triangles: a leaf has 28 bits for the first.
const MAX_PRIMS: usize = 1 << 28;

const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 28;
const FIRST: u32 = (1 << COUNT_SHIFT) - 1;
const NONE: u32 = u32::MAX;

/// Places on the stack of a walk: all but one of a node's children wait on each level.
const STACK: usize = (WIDTH - 1) * (MAX_DEPTH + 1) + 1;

/// Eight children's boxes and where they are: a node, or a run of triangles with its count less one in bits 28 to 30.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// `[axis][min, max][child]`.
    planes: [[[f32; WIDTH]; 2]; 3],
    links: [u32; WIDTH],
}

/// The tree.
#[derive(Debug)]
pub(crate) struct RigidTree {
    nodes: Vec<Node>,
    /// Triangle numbers in the order of the leaves.
    prims: Vec<u32>,
    /// Greatest absolute coordinates of the triangles.
    reach: DVec3,
}

/// Where a part is in one frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RigidPlace {
    part_from_world: DMat3,
    /// The same with absolute values.
    stretch: DMat3,
    origin: DVec3,
    /// By how much boxes are widened for rays from the world's origin.
    margin: DVec3,
}

impl RigidTree {
    /// Builds over triangles whose positions are those of the part, in the current rayon pool.
    ///
    /// # Errors
    /// When an index is out of range or there are more than 2^28 triangles.
    pub(crate) fn build(prims: &Triangles<'_>) -> Result<Self, BuildError> {
        check_indices("rigid", prims, MAX_PRIMS - 1)?;
        let settings = topology::Settings { cut: Cut::Sah, bins: 16, leaf: BLOCK };
        let binary = topology::build(prims, &settings);
        let wide = collapse(&binary, prims);
        let empty = Node { planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3], links: [NONE; WIDTH] };
        let mut nodes = vec![empty; wide.len()];
        let mut boxes = vec![Aabb::EMPTY; wide.len()];
        for (number, children) in wide.iter().enumerate().rev() {
            for (slot, child) in children.iter().enumerate() {
                let (link, aabb) = match *child {
                    Child::None => continue,
                    Child::Inner(below) => (below, boxes[below as usize]),
                    Child::Leaf { first, count } => {
                        let own = &binary.prims[first as usize..][..count as usize];
                        let aabb = own.iter().fold(Aabb::EMPTY, |all, &p| all.union(prims.finite_aabb(PrimId(p))));
                        (LEAF | (count - 1) << COUNT_SHIFT | first, aabb)
                    }
                };
                if aabb.is_empty() {
                    continue;
                }
                nodes[number].links[slot] = link;
                for axis in 0..3 {
                    nodes[number].planes[axis][0][slot] = aabb.min[axis];
                    nodes[number].planes[axis][1][slot] = aabb.max[axis];
                }
                boxes[number] = boxes[number].union(aabb);
            }
        }
        let all = boxes.first().copied().filter(|all| !all.is_empty());
        let reach = all.map_or(DVec3::ZERO, |all| all.min.as_dvec3().abs().max(all.max.as_dvec3().abs()));
        Ok(Self { nodes, prims: binary.prims, reach })
    }
}

impl RigidPlace {
    /// For a part placed by `world_from_part`, whose vertices in the world lie in `bounds`. `fast` when they were computed in `f32`.
    pub(crate) fn new(tree: &RigidTree, world_from_part: &DAffine3, bounds: Aabb, fast: bool) -> Self {
        let (linear, origin) = (world_from_part.matrix3, world_from_part.translation);
        let inverse = linear.inverse();
        let (size, stretch) = (absolute(&linear), absolute(&inverse));
        let world = bounds.min.as_dvec3().abs().max(bounds.max.as_dvec3().abs());
        // The error of vertices, then of the inverse.
        let terms = size * tree.reach + origin.abs();
        let rounding = if fast { 2.0_f64.powi(-20) } else { 2.0_f64.powi(-50) };
        let vertices = terms * rounding + world * (2.0_f64.powi(-24) * 1.000_001) + DVec3::splat(1e-44);
        let residual = absolute(&(inverse * linear - DMat3::IDENTITY)) + (stretch * size) * 2.0_f64.powi(-50);
        let of_rays = stretch * (origin.abs() + world) * 2.0_f64.powi(-49);
        let margin = (residual * tree.reach + stretch * vertices + of_rays) * 1.000_001;
        Self { part_from_world: inverse, stretch, origin, margin }
    }

    /// A ray in the part's space, with its slabs' margin.
    #[inline(always)]
    fn localize(&self, ray: &TravRay) -> LocalRay {
        let range = ray.range();
        let (origin, dir) = (range.origin.as_dvec3(), range.dir.as_dvec3());
        let from = self.part_from_world * (origin - self.origin);
        let dir = self.part_from_world * dir + DVec3::ZERO;
        let margin = self.margin + self.stretch * origin.abs() * (2.0_f64.powi(-49) * 1.000_001);
        let inv = DVec3::ONE / dir;
        LocalRay { above: (from + margin).to_array(), below: (from - margin).to_array(), inv: inv.to_array() }
    }
}

fn absolute(m: &DMat3) -> DMat3 {
    DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs())
}

/// The line of a ray from either side of its margin.
struct LocalRay {
    /// What lower planes are reached from.
    above: [f64; 3],
    /// What upper planes are reached from.
    below: [f64; 3],
    inv: [f64; 3],
}

/// What is done with the triangles that a walk comes upon.
trait Visit {
    /// Nothing beyond this `t` counts any more.
    fn limit(&self) -> f64;
    /// Looks at a triangle; true to end the walk.
    fn look(&mut self, prim: PrimId) -> bool;
}

struct Nearest<'a, K> {
    prims: &'a Triangles<'a>,
    ray: &'a TravRay,
    best: &'a mut Closest,
    sink: &'a K,
}

impl<K: HitSink> Visit for Nearest<'_, K> {
    #[inline(always)]
    fn limit(&self) -> f64 {
        self.best.t_high()
    }

    #[inline(always)]
    fn look(&mut self, prim: PrimId) -> bool {
        self.best.offer(self.ray, self.prims, prim, self.sink);
        false
    }
}

struct Any<'a, K> {
    prims: &'a Triangles<'a>,
    ray: &'a TravRay,
    sink: &'a K,
    is_blocked: bool,
}

impl<K: HitSink> Visit for Any<'_, K> {
    #[inline(always)]
    fn limit(&self) -> f64 {
        f64::from(self.ray.range().t_far)
    }

    #[inline(always)]
    fn look(&mut self, prim: PrimId) -> bool {
        self.is_blocked = is_blocked_by(self.ray, self.prims, prim, self.sink);
        self.is_blocked
    }
}

impl RigidTree {
    /// Offers to `best` every triangle that may beat it; `prims` are those of the world.
    #[inline(always)]
    pub(crate) fn closest<S: Simd, K: HitSink>(
        &self,
        place: &RigidPlace,
        prims: &Triangles<'_>,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
    ) {
        let mut visit = Nearest { prims, ray, best, sink };
        S::call(Walk { tree: self, local: place.localize(ray), t_near: ray.range().t_near, visit: &mut visit });
    }

    /// True when any triangle that `sink` accepts is hit within the ray's range.
    #[inline(always)]
    pub(crate) fn occluded<S: Simd, K: HitSink>(
        &self,
        place: &RigidPlace,
        prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K,
    ) -> bool {
        let mut visit = Any { prims, ray, sink, is_blocked: false };
        S::call(Walk { tree: self, local: place.localize(ray), t_near: ray.range().t_near, visit: &mut visit });
        visit.is_blocked
    }
}

struct Walk<'a, V> {
    tree: &'a RigidTree,
    local: LocalRay,
    t_near: f32,
    visit: &'a mut V,
}

impl<V: Visit> Task for Walk<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, local, t_near, visit } = self;
        let t_near = f64::from(t_near);
        let mut stack: ArrayVec<(f64, u32), STACK> = ArrayVec::new();
        if !tree.nodes.is_empty() {
            stack.push((t_near, 0));
        }
        while let Some((entry, link)) = stack.pop() {
            if entry > visit.limit() * WIDER {
                continue;
            }
            if link & LEAF != 0 {
                let (first, count) = ((link & FIRST) as usize, ((link & !LEAF) >> COUNT_SHIFT) as usize + 1);
                for &prim in &tree.prims[first..first + count] {
                    if visit.look(PrimId(prim)) {
                        return;
                    }
                }
                continue;
            }
            let node = &tree.nodes[link as usize];
            let entries = node.entries(&local, t_near, visit.limit() * WIDER);
            let from = stack.len();
            for (slot, &entry) in entries.iter().enumerate() {
                if entry < f64::INFINITY && node.links[slot] != NONE {
                    // The nearest last.
                    let mut at = stack.len();
                    stack.push((entry, node.links[slot]));
                    while at > from && stack[at - 1].0 < entry {
                        stack.swap(at, at - 1);
                        at -= 1;
                    }
                }
            }
        }
    }
}

impl Node {
    /// Where the ray enters each child's box; infinity where it misses it.
    #[inline(always)]
    fn entries(&self, ray: &LocalRay, t_near: f64, limit: f64) -> [f64; WIDTH] {
        let mut entries = [t_near; WIDTH];
        let mut exits = [limit; WIDTH];
        for axis in 0..3 {
            let inv = ray.inv[axis];
            let (near, far) = if inv < 0.0 { (1, 0) } else { (0, 1) };
            let starts = [ray.above[axis], ray.below[axis]];
            let (near_planes, far_planes) = (&self.planes[axis][near], &self.planes[axis][far]);
            for slot in 0..WIDTH {
                let entry = (f64::from(near_planes[slot]) - starts[near]) * inv;
                let exit = (f64::from(far_planes[slot]) - starts[far]) * inv * WIDER;
                // A NaN changes neither.
                entries[slot] = if entry > entries[slot] { entry } else { entries[slot] };
                exits[slot] = if exit < exits[slot] { exit } else { exits[slot] };
            }
        }
        for slot in 0..WIDTH {
            entries[slot] = if entries[slot] > exits[slot] { f64::INFINITY } else { entries[slot] };
        }
        entries
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, Vec3};
    use proptest::prelude::*;

    use super::*;
    use crate::{accel::AnyHit, geom::Ray, simd::Scalar};

    /// What every triangle says, one after the other.
    fn listed(prims: &Triangles<'_>, ray: &TravRay) -> (Option<[u32; 4]>, bool) {
        let mut best = Closest::new(ray);
        (0..prims.len() as u32).for_each(|p| best.offer(ray, prims, PrimId(p), &AnyHit));
        let bits = best.hit(ray).map(|h| [h.prim.0, h.t.to_bits(), h.u.to_bits(), h.v.to_bits()]);
        (bits, bits.is_some())
    }

    fn walked(tree: &RigidTree, place: &RigidPlace, prims: &Triangles<'_>, ray: &TravRay) -> (Option<[u32; 4]>, bool) {
        let mut best = Closest::new(ray);
        tree.closest::<Scalar, _>(place, prims, ray, &mut best, &AnyHit);
        let bits = best.hit(ray).map(|h| [h.prim.0, h.t.to_bits(), h.u.to_bits(), h.v.to_bits()]);
        (bits, tree.occluded::<Scalar, _>(place, prims, ray, &AnyHit))
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
        assert_eq!(walked(&tree, &place, &none, &ray), (None, false));
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
            for (a, b, off, through) in rays {
                // At a vertex or the middle of two, along an axis or not, from near or far.
                let (a, b) = (world[a % world.len()], world[b % world.len()]);
                let target = if through { a } else { (a + b) * 0.5 };
                let off = Vec3::from(off.map(f32::from));
                let origin = target + off * size;
                let dir = if off == Vec3::ZERO { b - a } else { target - origin };
                let Some(ray) = TravRay::new(&Ray::new(origin, dir)) else { continue };
                prop_assert_eq!(walked(&tree, &place, &prims, &ray), listed(&prims, &ray));
            }
        }
    }
}
