//! Cases of collision whose answers are known, made from streams of random numbers.

use super::whole::{Point, Whole};
use crate::{
    glam::{DVec3, Vec3},
    report::random::Random,
};

/// Two triangles.
pub(super) type Pair = [[Point; 3]; 2];

/// Coordinates are whole numbers of these.
pub(super) const UNIT: f32 = 1.0 / 1024.0;

/// A whole point as f32; exact.
#[expect(clippy::cast_precision_loss, reason = "at most 2^20")]
pub(super) fn placed(p: Point) -> Vec3 {
    Vec3::from_array(p.map(|x| x as f32 * UNIT))
}

/// The numbers of a case.
pub(super) struct Dice(Random);

impl Dice {
    pub(super) fn new(set: u64, case: usize) -> Self {
        Self(Random::new(0xc0_111d ^ set << 32, case as u64))
    }

    /// In `-n..=n`.
    #[expect(clippy::cast_possible_truncation, reason = "below 2^53")]
    pub(super) fn within(&mut self, n: i64) -> i64 {
        (self.0.unit() * (2 * n + 1) as f64) as i64 - n
    }

    /// Below `n`.
    #[expect(clippy::cast_possible_truncation, reason = "below n")]
    pub(super) fn below(&mut self, n: i64) -> i64 {
        (self.0.unit() * n as f64) as i64
    }

    pub(super) fn point(&mut self, n: i64) -> Point {
        [(); 3].map(|()| self.within(n))
    }

    /// With area, around `center`.
    pub(super) fn triangle(&mut self, center: Point, n: i64) -> [Point; 3] {
        loop {
            let corners = [(); 3].map(|()| plus(center, self.point(n)));
            if has_area(corners) {
                return corners;
            }
        }
    }
}

fn plus(a: Point, b: Point) -> Point {
    [0, 1, 2].map(|i| a[i] + b[i])
}

fn has_area([a, b, c]: [Point; 3]) -> bool {
    let way = |p: Point| [0, 1, 2].map(|i| p[i] - a[i]);
    let (u, v) = (way(b), way(c));
    (0..3).any(|i| u[i] * v[(i + 1) % 3] != u[(i + 1) % 3] * v[i])
}

/// Makes a case.
type Make = fn(&mut Dice) -> Pair;

/// How two triangles lie; all but the last have area.
pub(super) const PAIRS: [(&str, Make); 6] = [
    ("near each other", |d| {
        let center = d.point(700);
        [d.triangle([0; 3], 500), d.triangle(center, 500)]
    }),
    ("sharing an edge", |d| {
        let [a, b, c] = d.triangle([0; 3], 500);
        let other = d.triangle([0; 3], 500);
        let shared = [b, a, other[2]];
        if has_area(shared) { [[a, b, c], shared] } else { [[a, b, c], [c, b, a]] }
    }),
    ("corners on a grid of 5^3", |d| [d.triangle([0; 3], 2), d.triangle([0; 3], 2)]),
    ("in one plane", |d| {
        let flat = |t: [Point; 3]| t.map(|[x, y, _]| [x, y, x + 2 * y]);
        loop {
            let pair = [flat(d.triangle([0; 3], 40)), flat(d.triangle([0; 3], 40))];
            if pair.into_iter().all(has_area) {
                return pair;
            }
        }
    }),
    ("a step of 2^-20 of their size apart, or touching", |d| {
        // A corner above the other's plane z = 0, by one step or none.
        let flat = |p: Point| [p[0] * 512, p[1] * 512, 0];
        let low = loop {
            let low = d.triangle([0; 3], 1000).map(flat);
            if has_area(low) {
                break low;
            }
        };
        let (shares, step) = ([d.below(3), d.below(3)], d.below(2));
        let inside = [0, 1, 2]
            .map(|i| (low[0][i] * (4 - shares[0] - shares[1]) + low[1][i] * shares[0] + low[2][i] * shares[1]) / 4);
        let above = |d: &mut Dice| {
            let [x, y, z] = d.point(1000);
            [x * 512, y * 512, (z.abs() + 1) * 512]
        };
        [low, [plus(inside, [0, 0, step]), above(d), above(d)]]
    }),
    ("one of them without area", |d| {
        let [a, b, c] = d.triangle([0; 3], 3);
        let other = d.triangle([0; 3], 3);
        match d.below(3) {
            0 => [[a, b, b], other],
            1 => [other, [c, c, c]],
            _ => [[a, plus(a, [1, 0, 0]), plus(a, [3, 0, 0])], other],
        }
    }),
];

