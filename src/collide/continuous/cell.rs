use std::cmp::Ordering;

use glam::DVec3;

use super::map::{Map, range};

/// A box of parameters in which a contact may lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    t: [f64; 2],
    u: [f64; 2],
    v: [f64; 2],
    /// How far the map's values reach over the cell, roughly.
    size: f64,
    /// Too small for f64 to say more.
    spent: bool,
}

/// What became of a cell.
pub(super) enum Fate {
    /// No contact in it.
    Empty,
    /// It has shrunk, or is half of what it was and the other half comes with it.
    Open(Cell, Option<Cell>),
}

/// A parameter is known to no better than this.
const GRAIN: f64 = 4.0 * f64::EPSILON;

/// A cell that lost less than this share is split.
const SHRUNK: f64 = 0.6;

impl Cell {
    /// All parameters.
    pub(super) const ALL: Self =
        Self { t: [0.0, 1.0], u: [0.0, 1.0], v: [0.0, 1.0], size: f64::INFINITY, spent: false };

    /// Its least t.
    pub(super) fn begins(&self) -> f64 {
        self.t[0]
    }

    /// Of t, u and v.
    pub(super) fn ranges(&self) -> [[f64; 2]; 3] {
        [self.t, self.u, self.v]
    }

    pub(super) fn is_spent(&self) -> bool {
        self.spent
    }

    /// Drops, shrinks or splits the cell.
    pub(super) fn work(mut self, map: &Map, separation: f64) -> Fate {
        let values = Values(map.over(self.t, self.u, self.v));
        if values.miss_along_axes(map, separation) {
            return Fate::Empty;
        }
        let slopes = values.slopes();
        let widths = slopes.map(|s| s.abs().max_element());
        self.size = widths[0].max(widths[1]).max(widths[2]);
        let Some(cuts) = values.cuts(map, separation, slopes) else { return Fate::Empty };
        let before = self.volume();
        self.shrink(&cuts);
        if self.volume() <= SHRUNK * before {
            return Fate::Open(self, None);
        }
        self.spent = self.size <= 2.0 * map.error.max_element();
        match self.halved(widths).filter(|_| !self.spent) {
            Some((near, far)) => Fate::Open(near, Some(far)),
            None => Fate::Open(Self { spent: true, ..self }, None),
        }
    }

    fn volume(&self) -> f64 {
        [self.t, self.u, self.v].iter().map(|[from, to]| to - from).product()
    }

    fn shrink(&mut self, cuts: &Cuts) {
        for (range, cut) in [(&mut self.t, cuts.0[0]), (&mut self.u, cuts.0[1]), (&mut self.v, cuts.0[2])] {
            let [from, to] = *range;
            let way = to - from;
            if cut[0] > 0.0 {
                range[0] = (from + cut[0] * way - GRAIN).clamp(from, to);
            }
            if cut[1] < 1.0 {
                range[1] = (from + cut[1] * way + GRAIN).clamp(range[0], to);
            }
        }
    }

    /// Halves along the parameter that moves the values most, of those that can be halved.
    fn halved(self, widths: [f64; 3]) -> Option<(Self, Self)> {
        let ranges = [self.t, self.u, self.v];
        let wide = (0..3).filter(|&i| ranges[i][1] - ranges[i][0] > 8.0 * GRAIN);
        let widest = wide.reduce(|best, i| if widths[i] > widths[best] { i } else { best })?;
        let [from, to] = ranges[widest];
        let middle = from + 0.5 * (to - from);
        let (mut near, mut far) = (self, self);
        match widest {
            0 => (near.t[1], far.t[0]) = (middle, middle),
            1 => (near.u[1], far.u[0]) = (middle, middle),
            _ => (near.v[1], far.v[0]) = (middle, middle),
        }
        Some((near, far))
    }
}

/// Cells by urgency: the earliest, then the smallest.
impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        other.t[0].total_cmp(&self.t[0]).then_with(|| other.size.total_cmp(&self.size))
    }
}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Cell {}

/// The share of each parameter's range in which a contact may lie.
struct Cuts([[f64; 2]; 3]);

impl Cuts {
    const NONE: Self = Self([[0.0, 1.0]; 3]);
}

/// The map's values at a cell's corners.
struct Values([[f64; 8]; 3]);

impl Values {
    fn corner(&self, i: usize) -> DVec3 {
        DVec3::new(self.0[0][i], self.0[1][i], self.0[2][i])
    }

    /// Whether 0 lies outside along an axis.
    fn miss_along_axes(&self, map: &Map, separation: f64) -> bool {
        self.0.iter().zip(map.error.to_array()).any(|(values, error)| {
            let (low, high) = range(values);
            let beyond = error + separation;
            low > beyond || high < -beyond
        })
    }

