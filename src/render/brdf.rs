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

use glam::Vec3;

use super::math::pow5;

/// Least perceptual roughness: a point light's highlight keeps a visible size.
const LEAST_ROUGHNESS: f32 = 0.07;
/// Entries a side of the table.
const SIZE: usize = 32;

/// A surface's reflectance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reflectance {
    /// Diffuse albedo.
    pub(crate) diffuse: Vec3,
    /// Reflectance at normal incidence.
    pub(crate) f0: Vec3,
    /// Square of perceptual roughness.
    pub(crate) alpha: f32,
    /// Perceptual roughness.
    pub(crate) roughness: f32,
}

/// What depends on the view direction but not on the light, made once a shading point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    cos: f32,
    /// Directional albedo of the specular layer.
    specular: Vec3,
    /// Albedo of what lies below it.
    diffuse: Vec3,
    /// Gain that makes up for scattering between microfacets.
    gain: Vec3,
}

impl Reflectance {
    /// Of base colour, metalness and perceptual roughness, as glTF mixes them.
    #[inline(always)]
    pub(crate) fn new(base: Vec3, metallic: f32, roughness: f32) -> Self {
        let roughness = roughness.clamp(LEAST_ROUGHNESS, 1.0);
        let f0 = Vec3::splat(0.04);
        Self {
            diffuse: base * (1.0 - metallic),
            f0: f0 + (base - f0) * metallic,
            alpha: roughness * roughness,
            roughness,
        }
    }

    /// The part that depends on the view alone; `cos` between view and shading normal, positive.
    #[inline(always)]
    pub(crate) fn view(&self, cos: f32) -> View {
        let split = albedo(cos, self.roughness);
        let lost = 1.0 / (split[0] + split[1]).max(1e-3) - 1.0;
        let gain = Vec3::ONE + self.f0 * lost;
        let specular = (self.f0 * split[0] + split[1]) * gain;
        View { cos, specular, diffuse: self.diffuse * (Vec3::ONE - specular).max(Vec3::ZERO), gain }
    }

    /// Reflected radiance a unit of irradiance facing the light, times the cosine: `f(v, l) * (n . l)`.
    ///
    /// `l` and `v` are unit; `n_l` is the clamped cosine between `n` and `l`.
    #[inline(always)]
    pub(crate) fn evaluate(&self, view: &View, n: Vec3, v: Vec3, l: Vec3, n_l: f32) -> Vec3 {
        let h = (v + l) * (1.0 / (v + l).length().max(1e-6));
        let (n_h, v_h) = (n.dot(h).clamp(0.0, 1.0), v.dot(h).clamp(0.0, 1.0));
        let fresnel = self.f0 + (Vec3::ONE - self.f0) * pow5(1.0 - v_h);
        let specular = distribution(n_h, self.alpha) * visibility(view.cos, n_l, self.alpha);
        (view.diffuse * (1.0 / PI) + fresnel * view.gain * specular) * n_l
    }

    /// Light reflected from surroundings: `irradiance` over pi around the normal, `mirrored` around the
    /// reflected direction.
    #[inline(always)]
    pub(crate) fn surroundings(view: &View, irradiance: Vec3, mirrored: Vec3) -> Vec3 {
        view.diffuse * irradiance + view.specular * mirrored
    }
}

/// GGX distribution of normals.
#[inline(always)]
fn distribution(n_h: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let d = n_h * n_h * (a2 - 1.0) + 1.0;
    a2 / (PI * d * d)
}

/// Smith's height-correlated masking and shadowing over `4 (n . l) (n . v)`.
#[inline(always)]
fn visibility(n_v: f32, n_l: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let light = n_v * (n_l * n_l * (1.0 - a2) + a2).sqrt();
    let view = n_l * (n_v * n_v * (1.0 - a2) + a2).sqrt();
    0.5 / (light + view).max(1e-7)
}

/// Scale and bias of `f0` in the directional albedo, by cosine and roughness.
#[inline(always)]
fn albedo(cos: f32, roughness: f32) -> [f32; 2] {
    static TABLE: OnceLock<Box<[[f32; 2]]>> = OnceLock::new();
    let table = TABLE.get_or_init(albedo_table);
    let at = |x: f32| {
        let x = x.clamp(0.0, 1.0) * (SIZE - 1) as f32;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the table")]
        let low = (x as usize).min(SIZE - 2);
        (low, x - low as f32)
    };
    let ((i, a), (j, b)) = (at(cos), at(roughness));
    let row = |j: usize, k: usize| {
        let (low, high) = (table[j * SIZE + i][k], table[j * SIZE + i + 1][k]);
        low + (high - low) * a
    };
    let cell = |k: usize| {
        let (low, high) = (row(j, k), row(j + 1, k));
        low + (high - low) * b
    };
    [cell(0), cell(1)]
}

