//! Acceleration structures behind one trait, and the registry of their names.

mod batch;
mod block;
mod boxes;
pub mod bvh2;
pub mod bvh8;
mod counter;
mod eight;
pub mod events;
mod fast;
pub mod grid;
pub mod grug;
pub mod kdtree;
mod leaves;
mod lineage;
pub mod list;
mod packet;
mod query;
mod registry;
mod rigid;
mod run;
mod sah;
mod shapes;
mod slabs;
pub mod ssh;
mod topology;
mod wide;

pub use boxes::Visitor;
pub use counter::ReadCounter;
pub(crate) use eight::{EIGHT, Eight, EightPacket, EightRay, LEAF, ManyVisit, OneVisit, walk_many, walk_one};
pub use packet::PACKET;
pub(crate) use packet::{LanePacket, PacketBoxes};
pub use query::{AnyHit, Closest, HitSink, TravRay};
pub use registry::{AccelKind, AccelSpec, AnyAccel, SpecError};
pub(crate) use rigid::{RigidPacket, RigidPlace, RigidTree};
pub use topology::Cut;

pub use crate::geom::{Forms, Precision};

use rayon::prelude::*;

use crate::{
    geom::{Aabb, Hit, Ray, Triangles},
    simd::{FloatModeError, Simd},
};

/// Why a structure could not be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// More primitives than the structure's indices can hold.
    #[error("{structure}: {actual} triangles, at most {limit} fit")]
    TooMany {
        /// The structure's name.
        structure: &'static str,
        /// Largest number that fits.
        limit: usize,
        /// Number given.
        actual: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {prim}: vertex {vertex} of {count}")]
    IndexOutOfRange {
        /// The triangle.
        prim: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many there are.
        count: usize,
    },
    /// A setting that would take more references to primitives, or more bytes, than the structure may hold.
    #[error("{structure}: more than {limit} references or {bytes} bytes at this setting")]
    TooLarge {
        /// The structure's name.
        structure: &'static str,
        /// Most references.
        limit: u64,
        /// Most bytes of what leaves own.
        bytes: u64,
    },
    /// A structure's name or setting that does not exist.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// Foreign code changed how the calling thread computes.
    #[error(transparent)]
    FloatMode(#[from] FloatModeError),
}

/// Outcome of a refit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refit {
    /// The structure bounds the new positions.
    Done,
    /// Topology changed, or the structure cannot refit; `out` is unspecified.
    NeedsRebuild,
}

/// What [`Accel::validate`] found wrong, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation(pub String);

/// Size and quality of a built structure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AccelStats {
    /// Number of nodes, leaves included.
    pub nodes: usize,
    /// Number of leaves.
    pub leaves: usize,
    /// Longest path from the root, in nodes.
    pub depth: usize,
    /// Bytes of nodes alone.
    pub node_bytes: usize,
    /// Bytes of everything the structure owns.
    pub total_bytes: usize,
    /// Surface-area cost: expected node visits and triangle tests of a ray that meets the root box.
    pub sah_cost: f64,
}

/// Counts what a traversal does. The unit type counts nothing and costs nothing.
pub trait Counter {
    /// A node's box was tested.
    #[inline(always)]
    fn node(&mut self) {}
    /// A primitive was tested by itself.
    #[inline(always)]
    fn prim(&mut self) {}
    /// A block of up to four primitives was tested at once.
    #[inline(always)]
    fn block(&mut self) {}
    /// A grid cell was entered.
    #[inline(always)]
    fn step(&mut self) {}
    /// An event of a sorted list was handled.
    #[inline(always)]
    fn event(&mut self) {}
    /// An event of a sorted list was passed over when its volume was opened.
    #[inline(always)]
    fn skip(&mut self) {}
    /// Memory of the structure was read, triangles left out: `bytes` from `address` on.
    #[inline(always)]
    fn read(&mut self, address: usize, bytes: usize) {
        let _ = (address, bytes);
    }
}

impl Counter for () {}

/// Build settings of a structure, as `key=value` pairs.
pub trait AccelConfig: Default + Clone + std::fmt::Debug + Send + Sync {
    /// The settings that exist.
    const KEYS: &'static [&'static str];

    /// Sets one of [`AccelConfig::KEYS`].
    ///
    /// # Errors
    /// What is wrong with the value.
    fn set(&mut self, key: &str, value: &str) -> Result<(), String>;
}

