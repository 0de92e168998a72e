use super::{Grid, Owned, build::number};
use crate::{
    accel::kdtree::validate::finite_prims,
    geom::{PrimId, Triangles},
};

/// Checks places, corners, and that every triangle is where its corners are; the first violation in words.
pub(super) fn validate(grid: &Grid, prims: &Triangles<'_>) -> Result<(), String> {
    if grid.prim_count != prims.len() {
        return Err(format!("{} triangles, built over {}", prims.len(), grid.prim_count));
    }
    let (starts, lattice) = (&grid.cells.starts, &grid.cells.lattice);
    let units = match &grid.owned {
        Owned::Blocks(blocks) => blocks.len(),
        Owned::Ids(ids) => ids.len(),
    };
    let total: usize = lattice.cells.iter().map(|&n| n as usize).product();
    if starts.len() != total + 1 || starts[0] != 0 || starts[total] as usize != units || !starts.is_sorted() {
        return Err("the cells do not share out what there is".into());
    }
    let full = |cell: usize| grid.cells.full[cell / 64] >> (cell % 64) & 1 == 1;
    if (0..total).any(|cell| full(cell) == grid.cells.units(cell).is_empty()) {
        return Err("a full cell is marked as empty, or an empty one as full".into());
    }
    if let Owned::Blocks(blocks) = &grid.owned {
        for block in blocks {
            for (lane, prim) in block.prims().enumerate() {
                if prim.0 as usize >= prims.len() || block.corners(lane) != prims.corners(prim) {
                    return Err(format!("triangle {} has stale corners", prim.0));
                }
            }
        }
    }
    for (prim, own) in finite_prims(prims) {
        if !grid.cells.bounds.contains(own) {
            return Err(format!("triangle {} leaves the bounds", prim.0));
        }
        for corner in prims.corners(prim) {
            let cell = std::array::from_fn(|axis| lattice.cell(axis, f64::from(corner[axis])));
            if !holds(grid, number(lattice, cell), prim) {
                return Err(format!("cell {cell:?} does not hold triangle {}", prim.0));
            }
        }
    }
    Ok(())
}

fn holds(grid: &Grid, cell: usize, prim: PrimId) -> bool {
    match &grid.owned {
        Owned::Blocks(blocks) => blocks[grid.cells.units(cell)].iter().any(|b| b.prims().any(|p| p == prim)),
        Owned::Ids(ids) => ids[grid.cells.units(cell)].contains(&prim.0),
    }
}
