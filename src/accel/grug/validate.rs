use super::{
    Grug,
    build::{BOUNDS, Bounds},
};
use crate::{
    accel::kdtree::validate::{Forest, finite_prims},
    geom::{Aabb, Triangles},
};

/// Checks that groups cover all cells once, their trees, and that every triangle is where its corners are; the first violation in
/// words.
pub(super) fn validate(grug: &Grug, prims: &Triangles<'_>) -> Result<(), String> {
    if grug.prim_count != prims.len() {
        return Err(format!("{} triangles, built over {}", prims.len(), grug.prim_count));
    }
    let forest = Forest { nodes: &grug.nodes, blocks: &grug.blocks, prims };
    let (mut nodes, mut units, mut cells) = (0, 0, 0);
    for group in grug.groups.iter().map(|&g| g as usize) {
        if group != nodes {
            return Err(format!("a group begins at node {group}, due {nodes}"));
        }
        nodes += BOUNDS;
        let bounds = Bounds::read(&grug.nodes, group);
        let (low, high) = grug.lattice.around_run(bounds.first, bounds.end);
        let cell = Aabb { min: low.into(), max: high.into() };
        forest.subtree(group + BOUNDS, cell, &mut nodes, &mut units)?;
        for cell in bounds.cells() {
            cells += 1;
            if grug.table[grug.hash.of(cell)] as usize != group {
                return Err(format!("cell {cell:?} is not of the group that covers it"));
            }
        }
    }
    if nodes != grug.nodes.len() || units != grug.blocks.len() || cells != grug.table.len() {
        return Err("nodes, blocks or cells are out of reach".into());
    }
    for (prim, own) in finite_prims(prims) {
        if !grug.bounds.contains(own) {
            return Err(format!("triangle {} leaves the bounds", prim.0));
        }
        for corner in prims.corners(prim) {
            let cell = std::array::from_fn(|axis| grug.lattice.cell(axis, f64::from(corner[axis])));
            let group = grug.table[grug.hash.of(cell)] as usize;
            if !forest.holds(group + BOUNDS, corner, prim.0) {
                return Err(format!("the group at {corner} does not hold triangle {}", prim.0));
            }
        }
    }
    Ok(())
}
