//! A walk: what every joint does at every phase of the cycle.
//!
//! Feet are planned on the ground (heel strike, roll, toe off) and the legs follow by two-bone inverse
//! kinematics; hips, spine, arms and head swing with fixed phases. The walker stays in place while the
//! ground moves back by [`STRIDE`] a cycle; a planted heel, sole or toe keeps exactly the ground's speed.

use glam::{DQuat, DVec3};

use super::rig::{ANKLE_HEIGHT, BALL, HEEL, JOINTS, Joint, LEG};
use crate::scenes::maths::{about, cos_turns, deg, euler, from_axes, mix, smoothstep};

/// Metres the ground moves in one cycle of two steps.
pub const STRIDE: f64 = 1.0;
/// Seconds a cycle takes.
pub const CYCLE: f64 = 1.0;

/// Part of the cycle that a foot is on the ground.
const STANCE: f64 = 0.58;
/// How far the toes point up at heel strike, and the heel rises before toe off, in radians.
const STRIKE_PITCH: f64 = 0.33;
const HEEL_RISE: f64 = 0.84;
const HIP_HEIGHT: f64 = 0.83;
const TOE_OUT: f64 = 0.10;

/// Everything the rig needs at one moment.
pub struct Posture {
    /// Place of the hips joint.
    pub hips: DVec3,
    /// Rotation of each joint against its parent.
    pub rotations: [DQuat; JOINTS.len()],
}

/// A foot: place of the ankle against the walker's middle, pitch (toes up positive) and bend of the toes.
#[derive(Clone, Copy)]
struct Foot {
    ankle: DVec3,
    pitch: f64,
    toe_bend: f64,
}

/// Rotation that lifts the toes by `angle`.
fn toes_up(angle: f64) -> DQuat {
    about(DVec3::X, -angle)
}

/// The foot on the ground, `phase` since its heel strike, pointing along `yaw`.
fn stance(phase: f64, yaw: DQuat) -> Foot {
    let flat = DVec3::new(0.0, ANKLE_HEIGHT, -0.015 + STRIDE * (0.5 * STANCE - phase));
    let rise = smoothstep(0.30, 0.68, phase) / smoothstep(0.30, 0.68, STANCE);
    let pitch =
        STRIKE_PITCH * (1.0 - smoothstep(-0.04, 0.10, phase)) / (1.0 - smoothstep(-0.04, 0.10, 0.0)) - HEEL_RISE * rise;
    // The pivot keeps its place on the ground: the heel at first, the toe joint (toes flat) at the end.
    let pivot = if pitch > 0.0 { HEEL } else { DVec3::new(BALL.x, BALL.y + 0.03, BALL.z) };
    Foot { ankle: flat + yaw * (pivot - toes_up(pitch) * pivot), pitch, toe_bend: (-pitch).max(0.0) }
}

/// The foot at any phase of the cycle, 0 at heel strike.
fn foot(phase: f64, yaw: DQuat) -> Foot {
    let phase = phase - phase.floor();
    if phase <= STANCE {
        return stance(phase, yaw);
    }
    let alpha = (phase - STANCE) / (1.0 - STANCE);
    let (off, strike) = (stance(STANCE, yaw), stance(0.0, yaw));
    let h = 1e-4;
    let scale = (1.0 - STANCE) / h;
    let (before, after) = (stance(STANCE - h, yaw), stance(h, yaw));
    let leave = (off.ankle - before.ankle) * scale;
    let arrive = (after.ankle - strike.ankle) * scale;
    let ankle = hermite(off.ankle, leave, strike.ankle, arrive, alpha);
    let ends = |a: f64| DVec3::new(a, 0.0, 0.0);
    let pitch_slopes = [(off.pitch - before.pitch) * scale, (after.pitch - strike.pitch) * scale];
    let pitch = hermite(ends(off.pitch), ends(pitch_slopes[0]), ends(strike.pitch), ends(pitch_slopes[1]), alpha).x;
    let lift = 0.030 * smoothstep(0.1, 0.5, alpha) * (1.0 - smoothstep(0.5, 0.95, alpha));
    Foot {
        ankle: ankle + DVec3::Y * lift,
        pitch,
        toe_bend: off.toe_bend * (1.0 - smoothstep(0.05, 0.75, alpha))
            - 0.15 * smoothstep(0.6, 1.0, alpha) * (1.0 - alpha),
    }
}

fn hermite(a: DVec3, slope_a: DVec3, b: DVec3, slope_b: DVec3, s: f64) -> DVec3 {
    let (s2, s3) = (s * s, s * s * s);
    a * (2.0 * s3 - 3.0 * s2 + 1.0) + slope_a * (s3 - 2.0 * s2 + s) + b * (3.0 * s2 - 2.0 * s3) + slope_b * (s3 - s2)
}

/// World rotations and the place of the hips while the posture is worked out.
struct Stance {
    hips: DVec3,
    world: [DQuat; JOINTS.len()],
}

