//! The surface-area cost that builders minimise and refits watch.
//!
//! # Source
//! Goldsmith and Salmon, "Automatic Creation of Object Hierarchies for Ray Tracing", 1987; `MacDonald` and Booth,
//! "Heuristics for Ray Tracing Using Space Subdivision", 1990. Departure: a leaf costs by blocks of four triangles, not by
//! triangles, since a block is tested as a whole.

use crate::geom::Aabb;

/// Cost of visiting a pair of nodes.
pub(super) const COST_TRAVERSE: f64 = 1.0;

/// Cost of testing a block of four triangles, measured against [`COST_TRAVERSE`].
pub(super) const COST_BLOCK: f64 = 1.5;

/// Triangles in a block.
pub(super) const BLOCK: usize = 4;

/// Half the surface area in f64, where no finite box overflows; 0 for an empty box.
#[inline(always)]
pub(super) fn half_area(aabb: Aabb) -> f64 {
    let e = aabb.max.as_dvec3() - aabb.min.as_dvec3();
    if e.x < 0.0 { 0.0 } else { e.x * e.y + e.y * e.z + e.z * e.x }
}
