//! Scenes that any implementation can make bit for bit: plain f64 operations, vertices on the grid 2^-20.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use kinora::{geom::Aabb, glam::Vec3};

/// Frames of every scene.
pub(crate) const FRAMES: usize = 60;

/// `SplitMix64` (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// In [0, 1), 24 bits.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    fn range(&mut self, from: f32, to: f32) -> f32 {
        from + (to - from) * self.unit()
    }
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A sum over pairs that does not depend on their order.
pub(crate) fn hash(pairs: impl Iterator<Item = [u32; 2]>) -> (usize, u64) {
    pairs.fold((0, 0), |(n, sum), [a, b]| (n + 1, sum.wrapping_add(mix(u64::from(a) << 32 | u64::from(b)))))
}

/// sin by reduction to [-pi/2, pi/2] and a polynomial of degree 17.
fn sin(x: f64) -> f64 {
    let turns = (x / PI).round();
    let r = x - turns * PI;
    let (r2, mut sum) = (r * r, 1.0);
    for i in (1..=8).rev().map(f64::from) {
        sum = 1.0 - sum * r2 / ((2.0 * i) * (2.0 * i + 1.0));
    }
    if (turns as i64) & 1 == 0 { sum * r } else { -(sum * r) }
}

fn cos(x: f64) -> f64 {
    sin(x + FRAC_PI_2)
}

pub(crate) fn snap(x: f64, y: f64, z: f64) -> Vec3 {
    let on_grid = |a: f64| ((a * 1_048_576.0).round() / 1_048_576.0) as f32;
    Vec3::new(on_grid(x), on_grid(y), on_grid(z))
}

/// Two triangles for each of `nu` by `nv` quads, closed round where asked.
fn grid(nu: usize, nv: usize, wrap_u: bool, wrap_v: bool) -> Vec<[u32; 3]> {
    let (mu, mv) = (if wrap_u { nu } else { nu + 1 }, if wrap_v { nv } else { nv + 1 });
    let at = |i: usize, j: usize| ((i % mu) * mv + (j % mv)) as u32;
    let quad = |i, j| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
    (0..nu).flat_map(|i| (0..nv).flat_map(move |j| quad(i, j))).collect()
}

fn time(frame: usize) -> f64 {
    frame as f64 / FRAMES as f64 * 6.0
}

pub(crate) fn tube_triangles() -> Vec<[u32; 3]> {
    grid(100, 100, false, true)
}

/// A twisting, bending tube of 20,000 triangles along x (0) or y (1).
pub(crate) fn tube(which: usize, frame: usize) -> Vec<Vec3> {
    let (t, w) = (time(frame), which as f64);
    let mut out = Vec::new();
    for u in (0..=100).map(|i| f64::from(i) / 100.0) {
        for s in (0..100).map(|j| f64::from(j) / 100.0) {
            let twist = 3.0 * u * sin(t + w) + 0.37 * w;
            let (a, b) = (0.45 * cos(TAU * s), 0.25 * sin(TAU * s));
            let (c, d) = (cos(twist), sin(twist));
            let (p, q) = (a * c - b * d, a * d + b * c);
            let along = (u - 0.5) * 4.0 + 0.003;
            let bend = 0.30 * sin(3.0 * u + 1.3 * t + 2.0 * w);
            out.push(if which == 0 {
                snap(along, p + bend, q + 0.011)
            } else {
                snap(p + 0.021 + bend, along, q + 0.15 * sin(t))
            });
        }
    }
    out
}

pub(crate) fn torus_triangles() -> Vec<[u32; 3]> {
    grid(250, 200, true, true)
}

/// A wavy torus of 100,000 triangles.
pub(crate) fn torus(frame: usize) -> Vec<Vec3> {
    let t = time(frame);
    let mut out = Vec::new();
    for a in (0..250).map(|i| TAU * f64::from(i) / 250.0) {
        for b in (0..200).map(|j| TAU * f64::from(j) / 200.0) {
            let r = 0.7 + (0.06 * sin(7.0 * a + 2.0 * t) + 0.04 * sin(9.0 * b - 3.0 * t));
            let twist = b + 0.8 * sin(a + t);
            let rr = 2.0 + 0.2 * sin(3.0 * a + t) + r * cos(twist);
            out.push(snap(rr * cos(a), rr * sin(a), r * sin(twist) + 0.3 * sin(2.0 * a + t)));
        }
    }
    out
}

