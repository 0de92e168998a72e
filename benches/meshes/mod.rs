//! Meshes and rays that the structure benches share: made here, the same on every machine.
#![allow(dead_code, reason = "each bench uses its share")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

use kinora::{
    geom::{Ray, Triangles},
    glam::Vec3,
};

/// An owned mesh.
pub(crate) struct Mesh {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) indices: Vec<[u32; 3]>,
}

impl Mesh {
    pub(crate) fn prims(&self) -> Triangles<'_> {
        Triangles { positions: &self.positions, indices: &self.indices, topology_epoch: 1 }
    }
}

/// A dented sphere of `2 * n * n` triangles; `phase` moves the dents.
pub(crate) fn dented_sphere(n: usize, phase: f64) -> Mesh {
    let vertex = |i: usize| {
        let (row, column) = (i / n, i % n);
        let (a, b) = (
            std::f64::consts::PI * (row as f64 + 0.5) / n as f64,
            2.0 * std::f64::consts::PI * column as f64 / n as f64,
        );
        let radius = 1.0 + 0.1 * libm::sin(7.0 * a + phase) * libm::cos(5.0 * b);
        let ring = radius * libm::sin(a);
        Vec3::new((ring * libm::cos(b)) as f32, (radius * libm::cos(a)) as f32, (ring * libm::sin(b)) as f32)
    };
    let positions = (0..n * n).map(vertex).collect();
    let quads = (0..n - 1).flat_map(|row| (0..n).map(move |column| (row, column)));
    let triangles = quads.flat_map(|(row, column)| {
        let at = |r: usize, c: usize| (r * n + c % n) as u32;
        let (a, b, c, d) = (at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column));
        [[a, b, c], [a, c, d]]
    });
    Mesh { positions, indices: triangles.collect() }
}

/// A pinhole picture of the unit ball, in 4 x 4 tiles.
pub(crate) fn camera_rays(side: usize) -> Vec<Ray> {
    let tiles = side / 4;
    let pixel = |i: usize| {
        let (tile, inner) = (i / 16, i % 16);
        let (x, y) = (tile % tiles * 4 + inner % 4, tile / tiles * 4 + inner / 4);
        let to_unit = |p: usize| (p as f32 + 0.5) / side as f32 - 0.5;
        Ray::new(Vec3::new(0.2, 0.4, 3.0), Vec3::new(to_unit(x), to_unit(y) - 0.13, -1.0))
    };
    (0..tiles * tiles * 16).map(pixel).collect()
}

/// Rays between scattered points of the box around the unit ball.
pub(crate) fn scattered_rays(count: usize) -> Vec<Ray> {
    let mut state = 1_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / 8_388_608.0 - 1.0
    };
    let mut point = || Vec3::new(unit(), unit(), unit()) * 1.3;
    (0..count)
        .map(|_| {
            let (from, to) = (point(), point());
            Ray::new(from, to - from)
        })
        .collect()
}
