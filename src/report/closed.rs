//! Closed meshes, and rays that search them for leaks.
//!
//! All coordinates are multiples of 2^-16 of less than 2, and so are the origins of aimed rays: the way to a corner or to the middle of an edge is
//! then a direction without any rounding, and the ray passes exactly through it.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of triangles are far below u32; coordinates are small"
)]

use std::collections::HashMap;

use super::{Subject, random::Random};
use crate::{
    geom::{PrimId, Ray},
    glam::{DVec3, Vec3},
};

/// Steps of coordinates in a unit.
const STEPS: f64 = 65_536.0;

/// Rays made at once.
pub const BATCH: usize = 4096;

/// A closed mesh around the origin.
#[derive(Clone, Debug)]
pub struct Closed {
    /// The mesh.
    pub subject: Subject,
    /// Every point this near to the origin is inside.
    pub core: f64,
}

/// Where rays go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// From points inside in all directions.
    Anywhere,
    /// As [`Aim::Anywhere`], in packets of 16 with one origin and neighbouring directions.
    Packets,
    /// Exactly through a corner.
    Corners,
    /// Exactly through the middle of an edge.
    Middles,
    /// At any point of an edge, and at corners from any origin, as closely as f32 can.
    Edges,
}

impl Aim {
    /// Those that are aimed at corners and edges.
    pub const AT_EDGES: [Self; 3] = [Self::Corners, Self::Middles, Self::Edges];

    /// Name in rows.
    pub fn name(self) -> &'static str {
        match self {
            Self::Anywhere => "anywhere",
            Self::Packets => "packets",
            Self::Corners => "exactly through corners",
            Self::Middles => "exactly through edges",
            Self::Edges => "at edges and corners",
        }
    }
}

fn snapped(p: DVec3) -> Vec3 {
    ((p * STEPS).round() / STEPS).as_vec3()
}

/// A ball of at least `triangles` triangles of nearly one size: an icosahedron whose faces are split in four again and again.
pub fn ball(triangles: usize) -> Closed {
    let (points, indices) = icosphere(triangles);
    let positions = points.into_iter().map(snapped).collect();
    Closed { subject: Subject::still(format!("ball-{}", indices.len()), positions, indices), core: 0.9 }
}

/// As [`ball`], with large and small dents.
pub fn dented(triangles: usize) -> Closed {
    let (points, indices) = icosphere(triangles);
    let dent = |p: DVec3| {
        let wave = |k: f64| libm::sin(k * p.x) * libm::sin(k * p.y + 1.0) * libm::sin(k * p.z + 2.0);
        p * (1.0 + 0.15 * wave(6.0) + 0.02 * wave(50.0))
    };
    let positions = points.into_iter().map(|p| snapped(dent(p))).collect();
    Closed { subject: Subject::still(format!("dented-{}", indices.len()), positions, indices), core: 0.75 }
}

