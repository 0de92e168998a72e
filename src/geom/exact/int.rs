#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "counts of bits are small; halves of wide products are taken on purpose"
)]

use std::cmp::Ordering;

/// Limbs an [`Int`] can hold.
///
/// Positions scaled to integers have at most 277 bits, their differences 278, sums of six triple products 837
/// (14 limbs); the product of two such sums fits in 28. Aligned comparisons add no limb ([`cmp_scaled`]).
const LIMBS: usize = 28;

/// A signed integer of up to 1792 bits on the stack; work is proportional to the limbs in use.
#[derive(Clone, Copy)]
pub(super) struct Int {
    negative: bool,
    /// Limbs in use; the highest of them is nonzero.
    len: usize,
    limbs: [u64; LIMBS],
}

impl Int {
    pub(super) const ZERO: Self = Self { negative: false, len: 0, limbs: [0; LIMBS] };

    /// `mantissa * 2^shift`.
    pub(super) fn from_scaled(mantissa: i32, shift: u32) -> Self {
        let mut out = Self::ZERO;
        if mantissa != 0 {
            out.negative = mantissa < 0;
            out.limbs[0] = u64::from(mantissa.unsigned_abs());
            out.len = 1;
            out = out.shl(shift);
        }
        out
    }

    /// -1, 0 or 1.
    pub(super) fn signum(&self) -> i32 {
        match (self.len, self.negative) {
            (0, _) => 0,
            (_, true) => -1,
            (_, false) => 1,
        }
    }

    /// The same magnitude with the sign times `sign`.
    pub(super) fn times_sign(mut self, sign: i32) -> Self {
        self.negative ^= sign < 0;
        self
    }

    fn digits(&self) -> &[u64] {
        &self.limbs[..self.len]
    }

    fn trim(mut self) -> Self {
        while self.len > 0 && self.limbs[self.len - 1] == 0 {
            self.len -= 1;
        }
        self
    }

    /// Number of significant bits of the magnitude.
    pub(super) fn bits(&self) -> i32 {
        match self.digits().last() {
            Some(top) => self.len as i32 * 64 - top.leading_zeros() as i32,
            None => 0,
        }
    }

    pub(super) fn shl(&self, shift: u32) -> Self {
        if self.len == 0 || shift == 0 {
            return *self;
        }
        let (whole, part) = ((shift / 64) as usize, shift % 64);
        let mut out = Self { negative: self.negative, len: self.len + whole, ..Self::ZERO };
        let mut carry = 0;
        for (i, &limb) in self.digits().iter().enumerate() {
            out.limbs[i + whole] = (limb << part) | carry;
            carry = if part == 0 { 0 } else { limb >> (64 - part) };
        }
        if carry != 0 {
            out.limbs[out.len] = carry;
            out.len += 1;
        }
        out
    }

    /// The magnitude halved, rounded down.
    fn halved(mut self) -> Self {
        let mut carry = 0;
        for limb in self.limbs[..self.len].iter_mut().rev() {
            let next = *limb << 63;
            *limb = (*limb >> 1) | carry;
            carry = next;
        }
        self.trim()
    }

    fn cmp_magnitude(&self, other: &Self) -> Ordering {
        self.len.cmp(&other.len).then_with(|| self.digits().iter().rev().cmp(other.digits().iter().rev()))
    }

    fn add_magnitude(&self, other: &Self, negative: bool) -> Self {
        let (long, short) = if self.len >= other.len { (self, other) } else { (other, self) };
        let mut out = Self { negative, ..*long };
        let mut carry = false;
        for i in 0..long.len {
            if i >= short.len && !carry {
                break;
            }
            let (sum, c0) = out.limbs[i].overflowing_add(short.limbs[i]);
            let (sum, c1) = sum.overflowing_add(u64::from(carry));
            out.limbs[i] = sum;
            carry = c0 | c1;
        }
        if carry {
            out.limbs[out.len] = 1;
            out.len += 1;
        }
        out
    }

    /// `self - other` in magnitudes, where `self` is the greater.
    fn sub_magnitude(&self, other: &Self, negative: bool) -> Self {
        let mut out = Self { negative, ..*self };
        let mut borrow = false;
        for i in 0..self.len {
            let (diff, b0) = out.limbs[i].overflowing_sub(other.limbs[i]);
            let (diff, b1) = diff.overflowing_sub(u64::from(borrow));
            out.limbs[i] = diff;
            borrow = b0 | b1;
        }
        out.trim()
    }

