//! `teapot`: 32 Bezier patches cut into triangles, on a checkerboard cut alike.

use glam::DVec3;

use super::{
    object::{SpdScene, SpdShape, SpdSurface},
    teapot_net::{PATCHES, VERTICES},
};

/// Half the board's side.
const BOARD: f64 = 4.0;

pub(super) fn make(scene: &mut SpdScene) {
    scene.look([4.86, 7.2, 5.4], [0.0; 3], [0.0, 0.0, 1.0]);
    scene.light(&[[-3.1, 9.8, 12.1], [11.3, 5.1, 8.8]]);
    let orange = scene.surface(SpdSurface {
        color: DVec3::new(1.0, 0.5, 0.1),
        diffuse: 0.75,
        specular: 0.25,
        shine: 37.0,
        two_sided: true,
        ..SpdSurface::MATT
    });
    let cut = scene.size;
    for patch in &PATCHES {
        let net = patch.map(|i| DVec3::from_array(VERTICES[usize::from(i)]));
        let grid: Vec<Point> = (0..=cut)
            .flat_map(|s| (0..=cut).map(move |t| (s, t)))
            .map(|(s, t)| Point::at(&net, f64::from(s) / f64::from(cut), f64::from(t) / f64::from(cut)))
            .collect();
        let place = |s: u32, t: u32| grid[(s * (cut + 1) + t) as usize];
        for s in 0..cut {
            for t in 0..cut {
                let square = [place(s, t), place(s, t + 1), place(s + 1, t + 1), place(s + 1, t)];
                add_triangle(scene, orange, [square[0], square[1], square[2]]);
                add_triangle(scene, orange, [square[2], square[3], square[0]]);
            }
        }
    }
    add_board(scene);
}

/// A point of a patch with its unit normal.
#[derive(Clone, Copy)]
struct Point {
    position: DVec3,
    normal: DVec3,
}

impl Point {
    /// At (s, t) in [0, 1]^2 of the patch with these 16 control points, s along its rows.
    fn at(net: &[DVec3; 16], s: f64, t: f64) -> Self {
        let (at_s, along_s) = (bernstein(s), bernstein_slope(s));
        let (at_t, along_t) = (bernstein(t), bernstein_slope(t));
        let sum = |rows: &[f64; 4], columns: &[f64; 4]| {
            (0..16).fold(DVec3::ZERO, |sum, i| sum + net[i] * (rows[i / 4] * columns[i % 4]))
        };
        let position = sum(&at_s, &at_t);
        // Lid and bottom have a cusp on the axis, where the slopes vanish.
        let cusp = if position.z > 1.5 { DVec3::Z } else { DVec3::NEG_Z };
        let normal = sum(&at_s, &along_t).cross(sum(&along_s, &at_t)).normalize_or(cusp);
        Self { position, normal: if on_axis(position) { cusp } else { normal } }
    }
}

fn on_axis(p: DVec3) -> bool {
    p.x.abs() < 1e-4 && p.y.abs() < 1e-4
}

fn bernstein(x: f64) -> [f64; 4] {
    let y = 1.0 - x;
    [y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x]
}

fn bernstein_slope(x: f64) -> [f64; 4] {
    let y = 1.0 - x;
    [-3.0 * y * y, 3.0 * y * (y - 2.0 * x), 3.0 * x * (2.0 * y - x), 3.0 * x * x]
}

/// Triangles with two corners in a cusp have no area and are left out.
fn add_triangle(scene: &mut SpdScene, surface: u32, points: [Point; 3]) {
    if points.iter().filter(|p| on_axis(p.position)).count() < 2 {
        let (corners, normals) = (points.map(|p| p.position), points.map(|p| p.normal));
        scene.add(surface, SpdShape::Patch { corners, normals });
    }
}

/// White squares, then gray ones.
fn add_board(scene: &mut SpdScene) {
    let cut = scene.size;
    let place = |i: u32| BOARD * (2.0 * f64::from(i) / f64::from(cut) - 1.0);
    for (gray, odd) in [(1.0, 1), (0.5, 0)] {
        let color = DVec3::splat(gray);
        let surface = scene.surface(SpdSurface { color, diffuse: 0.5, specular: 0.5, shine: 30.0, ..SpdSurface::MATT });
        for x in 0..cut {
            for y in (0..cut).filter(|y| (x + y) % 2 == odd) {
                let corner = |i, j| DVec3::new(place(x + i), place(y + j), 0.0);
                scene.add_polygon(surface, [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]);
            }
        }
    }
}
