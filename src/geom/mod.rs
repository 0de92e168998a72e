//! Plain geometric values: boxes, rays, hits, borrowed triangle views. No allocation.

mod aabb;
pub mod exact;
mod hit;
mod leave;
mod precision;
mod ray;
mod triangles;

pub use aabb::Aabb;
pub use hit::{Hit, InstanceId, PrimId};
pub(crate) use leave::INWARD;
pub use leave::leave;
pub use precision::{Forms, Precision};
pub use ray::Ray;
pub use triangles::Triangles;
