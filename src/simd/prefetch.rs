/// Lines that [`prefetch_either`] asks for.
#[cfg(all(target_arch = "x86_64", not(miri)))]
const LINES: usize = 3;

/// Asks for the memory of one item of a slice, which will be needed soon. Changes nothing else; there need be no such item.
#[inline(always)]
pub fn prefetch<T>(slice: &[T], at: usize) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    if let Some(item) = slice.get(at) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: the instruction is a part of x86-64's baseline and reads nothing that the program can see.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(item).cast()) };
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    let _ = (slice, at);
}

/// As [`prefetch`], for the first three cache lines of an item of the one slice or the other, without a branch on which.
#[inline(always)]
pub fn prefetch_either<A, B>(first: bool, a: &[A], b: &[B], at: usize) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let (a, b) = (a.as_ptr().wrapping_add(at).cast::<i8>(), b.as_ptr().wrapping_add(at).cast::<i8>());
        let item = std::hint::select_unpredictable(first, a, b);
        for line in 0..LINES {
            // SAFETY: the instruction takes any address, and reads nothing that the program can see.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(item.wrapping_add(64 * line)) };
        }
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    let _ = (first, a, b, at);
}
