use glam::Vec3;

/// A light of `KHR_lights_punctual`; it shines along the node's -Z.
#[derive(Clone, Debug)]
pub struct Light {
    /// Name, empty when the file has none.
    pub name: String,
    /// Linear colour.
    pub color: Vec3,
    /// Candela for point and spot lights, lux for directional ones.
    pub intensity: f32,
    /// Distance in metres past which a point or spot light gives nothing; `None` is infinite.
    pub range: Option<f32>,
    /// Shape of the light.
    pub kind: LightKind,
}

/// Shape of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel light.
    Directional,
    /// Light from a point.
    Point,
    /// Light from a point within a cone; half angles in radians.
    Spot {
        /// Half angle where the falloff starts.
        inner: f32,
        /// Half angle where light ends.
        outer: f32,
    },
}
