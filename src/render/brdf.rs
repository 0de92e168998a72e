//! The metallic-roughness reflection model: GGX with height-correlated Smith shadowing and Schlick's Fresnel
//! term, made energy-conserving by a table of its directional albedo: light scattered between microfacets is added, and what
//! the specular layer reflects is missing below it (by its albedo at the view's angle, where the specification's simple
//! mix takes the Fresnel term of the half vector and gains a quarter at grazing angles).
//!
//! # Source
//! glTF 2.0 specification, appendix B; Heitz, "Understanding the Masking-Shadowing Function", 2014; Karis, "Real
//! Shading in Unreal Engine 4", 2013 (the split sum); Fdez-Aguera, "A Multiple-Scattering Microfacet Model for
//! Real-Time Image-based Lighting", 2019.

use std::{f32::consts::PI, sync::OnceLock};

use super::wide::{Bits, Floats, LANES, One, Row, V3, clamp, only, pow5, row};
use crate::simd::Lanes;

/// Least perceptual roughness: a point light's highlight keeps a visible size.
const LEAST_ROUGHNESS: f32 = 0.07;
/// Entries a side of the table.
const SIZE: usize = 32;

/// A surface's reflectance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reflectance<F> {
    /// Diffuse albedo.
    pub(crate) diffuse: V3<F>,
    /// Reflectance at normal incidence.
    pub(crate) f0: V3<F>,
    /// Square of perceptual roughness.
    pub(crate) alpha: F,
    /// Perceptual roughness.
    pub(crate) roughness: F,
}

/// What depends on the view direction but not on the light, made once a shading point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<F> {
    cos: F,
    /// Directional albedo of the specular layer.
    specular: V3<F>,
    /// Albedo of what lies below it.
    diffuse: V3<F>,
    /// Gain that makes up for scattering between microfacets.
    gain: V3<F>,
}

impl<F: Floats> Reflectance<F> {
    /// Of base colour, metalness and perceptual roughness, as glTF mixes them.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn new(base: V3<F>, metallic: F, roughness: F) -> Self {
        let roughness = clamp(roughness, LEAST_ROUGHNESS, 1.0);
        let f0 = V3::all(F::splat(0.04));
        Self {
            diffuse: base * (F::splat(1.0) - metallic),
            f0: f0 + (base - f0) * metallic,
            alpha: roughness * roughness,
            roughness,
        }
    }

    /// The part that depends on the view alone; `cos` between view and shading normal, positive.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn view(&self, cos: F) -> View<F> {
        let one = V3::all(F::splat(1.0));
        let split = albedo(cos, self.roughness);
        let lost = one.x / (split[0] + split[1]).max(F::splat(1e-3)) - one.x;
        let gain = one + self.f0 * lost;
        let specular = (self.f0 * split[0] + V3::all(split[1])).times(gain);
        View { cos, specular, diffuse: self.diffuse.times((one - specular).max(V3::zero())), gain }
    }

    /// Reflected radiance a unit of irradiance facing the light, times the cosine: `f(v, l) * (n . l)`.
    ///
    /// `l` and `v` are unit; `n_l` is the clamped cosine between `n` and `l`.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn evaluate(&self, view: &View<F>, n: V3<F>, v: V3<F>, l: V3<F>, n_l: F) -> V3<F> {
        let one = F::splat(1.0);
        let h = (v + l) * (one / (v + l).length().max(F::splat(1e-6)));
        let (n_h, v_h) = (clamp(n.dot(h), 0.0, 1.0), clamp(v.dot(h), 0.0, 1.0));
        let fresnel = self.f0 + (V3::all(one) - self.f0) * pow5(one - v_h);
        let specular = distribution(n_h, self.alpha) * visibility(view.cos, n_l, self.alpha);
        (view.diffuse * F::splat(1.0 / PI) + fresnel.times(view.gain) * specular) * n_l
    }

    /// Light reflected from surroundings: `irradiance` over pi around the normal, `mirrored` around the
    /// reflected direction.
    #[inline(always)]
    pub(crate) fn surroundings(view: &View<F>, irradiance: V3<F>, mirrored: V3<F>) -> V3<F> {
        view.diffuse.times(irradiance) + view.specular.times(mirrored)
    }
}

/// GGX distribution of normals.
#[cfg_attr(not(debug_assertions), inline(always))]
fn distribution<F: Floats>(n_h: F, alpha: F) -> F {
    let one = F::splat(1.0);
    let a2 = alpha * alpha;
    let d = n_h * n_h * (a2 - one) + one;
    a2 / (F::splat(PI) * d * d)
}

