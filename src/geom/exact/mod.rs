//! The exact answer to "does this ray meet this triangle, and where".
//!
//! All inputs are f32 and taken as exact reals. With `e1 = v1 - v0`, `e2 = v2 - v0`, `s = origin - v0` (Möller and
//! Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997) four volumes decide everything:
//!
//! ```text
//! D = e1 . (d x e2)    U = s . (d x e2)    V = d . (s x e1)    T = e2 . (s x e1)    W = D - U - V
//! u = U / D            v = V / D           t = T / D
//! ```
//!
//! The triangle is hit when D is not 0, none of U, V, W has the sign opposite to D, and t lies in the ray's range.
//! The volumes are evaluated in f64 with a proven bound; where a rounding is in doubt, in pairs of f64; where a sign, a comparison or
//! still a rounding is in doubt, integers decide: the coordinates are multiples of a power of two, so the volumes are integers of at most
//! 837 bits. Nothing is allocated.

mod estimate;
mod fine;
mod hit;
mod int;
mod measure;
mod ratio;
mod side;
mod volumes;
mod within;

pub use estimate::{BOUND, Quotients};
pub use hit::{RayRange, TriangleHit};
pub use measure::{area, volume};
pub use ratio::Ratio;
pub use side::{side, slope};
pub use within::{point_within, segments_within};
