//! Clips and times to a pose; pose to world-space vertices.
//!
//! Key times and the pose are `f64`; transcendental functions come from the `libm` crate, so that the same
//! input gives the same bytes on every machine.

mod bounds;
mod class;
mod clock;
mod deform;
mod deform_fast;
mod left_out;
mod normals;
mod pose;
mod quat;
mod sampler;
mod transform;

pub use bounds::animation_bounds;
pub use class::{MotionClass, classify};
pub use clock::loop_time;
pub(crate) use deform::whole_placement;
pub use deform::{
    DEFORM_GRAIN, deform, deform_parallel, deform_parallel_as, deform_range, deform_range_as, deform_range_at,
    deform_unrounded,
};
pub use left_out::{LeftOut, left_out};
pub use normals::{vertex_normal, vertex_tangent};
pub use pose::{ActiveClip, Fade, Pose};
