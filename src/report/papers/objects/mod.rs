//! The primitives of the papers' scenes as they are, not as triangles: spheres, cone mantles, polygons, patches.
//!
//! Rays meet them in f64. Their boxes are `f32`, rounded outward with a margin for the tests' own error, so a structure
//! over the boxes loses no hit.

mod bounds;
mod cone;
mod polygon;
mod solid;
mod sphere;

#[cfg(test)]
mod tests;

pub use solid::{Sides, Solid, SolidHit, SolidRay, Solids};
