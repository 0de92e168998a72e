use crate::scene::Scene;

/// How a part instance can move over all clips of its scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum MotionClass {
    /// Never moves in any clip.
    Static,
    /// Moves as a whole.
    Rigid,
    /// Vertices move against each other (skin or morph).
    Deforming,
}

/// The class of each of `scene.instances`, over every clip together.
pub fn classify(scene: &Scene) -> Vec<MotionClass> {
    vec![MotionClass::Static; scene.instances.len()]
}
