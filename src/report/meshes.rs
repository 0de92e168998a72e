//! Meshes of any size, the same on every machine.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "vertices are counted in u32, which the largest mesh stays far below; coordinates are rounded to f32"
)]

use std::f64::consts::PI;

use rayon::prelude::*;

use super::{random::Random, rays::View, subject::Subject};
use crate::{
    geom::Aabb,
    glam::{DVec3, Vec3},
};

/// Largest mesh that can be asked for.
pub const MAX_TRIANGLES: usize = 100_000_000;

/// A unit ball with large and small dents, of about `triangles` triangles of similar size: a closed surface as scanners make.
pub fn dented_sphere(triangles: usize) -> Subject {
    let columns = ((triangles.clamp(8, MAX_TRIANGLES) as f64 / 2.0).sqrt().round() as usize).max(2);
    let rows = columns + 1;
    let vertex = |i: usize| {
        let (row, column) = (i / columns, i % columns);
        let a = PI * (row as f64 + 0.5) / rows as f64;
        let b = 2.0 * PI * column as f64 / columns as f64;
        let large = 0.1 * libm::sin(7.0 * a) * libm::cos(5.0 * b);
        let small = 0.01 * libm::sin(53.0 * a) * libm::cos(47.0 * b);
        let radius = 1.0 + large + small;
        let ring = radius * libm::sin(a);
        DVec3::new(ring * libm::cos(b), radius * libm::cos(a), ring * libm::sin(b)).as_vec3()
    };
    let positions: Vec<Vec3> = (0..rows * columns).into_par_iter().map(vertex).collect();
    let pair = |i: usize| {
        let (row, column) = (i / columns, i % columns);
        let at = |r: usize, c: usize| (r * columns + c % columns) as u32;
        let (a, b, c, d) = (at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column));
        [[a, b, c], [a, c, d]]
    };
    let indices: Vec<[u32; 3]> = (0..columns * columns).into_par_iter().flat_map_iter(pair).collect();
    Subject::still(format!("sphere-{}", short(indices.len())), positions, indices)
}

/// A [`dented_sphere`] seen from its middle: rays cross empty space before they come upon small triangles, as in a room.
pub(super) fn cave(triangles: usize) -> Subject {
    let sphere = dented_sphere(triangles);
    let view = View { eye: DVec3::ZERO, at: DVec3::X, up: DVec3::Y, half: 0.5 };
    Subject { name: sphere.name.replace("sphere", "cave"), view: Some(view), ..sphere }
}

/// Triangles without order in the unit cube, each about as large as the distance to the next: the worst that structures meet.
pub fn soup(triangles: usize) -> Subject {
    let count = triangles.clamp(1, MAX_TRIANGLES);
    let size = libm::cbrt(1.0 / count as f64);
    let corners = |i: usize| {
        let mut random = Random::new(0x5eed, i as u64);
        let mut point = |scale: f64| DVec3::new(random.unit(), random.unit(), random.unit()) * scale;
        let center = point(1.0);
        let half = DVec3::splat(size);
        [center, point(2.0 * size) + center - half, point(2.0 * size) + center - half].map(|p: DVec3| p.as_vec3())
    };
    let positions: Vec<Vec3> = (0..count).into_par_iter().flat_map_iter(corners).collect();
    let indices = (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Subject::still(format!("soup-{}", short(count)), positions, indices)
}

/// The corners of a box's faces: corner `c` is at the upper end of axis `i` when bit `i` is set.
const FACES: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// So many upright boxes of twelve triangles, the first of which is the room around the others, seen from a corner of it.
pub fn boxes(count: usize) -> Subject {
    let count = count.clamp(1, MAX_TRIANGLES / 12);
    let corners = |i: usize| {
        let mut random = Random::new(0xb0c5, i as u64);
        let mut number = |low: f64, high: f64| low + (high - low) * random.unit();
        let half = DVec3::new(number(0.02, 0.08), number(0.02, 0.3), number(0.02, 0.08));
        let (center, half) = match i {
            0 => (DVec3::new(0.0, 0.5, 0.0), DVec3::new(1.0, 0.5, 1.0)),
            _ => (DVec3::new(number(-0.9, 0.9), half.y, number(-0.9, 0.9)), half),
        };
        let side = |bit: usize, c: usize| if c >> bit & 1 == 1 { 1.0 } else { -1.0 };
        (0..8).map(move |c| (center + half * DVec3::new(side(0, c), side(1, c), side(2, c))).as_vec3())
    };
    let faces = |i: u32| {
        let halves = |f: [u32; 4]| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]];
        FACES.into_iter().flat_map(halves).map(move |t| t.map(|c| 8 * i + c))
    };
    let positions = (0..count).flat_map(corners).collect();
    let mut subject = Subject::still(format!("boxes-{count}"), positions, (0..count as u32).flat_map(faces).collect());
    let (eye, at) = (DVec3::new(-0.9, 0.7, 0.9), DVec3::new(0.0, 0.3, 0.0));
    subject.view = Some(View { eye, at, up: DVec3::Y, half: 0.5 });
    subject
}

/// The vertices moved by a standing wave of a thousandth of their box's diagonal.
pub(super) fn waved(positions: &[Vec3]) -> Vec<Vec3> {
    let bounds = Aabb::from_points(positions.iter().copied().filter(|p| p.is_finite()));
    let size = f64::from(bounds.diagonal());
    if !(size > 0.0 && size.is_finite()) {
        return positions.to_vec();
    }
    let low = bounds.min.as_dvec3();
    let wave = |p: &Vec3| {
        let at = (p.as_dvec3() - low) / size * (6.0 * PI);
        let by = DVec3::new(libm::sin(at.y), libm::sin(at.z), libm::sin(at.x));
        (p.as_dvec3() + by * (0.001 * size)).as_vec3()
    };
    positions.par_iter().map(wave).collect()
}

/// A count in few characters.
fn short(count: usize) -> String {
    match count {
        0..1000 => count.to_string(),
        1000..999_500 => format!("{:.0}k", count as f64 / 1e3),
        _ => format!("{:.0}M", count as f64 / 1e6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_have_about_the_size_asked_for_and_valid_indices() {
        for count in [1000, 10_000, 123_456] {
            for mesh in [dented_sphere(count), soup(count)] {
                let found = mesh.indices.len();
                assert!(found.abs_diff(count) <= count / 20, "{found} of {count}");
                assert!(mesh.indices.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
                assert!(mesh.positions.iter().chain(&mesh.moved).all(|p| p.is_finite()));
                assert_ne!(mesh.positions, mesh.moved);
            }
        }
        assert_eq!(dented_sphere(1000).name, "sphere-968");
        assert_eq!(soup(10_000).name, "soup-10k");
        assert_eq!(soup(0).indices.len(), 1);
        assert_eq!(cave(1000).name, "cave-968");
        assert_eq!((boxes(41).indices.len(), boxes(41).positions.len()), (492, 328));
    }
}
