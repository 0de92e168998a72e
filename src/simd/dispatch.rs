#[cfg(target_arch = "x86_64")]
use super::x86::{Avx2, Avx512};
use super::{Scalar, Simd, SimdLevel};

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
#[inline]
pub fn dispatch<T: Task>(level: SimdLevel, task: T) -> T::Output {
    assert!(level.is_available(), "this machine has no {level}");
    match level {
        // SAFETY: the level is available, so the machine has every feature that the function enables.
        #[cfg(target_arch = "x86_64")]
        SimdLevel::Avx512 => unsafe { run_avx512(task) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        SimdLevel::Avx2 => unsafe { run_avx2(task) },
        _ => task.run::<Scalar>(),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx2<T: Task>(task: T) -> T::Output {
    task.run::<Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
fn run_avx512<T: Task>(task: T) -> T::Output {
    task.run::<Avx512>()
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(super) fn call_avx2<T: Task>(task: T) -> T::Output {
    task.run::<Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[inline(never)]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq")]
pub(super) fn call_avx512<T: Task>(task: T) -> T::Output {
    task.run::<Avx512>()
}