/// A closed box with volume.
pub(super) fn cuboid(d: &mut Dice, spread: i64, size: i64) -> Whole {
    let min = d.point(spread);
    Whole { min, max: plus(min, [(); 3].map(|()| d.below(size) + 1)) }
}

/// A step of a vertex and a face, or of two edges: where the corners start and end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) is_face: bool,
    pub(super) start: [DVec3; 4],
    pub(super) end: [DVec3; 4],
    /// When they first meet; absent when they do not.
    pub(super) due: Option<f64>,
}

/// What a step does. Exponents are of two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Motion {
    /// It meets at one moment.
    Meets,
    /// One stays on its side of the other's plane, that many times 1 to 200 away.
    StaysApart(i32),
    /// One passes through the other's plane beside the border, that share of its size away.
    PassesBy(i32),
}

/// The two ends of an edge, or the corners of a face, move within a plane; the other passes through the plane at one known moment, at a point of the first
/// (a corner or an edge, as often as not) or beside it, or stays on its side. All numbers are short binary fractions, so every corner is exact in f64 and no
/// two can meet at another moment.
pub(super) fn step(d: &mut Dice, is_face: bool, motion: Motion) -> Step {
    loop {
        if let Some(step) = attempt(d, is_face, motion) {
            return step;
        }
    }
}

/// A step, unless what it passes by has no border to tell.
fn attempt(d: &mut Dice, is_face: bool, motion: Motion) -> Option<Step> {
    let (e1, e2, normal) = plane(d);
    let at = |[x, y]: [f64; 2]| e1 * x + e2 * y;
    let mut spot = || at([d.within(16) as f64 / 16.0, d.within(16) as f64 / 16.0]);
    let (mut start, mut end) = ([DVec3::ZERO; 4], [DVec3::ZERO; 4]);
    let own = if is_face { 1..4 } else { 0..2 };
    for i in own.clone() {
        (start[i], end[i]) = (spot(), spot());
    }
    let (across, drift) = (spot(), spot());
    // Sixteenths of the step, quarters of the way along edges.
    let time = d.below(17) as f64 / 16.0;
    let now: Vec<DVec3> = own.map(|i| start[i] + (end[i] - start[i]) * time).collect();
    let mut weights = [d.below(3) as f64 / 4.0, d.below(3) as f64 / 4.0];
    if let Motion::PassesBy(exponent) = motion {
        weights[0] = -libm::exp2(f64::from(exponent));
        let other = if is_face { now[2] - now[0] } else { across };
        if (now[1] - now[0]).cross(other) == DVec3::ZERO {
            return None;
        }
    }
    let sides = now.iter().skip(1).zip(weights).map(|(&p, w)| (p - now[0]) * w);
    let met = now[0] + sides.sum::<DVec3>();
    let speed = (d.below(64) + 1) as f64 / 64.0 * if d.below(2) == 0 { 1.0 } else { -1.0 };
    // Where it stays apart: at one height, or down to it.
    let above = if d.below(2) == 0 { 0.0 } else { speed.abs() };
    let (before, after) = match motion {
        Motion::StaysApart(exponent) => {
            let least = libm::exp2(f64::from(exponent));
            (normal * (least + above), normal * least)
        }
        _ => (normal * (-speed * time), normal * (speed * (1.0 - time))),
    };
    let others = if is_face {
        vec![(0, met)]
    } else {
        vec![(2, met - across * weights[1]), (3, met + across * (1.0 - weights[1]))]
    };
    for (i, there) in others {
        (start[i], end[i]) = (there - drift * time + before, there + drift * (1.0 - time) + after);
    }
    Some(Step { is_face, start, end, due: (motion == Motion::Meets).then_some(time) })
}

/// Two whole vectors and their cross product, which is not 0.
fn plane(d: &mut Dice) -> (DVec3, DVec3, DVec3) {
    loop {
        let [e1, e2] = [(); 2].map(|()| DVec3::from_array(d.point(8).map(|x| x as f64)));
        let normal = e1.cross(e2);
        if normal != DVec3::ZERO {
            return (e1, e2, normal);
        }
    }
}
