//! What touches what, how far apart, and when: worlds of scenes and meshes, and the exact and certified tests below them, one file a question.
//!
//! [`CollisionWorld`] holds scenes with their players, meshes and boxes; [`CollisionWorld::snapshot`] takes an immutable picture of it, and
//! every question is asked of that [`Snapshot`], from any number of threads:
//!
//! | question | answer | guarantee | cost |
//! |---|---|---|---|
//! | [`Snapshot::closest_hit`], [`Snapshot::any_hit`], [`Snapshot::all_hits`], [`Snapshot::closest_hits`] | what a ray hits, in order | exact | a walk, about a microsecond; batches in packets |
//! | [`Snapshot::overlaps`] and its kin | triangles that touch a [`Shape`] | exact for boxes, triangles, [`ConvexHull`]s and parts; in f64 for balls and capsules | a walk, tens of ns a triangle near by |
//! | [`Snapshot::closest_point`], [`Snapshot::distance_between`] | nearest points | in f64; 0 exactly for what meets | a few microseconds; some 0.3 µs for each pair of triangles near the answer |
//! | [`Snapshot::signed_distance`], [`Snapshot::winding_number`] | inside or outside of closed parts | sign exact, also where they cut through themselves | as the closest point |
//! | [`Snapshot::contact_pairs`], [`Snapshot::contacts`] | triangles that meet, with segment, normal and depth | which: exact; where: 2^-32 of an edge | 50 to 100 ns for each pair whose boxes meet |
//! | [`ContactTracker`] | contacts that begin, persist and end | | a sort |
//! | [`Snapshot::sweep`] | when a moving ball, capsule or box first touches anything | no contact missed, none late | a microsecond or less for each triangle on the way |
//! | [`Snapshot::moving_contacts`] | what touches between two snapshots | no contact missed, none late | a fraction of a microsecond for each pair of features near by |
//!
//! Deterministic: the answers follow from the vertices alone and come in a fixed order, whatever the threads, the SIMD level, the structures and
//! the snapshots before. Conservative, and never seen in an answer: boxes of trees, swept boxes, lower bounds of distances and times.
//! Invalid input is a [`CollideError`], or meets nothing where the test of a single primitive has no error to give; nothing panics.
//!
//! Every answer names its part ([`Snapshot::part`]: node, path, scene), triangle, weights of corners, texture coordinates, point and
//! normals: a [`Surface`], which [`Snapshot::surface`] and [`Snapshot::named`] also make of the bare hits of batches.
//!
//! [`BroadPhase`] stands by itself: the pairs of many moving boxes, frame after frame.
//!
//! Below the worlds are tests of single primitives:
//!
//! | question | answer | guarantee |
//! |---|---|---|
//! | [`triangles_meet`], [`triangle_contact`] | whether two closed triangles share a point, and which | exact for every finite input |
//! | [`triangle_meets_box`] | whether a triangle touches a box | exact |
//! | [`triangle_meets_sphere`], [`triangle_meets_capsule`] | whether it touches a ball or a capsule | exact |
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
mod broad;
mod closest;
mod contacts;
mod continuous;
mod distance;
mod hull;
mod inside;
mod moving;
mod overlap;
mod overlapping;
mod predicates;
mod ray;
mod snapshot;
mod surface;
mod sweep;
mod tree;
mod triangles;
mod world;

pub use boxes::{Passage, box_pairs, boxes_meet, ray_box, sweep_box};
pub use broad::{BroadMethod, BroadPhase};
pub use closest::{Nearest, closest_on_triangle, triangle_distance};
pub use contacts::{
    Contact, ContactEvent, ContactLevel, ContactOptions, ContactPhase, ContactTracker, PartFilter, TrianglePair,
};
pub use continuous::{Continuous, Impact};
pub use distance::{ClosestPoint, PartDistance};
pub use hull::ConvexHull;
pub use inside::SignedDistance;
pub use moving::{Features, MovingContact};
pub use overlap::{triangle_meets_box, triangle_meets_capsule, triangle_meets_sphere};
pub use overlapping::{Overlap, Shape, oriented_box};
pub use ray::RayHit;
pub use snapshot::{PartView, Snapshot};
pub use surface::{Side, Surface};
pub use sweep::{Mover, SweepHit};
pub use triangles::{TriangleContact, triangle_contact, triangles_meet};
pub use world::{CollideError, CollisionConfig, CollisionWorld, Layers, ObjectId, PartId};
