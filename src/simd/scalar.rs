use super::{Simd, SimdLevel};

/// Portable code.
#[derive(Clone, Copy, Debug)]
pub struct Scalar;

impl Simd for Scalar {
    const LEVEL: SimdLevel = SimdLevel::Scalar;
}