    /// Mean derivatives by t, u and v, times the cell's extent.
    fn slopes(&self) -> [DVec3; 3] {
        let mut out = [DVec3::ZERO; 3];
        for (axis, f) in self.0.iter().enumerate() {
            out[0][axis] = ((f[4] - f[0]) + (f[5] - f[1])) + ((f[6] - f[2]) + (f[7] - f[3]));
            out[1][axis] = ((f[2] - f[0]) + (f[3] - f[1])) + ((f[6] - f[4]) + (f[7] - f[5]));
            out[2][axis] = ((f[1] - f[0]) + (f[3] - f[2])) + ((f[5] - f[4]) + (f[7] - f[6]));
        }
        out.map(|s| s * 0.25)
    }

    /// The value at the start of t, the middle of u and v.
    fn at_start(&self) -> DVec3 {
        ((self.corner(0) + self.corner(1)) + (self.corner(2) + self.corner(3))) * 0.25
    }

    fn at_middle(&self) -> DVec3 {
        let late = ((self.corner(4) + self.corner(5)) + (self.corner(6) + self.corner(7))) * 0.25;
        (self.at_start() + late) * 0.5
    }

    /// What directions leave of the cell; `None` for nothing.
    fn cuts(&self, map: &Map, separation: f64, [t, u, v]: [DVec3; 3]) -> Option<Cuts> {
        let mut cuts = Cuts::NONE;
        self.cut(map, separation, self.at_middle(), &mut cuts)?;
        // Each of these is at right angles to the change by two parameters, and so sees the third alone.
        let crosses = [u.cross(v), v.cross(t), t.cross(u)];
        let lengths = crosses.map(|c| c.abs().max_element());
        let widest = (0..3).fold(0, |best, i| if lengths[i] > lengths[best] { i } else { best });
        let normal = crosses[widest];
        let rest = [t, u, v][widest];
        if normal.dot(rest).abs() > FLAT * lengths[widest] * rest.abs().max_element() {
            for direction in crosses {
                self.cut(map, separation, direction, &mut cuts)?;
            }
        } else {
            // The values lie near a plane, and all crosses along its normal.
            self.cut(map, separation, normal, &mut cuts)?;
            for slope in [t, u, v] {
                self.cut(map, separation, normal.cross(slope), &mut cuts)?;
            }
        }
        Some(cuts)
    }

    /// Cuts by what lies along one direction.
    #[inline(always)]
    fn cut(&self, map: &Map, separation: f64, direction: DVec3, cuts: &mut Cuts) -> Option<()> {
        let size = direction.abs();
        let largest = size.max_element();
        // Nothing to be seen, or nothing that f64 can say.
        if !(largest > NEGLIGIBLE && largest < 1.0 / NEGLIGIBLE) {
            return Some(());
        }
        let mut along = [0.0; 8];
        for (i, along) in along.iter_mut().enumerate() {
            *along = direction.x * self.0[0][i] + direction.y * self.0[1][i] + direction.z * self.0[2][i];
        }
        let beyond = size.dot(map.error) + separation * direction.length() * (1.0 + 8.0 * f64::EPSILON);
        let (low, high) = range(&along);
        if low > beyond || high < -beyond {
            return None;
        }
        for (bit, cut) in [4, 2, 1].into_iter().zip(&mut cuts.0) {
            narrow(&along, bit, beyond, cut)?;
        }
        Some(())
    }
}

/// The values count as flat where their volume is less than this share of what their slopes could span.
const FLAT: f64 = 1e-6;

/// Directions shorter than this underflow, and are left out; with their inverse, those that overflow.
const NEGLIGIBLE: f64 = 1e-100;

/// Keeps the share of one parameter at which the values along a direction may be within `beyond` of 0.
///
/// At a fixed share s, values lie between `(1 - s) low0 + s low1` and the same of the highs.
#[inline(always)]
fn narrow(along: &[f64; 8], bit: usize, beyond: f64, cut: &mut [f64; 2]) -> Option<()> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (i, &value) in along.iter().enumerate() {
        let end = usize::from(i & bit != 0);
        low[end] = if value < low[end] { value } else { low[end] };
        high[end] = if value > high[end] { value } else { high[end] };
    }
    below(low[0] - beyond, low[1] - beyond, cut);
    below(-high[0] - beyond, -high[1] - beyond, cut);
    (cut[0] <= cut[1]).then_some(())
}

/// Keeps the s at which `(1 - s) a + s b` may be at most 0; not both are above.
#[inline(always)]
fn below(a: f64, b: f64, cut: &mut [f64; 2]) {
    if a > 0.0 {
        cut[0] = cut[0].max(a / (a - b) * (1.0 - 2.0 * GRAIN));
    } else if b > 0.0 {
        cut[1] = cut[1].min(a / (a - b) * (1.0 + 2.0 * GRAIN));
    }
}
