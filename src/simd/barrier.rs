/// Returns `value`; the compiler may not turn a branch around the call into a conditional move.
#[inline(always)]
pub fn branch_barrier(value: u32) -> u32 {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    {
        let mut value = value;
        // SAFETY: the assembly is empty; it touches neither memory, stack nor flags.
        unsafe { std::arch::asm!("/* {0:e} */", inout(reg) value, options(nomem, nostack, preserves_flags)) };
        value
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    value
}
