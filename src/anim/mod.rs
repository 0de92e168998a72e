//! Clips and times to a pose; pose to world-space vertices.
//!
//! Key times and the pose are `f64`; transcendental functions come from the `libm` crate, so that the same
//! input gives the same bytes on every machine.

mod class;
mod deform;
mod pose;

pub use class::{MotionClass, classify};
pub use deform::{deform, vertex_normal, vertex_tangent};
pub use pose::{ActiveClip, Pose};