/// Smith's height-correlated masking and shadowing over `4 (n . l) (n . v)`.
#[cfg_attr(not(debug_assertions), inline(always))]
fn visibility<F: Floats>(n_v: F, n_l: F, alpha: F) -> F {
    let one = F::splat(1.0);
    let a2 = alpha * alpha;
    let light = n_v * (n_l * n_l * (one - a2) + a2).sqrt();
    let view = n_l * (n_v * n_v * (one - a2) + a2).sqrt();
    F::splat(0.5) / (light + view).max(F::splat(1e-7))
}

/// Directional albedo by roughness (rows) and cosine (columns): scale and bias of `f0`.
type Albedo = [[[f32; 2]; SIZE]; SIZE];

/// Scale and bias of `f0` in the directional albedo, by cosine and roughness.
#[cfg_attr(not(debug_assertions), inline(always))]
fn albedo<F: Floats>(cos: F, roughness: F) -> [F; 2] {
    static TABLE: OnceLock<Box<Albedo>> = OnceLock::new();
    let table: &Albedo = TABLE.get_or_init(albedo_table);
    let last = F::splat((SIZE - 1) as f32);
    let (x, y) = (clamp(cos, 0.0, 1.0) * last, clamp(roughness, 0.0, 1.0) * last);
    let (columns, rows) = (row(x), row(y));
    let mut low = [[0.0; LANES]; 2];
    // Entry by (row, column, scale or bias).
    let mut entries = [[[[0.0; LANES]; 2]; 2]; 2];
    for lane in Bits(F::ALL) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the table")]
        let (i, j) = ((columns[lane] as usize).min(SIZE - 2), (rows[lane] as usize).min(SIZE - 2));
        (low[0][lane], low[1][lane]) = (i as f32, j as f32);
        for (up, entries) in entries.iter_mut().enumerate() {
            for (right, entries) in entries.iter_mut().enumerate() {
                let [scale, bias] = table[j + up][i + right];
                (entries[0][lane], entries[1][lane]) = (scale, bias);
            }
        }
    }
    let (a, b) = (x - F::load(&low[0]), y - F::load(&low[1]));
    [cell(&entries, 0, a, b), cell(&entries, 1, a, b)]
}

/// Blend of four entries of the table.
#[cfg_attr(not(debug_assertions), inline(always))]
fn cell<F: Floats>(entries: &[[[Row; 2]; 2]; 2], k: usize, a: F, b: F) -> F {
    let [[low, high], [low2, high2]] = entries;
    let (low, high) = (between(&low[k], &high[k], a), between(&low2[k], &high2[k], a));
    low + (high - low) * b
}

#[inline(always)]
fn between<F: Floats>(from: &Row, to: &Row, part: F) -> F {
    let (low, high) = (F::load(from), F::load(to));
    low + (high - low) * part
}

