#![expect(clippy::cast_sign_loss, reason = "exponents of f64 are positive once biased")]

use glam::DVec3;

use super::Impact;

/// The vector from the one to the other, affine in each of t, u, v in [0, 1]: by its values at the corners of the cube.
///
/// Corner number `4 t + 2 u + v`. A face a, b, c has a at both corners of u = 0, b and c at those of u = 1.
pub(super) struct Map {
    /// Values at the corners, a component an array.
    pub(super) corners: [[f64; 8]; 3],
    /// Bound on the error of each component of a value, and on that of its product with a direction's.
    pub(super) error: DVec3,
    /// Lengths were multiplied by this power of two.
    scale: f64,
    is_face: bool,
}

/// With ε = 2^-53 and C the largest size of a component at the corners of the cube: a corner is a rounded difference, off by 1 ε C; each of
/// three interpolations `a + s (b - a)` adds at most 5 ε C (the difference 2, its product with s 2, the sum 1) and carries errors on
/// unchanged; a dot product with a direction adds 3 ε of the sum of its terms. That is 19, and 32 leaves room for
/// the rounding of the bounds themselves.
const ERROR: f64 = 32.0 * (f64::EPSILON / 2.0);

/// Far above what underflow can do, far below what matters: the greatest corner is above 2^-80.
const FLOOR: f64 = 1e-150;

impl Map {
    pub(super) fn vertex_face(start: &[DVec3; 4], end: &[DVec3; 4]) -> Option<Self> {
        let at = |&[p, a, b, c]: &[DVec3; 4]| [p - a, p - a, p - b, p - c];
        Self::new(start, end, true, at)
    }

    pub(super) fn edge_edge(start: &[DVec3; 4], end: &[DVec3; 4]) -> Option<Self> {
        let at = |&[a0, a1, b0, b1]: &[DVec3; 4]| [a0 - b0, a0 - b1, a1 - b0, a1 - b1];
        Self::new(start, end, false, at)
    }

    fn new(
        start: &[DVec3; 4],
        end: &[DVec3; 4],
        is_face: bool,
        at: impl Fn(&[DVec3; 4]) -> [DVec3; 4],
    ) -> Option<Self> {
        // Differences must not overflow.
        let largest = start.iter().chain(end).map(|p| p.abs().max_element()).fold(0.0, f64::max);
        if !start.iter().chain(end).all(|p| p.is_finite()) {
            return None;
        }
        let first = if largest > HUGE { 1.0 / HUGE } else { 1.0 };
        let [start, end] = [start, end].map(|points| at(&points.map(|p| p * first)));
        let mut map = Self { corners: [[0.0; 8]; 3], error: DVec3::ZERO, scale: first, is_face };
        for (i, value) in start.iter().chain(&end).enumerate() {
            for axis in 0..3 {
                map.corners[axis][i] = value[axis];
            }
        }
        map.bring_near_one();
        map.error = map.reach() * ERROR + DVec3::splat(FLOOR);
        Some(map)
    }

    /// The largest size of each component at the corners.
    fn reach(&self) -> DVec3 {
        let largest = |values: &[f64; 8]| values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        DVec3::new(largest(&self.corners[0]), largest(&self.corners[1]), largest(&self.corners[2]))
    }

    /// Scales by a power of two, so that products of three components neither overflow nor underflow.
    fn bring_near_one(&mut self) {
        let exponent = exponent(self.reach().max_element());
        if exponent.abs() > ORDINARY {
            let factor = power_of_two((-exponent).clamp(-400, 1000));
            self.scale *= factor;
            for value in self.corners.iter_mut().flatten() {
                *value *= factor;
            }
        }
    }

    /// A length of the caller in this map's unit, rounded up.
    pub(super) fn scaled(&self, length: f64) -> f64 {
        length * self.scale * (1.0 + 4.0 * f64::EPSILON)
    }

    pub(super) fn scale(&self) -> f64 {
        self.scale
    }

    pub(super) fn is_face(&self) -> bool {
        self.is_face
    }

    /// An answer in the caller's unit of length.
    pub(super) fn impact(&self, time: f64, gap: f64, place: [f64; 2]) -> Impact {
        Impact { time, gap: gap / self.scale * (1.0 + 4.0 * f64::EPSILON), place }
    }

    /// Values at the corners of u and v, number `2 u + v`, at one t.
    pub(super) fn at(&self, t: f64) -> [DVec3; 4] {
        let corner = |i: usize| DVec3::new(self.corners[0][i], self.corners[1][i], self.corners[2][i]);
        std::array::from_fn(|i| corner(i) + (corner(i + 4) - corner(i)) * t)
    }

    /// The cheap filter: true when boxes around both motions are further apart than `separation`.
    ///
    /// A corner is a difference rounded to nearest: its sign is exact, and its size is off by less than the factor.
    pub(super) fn lie_apart(&self, separation: f64) -> bool {
        let beyond = separation * (1.0 + 4.0 * f64::EPSILON);
        self.corners.iter().any(|values| {
            let (low, high) = range(values);
            low > beyond || high < -beyond
        })
    }

    /// Values at the corners of a cell.
    #[inline(always)]
    pub(super) fn over(&self, t: [f64; 2], u: [f64; 2], v: [f64; 2]) -> [[f64; 8]; 3] {
        let mut out = self.corners;
        for values in &mut out {
            cut::<4>(values, t);
            cut::<2>(values, u);
            cut::<1>(values, v);
        }
        out
    }
}

/// 2^600.
const HUGE: f64 = power_of_two(600);

/// Exponents up to this need no scaling.
const ORDINARY: i32 = 30;

/// An exponent in the normal range.
const fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// The exponent of a number's leading bit; -1023 for 0 and subnormal numbers.
fn exponent(value: f64) -> i32 {
    ((value.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

/// Narrows one parameter, whose bit in the corner number is `BIT`.
#[inline(always)]
fn cut<const BIT: usize>(values: &mut [f64; 8], [from, to]: [f64; 2]) {
    for low in (0..8).filter(|i| i & BIT == 0) {
        let (a, b) = (values[low], values[low | BIT]);
        let way = b - a;
        values[low] = a + from * way;
        values[low | BIT] = a + to * way;
    }
}

/// Least and greatest.
#[inline(always)]
pub(super) fn range(values: &[f64; 8]) -> (f64, f64) {
    let (mut low, mut high) = (values[0], values[0]);
    for &value in &values[1..] {
        low = if value < low { value } else { low };
        high = if value > high { value } else { high };
    }
    (low, high)
}
