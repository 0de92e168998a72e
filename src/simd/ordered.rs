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

/// The greatest key whose [`key_floor`] is at most a number that is not negative.
#[inline(always)]
pub fn last_key(number: f32) -> u32 {
    (number.to_bits() + BASE) | LANE
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![Just(0.0_f32), Just(f32::MIN_POSITIVE), Just(f32::INFINITY), 0.0_f32..1.0, 0.0_f32..f32::MAX]
    }

    proptest! {
        #[test]
        fn keys_up_to_the_last_are_those_whose_floor_is_within(a in number(), b in number(), near in -20_i32..20, lane in 0_u32..8) {
            let beside = f32::from_bits(b.to_bits().saturating_add_signed(near).min(f32::INFINITY.to_bits()));
            for number in [a, beside] {
                let key = key(number.min(f32::MAX), lane);
                prop_assert_eq!(key <= last_key(b), key_floor(key) <= b, "{} {}", number, b);
            }
        }
    }
}
