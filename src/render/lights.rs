//! Lights of a frame: the file's punctual lights, or a key light of our own.

use glam::Vec3;

use super::math::{frame, luminance, unit_or};
use crate::{
    anim::Pose,
    scene::{LightKind, NodeId, Scene},
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

/// Light arriving at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Incident {
    /// Unit direction towards the light.
    pub(crate) dir: Vec3,
    /// Irradiance on a surface that faces the light.
    pub(crate) level: Vec3,
    /// Distance to the light; infinite for directional lights.
    pub(crate) distance: f32,
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

    /// Light that reaches `p`; `disc` is a point of the unit disc that picks a spot on lights with a size.
    #[inline(always)]
    pub(crate) fn incident(&self, p: Vec3, disc: (f32, f32)) -> Option<Incident> {
        if let Kind::Directional { spread } = self.kind {
            let mut dir = self.to_light;
            if spread > 0.0 && disc != (0.0, 0.0) {
                let (a, b) = frame(dir);
                dir = unit_or(dir + (a * disc.0 + b * disc.1) * spread, dir);
            }
            return Some(Incident { dir, level: self.intensity, distance: f32::INFINITY });
        }
        let towards = self.position - p;
        let distance2 = towards.length_squared();
        let distance = distance2.sqrt();
        let dir = towards / distance;
        let mut level = self.intensity / distance2;
        if self.inv_range > 0.0 {
            let part = distance * self.inv_range;
            let part2 = part * part;
            level *= (1.0 - part2 * part2).clamp(0.0, 1.0);
        }
        if let Kind::Spot { inner, outer } = self.kind {
            let cos = dir.dot(self.to_light);
            let edge = ((cos - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
            level *= edge * edge;
        }
        (level.max_element() > 0.0 && level.is_finite()).then_some(Incident { dir, level, distance })
    }

    /// Irradiance (luminance) on a surface at `p` with unit normal `n`, either side.
    pub(crate) fn irradiance(&self, p: Vec3, n: Vec3) -> f32 {
        self.incident(p, (0.0, 0.0)).map_or(0.0, |i| luminance(i.level) * i.dir.dot(n).abs())
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
#[inline(always)]
pub(crate) fn terminator(geom_cos: f32, shade_cos: f32, between: f32) -> f32 {
    if geom_cos <= 0.0 {
        return 0.0;
    }
    let g = (geom_cos / (shade_cos * between).max(1e-6)).min(1.0);
    // -g^3 + g^2 + g
    g * (1.0 + g * (1.0 - g))
}
