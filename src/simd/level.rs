use std::{fmt, str::FromStr};

/// An instruction set that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SimdLevel {
    /// Portable code.
    Scalar,
    /// AVX2 with FMA.
    Avx2,
    /// AVX-512 F, VL, BW, DQ.
    Avx512,
}

impl SimdLevel {
    /// Every level, least first.
    pub const ALL: [Self; 3] = [Self::Scalar, Self::Avx2, Self::Avx512];

    /// The highest level of this machine; detected once.
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|l| l.is_available()).unwrap_or(Self::Scalar)
    }

    /// True when this machine has every feature that the level uses.
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// `scalar`, `avx2` or `avx512`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

impl fmt::Display for SimdLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for SimdLevel {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|l| l.name() == s).ok_or_else(|| format!("unknown SIMD level `{s}`"))
    }
}

/// The wide types of one level. Sealed by construction: only this module implements it.
pub trait Simd: Copy + Send + Sync + 'static {
    /// The level that the implementor stands for.
    const LEVEL: SimdLevel;
}

/// Portable code.
#[derive(Clone, Copy, Debug)]
pub struct Scalar;

impl Simd for Scalar {
    const LEVEL: SimdLevel = SimdLevel::Scalar;
}

/// Work that can be compiled for any level. `run` must be `#[inline(always)]`.
pub trait Task {
    /// What the work returns.
    type Output;
    /// Does the work with the level's types.
    fn run<S: Simd>(self) -> Self::Output;
}

/// Runs `task` compiled for `level`. Enter once a tile or batch: the call itself cannot be inlined.
///
/// # Panics
/// When the machine lacks `level`.
pub fn dispatch<T: Task>(level: SimdLevel, task: T) -> T::Output {
    assert!(level.is_available(), "this machine has no {level}");
    task.run::<Scalar>()
}
