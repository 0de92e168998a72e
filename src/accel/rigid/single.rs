//! One ray: boxes in f32, then triangles of the part that it may hit, then those of the world.

use super::{LocalRay, RigidPlace, RigidTree};
use crate::{
    accel::{
        Closest, HitSink, TravRay,
        block::{NO_PRIM, TriBlock, Volumes, norm1, splat3},
        eight::{EightRay, OneVisit, walk_one},
        packet::bits,
        query::is_blocked_by,
    },
    geom::{PrimId, Triangles, exact::BOUND},
    simd::{Lanes, Simd, Task},
};

/// What is done with the triangles of the world that a walk comes upon.
pub(super) trait Look {
    /// Nothing beyond this `t` counts any more.
    fn limit(&self) -> f64;
    /// No less than [`Look::limit`].
    fn limit32(&self) -> f32;
    /// Looks at a triangle; true to end the walk.
    fn look(&mut self, prim: PrimId) -> bool;
}

pub(super) struct Nearest<'a, K> {
    pub(super) prims: &'a Triangles<'a>,
    pub(super) ray: &'a TravRay,
    pub(super) best: &'a mut Closest,
    pub(super) sink: &'a K,
}

impl<K: HitSink> Look for Nearest<'_, K> {
    #[inline(always)]
    fn limit(&self) -> f64 {
        self.best.t_high()
    }

    #[inline(always)]
    fn limit32(&self) -> f32 {
        self.best.t_cull()
    }

    #[inline(always)]
    fn look(&mut self, prim: PrimId) -> bool {
        self.best.offer(self.ray, self.prims, prim, self.sink);
        false
    }
}

pub(super) struct Any<'a, K> {
    pub(super) prims: &'a Triangles<'a>,
    pub(super) ray: &'a TravRay,
    pub(super) sink: &'a K,
    pub(super) is_blocked: bool,
}

impl<K: HitSink> Look for Any<'_, K> {
    #[inline(always)]
    fn limit(&self) -> f64 {
        f64::from(self.ray.range().t_far)
    }

    #[inline(always)]
    fn limit32(&self) -> f32 {
        self.ray.range().t_far
    }

    #[inline(always)]
    fn look(&mut self, prim: PrimId) -> bool {
        self.is_blocked = is_blocked_by(self.ray, self.prims, prim, self.sink);
        self.is_blocked
    }
}

/// A line against the triangles of the part: which of them the ray may hit in the world.
///
/// Where the ray hits a triangle in the world, the line passes at the same `t` within `m`, axis by axis, of a point q of the triangle in the part. Moved there it
/// has volumes U, V and W of one sign. Moving it changes U, which is `s . (b x e2)`, by `m . |b x e2|` at most, and that is no more than `2 |m|∞ |b|∞ |e2|₁`;
/// V alike with e1, and W by what both are. The roundings are those of [`BOUND`], as in [`BlockRay`](crate::accel::block::BlockRay).
struct Sieve {
    from: [f64; 3],
    dir: [f64; 3],
    /// Bound on the roundings.
    rounding: f64,
    /// What the margin adds for each unit of `|e1|₁ + |e2|₁`.
    slope: f64,
}

impl Sieve {
    #[inline(always)]
    fn new(local: &LocalRay, reach: f64) -> Self {
        let (size, far) = (local.dir.abs().max_element(), local.from.abs().max_element());
        Self {
            from: local.from.to_array(),
            dir: local.dir.to_array(),
            rounding: BOUND * size * (40.0 * reach) * (2.0 * reach + far),
            slope: 2.000_001 * local.margin.max_element() * size,
        }
    }

    /// Lanes of a block whose triangles the ray may hit.
    #[inline(always)]
    fn open<S: Simd>(&self, block: &TriBlock) -> u32 {
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = block.narrow::<S>();
        let corners = [
            [S::widen(ax), S::widen(ay), S::widen(az)],
            [S::widen(bx), S::widen(by), S::widen(bz)],
            [S::widen(cx), S::widen(cy), S::widen(cz)],
        ];
        let volumes = Volumes::<S::D4>::new(corners, splat3(&self.from), splat3(&self.dir));
        let sides = norm1(volumes.e1) + norm1(volumes.e2);
        volumes.open(sides.mul_add_loose(S::D4::splat(self.slope), S::D4::splat(self.rounding)))
    }
}

struct Leaves<'a, L> {
    tree: &'a RigidTree,
    sieve: Sieve,
    look: &'a mut L,
}

impl<L: Look> OneVisit for Leaves<'_, L> {
    #[inline(always)]
    fn limit(&self) -> f32 {
        self.look.limit32()
    }

    #[inline(always)]
    fn leaf<S: Simd>(&mut self, word: u32) -> bool {
        for block in self.tree.leaf_blocks(word) {
            for lane in bits(self.sieve.open::<S>(block)) {
                let prim = block.prim(lane & 3);
                if prim != NO_PRIM && self.look.look(PrimId(prim)) {
                    return true;
                }
            }
        }
        false
    }
}

/// The walk of one ray from a word on.
pub(super) struct Walk<'a, L> {
    pub(super) tree: &'a RigidTree,
    pub(super) place: &'a RigidPlace,
    pub(super) ray: &'a TravRay,
    pub(super) start: u32,
    pub(super) look: &'a mut L,
}

impl<L: Look> Task for Walk<'_, L> {
    type Output = ();

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the walk allows for the rounding, and for infinities")]
    fn run<S: Simd>(self) {
        let Self { tree, place, ray, start, look } = self;
        if tree.nodes.is_empty() {
            return;
        }
        let (local, t_near) = (place.localize(ray), ray.range().t_near);
        let narrow = |v: glam::DVec3| [v.x as f32, v.y as f32, v.z as f32];
        let [from, dir, margin] = [narrow(local.from), narrow(local.dir), narrow(local.margin)];
        match EightRay::new::<S>(from, dir, margin, tree.reach32(), t_near) {
            Some(line) => {
                let sieve = Sieve::new(&local, tree.reach.max_element());
                walk_one::<S, _>(&tree.nodes, &line, start, &mut Leaves { tree, sieve, look });
            }
            None => tree.walk_exactly(&local, t_near, look),
        }
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
        let mut look = Nearest { prims, ray, best, sink };
        S::call(Walk { tree: self, place, ray, start: 0, look: &mut look });
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
        let mut look = Any { prims, ray, sink, is_blocked: false };
        S::call(Walk { tree: self, place, ray, start: 0, look: &mut look });
        look.is_blocked
    }
}
