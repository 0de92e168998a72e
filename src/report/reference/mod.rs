//! Right answers, to judge the tracer by.
//!
//! Two tracers that share no code with `geom::exact` or `accel`. [`exact`] tests every triangle in integers of any size: the plane
//! equation and the edge functions taken literally, for small sets. [`Reference`] is for large ones: f64 with a bound on
//! every error, in a tree that only leaves out what f64 proves to be out of reach, and [`exact`] wherever a bound leaves a doubt. So both
//! give the same answers, which tests hold.
//!
//! All inputs are f32 and taken as exact reals. A triangle is closed: its edges and corners belong to it. A ray counts as `CLI.md` has it:
//! NaN anywhere, a direction of zero or an empty range is a miss, and so is t beyond the largest f32. Where several triangles share
//! the least t, each of them is a right answer ([`Truth::accepted`]).

pub mod exact;
mod float;
mod interval;
mod judge;
mod tree;
mod truth;

pub use judge::{Tally, Verdict, judge, wilson};
pub use tree::Reference;
pub use truth::{Accepted, Truth};
