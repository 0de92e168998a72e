//! Uniform grid, walked cell by cell.
//!
//! Every cell owns the triangles that come near it; those whose plane passes a cell by are left out. By default a cell's triangles stand in
//! blocks of four with their corners, so a triangle in several cells is stored as often; `leaf=ids` stores numbers, reads the
//! corners from the mesh and keeps a small mailbox of triangles that the ray has met. Which cells a ray visits, and why none is
//! lost, is told in `lattice.rs`.
//!
//! Cost: build O(n) plus the references, in the current rayon pool; memory linear in n at automatic resolution, which gets coarser where
//! triangles fill many cells. It cannot be refitted: every change of positions or topology asks for a rebuild. Choose it for
//! evenly distributed geometry, and as the papers' baseline.
//!
//! # Source
//! Amanatides and Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987; Woo, "Ray Tracing Polygons using Spatial Subdivision", 1992
//! (resolution).

mod build;
pub(super) mod lattice;
mod mailbox;
mod validate;

use super::{
    Accel, AccelConfig, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation, Visitor,
    block::TriBlock,
    check_indices,
    leaves::{ClosestLeaves, Leaves, Line, Objects, OccludedLeaves, RareLeaves, pack},
    sah::BLOCK,
    shapes::Shapes,
};
use crate::{
    geom::{Aabb, Triangles},
    simd::Simd,
};
pub use build::Resolution;
use build::{Contents, MAX_TOTAL, Unit, fill, number};
use lattice::{Dda, Lattice, MAX_CELLS};
use mailbox::{MailedClosest, MailedOccluded};

/// Most objects: references are numbered by 30 bits.
const MAX_OBJECTS: usize = 1 << 28;

/// What a cell stores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridLeaf {
    /// Blocks of four triangles with their corners.
    Blocks,
    /// Numbers of triangles.
    Ids,
}

/// Build settings of `grid`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridConfig {
    /// How many cells: `density=X` or `res=N` or `res=NxMxK`.
    pub resolution: Resolution,
    /// What a cell stores: `leaf=blocks` or `leaf=ids`.
    pub leaf: GridLeaf,
}

impl Default for GridConfig {
    fn default() -> Self {
        Self { resolution: Resolution::Density(4.0), leaf: GridLeaf::Blocks }
    }
}

impl AccelConfig for GridConfig {
    const KEYS: &'static [&'static str] = &["density", "res", "leaf"];

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "density" => {
                let density = value.parse().ok().filter(|d| (0.001..=1000.0).contains(d));
                let density = density.ok_or_else(|| format!("`{value}` is not a number from 0.001 to 1000"))?;
                self.resolution = Resolution::Density(density);
            }
            "res" => self.resolution = Resolution::Cells(cells(value)?),
            _ => {
                self.leaf = match value {
                    "blocks" => GridLeaf::Blocks,
                    "ids" => GridLeaf::Ids,
                    _ => return Err(format!("`{value}` is neither `blocks` nor `ids`")),
                }
            }
        }
        Ok(())
    }
}

/// `N` or `NxMxK`.
fn cells(value: &str) -> Result<[u32; 3], String> {
    let parts: Vec<_> = value.split('x').map(|n| n.parse().ok().filter(|n| (1..=MAX_CELLS).contains(n))).collect();
    let cells = match parts[..] {
        [Some(n)] => [n; 3],
        [Some(x), Some(y), Some(z)] => [x, y, z],
        _ => return Err(format!("`{value}` is neither N nor NxMxK with numbers from 1 to {MAX_CELLS}")),
    };
    let total: u64 = cells.iter().map(|&n| u64::from(n)).product();
    if total > MAX_TOTAL {
        return Err(format!("{total} cells, at most {MAX_TOTAL} fit"));
    }
    Ok(cells)
}

/// The cells alone, without what they own.
#[derive(Clone, Debug)]
struct Cells {
    bounds: Aabb,
    lattice: Lattice,
    /// The first unit of every cell, x fastest, then the number of units.
    starts: Vec<u32>,
    /// A bit for every cell that owns something: most cells are empty, and this stays in the cache.
    full: Vec<u64>,
}

