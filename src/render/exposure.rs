//! One exposure a scene, from its rest pose: the file's lights may be candles or suns.

use glam::Vec3;

use super::lights::LightSource;
use crate::{
    anim::{Pose, deform_range},
    scene::{NodeId, Scene},
};

/// Triangles looked at; more add nothing to the mean.
const SAMPLES: usize = 2048;
/// Mean irradiance that a lit scene is brought to.
const TARGET: f32 = 2.2;

/// The scale that brings the mean irradiance of the lit surfaces in the rest pose to a fixed level, without
/// regard to shadows. 1 without lights or when they reach nothing.
pub(crate) fn of_scene(scene: &Scene, light_nodes: &[NodeId]) -> f32 {
    if light_nodes.is_empty() {
        return 1.0;
    }
    let pose = Pose::rest(scene);
    let lights: Vec<_> = light_nodes.iter().filter_map(|&n| LightSource::at_node(scene, &pose, n, 1.0)).collect();
    let step = scene.triangles_drawn().div_ceil(SAMPLES).max(1);
    let (mut sum, mut area) = (0.0f64, 0.0f64);
    let mut next = 0;
    for &instance in &scene.instances {
        let triangles = &scene.part(instance).triangles;
        while next < triangles.len() {
            let corners = triangles[next].map(|i| {
                let mut out = [Vec3::ZERO];
                deform_range(scene, &pose, instance, i as usize, &mut out);
                out[0]
            });
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]) * 0.5;
            let size = normal.length();
            if size > 0.0 && size.is_finite() {
                let center = (corners[0] + corners[1] + corners[2]) / 3.0;
                let level: f32 = lights.iter().map(|l| l.irradiance(center, normal / size)).sum();
                if level > 0.0 && level.is_finite() {
                    sum += f64::from(level) * f64::from(size);
                    area += f64::from(size);
                }
            }
            next += step;
        }
        next -= triangles.len();
    }
    #[expect(clippy::cast_possible_truncation, reason = "a rounded mean")]
    let mean = (sum / area) as f32;
    if mean > 0.0 && mean.is_finite() { (TARGET / mean).clamp(1e-7, 1e7) } else { 1.0 }
}