/// A structure over triangles that answers rays exactly.
///
/// Every kind returns what `list` returns, bit for bit: the least exact `t`, equal `t` to the lower key.
pub trait Accel: Sized + Clone + Send + Sync + std::fmt::Debug + 'static {
    /// Name on the command line, in benches and in reports.
    const NAME: &'static str;
    /// Build settings.
    type Config: AccelConfig;
    /// False when every refit asks for a rebuild.
    const REFITS: bool = true;
    /// What its nodes say about what is below them, for reports.
    const NODE_FORMAT: &'static str = "full boxes";
    /// What a walk leaves for rays that start where it ended; `()` where nothing is gained.
    type RayState: Clone + Default + std::fmt::Debug;

    /// As [`Accel::NODE_FORMAT`], of this structure.
    fn node_format(&self) -> &'static str {
        Self::NODE_FORMAT
    }

    /// Builds over `prims`, in the current rayon pool.
    ///
    /// # Errors
    /// When an index is out of range or a limit of the structure is passed.
    fn build(prims: &Triangles<'_>, config: &Self::Config) -> Result<Self, BuildError>;

    /// Writes into `out` this structure refitted to `prims`' positions, reusing `out`'s memory. No allocation
    /// when `out` came from an earlier refit or clone of the same structure. Runs in the current rayon pool.
    fn refit_into(&self, out: &mut Self, prims: &Triangles<'_>) -> Refit;

    /// Offers to `best` every triangle that may beat it.
    fn closest<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    );

    /// As [`Accel::closest`]. `state` is what the walk of another ray left when it ended at this one's origin, or a default; the walk
    /// leaves its own there. The answer does not depend on it.
    #[inline(always)]
    fn closest_from<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        state: &mut Self::RayState,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        let _ = state;
        self.closest::<S, C, K>(prims, ray, best, sink, count);
    }

    /// True when any triangle that `sink` accepts is hit within the ray's range.
    fn occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool;

    /// The closest hit of every ray into `out`, which is as long, for callers who need no filter and no counts: rays by themselves where `packet` is 1, else
    /// in packets of up to `packet` consecutive ones, unless the structure finds that they point apart.
    #[inline(always)]
    fn closest_all<S: Simd>(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        forms: Forms,
        out: &mut [Option<Hit>],
    ) {
        run::closest_all::<S, Self>(self, prims, rays, packet, forms, out);
    }

    /// As [`Accel::closest_all`]: whether every ray is blocked.
    #[inline(always)]
    fn occluded_all<S: Simd>(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        forms: Forms,
        out: &mut [bool],
    ) {
        run::occluded_all::<S, Self>(self, prims, rays, packet, forms, out);
    }

    /// As [`Accel::closest`] for each ray whose bit is set in `active`; `best` and `sinks` go with the rays.
    ///
    /// At most [`PACKET`] rays. Those close together, with directions of the same signs, are walked together where the
    /// structure can; the answers are those of single rays.
    #[inline(always)]
    fn closest_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        run::closest_singly::<S, Self, C, K>(self, prims, rays, active, best, sinks, count);
    }

    /// As [`Accel::occluded`] for each ray whose bit is set in `active`: the bits of those that are blocked.
    #[inline(always)]
    fn occluded_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        sinks: &[K],
        count: &mut C,
    ) -> u32 {
        run::occluded_singly::<S, Self, C, K>(self, prims, rays, active, sinks, count)
    }

    /// Checks every invariant against `prims`.
    ///
    /// # Errors
    /// The first violation found.
    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation>;

    /// Size and quality; O(nodes).
    fn stats(&self) -> AccelStats;

    /// The least box around every triangle whose corners are finite.
    fn bounds(&self) -> Aabb;

    /// How much dearer rays are expected to be than right after the build, by surface areas: 1 when fresh. O(1).
    fn decay(&self) -> f64 {
        1.0
    }
}

/// Triangles whose indices one task checks.
const CHECKED: usize = 1 << 16;

/// Checks every index of `prims`, and their number against `limit`.
fn check_indices(structure: &'static str, prims: &Triangles<'_>, limit: usize) -> Result<(), BuildError> {
    if prims.len() > limit {
        return Err(BuildError::TooMany { structure, limit, actual: prims.len() });
    }
    let count = prims.positions.len();
    let greatest = |indices: &[[u32; 3]]| {
        let mut greatest = [0; 3];
        for corners in indices {
            for i in 0..3 {
                greatest[i] = corners[i].max(greatest[i]);
            }
        }
        greatest[0].max(greatest[1]).max(greatest[2])
    };
    let greatest = prims.indices.par_chunks(CHECKED).map(greatest).max();
    if greatest.is_none_or(|vertex| (vertex as usize) < count) {
        return Ok(());
    }
    for (prim, corners) in prims.indices.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&i| i as usize >= count) {
            return Err(BuildError::IndexOutOfRange { prim, vertex, count });
        }
    }
    Ok(())
}
