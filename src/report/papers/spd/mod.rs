//! Ray counts of the Standard Procedural Databases: what any tracer must find, and what a structure does for it.
//!
//! A [`Tracer`] casts the rays of a database's picture over any [`Walker`]. Its [`RayCounts`] stand beside
//! [`published`] ones; its [`WalkCounts`] are the structure's own, to be divided by the number of rays.

mod counts;
pub mod published;
mod tracer;
mod walker;

#[cfg(test)]
mod tests;

pub use counts::{RayCounts, RayTally, Recorder, WalkCounts};
pub use tracer::{PIXELS, RaySet, Rules, Tracer};
pub use walker::{BoxTree, LeastTests, Naive, Walker};

use super::objects::Solids;
use crate::scene::spd::SpdScene;

/// Ray counts of a database's picture of [`PIXELS`] x [`PIXELS`] pixels, in the current rayon pool.
pub fn spd_rays(scene: &SpdScene, rules: Rules) -> RayCounts {
    let solids = Solids::new(scene);
    let tree = BoxTree::new(solids.boxes());
    Tracer::new(scene, &solids, &tree, rules, (PIXELS, RaySet::All)).trace::<()>().0
}