pub(crate) fn cloth_triangles() -> Vec<[u32; 3]> {
    grid(250, 200, false, false)
}

/// A cloth of 100,000 triangles with overhanging folds that cut each other.
pub(crate) fn cloth(frame: usize) -> Vec<Vec3> {
    let t = time(frame);
    let grow = 0.65 + 0.35 * sin(t);
    let mut out = Vec::new();
    for u in (0..=250).map(|i| f64::from(i) / 250.0) {
        for v in (0..=200).map(|j| f64::from(j) / 200.0) {
            let phase = TAU * 6.0 * u + 0.9 * sin(TAU * v + t);
            let x = 2.0 * u + 0.135 * grow * sin(2.0 * phase + 0.4) + 0.05 * grow * sin(phase);
            let z = 0.22 * cos(phase) + 0.05 * sin(3.0 * TAU * v + phase + t);
            let y = 1.8 * v + 0.04 * sin(phase * 0.5 + 5.0 * v + t);
            out.push(snap(x - 1.0, y - 0.9, z));
        }
    }
    out
}

/// Boxes of edge 0.6 to 1 in a cube, one a unit of volume: at most 0.01 a frame and axis, or up to 1.
pub(crate) struct Boxes {
    side: f32,
    places: Vec<[f32; 3]>,
    halves: Vec<[f32; 3]>,
    speeds: Vec<[f32; 3]>,
    random: Random,
    calm: bool,
}

impl Boxes {
    pub(crate) fn new(count: usize, calm: bool) -> Self {
        let side = match count {
            1000 => 10.0,
            10_000 => 21.544,
            50_000 => 36.84,
            _ => (count as f64).cbrt() as f32,
        };
        let mut random = Random(0x00c0_ffee ^ count as u64);
        let mut scene = Self { side, places: vec![], halves: vec![], speeds: vec![], random: Random(0), calm };
        let vector = |random: &mut Random, a: f32, b: f32| [random.range(a, b), random.range(a, b), random.range(a, b)];
        for _ in 0..count {
            scene.places.push(vector(&mut random, 0.0, side));
            scene.halves.push(vector(&mut random, 0.3, 0.5));
            scene.speeds.push(vector(&mut random, -0.01, 0.01));
        }
        scene.random = random;
        scene
    }

    pub(crate) fn step(&mut self) {
        for (place, speed) in self.places.iter_mut().zip(&mut self.speeds) {
            if !self.calm {
                let r = &mut self.random;
                *speed = [r.range(-1.0, 1.0), r.range(-1.0, 1.0), r.range(-1.0, 1.0)];
            }
            for (p, v) in place.iter_mut().zip(speed) {
                let mut next = *p + *v;
                if next < 0.0 {
                    next = -next;
                    *v = -*v;
                }
                if next > self.side {
                    next = 2.0 * self.side - next;
                    *v = -*v;
                }
                *p = next;
            }
        }
    }

    pub(crate) fn boxes(&self) -> Vec<Aabb> {
        let one = |(p, h): (&[f32; 3], &[f32; 3])| {
            let (p, h) = (Vec3::from(*p), Vec3::from(*h));
            Aabb { min: p - h, max: p + h }
        };
        self.places.iter().zip(&self.halves).map(one).collect()
    }
}

/// 256 x 256 rays of a camera, then as many between random places.
pub(crate) fn rays() -> [Vec<(Vec3, Vec3)>; 2] {
    let eye = snap(0.2, -5.5, 3.1);
    let mut camera = Vec::new();
    for y in 0..256 {
        for x in 0..256 {
            let (fx, fy) = ((f64::from(x) + 0.5) / 128.0 - 1.0, 1.0 - (f64::from(y) + 0.5) / 128.0);
            camera.push((eye, snap(0.55 * fx, 0.87 + 0.55 * fy * 0.49, -0.49 + 0.55 * fy * 0.87)));
        }
    }
    let mut r = Random(77);
    let mut spread = |size: f64| (f64::from(r.unit()) * 2.0 - 1.0) * size;
    let mut random = Vec::new();
    for _ in 0..65_536 {
        let from = snap(spread(3.5), spread(3.5), spread(1.5));
        let to = snap(spread(3.0), spread(3.0), spread(1.0));
        random.push((from, to - from));
    }
    [camera, random]
}
