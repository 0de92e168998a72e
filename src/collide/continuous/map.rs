use glam::DVec3;

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
}

/// With ε = 2^-53 and C the largest size of a component at the corners of the cube: a corner is a rounded difference, off by 1 ε C; each of
/// three interpolations `a + s (b - a)` adds at most 5 ε C (the difference 2, its product with s 2, the sum 1) and carries errors on
/// unchanged; a dot product with a direction adds 3 ε of the sum of its terms. That is 19, and 32 leaves room for
/// the rounding of the bounds themselves.
const ERROR: f64 = 32.0 * (f64::EPSILON / 2.0);

/// Far above what underflow can do, far below what matters: the greatest corner is above 2^-200.
const FLOOR: f64 = 1e-150;

impl Map {
    pub(super) fn vertex_face(start: &[DVec3; 4], end: &[DVec3; 4]) -> Option<Self> {
        let at = |&[p, a, b, c]: &[DVec3; 4]| [p - a, p - a, p - b, p - c];
        Self::new(start, end, at)
    }

    pub(super) fn edge_edge(start: &[DVec3; 4], end: &[DVec3; 4]) -> Option<Self> {
        let at = |&[a0, a1, b0, b1]: &[DVec3; 4]| [a0 - b0, a0 - b1, a1 - b0, a1 - b1];
        Self::new(start, end, at)
    }

    fn new(start: &[DVec3; 4], end: &[DVec3; 4], at: impl Fn(&[DVec3; 4]) -> [DVec3; 4]) -> Option<Self> {
        let largest = start.iter().chain(end).map(|p| p.abs().max_element()).fold(0.0, f64::max);
        if !start.iter().chain(end).all(|p| p.is_finite()) {
            return None;
        }
        // Differences must not overflow.
        let first = if largest > HUGE { 1.0 / HUGE } else { 1.0 };
        let [start, end] = [start, end].map(|points| at(&points.map(|p| p * first)));
        let mut map = Self { corners: [[0.0; 8]; 3], error: DVec3::ZERO, scale: first };
        for (i, value) in start.iter().chain(&end).enumerate() {
            for axis in 0..3 {
                map.corners[axis][i] = value[axis];
            }
        }
        let reach = map.reach().max_element();
        if reach < TINY {
            map.enlarge();
        }
        map.error = map.reach() * ERROR + DVec3::splat(FLOOR);
        Some(map)
    }

    /// The largest size of each component at the corners.
    fn reach(&self) -> DVec3 {
        let largest = |values: &[f64; 8]| values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        DVec3::new(largest(&self.corners[0]), largest(&self.corners[1]), largest(&self.corners[2]))
    }

    /// Brings very small numbers to where products do not underflow.
    fn enlarge(&mut self) {
        self.scale *= HUGE;
        for value in self.corners.iter_mut().flatten() {
            *value *= HUGE;
        }
    }

    /// A length of the caller in this map's unit, rounded up.
    pub(super) fn scaled(&self, length: f64) -> f64 {
        length * self.scale * (1.0 + 4.0 * f64::EPSILON)
    }

    /// A length of this map in the caller's unit, rounded up.
    pub(super) fn unscaled(&self, length: f64) -> f64 {
        length / self.scale * (1.0 + 4.0 * f64::EPSILON)
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

/// 2^600; a power of two.
const HUGE: f64 = f64::from_bits((1023 + 600) << 52);

/// 2^-200.
const TINY: f64 = f64::from_bits((1023 - 200) << 52);

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
