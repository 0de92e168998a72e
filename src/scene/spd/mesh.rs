//! Triangles of single primitives, gathered into one part.

use std::{
    collections::{BTreeMap, HashMap},
    f64::consts::{FRAC_PI_4, PI},
};

use glam::{DVec3, Vec3};

use super::rotate::on_circle;
use crate::scene::{MaterialId, MeshPart, Topology};

/// A sphere of radius 1: six faces of a cube, cut into squares and pushed outwards, so that there are no poles.
#[derive(Debug)]
struct Ball {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl Ball {
    /// Each face cut into `cuts` x `cuts` squares.
    #[expect(clippy::cast_possible_truncation, reason = "a few thousand points")]
    fn new(cuts: u32) -> Self {
        let mut ball = Self { points: Vec::new(), triangles: Vec::new() };
        let mut known = HashMap::new();
        let place = |i: u32| libm::tan(FRAC_PI_4 * (2.0 * f64::from(i) / f64::from(cuts) - 1.0));
        let mut point = |at: [u32; 3]| {
            *known.entry(at).or_insert_with(|| {
                ball.points.push(DVec3::from_array(at.map(place)).normalize());
                ball.points.len() as u32 - 1
            })
        };
        for axis in 0..3 {
            for (side, flip) in [(0, true), (cuts, false)] {
                for i in 0..cuts {
                    for j in 0..cuts {
                        let mut corner = |i, j| {
                            let mut at = [side; 3];
                            (at[(axis + 1) % 3], at[(axis + 2) % 3]) = (i, j);
                            point(at)
                        };
                        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                        let pair = if flip { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] };
                        ball.triangles.extend(pair);
                    }
                }
            }
        }
        ball
    }
}

/// Gathers primitives into a part; positions are rounded to f32 once.
pub(super) struct MeshMaker<F> {
    turn: F,
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    balls: BTreeMap<u32, Ball>,
}

impl<F: Fn(DVec3) -> DVec3> MeshMaker<F> {
    /// Every position and normal goes through `turn`, which must be a rotation.
    pub(super) fn new(turn: F) -> Self {
        Self { turn, positions: Vec::new(), normals: Vec::new(), triangles: Vec::new(), balls: BTreeMap::new() }
    }

    /// Adds a vertex and returns its number.
    #[expect(clippy::cast_possible_truncation, reason = "the largest scenes have some ten million vertices")]
    fn vertex(&mut self, position: DVec3, normal: DVec3) -> u32 {
        self.positions.push((self.turn)(position).as_vec3());
        self.normals.push((self.turn)(normal).as_vec3());
        self.positions.len() as u32 - 1
    }

    #[expect(clippy::cast_possible_truncation, reason = "as `vertex`")]
    pub(super) fn sphere(&mut self, center: DVec3, radius: f64, segments: u32) {
        let cuts = segments / 4;
        let first = self.positions.len() as u32;
        let ball = self.balls.entry(cuts).or_insert_with(|| Ball::new(cuts));
        self.positions.extend(ball.points.iter().map(|&p| (self.turn)(center + p * radius).as_vec3()));
        self.normals.extend(ball.points.iter().map(|&p| (self.turn)(p).as_vec3()));
        self.triangles.extend(ball.triangles.iter().map(|t| t.map(|i| first + i)));
    }

    pub(super) fn cone(&mut self, (base, base_radius): (DVec3, f64), (apex, apex_radius): (DVec3, f64), segments: u32) {
        let along = apex - base;
        let length = along.length();
        let axis = along / length;
        let (right, up) = axis.any_orthonormal_pair();
        let ring: Vec<_> = (0..segments)
            .map(|i| {
                let p = on_circle(2.0 * PI * f64::from(i) / f64::from(segments));
                let out = right * p.x + up * p.y;
                let normal = (out * length + axis * (base_radius - apex_radius)).normalize();
                [self.vertex(base + out * base_radius, normal), self.vertex(apex + out * apex_radius, normal)]
            })
            .collect();
        for (i, &[a, d]) in ring.iter().enumerate() {
            let [b, c] = ring[(i + 1) % ring.len()];
            self.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }

    /// A plane polygon whose corners are in angular order around their mean.
    pub(super) fn polygon(&mut self, corners: &[DVec3], normal: DVec3) {
        if corners.len() < 3 {
            return;
        }
        let ring: Vec<_> = corners.iter().map(|&p| self.vertex(p, normal)).collect();
        if is_convex(corners, normal) {
            self.triangles.extend(ring[1..].windows(2).map(|pair| [ring[0], pair[0], pair[1]]));
            return;
        }
        let mean = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let hub = self.vertex(mean, normal);
        let pairs = ring.iter().zip(ring.iter().cycle().skip(1));
        self.triangles.extend(pairs.map(|(&a, &b)| [hub, a, b]));
    }

    pub(super) fn triangle(&mut self, corners: &[DVec3; 3], normals: &[DVec3; 3]) {
        let triangle = [0, 1, 2].map(|i| self.vertex(corners[i], normals[i]));
        self.triangles.push(triangle);
    }

    pub(super) fn finish(self, material: MaterialId) -> MeshPart {
        MeshPart {
            topology: Topology::Triangles,
            positions: self.positions,
            triangles: self.triangles,
            normals: self.normals,
            tangents: Vec::new(),
            tex_coords: Vec::new(),
            colors: Vec::new(),
            influences: None,
            targets: Vec::new(),
            material: Some(material),
        }
    }
}

/// Unit normal of a plane polygon by the sum over its edges (Newell): the side from which it is counter-clockwise. +Z
/// without area.
pub(super) fn polygon_normal(corners: &[DVec3]) -> DVec3 {
    let Some(&first) = corners.first() else { return DVec3::Z };
    let sum = |sum: DVec3, pair: &[DVec3]| sum + (pair[0] - first).cross(pair[1] - first);
    corners.windows(2).fold(DVec3::ZERO, sum).normalize_or(DVec3::Z)
}

/// True when no corner turns away from `normal`.
fn is_convex(corners: &[DVec3], normal: DVec3) -> bool {
    let n = corners.len();
    let corner = |i: usize| {
        let [a, b, c] = [corners[i], corners[(i + 1) % n], corners[(i + 2) % n]];
        (b - a).cross(c - b).dot(normal) >= 0.0
    };
    n == 3 || (0..n).all(corner)
}
