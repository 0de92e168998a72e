//! What touches what, and when: exact and certified tests, one file a question.
//!
//! | question | answer | guarantee |
//! |---|---|---|
//! | [`triangles_meet`], [`triangle_contact`] | whether two closed triangles share a point, and which | exact for every finite input |
//! | [`triangle_meets_box`] | whether a triangle touches a box | exact |
//! | [`triangle_meets_sphere`], [`triangle_meets_capsule`] | whether it touches a ball or a capsule | in f64 |
//! | [`closest_on_triangle`], [`triangle_distance`] | nearest points | in f64; 0 exactly for triangles that meet |
//! | [`boxes_meet`], [`box_pairs`] | which closed boxes share a point | exact, infinite bounds included |
//! | [`sweep_box`] | when a moving box first touches one at rest | exact decision, times within 2^-51 |
//! | [`ray_box`] | where a ray enters and leaves a closed box | exact decision, parameters within 2^-51 |
//! | [`Continuous`] | when a moving vertex meets a moving face, or a moving edge another | no contact is missed, none reported late |
//!
//! Triangles, boxes and rays are f32 and taken as exact reals; continuous queries take f64. What is not finite meets nothing (infinite
//! bounds of boxes are legal). Nothing panics. Answers are the same on every machine: plain f64 arithmetic, no contraction, no system
//! mathematics.

mod boxes;
mod closest;
mod continuous;
mod overlap;
mod predicates;
mod triangles;

pub use boxes::{Passage, box_pairs, boxes_meet, ray_box, sweep_box};
pub use closest::{Nearest, closest_on_triangle, triangle_distance};
pub use continuous::{Continuous, Impact};
pub use overlap::{triangle_meets_box, triangle_meets_capsule, triangle_meets_sphere};
pub use triangles::{TriangleContact, triangle_contact, triangles_meet};
