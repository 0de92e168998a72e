//! Lights of a frame: the file's punctual lights, or a key light of our own.

use glam::Vec3;

use super::{
    math::{frame, luminance, unit_or},
    wide::{Floats, One, Row, V2, V3, clamp, only},
};
use crate::{
    anim::Pose,
    scene::{LightKind, NodeId, Scene},
    simd::Lanes,
};

/// A light placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LightSource {
    /// Position; for directional lights unused.
    position: Vec3,
    /// Unit direction towards the light, for directional lights; the reverse of the axis for spots.
    to_light: Vec3,
    /// Candela, or lux for directional lights, times colour and exposure.
    intensity: Vec3,
    /// Inverse of the range; 0 without one.
    inv_range: f32,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Parallel light from a disc of this angular radius (tangent).
    Directional {
        spread: f32,
    },
    Point,
    /// Cosines of the cone's half angles.
    Spot {
        inner: f32,
        outer: f32,
    },
}

/// Light arriving at points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Incident<F> {
    /// Lanes that light reaches.
    pub(crate) mask: u32,
    /// Unit direction towards the light.
    pub(crate) dir: V3<F>,
    /// Irradiance on a surface that faces the light.
    pub(crate) level: V3<F>,
    /// Distance to the light; infinite for directional lights.
    pub(crate) distance: F,
}

impl LightSource {
    /// The default key light: warm, from the upper left of somebody who looks at the front (+Z).
    pub(crate) fn key() -> Self {
        Self {
            position: Vec3::ZERO,
            to_light: unit_or(Vec3::new(-0.42, 0.95, 0.82), Vec3::Y),
            intensity: Vec3::new(1.0, 0.945, 0.86) * 2.7,
            inv_range: 0.0,
            kind: Kind::Directional { spread: 0.022 },
        }
    }

    /// The light at a node of `scene` in `pose`, scaled by `exposure`; `None` without one or when it gives nothing.
    pub(crate) fn at_node(scene: &Scene, pose: &Pose, node: NodeId, exposure: f32) -> Option<Self> {
        let light = scene.lights.get(scene.nodes[node.index()].light?.index())?;
        let placed = pose.world_from_node(node);
        let intensity = (light.color * light.intensity * exposure).max(Vec3::ZERO);
        if !(intensity.is_finite() && intensity.max_element() > 0.0) {
            return None;
        }
        let cos = |angle: f32| libm::cosf(if angle.is_finite() { angle.clamp(0.0, 1.570_796_4) } else { 0.0 });
        let kind = match light.kind {
            LightKind::Directional => Kind::Directional { spread: 0.0 },
            LightKind::Point => Kind::Point,
            LightKind::Spot { inner, outer } => Kind::Spot { inner: cos(inner), outer: cos(outer) },
        };
        Some(Self {
            position: placed.translation.as_vec3(),
            to_light: unit_or(placed.matrix3.z_axis.as_vec3(), Vec3::Z),
            intensity,
            inv_range: light.range.filter(|&r| r > 0.0).map_or(0.0, |r| 1.0 / r),
            kind,
        })
    }

    /// Light that reaches the points `p`; `disc` holds points of the unit disc that pick a spot on lights with a size.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn incident<F: Floats>(&self, p: V3<F>, disc: Option<&[Row; 2]>) -> Incident<F> {
        if let Kind::Directional { spread } = self.kind {
            let mut dir = V3::splat(self.to_light);
            if let Some(disc) = disc.filter(|_| spread > 0.0) {
                let disc = V2::<F>::load(disc);
                let (a, b) = frame(self.to_light);
                let spot = (V3::splat(a) * disc.x + V3::splat(b) * disc.y) * F::splat(spread);
                dir = (dir + spot).unit_or(dir);
            }
            return Incident { mask: F::ALL, dir, level: V3::splat(self.intensity), distance: F::splat(f32::INFINITY) };
        }
        let (zero, one) = (F::splat(0.0), F::splat(1.0));
        let towards = V3::splat(self.position) - p;
        let distance2 = towards.length_squared();
        let distance = distance2.sqrt();
        let dir = towards.over(distance);
        let mut level = V3::splat(self.intensity).over(distance2);
        if self.inv_range > 0.0 {
            let part = distance * F::splat(self.inv_range);
            let part2 = part * part;
            level = level * clamp(one - part2 * part2, 0.0, 1.0);
        }
        if let Kind::Spot { inner, outer } = self.kind {
            let cos = dir.dot(V3::splat(self.to_light));
            let edge = clamp((cos - F::splat(outer)) / F::splat((inner - outer).max(1e-4)), 0.0, 1.0);
            level = level * (edge * edge);
        }
        let brightest = level.max_element();
        Incident { mask: zero.lt(brightest) & brightest.lt(F::splat(f32::INFINITY)), dir, level, distance }
    }

    /// Irradiance (luminance) on a surface at `p` with unit normal `n`, either side.
    pub(crate) fn irradiance(&self, p: Vec3, n: Vec3) -> f32 {
        let incident = self.incident(V3::<One>::splat(p), None);
        if incident.mask == 0 {
            return 0.0;
        }
        luminance(incident.level.only()) * only(incident.dir.dot(V3::splat(n)).abs())
    }

    /// True for lights with a size, whose shadows soften with more samples.
    pub(crate) fn has_size(&self) -> bool {
        matches!(self.kind, Kind::Directional { spread } if spread > 0.0)
    }
}

/// Fades the light on facets that turn from it, where interpolated normals still face it.
///
/// # Source
/// Chiang, Li and Burley, "Taming the Shadow Terminator", 2019.
#[cfg_attr(not(debug_assertions), inline(always))]
pub(crate) fn terminator<F: Floats>(geom_cos: F, shade_cos: F, between: F) -> F {
    let one = F::splat(1.0);
    let g = (geom_cos / (shade_cos * between).max(F::splat(1e-6))).min(one);
    // -g^3 + g^2 + g
    F::select(F::splat(0.0).lt(geom_cos), g * (one + g * (one - g)), F::splat(0.0))
}
