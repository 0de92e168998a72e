//! Vectors whose components are lanes: one point of a block a lane.
//!
//! The operations and their order are those of `glam`, so that a lane holds what a single point would give, bit for bit.
//!
//! Code over lanes must end up inlined in the function that carries the level's features. Larger steps are not in debug
//! builds: without optimisation every temporary has a place of its own on the stack.

use std::ops::{Add, Mul, Neg, Sub};

use glam::{Vec2, Vec3};

use super::math;
use crate::simd::{Array, Lanes, Texels};

/// Most lanes.
pub(crate) const LANES: usize = 16;

/// A number a lane, in memory.
pub(crate) type Row = [f32; LANES];

/// Lanes of `f32`.
pub(crate) trait Floats: Texels {}

impl<F: Texels> Floats for F {}

/// A single lane.
pub(crate) type One = Array<f32, 1>;

/// The number in a single lane.
#[inline(always)]
pub(crate) fn only(lane: One) -> f32 {
    let mut out = [0.0];
    lane.store(&mut out);
    out[0]
}

/// Two components.
#[derive(Clone, Copy, Debug)]
pub(crate) struct V2<F> {
    pub(crate) x: F,
    pub(crate) y: F,
}

/// Three components.
#[derive(Clone, Copy, Debug)]
pub(crate) struct V3<F> {
    pub(crate) x: F,
    pub(crate) y: F,
    pub(crate) z: F,
}

impl<F: Floats> V2<F> {
    /// The same vector in every lane.
    #[inline(always)]
    pub(crate) fn splat(v: Vec2) -> Self {
        Self { x: F::splat(v.x), y: F::splat(v.y) }
    }

    #[inline(always)]
    pub(crate) fn load(rows: &[Row; 2]) -> Self {
        Self { x: F::load(&rows[0]), y: F::load(&rows[1]) }
    }

    #[inline(always)]
    pub(crate) fn length_squared(self) -> F {
        self.x * self.x + self.y * self.y
    }

    /// Lanes of `a` in `mask`, of `b` elsewhere.
    #[inline(always)]
    pub(crate) fn select(mask: u32, a: Self, b: Self) -> Self {
        Self { x: F::select(mask, a.x, b.x), y: F::select(mask, a.y, b.y) }
    }
}

impl<F: Floats> V3<F> {
    /// The same vector in every lane.
    #[inline(always)]
    pub(crate) fn splat(v: Vec3) -> Self {
        Self { x: F::splat(v.x), y: F::splat(v.y), z: F::splat(v.z) }
    }

    /// The same number in every component.
    #[inline(always)]
    pub(crate) fn all(x: F) -> Self {
        Self { x, y: x, z: x }
    }

    #[inline(always)]
    pub(crate) fn zero() -> Self {
        Self::all(F::splat(0.0))
    }

    #[inline(always)]
    pub(crate) fn load(rows: &[Row; 3]) -> Self {
        Self { x: F::load(&rows[0]), y: F::load(&rows[1]), z: F::load(&rows[2]) }
    }

    #[inline(always)]
    pub(crate) fn rows(self) -> [Row; 3] {
        [row(self.x), row(self.y), row(self.z)]
    }

    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> F {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub(crate) fn length_squared(self) -> F {
        self.dot(self)
    }

    #[inline(always)]
    pub(crate) fn length(self) -> F {
        self.dot(self).sqrt()
    }

    #[inline(always)]
    pub(crate) fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - other.y * self.z,
            y: self.z * other.x - other.z * self.x,
            z: self.x * other.y - other.x * self.y,
        }
    }

    /// Component by component.
    #[inline(always)]
    pub(crate) fn times(self, other: Self) -> Self {
        Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }

    #[inline(always)]
    pub(crate) fn over(self, divisor: F) -> Self {
        Self { x: self.x / divisor, y: self.y / divisor, z: self.z / divisor }
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self { x: self.x.abs(), y: self.y.abs(), z: self.z.abs() }
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        Self { x: self.x.max(other.x), y: self.y.max(other.y), z: self.z.max(other.z) }
    }

    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        Self { x: self.x.min(other.x), y: self.y.min(other.y), z: self.z.min(other.z) }
    }

    #[inline(always)]
    pub(crate) fn max_element(self) -> F {
        self.x.max(self.y).max(self.z)
    }

    /// Lanes of `a` in `mask`, of `b` elsewhere.
    #[inline(always)]
    pub(crate) fn select(mask: u32, a: Self, b: Self) -> Self {
        Self { x: F::select(mask, a.x, b.x), y: F::select(mask, a.y, b.y), z: F::select(mask, a.z, b.z) }
    }

    /// As [`math::unit_or`].
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn unit_or(self, or: Self) -> Self {
        let scaled = self.over(self.abs().max_element());
        let length = scaled.length();
        let usable = F::splat(1.0).le(length) & length.lt(F::splat(f32::INFINITY));
        Self::select(usable, scaled.over(length), or)
    }

    /// As [`math::mix`].
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn mix(a: Self, b: Self, s: F) -> Self {
        a + (b - a) * s
    }
}

impl V3<One> {
    /// The vector in a single lane.
    #[inline(always)]
    pub(crate) fn only(self) -> Vec3 {
        Vec3::new(only(self.x), only(self.y), only(self.z))
    }
}

