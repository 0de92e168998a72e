//! Continuous detection: when a moving vertex meets a moving face, or a moving edge another edge.
//!
//! All corners move along straight lines while t goes from 0 to 1. The vector F(t, u, v) from a point of the one to a point of the other
//! is affine in each of its parameters, so its values over a cell of parameters lie in the hull of its eight values at the cell's corners.
//! Cells whose hull cannot hold 0 are dropped, with every rounding accounted for; the others shrink and split, the earliest first, until
//! the distance at a cell's start is within the tolerance and a look in twice the precision ([`fine`]) cannot rule it out. So no contact
//! is missed, and none is reported late.
//!
//! # Source
//! Wang, Ferguson, Schneider, Jiang, Attene, Panozzo, "A Large-Scale Benchmark and an Inclusion-Based Algorithm for Continuous Collision
//! Detection", 2021, for the inclusion by corners and the order by time. Added here: hulls are tested along the directions that the
//! derivatives give besides the axes, and the hull along a direction cuts the cell (as Sederberg and Nishita's "Curve intersection using
//! Bézier clipping", 1990, cuts a parameter), which converges quadratically where the contact is simple; a face is mapped
//! from a square, so that faces and edges are one case; the search ends by the distance reached, not by the cell's size; and near-misses
//! are looked at again.

mod cell;
mod fine;
mod map;
mod nearest;

use std::collections::BinaryHeap;

use glam::DVec3;

use cell::{Cell, Fate};
use fine::Fine;
use map::Map;
use nearest::nearest;

/// Continuous detection with its settings.
///
/// Lengths are in the units of the coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Continuous {
    /// A contact may be reported where the distance comes within `min_separation + tolerance`. Where `tolerance` is less than rounding
    /// allows, some 2^-43 of the distances between the corners, that takes its place.
    pub tolerance: f64,
    /// Distances up to this one count as contact.
    pub min_separation: f64,
    /// Cells looked at before the search gives up and reports the earliest time that is still open. Each takes a fraction of a microsecond.
    pub max_cells: u32,
}

/// How often a near-miss is looked at in twice the precision.
const LOOKS: u32 = 8;

impl Default for Continuous {
    fn default() -> Self {
        Self { tolerance: 1e-9, min_separation: 0.0, max_cells: 1 << 14 }
    }
}

/// A contact, or what cannot be told from one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// Not after the first contact; in [0, 1].
    pub time: f64,
    /// At `time`, the two come at least this near: at most `min_separation + tolerance` unless the search gave up or rounding hid
    /// the rest.
    pub gap: f64,
    /// Where: weights of the face's second and third corner, or how far along the first and the second edge.
    pub place: [f64; 2],
}

impl Continuous {
    /// When a vertex meets a closed face, while t goes from 0 to 1: `start` and `end` are `[vertex, a, b, c]`.
    ///
    /// `None` only if they surely do not come within `min_separation` of each other. Degenerate faces are legal. Corners that
    /// are not finite meet nothing. Cost: 0.1 to 0.5 µs where the motions lie apart, 2 to 5 µs for a contact, tens where it is
    /// one along an edge; hundreds with a separation much larger than the tolerance. Allocates only when a cell must be split.
    pub fn vertex_face(&self, start: &[DVec3; 4], end: &[DVec3; 4]) -> Option<Impact> {
        self.earliest(&Map::vertex_face(start, end)?, start, end)
    }

    /// When a closed edge meets another, while t goes from 0 to 1: `start` and `end` are `[a0, a1, b0, b1]`, edges a0 a1 and b0 b1.
    ///
    /// As [`Continuous::vertex_face`].
    pub fn edge_edge(&self, start: &[DVec3; 4], end: &[DVec3; 4]) -> Option<Impact> {
        self.earliest(&Map::edge_edge(start, end)?, start, end)
    }

    fn earliest(&self, map: &Map, start: &[DVec3; 4], end: &[DVec3; 4]) -> Option<Impact> {
        let separation = map.scaled(self.min_separation.max(0.0));
        // Below some of the map's errors, f64 shows no gap.
        let enough = separation + map.scaled(self.tolerance.max(0.0)).max(8.0 * map.error.element_sum());
        if map.lie_apart(separation) {
            return None;
        }
        // Every contact is in an open cell, the earliest cell first.
        let mut open = BinaryHeap::new();
        let mut cell = Cell::ALL;
        let (mut fine, mut looks) = (None, 0);
        for _ in 0..self.max_cells {
            match cell.work(map, separation) {
                Fate::Empty => cell = open.pop()?,
                Fate::Open(rest, other) => {
                    open.extend(other);
                    cell = rest;
                    if let Some(mut earlier) = open.peek_mut().filter(|c| c.begins() < cell.begins()) {
                        std::mem::swap(&mut *earlier, &mut cell);
                    }
                }
            }
            // Nothing happens before this cell begins: if the two are near enough then, it is over, unless a closer look finds no contact.
            loop {
                let (gap, place) = nearest(map, cell.begins());
                if gap > enough && !cell.is_spent() {
                    break;
                }
                let fine = fine.get_or_insert_with(|| Fine::new(start, end, map.is_face(), map.scale()));
                looks += 1;
                if looks > LOOKS || !fine.rules_out(map, &cell, separation) {
                    return Some(map.impact(cell.begins(), gap, place));
                }
                cell = open.pop()?;
            }
        }
        let (gap, place) = nearest(map, cell.begins());
        Some(map.impact(cell.begins(), gap, place))
    }
}