/// Rows of roughness, columns of cosine, from normals drawn by their visibility-free density.
fn albedo_table() -> Box<Albedo> {
    const COUNT: u32 = 128;
    let mut table = Box::new([[[0.0; 2]; SIZE]; SIZE]);
    for (cell, out) in table.as_flattened_mut().iter_mut().enumerate() {
        let n_v = ((cell % SIZE) as f64 / (SIZE - 1) as f64).max(1e-3);
        let roughness = ((cell / SIZE) as f64 / (SIZE - 1) as f64).max(0.02);
        let alpha = roughness * roughness;
        let v = [(1.0 - n_v * n_v).sqrt(), n_v];
        let (mut scale, mut bias) = (0.0, 0.0);
        for i in 0..COUNT {
            let (u, w) = ((f64::from(i) + 0.5) / f64::from(COUNT), f64::from(i.reverse_bits()) / 4_294_967_296.0);
            let cos = ((1.0 - u) / (1.0 + (alpha * alpha - 1.0) * u)).sqrt();
            let h = [(1.0 - cos * cos).max(0.0).sqrt() * libm::cos(2.0 * std::f64::consts::PI * w), cos];
            let v_h = v[0] * h[0] + v[1] * h[1];
            let n_l = 2.0 * v_h * h[1] - v[1];
            if n_l > 0.0 && v_h > 0.0 {
                #[expect(clippy::cast_possible_truncation, reason = "a table of f32")]
                let [n_v, n_l32, alpha] = [n_v, n_l, alpha].map(|x| One::splat(x as f32));
                let shadow = f64::from(only(visibility(n_v, n_l32, alpha))) * 4.0 * n_l * v_h / cos;
                let x = 1.0 - v_h;
                let fresnel = x * x * x * x * x;
                scale += (1.0 - fresnel) * shadow;
                bias += fresnel * shadow;
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "a table of f32")]
        let mean = |sum: f64| (sum / f64::from(COUNT)) as f32;
        *out = [mean(scale), mean(bias)];
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        render::{math::frame, pattern::hash},
        simd::Lanes,
    };
    use glam::Vec3;

    /// A surface of one lane.
    fn surface(base: Vec3, metallic: f32, roughness: f32) -> Reflectance<One> {
        Reflectance::new(V3::splat(base), One::splat(metallic), One::splat(roughness))
    }

    /// Mean of `f(v, l) (n . l)` over the hemisphere by uniform directions, times its solid angle.
    fn reflected(surface: &Reflectance<One>, cos: f32) -> Vec3 {
        let n = Vec3::Z;
        let v = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let view = surface.view(One::splat(cos));
        let side = 600u32;
        let mut sum = Vec3::ZERO;
        for i in 0..side * side {
            let z = ((i % side) as f32 + 0.5) / side as f32;
            let phi = ((i / side) as f32 + 0.5) / side as f32 * 2.0 * PI;
            let r = (1.0 - z * z).sqrt();
            let l = Vec3::new(r * libm::cosf(phi), r * libm::sinf(phi), z);
            sum += surface.evaluate(&view, V3::splat(n), V3::splat(v), V3::splat(l), One::splat(z)).only();
        }
        sum * (2.0 * PI / (side * side) as f32)
    }

    #[test]
    fn a_white_metal_in_a_white_furnace_stays_white() {
        for roughness in [0.3, 0.5, 0.8, 1.0] {
            for cos in [0.3, 0.7, 1.0] {
                let albedo = reflected(&surface(Vec3::ONE, 1.0, roughness), cos).x;
                assert!((albedo - 1.0).abs() < 0.04, "roughness {roughness}, cosine {cos}: {albedo}");
            }
        }
    }

    #[test]
    fn a_white_dielectric_gains_no_energy() {
        for roughness in [0.3, 0.6, 1.0] {
            for cos in [0.1, 0.5, 1.0] {
                let albedo = reflected(&surface(Vec3::ONE, 0.0, roughness), cos).x;
                assert!((0.85..1.03).contains(&albedo), "roughness {roughness}, cosine {cos}: {albedo}");
            }
        }
    }

    #[test]
    fn surroundings_of_one_colour_reflect_as_one_colour() {
        for (metallic, roughness) in [(1.0, 0.2), (1.0, 1.0), (0.0, 0.4), (0.0, 1.0)] {
            let surface = surface(Vec3::ONE, metallic, roughness);
            for cos in [0.05, 0.4, 1.0] {
                let one = V3::splat(Vec3::ONE);
                let out = only(Reflectance::surroundings(&surface.view(One::splat(cos)), one, one).x);
                assert!((out - 1.0).abs() < 0.01, "{metallic} {roughness} {cos}: {out}");
            }
        }
    }

    #[test]
    fn reflection_is_reciprocal_in_its_single_scattering_part() {
        let half = One::splat(0.5);
        let surface = Reflectance { f0: V3::all(half), diffuse: V3::zero(), alpha: One::splat(0.25), roughness: half };
        let direction = |i: u64| {
            let (t, b) = frame(Vec3::Z);
            let part = |k: u64| hash(i * 2 + k) as f32 / 4.3e9 * 1.2 - 0.6;
            (t * part(0) + b * part(1) + Vec3::Z).normalize()
        };
        for i in 0..100 {
            let (v, l) = (direction(i), direction(i + 1000));
            let plain = |a: Vec3, b: Vec3| {
                let (cos, n_l) = (One::splat(a.z), One::splat(b.z));
                let view = View { cos, specular: V3::zero(), diffuse: V3::zero(), gain: V3::splat(Vec3::ONE) };
                let [n, a, l] = [Vec3::Z, a, b].map(V3::splat);
                only(surface.evaluate(&view, n, a, l, n_l).x) / b.z
            };
            assert!((plain(v, l) - plain(l, v)).abs() < 1e-4 * plain(v, l).max(1.0));
        }
    }
}
