//! Shading normals and tangents of vertices, computed at the first hit of a frame and kept for the others.
//!
//! Every entry carries the number of the frame it was made in, so a frame begins without clearing anything.
//! Two threads that meet at the same vertex write the same bits, so plain relaxed stores behind one release
//! suffice.

use std::sync::atomic::{
    AtomicU32,
    Ordering::{Acquire, Relaxed, Release},
};

use glam::Vec3;

/// Four words: three of payload and the stamp; the stamp's top bit says that there is a value.
#[derive(Debug, Default)]
struct Entry {
    payload: [AtomicU32; 3],
    stamp: AtomicU32,
}

/// A vector a vertex, made on demand.
#[derive(Debug, Default)]
pub(crate) struct VertexCache {
    entries: Vec<Entry>,
    frame: u32,
}

const PRESENT: u32 = 1 << 31;
const NEGATIVE: u32 = 1 << 30;
const FRAMES: u32 = NEGATIVE - 1;

impl VertexCache {
    /// Begins a frame in which every entry is unknown, with room for `len` entries. Allocates only to grow.
    pub(crate) fn begin(&mut self, len: usize) {
        if self.entries.len() < len {
            self.entries.resize_with(len, Entry::default);
        }
        self.frame += 1;
        if self.frame > FRAMES {
            self.frame = 1;
            for entry in &self.entries {
                entry.stamp.store(0, Relaxed);
            }
        }
    }

    /// The vector at `index` with a sign, from the cache or by `make`; `make` must always return the same for
    /// an index within a frame.
    #[inline(always)]
    pub(crate) fn get(&self, index: usize, make: impl FnOnce() -> Option<(Vec3, f32)>) -> Option<(Vec3, f32)> {
        let Some(entry) = self.entries.get(index) else { return make() };
        let stamp = entry.stamp.load(Acquire);
        if stamp & FRAMES == self.frame {
            return (stamp & PRESENT != 0).then(|| {
                let word = |i: usize| f32::from_bits(entry.payload[i].load(Relaxed));
                (Vec3::new(word(0), word(1), word(2)), if stamp & NEGATIVE != 0 { -1.0 } else { 1.0 })
            });
        }
        let made = make();
        let mut stamp = self.frame;
        if let Some((v, sign)) = made {
            for (word, x) in entry.payload.iter().zip([v.x, v.y, v.z]) {
                word.store(x.to_bits(), Relaxed);
            }
            stamp |= PRESENT | if sign < 0.0 { NEGATIVE } else { 0 };
        }
        entry.stamp.store(stamp, Release);
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_made_once_a_frame() {
        let mut cache = VertexCache::default();
        for frame in 0..3 {
            cache.begin(4);
            let value = Some((Vec3::splat(frame as f32), -1.0));
            assert_eq!(cache.get(2, || value), value);
            assert_eq!(cache.get(2, || unreachable!()), value);
            assert_eq!(cache.get(1, || None), None);
            assert_eq!(cache.get(1, || unreachable!()), None);
        }
    }

    #[test]
    fn an_index_past_the_end_is_computed_each_time() {
        let cache = VertexCache::default();
        assert_eq!(cache.get(9, || Some((Vec3::X, 1.0))), Some((Vec3::X, 1.0)));
    }

    #[test]
    fn frame_numbers_may_run_over() {
        let mut cache = VertexCache { frame: FRAMES - 1, ..VertexCache::default() };
        for frame in 0..4 {
            cache.begin(1);
            let value = Some((Vec3::splat(frame as f32), 1.0));
            assert_eq!(cache.get(0, || value), value);
        }
    }
}
