use super::sync::Arc;

/// Buffers that are written again once nobody else holds them.
///
/// A frame takes a free buffer, writes it and keeps it shared with readers; when the last reader lets go it is
/// free again. Two or three turn in steady state: this frame's, the next one's, and what a reader still holds.
#[derive(Debug)]
pub(crate) struct Pool<T> {
    kept: Vec<Arc<T>>,
}

/// More than this are not kept: the rest belong to readers that hold on to old frames.
const KEPT: usize = 4;

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Self { kept: Vec::with_capacity(KEPT) }
    }
}

impl<T> Pool<T> {
    /// A buffer that nobody else holds, as it was left, or a new one.
    pub(crate) fn take(&mut self, make: impl FnOnce() -> T) -> Arc<T> {
        match self.kept.iter_mut().position(|item| Arc::get_mut(item).is_some()) {
            Some(free) => self.kept.swap_remove(free),
            None => Arc::new(make()),
        }
    }

    /// Remembers a buffer for later frames; the oldest remembered one is forgotten when there are too many.
    pub(crate) fn keep(&mut self, item: Arc<T>) {
        if self.kept.len() == KEPT {
            self.kept.remove(0);
        }
        self.kept.push(item);
    }

    /// Runs `f` over every buffer that nobody else holds.
    pub(crate) fn for_each_free(&mut self, f: impl FnMut(&mut T)) {
        self.kept.iter_mut().filter_map(Arc::get_mut).for_each(f);
    }
}
