//! SIMD levels, the wide types of each, and the one dispatch into them. The only home of `unsafe`.
//!
//! Code above is generic over `S:` [`Simd`] and marked `#[inline(always)]`; [`dispatch`] enters it once a
//! tile or batch through a function that carries the level's `#[target_feature]`, so that everything below
//! is compiled for the level. Results never depend on the level: no kernel contracts `a * b + c` where a
//! result is kept.

mod barrier;
mod dispatch;
mod float_mode;
mod lanes;
mod level;
mod ordered;
mod prefetch;
mod scalar;
mod stack;
mod texels;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use barrier::branch_barrier;
pub use dispatch::{Task, dispatch};
pub use float_mode::{FloatModeError, check_float_mode};
pub use lanes::{Halves, Lanes, Simd};
pub use level::SimdLevel;
pub use ordered::{LEAST_KEY, key_floor, last_key};
pub use prefetch::{prefetch, prefetch_either};
pub use scalar::{Array, Scalar};
pub use stack::Stack;
pub use texels::Texels;

#[cfg(test)]
mod float_mode_tests;
#[cfg(test)]
mod tests;