/// The posture at `phase` of the cycle; the left heel strikes at 0, the right one at one half.
pub fn posture(phase: f64) -> Posture {
    let mut at = Stance { hips: hips_place(phase), world: [DQuat::IDENTITY; JOINTS.len()] };
    trunk(&mut at, phase);
    leg(&mut at, phase, [Joint::ThighL, Joint::ShinL, Joint::FootL, Joint::ToesL]);
    leg(&mut at, phase + 0.5, [Joint::ThighR, Joint::ShinR, Joint::FootR, Joint::ToesR]);
    arm(&mut at, phase, 1.0, Joint::ClavicleL);
    arm(&mut at, phase + 0.5, -1.0, Joint::ClavicleR);
    let local = |joint: Joint| {
        let own = at.world[joint as usize];
        joint.parent().map_or(own, |p| at.world[p as usize].conjugate() * own)
    };
    Posture { hips: at.hips, rotations: JOINTS.map(local) }
}

/// Lowest when both feet are down, highest over the standing leg, and towards it.
fn hips_place(phase: f64) -> DVec3 {
    DVec3::new(
        0.018 * cos_turns(phase - 0.30),
        HIP_HEIGHT - 0.017 * cos_turns(2.0 * (phase - 0.04)),
        0.006 * cos_turns(2.0 * (phase - 0.20)),
    )
}

fn trunk(at: &mut Stance, phase: f64) {
    let (turn, tip, beat) = (cos_turns(phase), cos_turns(phase - 0.29), cos_turns(2.0 * (phase - 0.06)));
    let set = |lean: f64, yaw: f64, roll: f64| euler(deg(lean), deg(yaw), deg(roll));
    at.world[Joint::Hips as usize] = set(3.0, -7.0 * turn, 3.2 * tip);
    at.world[Joint::Spine as usize] = set(3.5 + 0.6 * beat, -turn, 0.4 * tip);
    at.world[Joint::Chest as usize] = set(2.5 + 0.8 * beat, 7.0 * turn, -1.8 * tip);
    at.world[Joint::Neck as usize] = set(3.0 - 0.5 * beat, 3.0 * turn, -0.8 * tip);
    at.world[Joint::Head as usize] = set(-1.0 - 1.0 * beat, 1.2 * turn, -0.5 * tip);
}

/// A leg whose heel strikes at `phase` 0, by two-bone inverse kinematics.
fn leg(at: &mut Stance, phase: f64, [thigh, shin, foot_joint, toes]: [Joint; 4]) {
    let side = if thigh == Joint::ThighL { 1.0 } else { -1.0 };
    let yaw = about(DVec3::Y, side * TOE_OUT);
    let foot = foot(phase, yaw);
    let hip_offset = thigh.position() - Joint::Hips.position();
    let hip = at.hips + at.world[Joint::Hips as usize] * hip_offset;
    let ankle = foot.ankle + DVec3::X * (side * 0.068);
    let forward = yaw * DVec3::Z;
    let reach = ankle - hip;
    let length = reach.length().min(0.9995 * (LEG[0] + LEG[1]));
    let up = -reach / reach.length();
    let x = up.cross(forward).normalize();
    let frame = from_axes(x, up, x.cross(up));
    // Both bones are equally long, so the knee bends both by the same angle.
    let bend = libm::acos(length / (LEG[0] + LEG[1]));
    at.world[thigh as usize] = frame * about(DVec3::X, -bend);
    at.world[shin as usize] = frame * about(DVec3::X, bend);
    let sole = yaw * toes_up(foot.pitch);
    at.world[foot_joint as usize] = sole;
    at.world[toes as usize] = sole * toes_up(foot.toe_bend);
}

/// An arm; it swings against the leg of its side, whose heel strikes at `phase` 0.
fn arm(at: &mut Stance, phase: f64, side: f64, clavicle: Joint) {
    let first = clavicle as usize;
    let (upper, forearm, hand, fingers) = (first + 1, first + 2, first + 3, first + 4);
    let chest = at.world[Joint::Chest as usize];
    let (swing, lag) = (-cos_turns(phase - 0.02), -cos_turns(phase - 0.07));
    at.world[first] = chest * euler(0.0, side * deg(-3.0 * swing), side * deg(-3.0));
    let lower = about(DVec3::Z, side * deg(-29.0));
    let forward = |angle: f64, inward: f64| about(DVec3::Y, side * -inward) * about(DVec3::X, -angle);
    let shoulder = deg(mix(2.0, 25.0, 0.5 + 0.5 * swing) + mix(-23.0, 0.0, 0.5 + 0.5 * swing));
    let elbow = deg(30.0 + 13.0 * lag);
    at.world[upper] = forward(shoulder, deg(-2.0)) * lower;
    at.world[forearm] = forward(shoulder + elbow, deg(3.0 + 5.0 * lag)) * lower;
    at.world[hand] =
        forward(shoulder + elbow + deg(4.0), deg(4.0 + 5.0 * lag)) * lower * euler(0.0, 0.0, side * deg(-4.0));
    at.world[fingers] = at.world[hand] * about(DVec3::Z, side * deg(-24.0 - 5.0 * lag));
}
