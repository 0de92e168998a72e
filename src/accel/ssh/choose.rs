//! Which of its six sides a node keeps.
//!
//! # Source
//! Eisemann, Woizischke and Magnor, "Ray Tracing with the Single Slab Hierarchy", 2008, figure 5. Departures: equal areas are told apart by the
//! sum of the extents, so that flat and thin boxes shrink too; of equals the first of +x, -x, +y, -y, +z, -z.

use super::node::Side;
use crate::geom::Aabb;

/// Half the surface area, then the sum of the extents, in f64; extents below 0 count as 0.
pub(super) fn size(aabb: &Aabb) -> (f64, f64) {
    let e = (aabb.max.as_dvec3() - aabb.min.as_dvec3()).max(glam::DVec3::ZERO);
    (e.x * (e.y + e.z) + e.y * e.z, e.x + e.y + e.z)
}

/// A side, its plane, and what is left of the box it was inherited from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    pub(super) side: Side,
    pub(super) plane: f32,
    pub(super) inherited: Aabb,
    /// The plane takes nothing off the inherited box.
    pub(super) useless: bool,
}

/// The side of `tight` that leaves the least of `inherited`. An empty `tight` leaves nothing.
pub(super) fn choose(tight: &Aabb, inherited: &Aabb) -> Choice {
    let make = |side: Side| {
        let plane = side.of(tight);
        Choice { side, plane, inherited: side.tightened(*inherited, plane), useless: false }
    };
    let mut best = make(Side::ALL[0]);
    if tight.is_empty() {
        return best;
    }
    let mut least = size(&best.inherited);
    for side in &Side::ALL[1..] {
        let choice = make(*side);
        let size = size(&choice.inherited);
        if size < least {
            (best, least) = (choice, size);
        }
    }
    best.useless = least == size(inherited);
    best
}
