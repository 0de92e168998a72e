//! The volumes in pairs of f64: what f64 leaves in doubt of a rounding, at a tenth of the cost of integers.
//!
//! A pair is the unevaluated sum of two f64, the second at most half a unit in the last place of the first. Sums and products are those of Joldes, Muller and
//! Popescu, "Tight and Rigorous Error Bounds for Basic Building Blocks of Double-Word Arithmetic", 2017 (`AccurateDWPlusDW`, `DWTimesDW1`): each has a relative
//! error below 2^-102, also where terms cancel.

use glam::Vec3;

use super::hit::RayRange;

/// Factor of the bounds on volumes: the derivation of [`BOUND`](super::BOUND) with operations off by 2^-102, and as much again for bounds that are evaluated in f64.
///
/// Differences of two f32 are exact here. Products of three f32 and what is split from them stay within 2^-606 and 2^424, so nothing over- or underflows.
const BOUND: f64 = 1.0 / (1_u128 << 97) as f64;

/// The sum of two f64.
#[derive(Clone, Copy, Debug)]
struct Pair {
    high: f64,
    low: f64,
}

impl Pair {
    /// `a + b`, exactly.
    #[inline(always)]
    fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let b_part = high - a;
        Self { high, low: (a - (high - b_part)) + (b - b_part) }
    }

    /// `a + b`, exactly; `|a| >= |b|` or `a` is 0.
    #[inline(always)]
    fn ordered_sum(a: f64, b: f64) -> Self {
        let high = a + b;
        Self { high, low: b - (high - a) }
    }

    /// `a * b`, exactly (Dekker).
    #[inline(always)]
    fn product(a: f64, b: f64) -> Self {
        let (a1, a2) = halves(a);
        let (b1, b2) = halves(b);
        let high = a * b;
        Self { high, low: a2 * b2 - (((high - a1 * b1) - a2 * b1) - a1 * b2) }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        let (s, t) = (Self::sum(self.high, other.high), Self::sum(self.low, other.low));
        let v = Self::ordered_sum(s.high, s.low + t.high);
        Self::ordered_sum(v.high, t.low + v.low)
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.plus(Self { high: -other.high, low: -other.low })
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        let c = Self::product(self.high, other.high);
        let crossed = self.high * other.low + self.low * other.high;
        Self::ordered_sum(c.high, c.low + crossed)
    }
}

/// The upper 26 bits of a number, and the rest.
#[inline(always)]
fn halves(a: f64) -> (f64, f64) {
    let scaled = 134_217_729.0 * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

type Pair3 = [Pair; 3];

fn difference(a: Vec3, b: Vec3) -> Pair3 {
    let axis = |i: usize| Pair::sum(f64::from(a[i]), -f64::from(b[i]));
    [axis(0), axis(1), axis(2)]
}

fn cross(a: &Pair3, b: &Pair3) -> Pair3 {
    let minor = |i: usize, j: usize| a[i].times(b[j]).minus(a[j].times(b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

fn dot(a: &Pair3, b: &Pair3) -> Pair {
    a[0].times(b[0]).plus(a[1].times(b[1])).plus(a[2].times(b[2]))
}

fn norm1(a: &Pair3) -> f64 {
    a[0].high.abs() + a[1].high.abs() + a[2].high.abs()
}

/// A volume and a bound on its error.
type Bounded = (Pair, f64);

/// t, u and v of a triangle that `ray` hits, each rounded to the nearest f32; `None` where pairs do not settle one of them.
pub(super) fn tuv(ray: &RayRange, [v0, v1, v2]: [Vec3; 3]) -> Option<[f32; 3]> {
    let zero = Vec3::ZERO;
    let (e1, e2, s, d) =
        (difference(v1, v0), difference(v2, v0), difference(ray.origin, v0), difference(ray.dir, zero));
    let (p, q) = (cross(&d, &e2), cross(&s, &e1));
    let (n1, n2, ns) = (norm1(&e1), norm1(&e2), norm1(&s));
    let reach = BOUND * ray.dir.as_dvec3().abs().max_element();
    let det = (dot(&e1, &p), reach * (n1 * n2));
    let uv_error = reach * (n1 * n2 + ns * (n1 + n2));
    let t = rounded((dot(&e2, &q), BOUND * (n1 * n2) * ns), det)?;
    let u = rounded((dot(&s, &p), uv_error), det)?;
    let v = rounded((dot(&d, &q), uv_error), det)?;
    Some([t, u, v])
}

/// The f32 nearest to the quotient of two volumes, if they are known well enough: it lies strictly between the middles to the neighbours.
#[expect(clippy::cast_possible_truncation, reason = "the rounding is what is asked for")]
fn rounded(volume: Bounded, det: Bounded) -> Option<f32> {
    let near = (volume.0.high / det.0.high) as f32;
    let middle = |other: f32| f64::midpoint(f64::from(near), f64::from(other));
    let settled = det.1 < det.0.high.abs()
        && near.abs() < f32::MAX
        && is_above(volume, det, middle(near.next_down()))
        && is_above((negated(volume.0), volume.1), det, -middle(near.next_up()));
    (settled && near != 0.0).then_some(near)
}

fn negated(a: Pair) -> Pair {
    Pair { high: -a.high, low: -a.low }
}

/// True when the quotient of two volumes surely exceeds a limit.
fn is_above((volume, error): Bounded, (det, det_error): Bounded, limit: f64) -> bool {
    let product = det.times(Pair { high: limit, low: 0.0 });
    let rest = volume.minus(product).high * det.high.signum();
    rest > error + limit.abs() * det_error + (product.high.abs() + rest.abs()) * BOUND
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geom::exact::TriangleHit;

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            (-4096_i16..4096, -30_i32..30).prop_map(|(m, e)| f32::from(m) * 2.0_f32.powi(e)),
            -2.0_f32..2.0,
            any::<f32>().prop_filter("finite", |x| x.is_finite()),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        /// Integers are the judge; the weights aim rays into triangles.
        #[test]
        fn what_pairs_settle_is_what_integers_say(
            corners in prop::array::uniform3(prop::array::uniform3(number())),
            origin in prop::array::uniform3(number()),
            weights in prop::array::uniform3(1_u8..9),
        ) {
            let corners = corners.map(Vec3::from);
            let weights = weights.map(f32::from);
            let sum = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
            let target = sum / weights.iter().sum::<f32>();
            let origin = Vec3::from(origin);
            let ray = RayRange { origin, dir: target - origin, t_near: 0.0, t_far: f32::MAX };
            prop_assume!(ray.dir.is_finite() && ray.dir != Vec3::ZERO);
            if let (Some(hit), Some(fine)) = (TriangleHit::exactly(&ray, corners), tuv(&ray, corners)) {
                prop_assert_eq!(fine.map(f32::to_bits), hit.tuv_by_integers(&ray).map(f32::to_bits));
            }
        }
    }

    #[test]
    fn plain_rays_are_settled_but_for_exact_middles_and_zeros() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let at = |x: f32, y: f32| RayRange {
            origin: Vec3::new(x, y, 1.0),
            dir: Vec3::new(0.1, 0.2, -1.0),
            t_near: 0.0,
            t_far: 9.0,
        };
        assert!(tuv(&at(0.1, 0.3), corners).is_some());
        let flat = RayRange { dir: Vec3::NEG_Z, ..at(0.25, 0.0) };
        assert_eq!(tuv(&flat, corners), None);
    }
}