/// Address that reads of `full` are counted from; `starts` are counted from 0.
const FULL: usize = usize::MAX / 2 + 1;

impl Cells {
    fn build(
        shapes: &(impl Shapes + ?Sized),
        resolution: Resolution,
        unit: Unit,
    ) -> Result<(Self, Vec<u32>), BuildError> {
        let Contents { bounds, lattice, starts, items } = fill(Grid::NAME, shapes, resolution, unit)?;
        let mut full = vec![0; starts.len().div_ceil(64)];
        for (cell, places) in starts.windows(2).enumerate() {
            full[cell / 64] |= u64::from(places[0] < places[1]) << (cell % 64);
        }
        Ok((Self { bounds, lattice, starts, full }, items))
    }

    /// What a step along each axis adds to a cell's number, modulo the range of numbers.
    #[inline(always)]
    fn strides(&self, line: &Line) -> [usize; 3] {
        let cells = &self.lattice.cells;
        let mut strides = [1, cells[0] as usize, cells[0] as usize * cells[1] as usize];
        for (stride, inv) in strides.iter_mut().zip(&line.inv) {
            if *inv < 0.0 {
                *stride = stride.wrapping_neg();
            }
        }
        strides
    }

    #[inline(always)]
    fn units(&self, cell: usize) -> std::ops::Range<usize> {
        self.starts[cell] as usize..self.starts[cell + 1] as usize
    }

    #[inline(always)]
    fn walk<L: Leaves, C: Counter>(&self, ray: &TravRay, leaves: &mut L, count: &mut C) -> bool {
        let line = Line::new(ray.range());
        let Some(interval) = line.clip_to(&self.bounds, leaves.t_limit()) else { return false };
        if !self.lattice.is_near(&line) {
            return self.walk_far(&line, interval, leaves.rare(), count);
        }
        let mut dda = Dda::new(&self.lattice, &line, interval.0);
        let (mut cell, strides) = (number(&self.lattice, dda.cell), self.strides(&line));
        let mut t_end = interval.1;
        loop {
            count.step();
            count.read(FULL + cell / 64 * 8, 8);
            if (self.full[cell / 64] >> (cell % 64)) & 1 == 1 {
                count.read(cell * 4, 8);
                if leaves.leaf(self.units(cell), count) {
                    return true;
                }
                let limit = leaves.t_limit();
                t_end = if limit < t_end { limit } else { t_end };
            }
            let (axis, t) = dda.crossing();
            if t > t_end {
                return false;
            }
            dda.cross(&self.lattice, &line, axis);
            cell = cell.wrapping_add(strides[axis]);
        }
    }

    /// For rays from so far away that planes of cells cannot be told apart in f64.
    #[cold]
    #[inline(never)]
    fn walk_far(
        &self,
        line: &Line,
        interval: (f64, f64),
        leaves: &mut dyn RareLeaves,
        count: &mut dyn Counter,
    ) -> bool {
        self.lattice.bisect(line, interval, &mut |cell, t0, _| {
            count.step();
            t0 <= leaves.limits().0 && leaves.test(self.units(number(&self.lattice, cell)), count)
        })
    }

    /// Cells as nodes, those that own something as leaves.
    fn stats(&self) -> AccelStats {
        let full = self.starts.windows(2).filter(|w| w[0] < w[1]).count();
        AccelStats {
            nodes: self.starts.len() - 1,
            leaves: full,
            depth: 1,
            node_bytes: size_of_val(&self.starts[..]) + size_of_val(&self.full[..]),
            total_bytes: 0,
            sah_cost: 0.0,
        }
    }
}

/// A grid over plain boxes, which leaves the objects to a [`Visitor`].
#[derive(Clone, Debug)]
pub struct BoxGrid {
    cells: Cells,
    items: Vec<u32>,
}

