//! Whether this thread computes as Rust assumes: rounding to nearest, denormals kept, no traps.
//!
//! Rust may not change the mode, but C code in the same process can (`-ffast-math` at link time, audio libraries). Every
//! error bound of this crate and the sameness of its bytes rest on the default, so entry points ask once a batch or frame.

/// A floating point mode under which answers would be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FloatModeError {
    /// Denormal results become zero.
    #[error("foreign code made this thread flush denormal results to zero: answers would be wrong")]
    FlushToZero,
    /// Denormal inputs count as zero.
    #[error("foreign code made this thread take denormal inputs as zero: answers would be wrong")]
    DenormalsAreZero,
    /// Results are not rounded to the nearest.
    #[error("foreign code changed this thread's rounding of floating point results: answers would be wrong")]
    Rounding,
    /// Inexact, infinite or invalid results stop the process.
    #[error("foreign code made this thread's floating point exceptions trap: queries would stop the process")]
    Traps,
}

/// Asks whether the calling thread's floating point mode is Rust's.
///
/// Cost: a few nanoseconds on `x86_64`, some hundred elsewhere. Single-ray queries do not ask; whoever shares a thread with
/// foreign code asks once before a run of them.
///
/// # Errors
/// What is wrong with the mode, the first thing found.
pub fn check_float_mode() -> Result<(), FloatModeError> {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    return x86::check();
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    probe::check()
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
pub(super) mod x86 {
    use super::FloatModeError;

    const DENORMALS_ARE_ZERO: u32 = 1 << 6;
    /// All six exceptions masked.
    const MASKED: u32 = 0x3f << 7;
    const ROUNDING: u32 = 3 << 13;
    const FLUSH_TO_ZERO: u32 = 1 << 15;

    /// The control and status register of SSE and AVX.
    pub(in crate::simd) fn mxcsr() -> u32 {
        let mut value = 0_u32;
        // SAFETY: the instruction stores four bytes where `value` lies; every x86_64 has it.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut value, options(nostack, preserves_flags)) };
        value
    }

    #[inline]
    pub(super) fn check() -> Result<(), FloatModeError> {
        let mode = mxcsr();
        if mode & FLUSH_TO_ZERO != 0 {
            Err(FloatModeError::FlushToZero)
        } else if mode & DENORMALS_ARE_ZERO != 0 {
            Err(FloatModeError::DenormalsAreZero)
        } else if mode & ROUNDING != 0 {
            Err(FloatModeError::Rounding)
        } else if mode & MASKED != MASKED {
            Err(FloatModeError::Traps)
        } else {
            Ok(())
        }
    }
}

/// The same by arithmetic, for targets whose registers are not read. It cannot see traps: it would trap.
#[cfg(any(test, miri, not(target_arch = "x86_64")))]
pub(super) mod probe {
    use std::hint::black_box;

    use super::FloatModeError;

    pub(in crate::simd) fn check() -> Result<(), FloatModeError> {
        // Looked at as bits: a comparison would itself take denormals as zero.
        let halved = (black_box(f32::MIN_POSITIVE) * black_box(0.5)).to_bits();
        let halved_wide = (black_box(f64::MIN_POSITIVE) * black_box(0.5)).to_bits();
        let raised = (black_box(f32::from_bits(1)) * black_box(16_777_216.0)).to_bits();
        let raised_wide = (black_box(f64::from_bits(1)) * black_box(9_007_199_254_740_992.0)).to_bits();
        let tiny = black_box(f32::EPSILON * 0.25);
        let up = (black_box(1.0_f32) + tiny).to_bits();
        let down = (black_box(-1.0_f32) - tiny).to_bits();
        let near = (black_box(1.0_f32) + tiny * black_box(3.0)).to_bits();
        if raised == 0 || raised_wide == 0 {
            // Flushing inputs flushes results too on most machines; the graver one is named.
            return Err(if halved == 0 { FloatModeError::FlushToZero } else { FloatModeError::DenormalsAreZero });
        }
        if halved == 0 || halved_wide == 0 {
            return Err(FloatModeError::FlushToZero);
        }
        let nearest = up == 1.0_f32.to_bits() && down == (-1.0_f32).to_bits();
        if nearest && near == 1.0_f32.next_up().to_bits() { Ok(()) } else { Err(FloatModeError::Rounding) }
    }
}
