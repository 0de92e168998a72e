//! Resolution and contents of a grid.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of cells and references are bounded before they are narrowed"
)]

use glam::DVec3;
use rayon::prelude::*;

use super::lattice::{Lattice, MAX_CELLS};
use crate::{
    accel::{
        BuildError,
        block::NO_PRIM,
        kdtree::build::{Ref, bounds, refs},
        shapes::Shapes,
    },
    geom::Aabb,
};

/// Most cells of a grid: their places take 1 GiB.
pub(super) const MAX_TOTAL: u64 = 1 << 28;

/// References that a grid of automatic resolution may hold, an object on average and in all.
const REFS_EACH: u64 = 24;
const REFS_FREE: u64 = 1 << 18;

/// Bytes of leaves that a grid of automatic resolution may hold, an object on average and in all.
const BYTES_EACH: u64 = 640;
const BYTES_FREE: u64 = 1 << 24;

/// Most references and most bytes of leaves at a resolution that is given.
const REFS_MAX: u64 = 1 << 30;
const BYTES_MAX: u64 = 8 << 30;

/// How many cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Resolution {
    /// Cells an object on average, as near to cubes as whole numbers allow (Woo's rule); fewer where objects fill too many cells.
    Density(f64),
    /// Cells along each axis.
    Cells([u32; 3]),
}

/// What the cells hold.
#[derive(Clone, Debug)]
pub(super) struct Contents {
    pub(super) bounds: Aabb,
    pub(super) lattice: Lattice,
    /// The first unit of every cell, x fastest, then the number of units.
    pub(super) starts: Vec<u32>,
    pub(super) items: Vec<u32>,
}

/// Bytes of a unit and objects in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unit {
    pub(super) objects: usize,
    pub(super) bytes: u64,
}

/// Woo's rule: cubic cells, `density` times as many as objects; axes too thin for two cells get one.
///
/// # Source
/// Woo, "Ray Tracing Polygons using Spatial Subdivision", 1992: cells along an axis in proportion to the box's extent.
pub(super) fn woo(bounds: &Aabb, count: usize, density: f64) -> [u32; 3] {
    let extent = bounds.max.as_dvec3() - bounds.min.as_dvec3();
    let total = (density * count as f64).clamp(1.0, MAX_TOTAL as f64);
    let mut open = [true; 3];
    loop {
        let volume: f64 = (0..3).filter(|&i| open[i]).map(|i| extent[i]).product();
        let ratio = total / volume;
        let scale = match open.iter().filter(|&&o| o).count() {
            0 => return [1; 3],
            1 => ratio,
            2 => ratio.sqrt(),
            _ => libm::cbrt(ratio),
        };
        // An extent of 0 makes the scale infinite and the product NaN: one cell.
        let cells: [f64; 3] = std::array::from_fn(|i| if open[i] { extent[i] * scale } else { 1.0 });
        let thin = (0..3).filter(|&i| open[i]).min_by(|&a, &b| extent[a].total_cmp(&extent[b]));
        if let Some(thin) = thin
            && (cells[thin] < 1.0 || !cells.iter().all(|c| c.is_finite()))
        {
            open[thin] = false;
            continue;
        }
        return cells.map(|c| ((c + 0.5) as u32).clamp(1, MAX_CELLS));
    }
}

/// Enters all objects into cells.
pub(super) fn fill(
    structure: &'static str,
    shapes: &(impl Shapes + ?Sized),
    resolution: Resolution,
    unit: Unit,
) -> Result<Contents, BuildError> {
    let refs = refs(shapes);
    let bounds = bounds(&refs);
    let count = refs.len() as u64;
    let (mut cells, fixed) = match resolution {
        Resolution::Density(density) => (woo(&bounds, refs.len(), density), false),
        Resolution::Cells(cells) => (cells, true),
    };
    let (max_refs, max_bytes) = if fixed {
        (REFS_MAX, BYTES_MAX)
    } else {
        ((REFS_EACH * count + REFS_FREE).min(REFS_MAX), (BYTES_EACH * count + BYTES_FREE).min(BYTES_MAX))
    };
    loop {
        let lattice = lattice(&bounds, cells);
        let entries: u64 = refs.par_iter().map(|r| entries(&lattice, r)).sum();
        let too_many = entries > max_refs;
        if !too_many {
            let pairs = pairs(&refs, shapes, &lattice);
            let counts = counts(&pairs, &lattice);
            let units: u64 = counts.iter().map(|c| u64::from(*c).div_ceil(unit.objects as u64)).sum();
            if units * unit.bytes <= max_bytes {
                let (starts, items) = sort(&pairs, &counts, unit.objects);
                return Ok(Contents { bounds, lattice, starts, items });
            }
        }
        if fixed {
            return Err(BuildError::TooLarge { structure, limit: max_refs, bytes: max_bytes });
        }
        if cells == [1; 3] {
            // One cell holds every object once, which is within the limits.
            return Err(BuildError::TooMany { structure, limit: REFS_MAX as usize, actual: refs.len() });
        }
        cells = cells.map(|c| (c * 4 / 5).max(1));
    }
}

