use super::{Simd, SimdLevel};

/// AVX2 with FMA. Named only by `dispatch`, which checks the machine first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx2;

/// AVX-512 besides. Named only by `dispatch`, which checks the machine first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx512;

impl Simd for Avx2 {
    const LEVEL: SimdLevel = SimdLevel::Avx2;
}

impl Simd for Avx512 {
    const LEVEL: SimdLevel = SimdLevel::Avx512;
}
