//! Skin weights: nearness to the bones, smoothed over the surface, the four greatest kept.

use glam::DVec3;

use super::rig::{ARM_DIR, BALL, JOINTS, Joint};
use crate::scenes::nets::Surface;

/// Four joints and their weights, which sum to one.
#[derive(Clone, Copy)]
pub struct Influence {
    /// Joint numbers.
    pub joints: [u8; 4],
    /// Weights.
    pub weights: [f64; 4],
}

/// Width over which neighbouring bones share the surface, in metres.
const SHARE: f64 = 0.016;
const SMOOTHING_ROUNDS: usize = 12;

/// Weights of every vertex of the figure's surface.
pub fn bind(surface: &Surface) -> Vec<Influence> {
    let mut weights: Vec<Vec<f64>> = surface.positions.iter().map(|&p| by_distance(p)).collect();
    let neighbours = surface.neighbours();
    for _ in 0..SMOOTHING_ROUNDS {
        let smoothed = |(own, list): (&Vec<f64>, &Vec<u32>)| {
            let mean = |j: usize| list.iter().map(|&n| weights[n as usize][j]).sum::<f64>() / list.len() as f64;
            (0..JOINTS.len()).map(|j| 0.5 * own[j] + 0.5 * mean(j)).collect()
        };
        weights = weights.iter().zip(&neighbours).map(smoothed).collect();
    }
    weights.iter().map(|w| strongest(w)).collect()
}

fn by_distance(p: DVec3) -> Vec<f64> {
    let distances = JOINTS.map(|joint| bone_distance(joint, p));
    let least = distances.iter().fold(f64::INFINITY, |a, &b| a.min(b));
    let raw = distances.map(|d| libm::exp((least - d) / SHARE));
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|w| w / sum).collect()
}

/// Distance of `p` from the bone that starts at `joint`, less the flesh around it.
fn bone_distance(joint: Joint, p: DVec3) -> f64 {
    let start = joint.position();
    let side = if start.x < 0.0 { -1.0 } else { 1.0 };
    let arm = DVec3::new(side * ARM_DIR.x, ARM_DIR.y, 0.0);
    let (end, flesh) = match joint {
        Joint::Hips => (DVec3::new(0.0, 0.93, 0.0), 0.12),
        Joint::Spine => (DVec3::new(0.0, 1.05, 0.0), 0.12),
        Joint::Chest => (DVec3::new(0.0, 1.22, 0.0), 0.12),
        Joint::Neck => (DVec3::new(0.0, 1.33, 0.0), 0.05),
        Joint::Head => (DVec3::new(0.0, 1.52, 0.02), 0.10),
        Joint::ClavicleL | Joint::ClavicleR => (start + DVec3::new(side * 0.08, -0.01, 0.0), 0.06),
        Joint::UpperArmL | Joint::UpperArmR => (start + arm * 0.225, 0.06),
        Joint::ForearmL | Joint::ForearmR => (start + arm * 0.205, 0.05),
        Joint::HandL | Joint::HandR => (start + arm * 0.07, 0.035),
        Joint::FingersL | Joint::FingersR => (start + arm * 0.07, 0.03),
        Joint::ThighL | Joint::ThighR => (start - DVec3::Y * 0.365, 0.08),
        Joint::ShinL | Joint::ShinR => (start - DVec3::Y * 0.35, 0.06),
        Joint::FootL | Joint::FootR => (start + DVec3::new(0.0, -0.055, BALL.z - 0.035), 0.045),
        Joint::ToesL | Joint::ToesR => (start + DVec3::new(0.0, 0.0, 0.05), 0.045),
    };
    let axis = end - start;
    let along = ((p - start).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
    (p - start - axis * along).length() - flesh
}

fn strongest(weights: &[f64]) -> Influence {
    let mut order: Vec<usize> = (0..weights.len()).collect();
    order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
    let kept: [usize; 4] = [order[0], order[1], order[2], order[3]];
    let least = weights[order[4]].max(0.004);
    let raw = kept.map(|j| (weights[j] - least).max(0.0));
    let sum: f64 = raw.iter().sum();
    // A joint without weight is written as joint 0, as the format asks.
    Influence {
        joints: std::array::from_fn(|i| if raw[i] > 0.0 { kept[i] as u8 } else { 0 }),
        weights: raw.map(|w| w / sum),
    }
}
