//! A last look at a cell that f64 cannot tell from a contact, in twice the precision.
//!
//! Near-misses at the end of an edge or the rim of a face are decided by far less than an ulp of f64: the map's values are exact sums of two f64
//! at the corners of the cube, and stay so up to 2^-98 of their size.
//!
//! # Source
//! Dekker, "A floating-point technique for extending the available precision", 1971, for the sums and products.

use glam::DVec3;

use super::{cell::Cell, map::Map};

/// A number as the unevaluated sum of two, the second at most half an ulp of the first.
#[derive(Clone, Copy, Debug)]
struct Two {
    high: f64,
    low: f64,
}

impl Two {
    /// `a + b`, exactly.
    fn sum(a: f64, b: f64) -> Self {
        let high = a + b;
        let part = high - a;
        Self { high, low: (a - (high - part)) + (b - part) }
    }

    /// `a * b`, exactly; both far from the ends of f64's range.
    fn product(a: f64, b: f64) -> Self {
        let high = a * b;
        let ((a1, a2), (b1, b2)) = (halves(a), halves(b));
        Self { high, low: a2 * b2 - (((high - a1 * b1) - a2 * b1) - a1 * b2) }
    }

    /// Off by at most 2^-103 of the sizes of both.
    fn plus(self, other: Self) -> Self {
        let (high, low) = (Self::sum(self.high, other.high), Self::sum(self.low, other.low));
        let first = Self::sum(high.high, high.low + low.high);
        Self::sum(first.high, first.low + low.low)
    }

    fn minus(self, other: Self) -> Self {
        self.plus(Self { high: -other.high, low: -other.low })
    }

    /// Off by at most 2^-103 of its size.
    fn times(self, factor: f64) -> Self {
        let product = Self::product(self.high, factor);
        Self::sum(product.high, product.low + self.low * factor)
    }
}

/// A number as the exact sum of two of half the digits.
fn halves(a: f64) -> (f64, f64) {
    const SPLITTER: f64 = 134_217_729.0;
    let scaled = SPLITTER * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

/// The map in twice the precision.
pub(super) struct Fine {
    corners: [[Two; 8]; 3],
    /// The largest size of each component at the corners.
    reach: DVec3,
}

/// Each of three interpolations is off by at most 12 * 2^-103 of the largest size (a difference of size 2, its product, a sum), and a
/// dot product by 3 products and 2 sums more: below 2^-97 in all.
const ERROR: f64 = 6.310_887_241_768_095e-30;

/// As in the map: above all that underflow can do.
const FLOOR: f64 = 1e-150;

impl Fine {
    /// Pairs of corners whose differences are the map's values at the corners of u and v.
    pub(super) fn new(start: &[DVec3; 4], end: &[DVec3; 4], is_face: bool, scale: f64) -> Self {
        const FACE: [(usize, usize); 4] = [(0, 1), (0, 1), (0, 2), (0, 3)];
        const EDGE: [(usize, usize); 4] = [(0, 2), (0, 3), (1, 2), (1, 3)];
        let pairs = if is_face { FACE } else { EDGE };
        let mut fine = Self { corners: [[Two { high: 0.0, low: 0.0 }; 8]; 3], reach: DVec3::ZERO };
        for (i, points) in [start, end].into_iter().enumerate() {
            for (j, &(a, b)) in pairs.iter().enumerate() {
                for (axis, component) in fine.corners.iter_mut().enumerate() {
                    let value = Two::sum(points[a][axis] * scale, -(points[b][axis] * scale));
                    component[4 * i + j] = value;
                    fine.reach[axis] = fine.reach[axis].max(value.high.abs());
                }
            }
        }
        fine
    }

    /// Whether the cell surely holds no contact.
    pub(super) fn rules_out(&self, map: &Map, cell: &Cell, separation: f64) -> bool {
        let ranges = cell.ranges();
        let values = self.corners.map(|component| over(component, ranges));
        let middle = ranges.map(|[from, to]| [from + 0.5 * (to - from); 2]);
        let slope = |parameter: usize| {
            let mut ranges = middle;
            ranges[parameter] = [0.0, 1.0];
            let ends = map.over(ranges[0], ranges[1], ranges[2]);
            DVec3::from_array(ends.map(|component| component[7] - component[0]))
        };
        let [t, u, v] = [slope(0), slope(1), slope(2)];
        let directions = [DVec3::X, DVec3::Y, DVec3::Z, u.cross(v), v.cross(t), t.cross(u)];
        directions.into_iter().any(|d| self.parts(&values, d, separation))
    }

    /// Whether all values lie beyond the separation along a direction.
    fn parts(&self, values: &[[Two; 8]; 3], direction: DVec3, separation: f64) -> bool {
        if direction.abs().max_element() < 1e-60 {
            return false;
        }
        let error = direction.abs().dot(self.reach * ERROR + FLOOR);
        let beyond = (error + separation * direction.length()) * (1.0 + 1e-9);
        let along = |i: usize| {
            let [x, y, z] = [0, 1, 2].map(|axis: usize| values[axis][i].times(direction[axis]));
            let sum = x.plus(y).plus(z);
            sum.high + sum.low
        };
        let first = along(0);
        first.abs() > beyond && (1..8).all(|i| along(i) * first.signum() > beyond)
    }
}

/// One component over a cell.
fn over(mut values: [Two; 8], ranges: [[f64; 2]; 3]) -> [Two; 8] {
    for (bit, [from, to]) in [4, 2, 1].into_iter().zip(ranges) {
        for low in (0..8).filter(|i| i & bit == 0) {
            let (a, b) = (values[low], values[low | bit]);
            let way = b.minus(a);
            values[low] = a.plus(way.times(from));
            values[low | bit] = a.plus(way.times(to));
        }
    }
    values
}
