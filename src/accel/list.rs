//! Brute force: every triangle against every ray. The oracle of the other structures.
//!
//! Cost: O(triangles) a ray, no build. Choose it for a handful of triangles, or to check another structure.

#![expect(clippy::cast_possible_truncation, reason = "the number of triangles is checked by the build")]

use super::{
    Accel, AccelConfig, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation, check_indices,
    query::is_blocked_by,
};
use crate::{
    geom::{Aabb, PrimId, Triangles},
    simd::Simd,
};

/// All triangles, in order, with the box around them.
#[derive(Clone, Debug)]
pub struct List {
    bounds: Aabb,
    count: usize,
    topology_epoch: u64,
}

/// `list` has no settings.
#[derive(Clone, Copy, Debug, Default)]
pub struct ListConfig;

impl AccelConfig for ListConfig {
    const KEYS: &'static [&'static str] = &[];

    fn set(&mut self, _key: &str, _value: &str) -> Result<(), String> {
        Err("`list` has no settings".into())
    }
}

/// The least box around all triangles whose corners are finite.
fn bounds(prims: &Triangles<'_>) -> Aabb {
    let boxes = (0..prims.len() as u32).map(|i| prims.finite_aabb(PrimId(i)));
    boxes.fold(Aabb::EMPTY, Aabb::union)
}

fn ids(prims: &Triangles<'_>) -> impl Iterator<Item = PrimId> + use<> {
    (0..prims.len() as u32).map(PrimId)
}

impl Accel for List {
    const NAME: &'static str = "list";
    const NODE_FORMAT: &'static str = "none";
    type Config = ListConfig;
    type RayState = ();

    fn build(prims: &Triangles<'_>, _config: &ListConfig) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, u32::MAX as usize)?;
        Ok(Self { bounds: bounds(prims), count: prims.len(), topology_epoch: prims.topology_epoch })
    }

    fn refit_into(&self, out: &mut Self, prims: &Triangles<'_>) -> Refit {
        if prims.topology_epoch != self.topology_epoch || prims.len() != self.count {
            return Refit::NeedsRebuild;
        }
        out.clone_from(self);
        out.bounds = bounds(prims);
        Refit::Done
    }

    #[inline(always)]
    fn closest<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        for prim in ids(prims) {
            count.prim();
            best.offer(ray, prims, prim, sink);
        }
    }

    #[inline(always)]
    fn occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        ids(prims).any(|prim| {
            count.prim();
            is_blocked_by(ray, prims, prim, sink)
        })
    }

    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
        if self.count != prims.len() {
            return Err(Violation(format!("{} triangles, built over {}", prims.len(), self.count)));
        }
        let outside = ids(prims).find(|&p| !self.bounds.contains(prims.finite_aabb(p)));
        outside.map_or(Ok(()), |p| Err(Violation(format!("triangle {} leaves the bounds", p.0))))
    }

    fn stats(&self) -> AccelStats {
        AccelStats { total_bytes: size_of::<Self>(), sah_cost: self.count as f64, ..AccelStats::default() }
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }
}