impl BoxGrid {
    /// Builds over `boxes`, in the current rayon pool; an object's number is its place there. Boxes that are empty or not finite are never
    /// visited. [`GridConfig::leaf`] is of no concern.
    ///
    /// # Errors
    /// More boxes than can be numbered, or more references than fit at a given resolution.
    pub fn build(boxes: &[Aabb], config: &GridConfig) -> Result<Self, BuildError> {
        let error = BuildError::TooMany { structure: Grid::NAME, limit: MAX_OBJECTS, actual: boxes.len() };
        if boxes.len() > MAX_OBJECTS {
            return Err(error);
        }
        let (cells, items) = Cells::build(boxes, config.resolution, Unit { objects: 1, bytes: 4 })?;
        Ok(Self { cells, items })
    }

    /// Visits the objects whose cells the ray meets, cell by cell, some several times; true when a visit ended the walk.
    #[inline(always)]
    pub fn walk<V: Visitor, C: Counter>(&self, ray: &TravRay, visitor: &mut V, count: &mut C) -> bool {
        self.cells.walk(ray, &mut Objects { items: &self.items, visitor }, count)
    }

    /// Cells along each axis.
    pub fn resolution(&self) -> [u32; 3] {
        self.cells.lattice.cells
    }

    /// Size; nodes are cells, and leaves those that hold something.
    pub fn stats(&self) -> AccelStats {
        let stats = self.cells.stats();
        AccelStats { total_bytes: size_of::<Self>() + stats.node_bytes + size_of_val(&self.items[..]), ..stats }
    }
}

/// A built grid over triangles.
#[derive(Clone, Debug)]
pub struct Grid {
    cells: Cells,
    owned: Owned,
    prim_count: usize,
}

/// What the cells own.
#[derive(Clone, Debug)]
enum Owned {
    Blocks(Vec<TriBlock>),
    Ids(Vec<u32>),
}

impl Grid {
    /// Cells along each axis.
    pub fn resolution(&self) -> [u32; 3] {
        self.cells.lattice.cells
    }
}

impl Accel for Grid {
    const NAME: &'static str = "grid";
    const NODE_FORMAT: &'static str = "cells";
    type Config = GridConfig;
    const REFITS: bool = false;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &GridConfig) -> Result<Self, BuildError> {
        check_indices(Self::NAME, prims, MAX_OBJECTS)?;
        let unit = match config.leaf {
            GridLeaf::Blocks => Unit { objects: BLOCK, bytes: size_of::<TriBlock>() as u64 },
            GridLeaf::Ids => Unit { objects: 1, bytes: 4 },
        };
        let (cells, items) = Cells::build(prims, config.resolution, unit)?;
        let owned = match config.leaf {
            GridLeaf::Blocks => Owned::Blocks(pack(&items, prims)),
            GridLeaf::Ids => Owned::Ids(items),
        };
        Ok(Self { cells, owned, prim_count: prims.len() })
    }

    /// Always [`Refit::NeedsRebuild`]: cells do not follow the triangles in them.
    fn refit_into(&self, _out: &mut Self, _prims: &Triangles<'_>) -> Refit {
        Refit::NeedsRebuild
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
        match &self.owned {
            Owned::Blocks(blocks) => {
                self.cells.walk(
                    ray,
                    &mut ClosestLeaves::<S, K>::new(blocks, self.cells.bounds.reach(), ray, best, sink),
                    count,
                );
            }
            Owned::Ids(ids) => {
                self.cells.walk(ray, &mut MailedClosest::new(ids, prims, ray, best, sink), count);
            }
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
        match &self.owned {
            Owned::Blocks(blocks) => self.cells.walk(
                ray,
                &mut OccludedLeaves::<S, K>::new(blocks, self.cells.bounds.reach(), ray, sink),
                count,
            ),
            Owned::Ids(ids) => self.cells.walk(ray, &mut MailedOccluded::new(ids, prims, ray, sink), count),
        }
    }

    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
        validate::validate(self, prims).map_err(Violation)
    }

    fn stats(&self) -> AccelStats {
        let stats = self.cells.stats();
        let owned = match &self.owned {
            Owned::Blocks(blocks) => size_of_val(&blocks[..]),
            Owned::Ids(ids) => size_of_val(&ids[..]),
        };
        AccelStats { total_bytes: size_of::<Self>() + stats.node_bytes + owned, ..stats }
    }

    fn bounds(&self) -> Aabb {
        self.cells.bounds
    }
}
