/// The bits of a key that hold the lane.
pub(super) const LANE: u32 = 7;

/// Added to keys, so that those of 0 differ from no key.
pub(super) const BASE: u32 = LEAST_KEY;

/// The least key that [`Simd::descending`](super::Simd::descending) makes.
pub const LEAST_KEY: u32 = 8;

/// The key by which [`Simd::descending`](super::Simd::descending) orders a number of a lane; greater than 0.
#[inline(always)]
pub(super) fn key(number: f32, lane: u32) -> u32 {
    (number.to_bits() & !LANE | lane) + BASE
}

/// A number that is at most the one that a key was made of, and less by at most seven units in its last place.
#[inline(always)]
pub fn key_floor(key: u32) -> f32 {
    f32::from_bits((key & !LANE).wrapping_sub(BASE))
}
