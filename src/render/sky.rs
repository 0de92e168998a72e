//! The default surroundings: a soft gradient sky with a bright window, looked up analytically.
//!
//! A studio, not a place: light comes mostly from above, a little from the floor, and two soft boxes give metals
//! something to mirror. Everything is a short rational expression, so a look-up costs a few tens of operations.

use glam::Vec3;

use super::{
    math::{mix, smooth, unit_or},
    wide::{self, Floats, V3},
};

/// Light around the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sky {
    zenith: Vec3,
    horizon: Vec3,
    ground: Vec3,
    key: Vec3,
    rim: Vec3,
    boxes: f32,
}

impl Sky {
    /// The sky at full level (`level` 1 beside the default key light).
    pub(crate) fn new(level: f32) -> Self {
        Self {
            zenith: Vec3::new(0.50, 0.58, 0.70) * level,
            horizon: Vec3::new(0.52, 0.55, 0.58) * level,
            ground: Vec3::new(0.22, 0.205, 0.19) * level,
            key: unit_or(Vec3::new(-0.55, 0.62, 0.62), Vec3::Y),
            rim: unit_or(Vec3::new(0.85, 0.35, -0.45), Vec3::X),
            boxes: level,
        }
    }

    /// Irradiance over pi on a surface with unit normal `n`.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn irradiance<F: Floats>(&self, n: V3<F>) -> V3<F> {
        let up = V3::splat(mix(self.horizon, self.zenith, 0.6));
        let half = F::splat(0.5);
        let side = V3::mix(V3::splat(self.ground), up, half + half * n.y);
        // The rim box lends shape to the side away from the key light.
        let rim = n.dot(V3::splat(self.rim)).max(F::splat(0.0));
        side + V3::all(F::splat(0.10 * self.boxes) * rim)
    }

    /// Radiance mirrored around unit direction `r` by a surface of perceptual `roughness`.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn mirrored<F: Floats>(&self, r: V3<F>, roughness: F) -> V3<F> {
        let blur = F::splat(0.08) + roughness * roughness;
        let above = wide::smooth(-blur, blur, r.y);
        let height = r.y.max(F::splat(0.0));
        let sky = V3::mix(V3::splat(self.horizon), V3::splat(self.zenith), height * (F::splat(2.0) - height));
        let down = wide::smooth(F::splat(0.0), F::splat(0.6), -r.y);
        let ground = V3::mix(V3::splat(self.horizon * 0.55), V3::splat(self.ground), down);
        let base = V3::mix(ground, sky, above);
        let boxes = lobe(r, self.key, 0.10, blur) * F::splat(2.2) + lobe(r, self.rim, 0.06, blur) * F::splat(1.4);
        base + V3::all(F::splat(self.boxes) * boxes)
    }
}

/// A soft disc around `center` of size `size` (one minus the cosine), blurred and dimmed by `blur`.
#[cfg_attr(not(debug_assertions), inline(always))]
fn lobe<F: Floats>(r: V3<F>, center: Vec3, size: f32, blur: F) -> F {
    let (one, size) = (F::splat(1.0), F::splat(size));
    let away = one - r.dot(V3::splat(center));
    let spread = size + blur;
    let x = away / spread;
    let x2 = x * x;
    size / spread / (one + x2 * x2)
}

/// Colour of the backdrop at `v` from the picture's top (0) to its bottom (1), scene-referred.
pub(crate) fn backdrop(v: f32) -> Vec3 {
    let s = smooth(0.0, 1.0, v);
    mix(Vec3::new(0.090, 0.104, 0.125), Vec3::new(0.300, 0.312, 0.325), s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{render::wide::One, simd::Lanes};

    fn irradiance(sky: &Sky, n: Vec3) -> Vec3 {
        sky.irradiance(V3::<One>::splat(n)).only()
    }

    fn mirrored(sky: &Sky, r: Vec3, roughness: f32) -> Vec3 {
        sky.mirrored(V3::<One>::splat(r), One::splat(roughness)).only()
    }

    #[test]
    fn light_comes_from_above_and_is_never_negative() {
        let sky = Sky::new(1.0);
        assert!(irradiance(&sky, Vec3::Y).min_element() > 2.0 * irradiance(&sky, Vec3::NEG_Y).max_element());
        for i in 0..500 {
            let d = unit_or(Vec3::new((i % 9) as f32 - 4.0, (i % 7) as f32 - 3.0, (i % 5) as f32 - 2.0), Vec3::X);
            for roughness in [0.0, 0.5, 1.0] {
                let m = mirrored(&sky, d, roughness);
                assert!(m.min_element() > 0.0 && m.max_element() < 4.0, "{d} {m}");
            }
        }
    }

    #[test]
    fn a_dim_sky_is_the_same_sky_scaled() {
        let (full, half) = (Sky::new(1.0), Sky::new(0.5));
        let n = unit_or(Vec3::new(0.3, 0.4, -0.2), Vec3::Y);
        assert!((irradiance(&full, n) * 0.5 - irradiance(&half, n)).abs().max_element() < 1e-6);
        assert!((mirrored(&full, n, 0.3) * 0.5 - mirrored(&half, n, 0.3)).abs().max_element() < 1e-6);
    }
}
