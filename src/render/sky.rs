//! The default surroundings: a soft gradient sky with a bright window, looked up analytically.
//!
//! A studio, not a place: light comes mostly from above, a little from the floor, and two soft boxes give metals
//! something to mirror. Everything is a short rational expression, so a look-up costs a few tens of operations.

use glam::Vec3;

use super::math::{mix, smooth, unit_or};

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
    #[inline(always)]
    pub(crate) fn irradiance(&self, n: Vec3) -> Vec3 {
        let up = mix(self.horizon, self.zenith, 0.6);
        let side = mix(self.ground, up, 0.5 + 0.5 * n.y);
        // The rim box lends shape to the side away from the key light.
        side + Vec3::splat(0.10 * self.boxes * n.dot(self.rim).max(0.0))
    }

    /// Radiance mirrored around unit direction `r` by a surface of perceptual `roughness`.
    #[inline(always)]
    pub(crate) fn mirrored(&self, r: Vec3, roughness: f32) -> Vec3 {
        let blur = 0.08 + roughness * roughness;
        let above = smooth(-blur, blur, r.y);
        let height = r.y.max(0.0);
        let sky = mix(self.horizon, self.zenith, height * (2.0 - height));
        let ground = mix(self.horizon * 0.55, self.ground, smooth(0.0, 0.6, -r.y));
        let base = mix(ground, sky, above);
        base + Vec3::splat(self.boxes) * (lobe(r, self.key, 0.10, blur) * 2.2 + lobe(r, self.rim, 0.06, blur) * 1.4)
    }
}

/// A soft disc around `center` of size `size` (one minus the cosine), blurred and dimmed by `blur`.
#[inline(always)]
fn lobe(r: Vec3, center: Vec3, size: f32, blur: f32) -> f32 {
    let away = 1.0 - r.dot(center);
    let spread = size + blur;
    let x = away / spread;
    let x2 = x * x;
    size / spread / (1.0 + x2 * x2)
}

/// Colour of the backdrop at `v` from the picture's top (0) to its bottom (1), scene-referred.
pub(crate) fn backdrop(v: f32) -> Vec3 {
    let s = smooth(0.0, 1.0, v);
    mix(Vec3::new(0.090, 0.104, 0.125), Vec3::new(0.300, 0.312, 0.325), s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_comes_from_above_and_is_never_negative() {
        let sky = Sky::new(1.0);
        assert!(sky.irradiance(Vec3::Y).min_element() > 2.0 * sky.irradiance(Vec3::NEG_Y).max_element());
        for i in 0..500 {
            let d = unit_or(Vec3::new((i % 9) as f32 - 4.0, (i % 7) as f32 - 3.0, (i % 5) as f32 - 2.0), Vec3::X);
            for roughness in [0.0, 0.5, 1.0] {
                let m = sky.mirrored(d, roughness);
                assert!(m.min_element() > 0.0 && m.max_element() < 4.0, "{d} {m}");
            }
        }
    }

    #[test]
    fn a_dim_sky_is_the_same_sky_scaled() {
        let (full, half) = (Sky::new(1.0), Sky::new(0.5));
        let n = unit_or(Vec3::new(0.3, 0.4, -0.2), Vec3::Y);
        assert!((full.irradiance(n) * 0.5 - half.irradiance(n)).abs().max_element() < 1e-6);
        assert!((full.mirrored(n, 0.3) * 0.5 - half.mirrored(n, 0.3)).abs().max_element() < 1e-6);
    }
}