    pub(super) fn add(&self, other: &Self) -> Self {
        if self.negative == other.negative {
            return self.add_magnitude(other, self.negative);
        }
        match self.cmp_magnitude(other) {
            Ordering::Equal => Self::ZERO,
            Ordering::Greater => self.sub_magnitude(other, self.negative),
            Ordering::Less => other.sub_magnitude(self, other.negative),
        }
    }

    pub(super) fn sub(&self, other: &Self) -> Self {
        self.add(&other.times_sign(-1))
    }

    pub(super) fn mul(&self, other: &Self) -> Self {
        if self.len == 0 || other.len == 0 {
            return Self::ZERO;
        }
        let mut out = Self { negative: self.negative != other.negative, len: self.len + other.len, ..Self::ZERO };
        for (i, &a) in self.digits().iter().enumerate() {
            let mut carry = 0;
            for (j, &b) in other.digits().iter().enumerate() {
                let sum = u128::from(a) * u128::from(b) + u128::from(out.limbs[i + j]) + carry;
                out.limbs[i + j] = low(sum);
                carry = sum >> 64;
            }
            out.limbs[i + other.len] = low(carry);
        }
        out.trim()
    }

    /// `self * 2^exponent` in f64 with a relative error of at most 2^-52; the result must lie in its normal range.
    pub(super) fn to_f64(self, exponent: i32) -> f64 {
        let magnitude = match *self.digits() {
            [] => return 0.0,
            [.., next, top] => top as f64 * TWO_64 + next as f64,
            [top] => top as f64,
        };
        let exponent = exponent + 64 * (self.len as i32 - 2).max(0);
        let magnitude = libm::scalbn(magnitude, exponent);
        if self.negative { -magnitude } else { magnitude }
    }
}

const TWO_64: f64 = 18_446_744_073_709_551_616.0;

fn low(wide: u128) -> u64 {
    (wide & u128::from(u64::MAX)) as u64
}

/// Compares `a * 2^a_exponent` with `b * 2^b_exponent`.
pub(super) fn cmp_scaled(a: &Int, a_exponent: i32, b: &Int, b_exponent: i32) -> Ordering {
    let sign = a.signum();
    if sign != b.signum() || sign == 0 {
        return sign.cmp(&b.signum());
    }
    let magnitude = (a.bits() + a_exponent).cmp(&(b.bits() + b_exponent)).then_with(|| {
        // Equal leading bits: the one that is shifted becomes as long as the other.
        let shift = a_exponent - b_exponent;
        if shift >= 0 {
            a.shl(shift.unsigned_abs()).cmp_magnitude(b)
        } else {
            a.cmp_magnitude(&b.shl(shift.unsigned_abs()))
        }
    });
    if sign < 0 { magnitude.reverse() } else { magnitude }
}

/// `numerator / denominator * 2^exponent` rounded to the nearest f32, ties to even; 0 is +0.
///
/// The denominator must not be 0. Beyond the range of f32 the result is infinite.
pub(super) fn quotient_f32(numerator: &Int, denominator: &Int, exponent: i32) -> f32 {
    if numerator.len == 0 {
        return 0.0;
    }
    let negative = numerator.negative != denominator.negative;
    // Scale so that the quotient has 26 or 27 bits, then divide bit by bit.
    let shift = 26 - (numerator.bits() - denominator.bits());
    let mut rest = numerator.shl(shift.max(0).unsigned_abs());
    rest.negative = false;
    let mut step = denominator.shl(((-shift).max(0) + 26).unsigned_abs());
    let mut quotient = 0_u64;
    for _ in 0..=26 {
        quotient <<= 1;
        if rest.cmp_magnitude(&step) != Ordering::Less {
            rest = rest.sub_magnitude(&step, false);
            quotient |= 1;
        }
        step = step.halved();
    }
    let sticky = u64::from(rest.len != 0);
    let magnitude = round_f32((quotient << 1) | sticky, exponent - shift - 1);
    if negative { -magnitude } else { magnitude }
}

/// `bits * 2^exponent` to nearest even; `bits` has more than 25 significant bits.
fn round_f32(bits: u64, exponent: i32) -> f32 {
    let top = 63 - bits.leading_zeros() as i32 + exponent;
    let unit = (top - 23).max(-149);
    let drop = (unit - exponent).unsigned_abs();
    if drop > 62 {
        return 0.0;
    }
    let (kept, rest, half) = (bits >> drop, bits & ((1 << drop) - 1), 1_u64 << (drop - 1));
    let kept = kept + u64::from(rest > half || (rest == half && kept & 1 == 1));
    libm::scalbn(kept as f64, unit) as f32
}