/// Rows of roughness, columns of cosine, from normals drawn by their visibility-free density.
fn albedo_table() -> Box<[[f32; 2]]> {
    const COUNT: u32 = 128;
    let mut table = vec![[0.0; 2]; SIZE * SIZE].into_boxed_slice();
    for (cell, out) in table.iter_mut().enumerate() {
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
                let shadow = f64::from(visibility(n_v as f32, n_l as f32, alpha as f32)) * 4.0 * n_l * v_h / cos;
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
    use crate::render::{math::frame, pattern::hash};

    /// Mean of `f(v, l) (n . l)` over the hemisphere by uniform directions, times its solid angle.
    fn reflected(surface: &Reflectance, cos: f32) -> Vec3 {
        let n = Vec3::Z;
        let v = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let view = surface.view(cos);
        let side = 600u32;
        let mut sum = Vec3::ZERO;
        for i in 0..side * side {
            let z = ((i % side) as f32 + 0.5) / side as f32;
            let phi = ((i / side) as f32 + 0.5) / side as f32 * 2.0 * PI;
            let r = (1.0 - z * z).sqrt();
            let l = Vec3::new(r * libm::cosf(phi), r * libm::sinf(phi), z);
            sum += surface.evaluate(&view, n, v, l, z);
        }
        sum * (2.0 * PI / (side * side) as f32)
    }

    #[test]
    fn a_white_metal_in_a_white_furnace_stays_white() {
        for roughness in [0.3, 0.5, 0.8, 1.0] {
            for cos in [0.3, 0.7, 1.0] {
                let albedo = reflected(&Reflectance::new(Vec3::ONE, 1.0, roughness), cos).x;
                assert!((albedo - 1.0).abs() < 0.04, "roughness {roughness}, cosine {cos}: {albedo}");
            }
        }
    }

    #[test]
    fn a_white_dielectric_gains_no_energy() {
        for roughness in [0.3, 0.6, 1.0] {
            for cos in [0.1, 0.5, 1.0] {
                let albedo = reflected(&Reflectance::new(Vec3::ONE, 0.0, roughness), cos).x;
                assert!((0.85..1.03).contains(&albedo), "roughness {roughness}, cosine {cos}: {albedo}");
            }
        }
    }

    #[test]
    fn surroundings_of_one_colour_reflect_as_one_colour() {
        for (metallic, roughness) in [(1.0, 0.2), (1.0, 1.0), (0.0, 0.4), (0.0, 1.0)] {
            let surface = Reflectance::new(Vec3::ONE, metallic, roughness);
            for cos in [0.05, 0.4, 1.0] {
                let out = Reflectance::surroundings(&surface.view(cos), Vec3::ONE, Vec3::ONE).x;
                assert!((out - 1.0).abs() < 0.01, "{metallic} {roughness} {cos}: {out}");
            }
        }
    }

    #[test]
    fn reflection_is_reciprocal_in_its_single_scattering_part() {
        let surface = Reflectance { f0: Vec3::splat(0.5), diffuse: Vec3::ZERO, alpha: 0.25, roughness: 0.5 };
        let direction = |i: u64| {
            let (t, b) = frame(Vec3::Z);
            let part = |k: u64| hash(i * 2 + k) as f32 / 4.3e9 * 1.2 - 0.6;
            (t * part(0) + b * part(1) + Vec3::Z).normalize()
        };
        for i in 0..100 {
            let (v, l) = (direction(i), direction(i + 1000));
            let plain = |a: Vec3, b: Vec3| {
                let view = View { cos: a.z, specular: Vec3::ZERO, diffuse: Vec3::ZERO, gain: Vec3::ONE };
                surface.evaluate(&view, Vec3::Z, a, b, b.z).x / b.z
            };
            assert!((plain(v, l) - plain(l, v)).abs() < 1e-4 * plain(v, l).max(1.0));
        }
    }
}
