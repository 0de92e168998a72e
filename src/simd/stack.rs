use std::{fmt, mem::MaybeUninit};

/// Up to `N` values, the last pushed the first to pop. Made without writing its memory, which for a walk of a few nodes would be most of the
/// work.
pub struct Stack<T, const N: usize> {
    items: [MaybeUninit<T>; N],
    /// At most N; the items before it have been written.
    len: usize,
}

impl<T, const N: usize> fmt::Debug for Stack<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Stack").field("len", &self.len).finish_non_exhaustive()
    }
}

impl<T: Copy, const N: usize> Stack<T, N> {
    /// An empty stack.
    #[inline(always)]
    pub fn new() -> Self {
        Self { items: [const { MaybeUninit::uninit() }; N], len: 0 }
    }

    /// Adds a value. Panics when the stack is full.
    #[inline(always)]
    pub fn push(&mut self, value: T) {
        self.items[self.len].write(value);
        self.len += 1;
    }

    /// Takes the last value.
    #[inline(always)]
    pub fn pop(&mut self) -> Option<T> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: items below `len` have been written, and this one was.
        Some(unsafe { self.items[self.len].assume_init() })
    }
}

impl<T: Copy, const N: usize> Default for Stack<T, N> {
    fn default() -> Self {
        Self::new()
    }
}
