/// A stream of numbers that depends on its seed and place only.
#[derive(Clone, Copy, Debug)]
pub(super) struct Random(u64);

impl Random {
    /// The stream of `place` under `seed`.
    pub(super) fn new(seed: u64, place: u64) -> Self {
        Self(mixed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ mixed(place)))
    }

    /// In [0, 1), with 53 random bits.
    pub(super) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mixed(self.0) >> 11) as f64 / 9_007_199_254_740_992.0
    }
}

/// The finalizer of `SplitMix64` (Steele, Lea, Flood, "Fast Splittable Pseudorandom Number Generators", 2014).
fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