/// Cells over a box; thin axes have one.
fn lattice(bounds: &Aabb, cells: [u32; 3]) -> Lattice {
    let (low, high) = if bounds.is_empty() { ([0.0; 3], [0.0; 3]) } else { corners(bounds) };
    let cells = std::array::from_fn(|i| if high[i] > low[i] { cells[i] } else { 1 });
    Lattice::new(low, high, cells)
}

fn corners(bounds: &Aabb) -> ([f64; 3], [f64; 3]) {
    (bounds.min.to_array().map(f64::from), bounds.max.to_array().map(f64::from))
}

/// Cells that come near an object's box.
fn entries(lattice: &Lattice, r: &Ref) -> u64 {
    let (first, last) = lattice.range(&r.aabb);
    (0..3).map(|i| u64::from(last[i] - first[i] + 1)).product()
}

/// A cell and an object in it.
type Pair = (u32, u32);

/// All pairs, ascending by object. Cells of a box that the object itself surely misses are left out.
fn pairs(refs: &[Ref], shapes: &(impl Shapes + ?Sized), lattice: &Lattice) -> Vec<Pair> {
    let of = |r: &Ref| {
        let (first, last) = lattice.range(&r.aabb);
        let mut out = Vec::new();
        let alone = first == last;
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let (center, half) = lattice.around([x, y, z]);
                    if alone || !shapes.surely_misses(r.id.0, DVec3::from(center), DVec3::from(half)) {
                        out.push((number(lattice, [x, y, z]) as u32, r.id.0));
                    }
                }
            }
        }
        out
    };
    refs.par_iter().with_min_len(1024).flat_map_iter(of).collect()
}

/// Number of a cell, x fastest.
#[inline(always)]
pub(super) fn number(lattice: &Lattice, cell: [u32; 3]) -> usize {
    let (nx, ny) = (lattice.cells[0] as usize, lattice.cells[1] as usize);
    (cell[2] as usize * ny + cell[1] as usize) * nx + cell[0] as usize
}

/// Number of objects in every cell.
fn counts(pairs: &[Pair], lattice: &Lattice) -> Vec<u32> {
    let total: usize = lattice.cells.iter().map(|&n| n as usize).product();
    let mut counts = vec![0; total];
    for &(cell, _) in pairs {
        counts[cell as usize] += 1;
    }
    counts
}

/// Places of the cells' units and the objects in them, ascending within a cell.
fn sort(pairs: &[Pair], counts: &[u32], objects: usize) -> (Vec<u32>, Vec<u32>) {
    let mut starts = Vec::with_capacity(counts.len() + 1);
    let mut units = 0;
    for &count in counts {
        starts.push(units);
        units += count.div_ceil(objects as u32);
    }
    starts.push(units);
    let mut items = vec![NO_PRIM; units as usize * objects];
    let mut next: Vec<u32> = starts[..counts.len()].iter().map(|&s| s * objects as u32).collect();
    for &(cell, id) in pairs {
        let at = &mut next[cell as usize];
        items[*at as usize] = id;
        *at += 1;
    }
    (starts, items)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn woo_gives_the_resolutions_published_for_the_procedural_databases() {
        // Counts and boxes of balls (floor 24 x 24, spheres up to 0.85 or so above it) and tetra; density 10.
        let balls = Aabb { min: Vec3::new(-12.0, -12.0, -0.5), max: Vec3::new(12.0, 12.0, 1.1) };
        assert_eq!(woo(&balls, 7382, 10.0), [103, 103, 7]);
        let tetra = Aabb { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) };
        assert_eq!(woo(&tetra, 4096, 10.0), [34, 34, 34]);
    }

    #[test]
    fn thin_boxes_get_one_cell_across() {
        let flat = Aabb { min: Vec3::ZERO, max: Vec3::new(4.0, 1.0, 0.0) };
        assert_eq!(woo(&flat, 64, 1.0), [16, 4, 1]);
        let line = Aabb { min: Vec3::ZERO, max: Vec3::new(0.0, 1.0, 0.0) };
        assert_eq!(woo(&line, 64, 1.0), [1, 64, 1]);
        assert_eq!(woo(&Aabb { min: Vec3::ONE, max: Vec3::ONE }, 64, 1.0), [1, 1, 1]);
        assert_eq!(woo(&Aabb::EMPTY, 0, 10.0), [1, 1, 1]);
    }
}