/// The cube from -1 to 1 of at least `triangles` triangles, two a square of a side's grid: all of them flat on planes of an axis.
pub fn cube(triangles: usize) -> Closed {
    let wanted = libm::sqrt(triangles.clamp(12, 10_000_000) as f64 / 12.0).ceil() as u32;
    let side = wanted.next_power_of_two();
    let mut corners = Corners::default();
    let mut indices = Vec::new();
    for (axis, upper) in (0..3).flat_map(|a| [(a, false), (a, true)]) {
        let mut at = |i: u32, j: u32| {
            let mut p = DVec3::ZERO;
            p[axis] = if upper { 1.0 } else { -1.0 };
            p[(axis + 1) % 3] = f64::from(i) / f64::from(side) * 2.0 - 1.0;
            p[(axis + 2) % 3] = f64::from(j) / f64::from(side) * 2.0 - 1.0;
            corners.number(p)
        };
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            indices.extend(if upper { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
        }
    }
    let positions = corners.points.into_iter().map(snapped).collect();
    Closed { subject: Subject::still(format!("cube-{}", indices.len()), positions, indices), core: 0.95 }
}

/// Points by number, each once.
#[derive(Default)]
struct Corners {
    points: Vec<DVec3>,
    numbers: HashMap<[u64; 3], u32>,
}

impl Corners {
    fn number(&mut self, p: DVec3) -> u32 {
        // Adding +0 turns -0 into +0.
        *self.numbers.entry((p + DVec3::ZERO).to_array().map(f64::to_bits)).or_insert_with(|| {
            self.points.push(p);
            self.points.len() as u32 - 1
        })
    }
}

fn icosphere(triangles: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    const FACES: [[u32; 3]; 20] = [
        [0, 1, 4],
        [0, 4, 9],
        [9, 4, 5],
        [4, 8, 5],
        [4, 1, 8],
        [8, 1, 10],
        [8, 10, 3],
        [5, 8, 3],
        [5, 3, 2],
        [2, 3, 7],
        [7, 3, 10],
        [7, 10, 6],
        [7, 6, 11],
        [11, 6, 0],
        [0, 6, 1],
        [6, 10, 1],
        [9, 11, 0],
        [9, 2, 11],
        [9, 5, 2],
        [7, 11, 2],
    ];
    let (x, z) = (0.525_731_112_119_133_6, 0.850_650_808_352_039_9);
    let mut points = vec![
        DVec3::new(-x, 0.0, z),
        DVec3::new(x, 0.0, z),
        DVec3::new(-x, 0.0, -z),
        DVec3::new(x, 0.0, -z),
        DVec3::new(0.0, z, x),
        DVec3::new(0.0, z, -x),
        DVec3::new(0.0, -z, x),
        DVec3::new(0.0, -z, -x),
        DVec3::new(z, x, 0.0),
        DVec3::new(-z, x, 0.0),
        DVec3::new(z, -x, 0.0),
        DVec3::new(-z, -x, 0.0),
    ];
    let mut faces = FACES.to_vec();
    // From 320 on, faces are flat enough not to cut into the core.
    while faces.len() < triangles.clamp(320, 10_000_000) {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        let quarter = |[a, b, c]: [u32; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        faces = faces.into_iter().flat_map(quarter).collect();
    }
    (points, faces)
}

impl Closed {
    /// The rays of one batch: the same for the same arguments on every machine. With `outside`, aimed rays come from outside.
    pub fn rays(&self, aim: Aim, outside: bool, batch: u64) -> Vec<Ray> {
        let place = batch * 64 + aim as u64 * 2 + u64::from(outside);
        let mut random = Random::new(0x1ea4, place);
        let mut rays = Vec::with_capacity(BATCH);
        while rays.len() < BATCH {
            match aim {
                Aim::Anywhere => rays.push(Ray::new(self.inner(&mut random), direction(&mut random).as_vec3())),
                Aim::Packets => self.packet(&mut random, &mut rays),
                Aim::Corners | Aim::Middles | Aim::Edges => rays.push(self.aimed(aim, outside, &mut random)),
            }
        }
        rays
    }

    /// A point inside.
    fn inner(&self, random: &mut Random) -> Vec3 {
        snapped(direction(random) * (self.core * random.unit()))
    }

    fn packet(&self, random: &mut Random, rays: &mut Vec<Ray>) {
        let (origin, toward) = (self.inner(random), direction(random));
        let (right, up) = toward.any_orthonormal_pair();
        for i in 0..16 {
            let (x, y) = (f64::from(i % 4) - 1.5, f64::from(i / 4) - 1.5);
            let dir = toward + (right * x + up * y) / 256.0;
            rays.push(Ray::new(origin, dir.as_vec3()));
        }
    }

    fn aimed(&self, aim: Aim, outside: bool, random: &mut Random) -> Ray {
        let prims = self.subject.prims();
        let below = |n: usize, random: &mut Random| ((random.unit() * n as f64) as usize).min(n - 1);
        let prim = PrimId(below(prims.len(), random) as u32);
        let corner = below(3, random);
        let corners = prims.corners(prim).map(Vec3::as_dvec3);
        let (a, b) = (corners[corner], corners[(corner + 1) % 3]);
        let mut origin =
            if outside { snapped(direction(random) * (1.5 + 0.4 * random.unit())) } else { self.inner(random) };
        let share = match aim {
            Aim::Corners => 0.0,
            Aim::Middles => 0.5,
            _ if random.unit() < 0.25 => 0.0,
            _ => random.unit(),
        };
        if aim == Aim::Edges {
            let shift = direction(random) * (0.01 * random.unit());
            origin = (origin.as_dvec3() + shift).as_vec3();
        }
        Ray::new(origin, (a + (b - a) * share - origin.as_dvec3()).as_vec3())
    }
}

/// A unit vector, any as likely as any other.
fn direction(random: &mut Random) -> DVec3 {
    loop {
        let p = DVec3::new(random.unit(), random.unit(), random.unit()) * 2.0 - DVec3::ONE;
        let length = p.length();
        if (0.01..=1.0).contains(&length) {
            return p / length;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::reference::exact;

    /// Every edge belongs to two triangles, which run along it in opposite directions.
    #[test]
    fn meshes_are_closed_have_the_size_asked_for_and_hold_their_core() {
        for size in [12, 1000, 5000] {
            for mesh in [ball(size), dented(size), cube(size)] {
                let name = &mesh.subject.name;
                let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
                for t in &mesh.subject.indices {
                    for i in 0..3 {
                        *edges.entry((t[i], t[(i + 1) % 3])).or_default() += 1;
                    }
                }
                assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1)), "{name}");
                let count = mesh.subject.indices.len();
                assert!(count >= size && count <= size.max(320) * 4, "{name}");
                let prims = mesh.subject.prims();
                for t in 0..count {
                    let [a, b, c] = prims.corners(PrimId(t as u32)).map(Vec3::as_dvec3);
                    let normal = (b - a).cross(c - a);
                    assert!(normal.dot(a) > 0.0, "{name}: {t} faces outward");
                    let inside = [a, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0, (a + b + c) / 3.0];
                    assert!(inside.iter().all(|p| p.length() > mesh.core), "{name}: {t} is beyond the core");
                }
            }
        }
    }

    #[test]
    fn aimed_rays_pass_exactly_through_corners_and_edges() {
        let mesh = dented(300);
        for (aim, least) in [(Aim::Corners, 3), (Aim::Middles, 2)] {
            for ray in mesh.rays(aim, false, 1).iter().take(40) {
                let met = (0..mesh.subject.indices.len() as u32)
                    .filter(|&i| exact::meeting(ray, &mesh.subject.prims().corners(PrimId(i))).is_some());
                assert!(met.count() >= least, "{aim:?}");
            }
        }
    }

    #[test]
    fn batches_differ_and_repeat() {
        let mesh = ball(100);
        for aim in [Aim::Anywhere, Aim::Packets, Aim::Corners, Aim::Middles, Aim::Edges] {
            let rays = mesh.rays(aim, false, 7);
            assert_eq!(rays.len(), BATCH);
            assert_eq!(rays, mesh.rays(aim, false, 7));
            assert_ne!(rays, mesh.rays(aim, false, 8));
            assert!(rays.iter().all(|r| r.origin.length() < 0.92));
        }
        assert!(mesh.rays(Aim::Corners, true, 7).iter().all(|r| r.origin.length() > 1.4));
    }
}
