//! The float mode's two checks against each other, under modes set here and put back at once.

use super::float_mode::{FloatModeError, check_float_mode, probe};

#[test]
fn rust_starts_threads_in_its_own_mode() {
    assert_eq!(check_float_mode(), Ok(()));
    assert_eq!(probe::check(), Ok(()));
    assert_eq!(std::thread::spawn(check_float_mode).join().unwrap(), Ok(()));
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
mod x86 {
    use super::{super::float_mode::x86::mxcsr, FloatModeError, check_float_mode, probe};

    fn set_mxcsr(value: u32) {
        // SAFETY: the instruction loads four bytes from where `value` lies, all of whose bits exist in the register. Callers
        // put the mode back before any other arithmetic.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack, preserves_flags)) };
    }

    /// Both checks with these bits of the register flipped.
    fn checks(flipped: u32) -> [Result<(), FloatModeError>; 2] {
        let before = mxcsr();
        set_mxcsr(before ^ flipped);
        let found = [check_float_mode(), probe::check()];
        set_mxcsr(before);
        found
    }

    #[test]
    fn every_mode_that_changes_results_is_found_by_register_and_by_arithmetic() {
        for (bits, due) in [
            (1 << 15, FloatModeError::FlushToZero),
            (1 << 6, FloatModeError::DenormalsAreZero),
            (1 << 13, FloatModeError::Rounding),
            (2 << 13, FloatModeError::Rounding),
            (3 << 13, FloatModeError::Rounding),
            (1 << 15 | 1 << 6, FloatModeError::FlushToZero),
        ] {
            assert_eq!(checks(bits), [Err(due); 2], "{bits:#x}");
        }
        assert_eq!(checks(0), [Ok(()); 2]);
    }

    #[test]
    fn traps_are_found_without_springing_them() {
        for exception in 7..13 {
            let before = mxcsr();
            // Flags that are already up do not trap when unmasked, but the next such operation would.
            set_mxcsr(before & !(1 << exception));
            let found = check_float_mode();
            set_mxcsr(before);
            assert_eq!(found, Err(FloatModeError::Traps), "mask bit {exception}");
        }
    }
}
