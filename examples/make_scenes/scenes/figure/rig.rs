//! The figure's joints in its rest pose: arms half lowered, facing +Z, left side at +X, feet on y = 0.
//!
//! Every joint's rest rotation is the identity, so inverse bind matrices only translate.

use glam::DVec3;

/// A joint of the figure; the number is its place in the skin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(usize)]
pub enum Joint {
    Hips,
    Spine,
    Chest,
    Neck,
    Head,
    ClavicleL,
    UpperArmL,
    ForearmL,
    HandL,
    FingersL,
    ThighL,
    ShinL,
    FootL,
    ToesL,
    ClavicleR,
    UpperArmR,
    ForearmR,
    HandR,
    FingersR,
    ThighR,
    ShinR,
    FootR,
    ToesR,
}

use Joint::{
    Chest, ClavicleL, ClavicleR, FingersL, FingersR, FootL, FootR, ForearmL, ForearmR, HandL, HandR, Head, Hips, Neck,
    ShinL, ShinR, Spine, ThighL, ThighR, ToesL, ToesR, UpperArmL, UpperArmR,
};

/// Every joint, parents first.
pub const JOINTS: [Joint; 23] = [
    Hips, Spine, Chest, Neck, Head, ClavicleL, UpperArmL, ForearmL, HandL, FingersL, ThighL, ShinL, FootL, ToesL,
    ClavicleR, UpperArmR, ForearmR, HandR, FingersR, ThighR, ShinR, FootR, ToesR,
];

/// Unit direction of the left arm in the rest pose.
pub const ARM_DIR: DVec3 = DVec3::new(0.642_787_609_686_539_3, -0.766_044_443_118_978, 0.0);
/// Lengths of the upper arm and the forearm.
pub const ARM: [f64; 2] = [0.225, 0.205];
/// Lengths of the thigh and the shin.
pub const LEG: [f64; 2] = [0.365, 0.365];
/// Height of the ankle above the ground with the foot flat.
pub const ANKLE_HEIGHT: f64 = 0.09;
/// From the ankle to the point of the heel that the foot rolls over.
pub const HEEL: DVec3 = DVec3::new(0.0, -ANKLE_HEIGHT, -0.058);
/// From the ankle to the ball of the foot on the ground.
pub const BALL: DVec3 = DVec3::new(0.0, -ANKLE_HEIGHT, 0.108);

const SHOULDER: DVec3 = DVec3::new(0.15, 1.222, -0.005);
const HIP_JOINT: DVec3 = DVec3::new(0.090, 0.82, 0.0);

impl Joint {
    /// The joint above it; `None` for the hips.
    pub fn parent(self) -> Option<Self> {
        Some(match self {
            Hips => return None,
            Spine | ThighL | ThighR => Hips,
            Chest => Spine,
            Neck | ClavicleL | ClavicleR => Chest,
            Head => Neck,
            UpperArmL => ClavicleL,
            ForearmL => UpperArmL,
            HandL => ForearmL,
            FingersL => HandL,
            ShinL => ThighL,
            FootL => ShinL,
            ToesL => FootL,
            UpperArmR => ClavicleR,
            ForearmR => UpperArmR,
            HandR => ForearmR,
            FingersR => HandR,
            ShinR => ThighR,
            FootR => ShinR,
            ToesR => FootR,
        })
    }

    /// Its place in the rest pose.
    pub fn position(self) -> DVec3 {
        match self {
            Hips => DVec3::new(0.0, 0.86, 0.0),
            Spine => DVec3::new(0.0, 0.95, 0.0),
            Chest => DVec3::new(0.0, 1.08, 0.0),
            Neck => DVec3::new(0.0, 1.28, -0.005),
            Head => DVec3::new(0.0, 1.345, 0.0),
            ClavicleL => DVec3::new(0.04, 1.23, 0.0),
            UpperArmL => SHOULDER,
            ForearmL => SHOULDER + ARM_DIR * ARM[0],
            HandL => SHOULDER + ARM_DIR * (ARM[0] + ARM[1]),
            FingersL => SHOULDER + ARM_DIR * (ARM[0] + ARM[1] + 0.08),
            ThighL => HIP_JOINT,
            ShinL => HIP_JOINT - DVec3::Y * LEG[0],
            FootL => HIP_JOINT - DVec3::Y * (LEG[0] + LEG[1]),
            ToesL => HIP_JOINT + DVec3::new(0.0, 0.03 - HIP_JOINT.y, BALL.z),
            right => mirror(right.mirrored().position()),
        }
    }

    /// The same joint of the other side; itself in the middle.
    pub fn mirrored(self) -> Self {
        let number = self as usize;
        match number {
            0..5 => self,
            5..14 => JOINTS[number + 9],
            _ => JOINTS[number - 9],
        }
    }

    /// Its name in the file.
    pub fn name(self) -> String {
        format!("{self:?}")
    }
}

/// `p` on the other side of the body.
pub fn mirror(p: DVec3) -> DVec3 {
    DVec3::new(-p.x, p.y, p.z)
}
