//! `mount`: midpoint displacement on a square, with a pyramid of glass spheres above.

use std::f64::consts::{FRAC_1_SQRT_2, LN_2, PI};

use glam::DVec3;

use super::{
    object::{SpdScene, SpdSurface},
    rotate::rotated,
};

/// Fractal dimension less one: 2.2 - 1.
const DIMENSION: f64 = 1.2;
/// Picks the mountain.
const MOUNTAIN: u64 = 21;
/// Displacement of a square's middle over that of its edges.
#[expect(clippy::approx_constant, reason = "the package rounds the root of 2, and so its mountains")]
const MIDDLE: f64 = 1.414_213_6;

pub(super) fn make(scene: &mut SpdScene) {
    scene.look([-1.6, 1.6, 1.7], [0.0; 3], [0.0, 0.0, 1.0]);
    scene.light(&[[-100.0, -100.0, 100.0]]);
    let glass = scene.surface(SpdSurface {
        diffuse: 0.1,
        specular: 0.1,
        shine: 6.7,
        transmittance: 0.9,
        ior: 1.5,
        two_sided: true,
        ..SpdSurface::MATT
    });
    add_spheres(scene, glass, DVec3::new(-0.8, 0.8, 1.0), 0.17);

    let rock = scene.surface(SpdSurface { color: DVec3::new(0.5, 0.45, 0.35), ..SpdSurface::MATT });
    let ratio = 2.0 / libm::exp(LN_2 / DIMENSION);
    let cells = 1u32 << scene.size;
    let mountain =
        Mountain { size: scene.size, cell: 2.0 / f64::from(cells), roughness: (ratio * ratio - 1.0).sqrt(), rock };
    mountain.grow(scene, cells, [0, 0], [0.0; 4]);
}

/// Four spheres that touch: one above `center`, three around it.
fn add_spheres(scene: &mut SpdScene, surface: u32, center: DVec3, radius: f64) {
    let top = DVec3::new(0.0, 0.0, radius * 1.5f64.sqrt());
    scene.add_sphere(surface, center + top, radius);
    let axis = DVec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0);
    let side = rotated(top, axis, libm::acos(-1.0 / 3.0));
    for i in 0..3 {
        scene.add_sphere(surface, center + rotated(side, DVec3::Z, f64::from(i) * 2.0 * PI / 3.0), radius);
    }
}

struct Mountain {
    size: u32,
    /// Side of a cell.
    cell: f64,
    roughness: f64,
    rock: u32,
}

impl Mountain {
    /// Splits the square of `width` cells at `at` with its corner heights, counter-clockwise from the lower left, down
    /// to cells.
    fn grow(&self, scene: &mut SpdScene, width: u32, at: [u32; 2], heights: [f64; 4]) {
        let [x, y] = at;
        let [ll, lr, ur, ul] = heights;
        if width == 1 {
            self.add_cell(scene, at, heights);
            return;
        }
        let half = width / 2;
        let rise = f64::from(half) * self.cell * self.roughness;
        let noise = |x, y| rise * gauss(MOUNTAIN + self.hash(x, y));
        let lower = f64::midpoint(ll, lr) + noise(x + half, y);
        let right = f64::midpoint(lr, ur) + noise(x + width, y + half);
        let upper = f64::midpoint(ur, ul) + noise(x + half, y + width);
        let left = f64::midpoint(ul, ll) + noise(x, y + half);
        let middle = (ll + lr + ur + ul) / 4.0 + MIDDLE * noise(x + half, y + half);
        self.grow(scene, half, [x, y], [ll, lower, middle, left]);
        self.grow(scene, half, [x + half, y], [lower, lr, right, middle]);
        self.grow(scene, half, [x + half, y + half], [middle, right, ur, upper]);
        self.grow(scene, half, [x, y + half], [left, middle, upper, ul]);
    }

    fn add_cell(&self, scene: &mut SpdScene, [x, y]: [u32; 2], heights: [f64; 4]) {
        let corner =
            |i: u32, j: u32, z| DVec3::new(f64::from(x + i) * self.cell - 1.0, f64::from(y + j) * self.cell - 1.0, z);
        let [ll, lr, ur, ul] = heights;
        let corners = [corner(0, 0, ll), corner(1, 0, lr), corner(1, 1, ur), corner(0, 1, ul)];
        scene.add_polygon(self.rock, [corners[0], corners[1], corners[2]]);
        scene.add_polygon(self.rock, [corners[2], corners[3], corners[0]]);
    }

    /// The package's first hash of a lattice point. From size 8 on its last term would be shifted by a negative count,
    /// and is left out.
    fn hash(&self, a: u32, b: u32) -> u64 {
        let (a, b) = (u64::from(a), u64::from(b));
        let last = 7u32.checked_sub(self.size).map_or(0, |shift| a << shift);
        ((a << (23 - self.size)) + (b << (15 - self.size)) + last) & 0xffff
    }
}

/// A normally distributed number from a seed: the polar method over a linear congruential generator.
fn gauss(seed: u64) -> f64 {
    const MODULUS: u64 = 134_456;
    let next = |state: u64| (28_411 + state * 8121) % MODULUS;
    #[expect(clippy::cast_precision_loss, reason = "below the modulus")]
    let signed = |state: u64| 2.0 * state as f64 / MODULUS as f64 - 1.0;
    let mut state = seed;
    loop {
        let first = next(state);
        state = next(first);
        let (v1, v2) = (signed(first), signed(state));
        let r = v1 * v1 + v2 * v2;
        if r < 1.0 && r > 0.0 {
            return v1 * (-2.0 * libm::log(r) / r).sqrt();
        }
    }
}