macro_rules! component_wise {
    ($vector:ident { $($part:ident),+ }) => {
        impl<F: Floats> Add for $vector<F> {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self { $($part: self.$part + other.$part),+ }
            }
        }

        impl<F: Floats> Sub for $vector<F> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self { $($part: self.$part - other.$part),+ }
            }
        }

        impl<F: Floats> Mul<F> for $vector<F> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, factor: F) -> Self {
                Self { $($part: self.$part * factor),+ }
            }
        }

        impl<F: Floats> Neg for $vector<F> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self { $($part: -self.$part),+ }
            }
        }
    };
}

component_wise!(V2 { x, y });
component_wise!(V3 { x, y, z });

/// Lanes in memory; what lies past the last lane is 0.
#[inline(always)]
pub(crate) fn row<F: Floats>(lanes: F) -> Row {
    let mut out = [0.0; LANES];
    lanes.store(&mut out);
    out
}

/// `x` within [`low`, `high`]; NaN becomes `low`.
#[inline(always)]
pub(crate) fn clamp<F: Floats>(x: F, low: f32, high: f32) -> F {
    x.max(F::splat(low)).min(F::splat(high))
}

/// As [`math::smooth`].
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn smooth<F: Floats>(a: F, b: F, x: F) -> F {
    let s = clamp((x - a) / (b - a), 0.0, 1.0);
    s * s * (F::splat(3.0) - F::splat(2.0) * s)
}

/// `x` raised to the fifth.
#[inline(always)]
pub(crate) fn pow5<F: Floats>(x: F) -> F {
    let x2 = x * x;
    x2 * x2 * x
}

/// As [`math::log2`].
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn log2<F: Floats>(x: F) -> F {
    let x = row(x);
    let mut out = [0.0; LANES];
    for i in 0..F::LEN {
        out[i] = math::log2(x[i]);
    }
    F::load(&out)
}

/// Numbers of the set bits, lowest first.
#[derive(Debug)]
pub(crate) struct Bits(pub(crate) u32);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let bit = self.0.trailing_zeros() as usize;
        if self.0 == 0 {
            return None;
        }
        self.0 &= self.0 - 1;
        // Told to the compiler so that rows are indexed without checks.
        Some(bit & (LANES - 1))
    }
}

/// Component `axis` of a point in rows.
#[inline(always)]
pub(crate) fn put3(rows: &mut [Row; 3], lane: usize, v: Vec3) {
    rows[0][lane] = v.x;
    rows[1][lane] = v.y;
    rows[2][lane] = v.z;
}

/// As [`put3`] for two components.
#[inline(always)]
pub(crate) fn put2(rows: &mut [Row; 2], lane: usize, v: Vec2) {
    rows[0][lane] = v.x;
    rows[1][lane] = v.y;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        render::pattern::hash,
        simd::{Simd, SimdLevel, Task, dispatch},
    };

    /// Numbers of all sizes, in the same order on every machine.
    fn numbers(seed: u64) -> Row {
        std::array::from_fn(|i| {
            let bits = hash(seed * 1000 + i as u64);
            let size = [1e-3, 1.0, 40.0, 1e20][(bits % 4) as usize];
            (bits as f32 / 4.3e9 - 0.5) * size
        })
    }

    /// Every function of two vectors and a number, each in rows.
    #[inline(always)]
    fn functions<F: Floats>(a: V3<F>, b: V3<F>, s: F) -> [Row; 12] {
        let unit = a.unit_or(b).rows();
        let mixed = V3::mix(a, b, s).rows();
        let crossed = a.cross(b).rows();
        let parts = [row(smooth(a.x, b.x, s)), row(log2(s.abs())), row(pow5(clamp(s, -1.0, 1.0)))];
        [
            unit[0], unit[1], unit[2], mixed[0], mixed[1], mixed[2], crossed[0], crossed[1], crossed[2], parts[0],
            parts[1], parts[2],
        ]
    }

    struct Lanewise<'a>(&'a [Row; 7]);

    impl Task for Lanewise<'_> {
        type Output = (usize, [Row; 12]);

        #[inline(always)]
        fn run<S: Simd>(self) -> (usize, [Row; 12]) {
            let [a, b, c, d, e, f, s] = self.0;
            let out = functions::<S::F>(V3::load(&[*a, *b, *c]), V3::load(&[*d, *e, *f]), S::F::load(s));
            (S::F::LEN, out)
        }
    }

    #[test]
    fn a_lane_holds_what_a_single_point_gives() {
        for seed in 0..200 {
            let rows: [Row; 7] = std::array::from_fn(|i| numbers(seed * 7 + i as u64));
            for level in SimdLevel::available() {
                let (len, wide) = dispatch(level, Lanewise(&rows));
                for lane in 0..len {
                    let one = |i: usize| One::splat(rows[i][lane]);
                    let (a, b) = (V3 { x: one(0), y: one(1), z: one(2) }, V3 { x: one(3), y: one(4), z: one(5) });
                    for (wide, single) in wide.iter().zip(functions(a, b, one(6))) {
                        assert_eq!(wide[lane].to_bits(), single[0].to_bits(), "{level}, seed {seed}, lane {lane}");
                    }
                    let v = |i: usize| Vec3::new(rows[i][lane], rows[i + 1][lane], rows[i + 2][lane]);
                    let due = math::unit_or(v(0), v(3));
                    assert_eq!([wide[0][lane], wide[1][lane], wide[2][lane]], due.to_array());
                }
            }
        }
    }

    #[test]
    fn bits_are_numbered_from_the_lowest() {
        assert_eq!(Bits(0b1000_0000_0010_0101).collect::<Vec<_>>(), [0, 2, 5, 15]);
        assert_eq!(Bits(0).next(), None);
    }
}
