//! What structures over plain boxes share: they find the objects whose boxes a ray meets, and leave the objects to a [`Visitor`].
//!
//! So one walk serves triangles, groups of a scene, and the spheres, cylinders and cones of the papers' scenes.

/// Tests the objects that a ray comes upon.
pub trait Visitor {
    /// Nothing beyond this t can change the answer any more: at least the exact t of the best hit, or the ray's end.
    fn t_limit(&self) -> f64;
    /// Tests an object whose box the ray meets. True ends the walk. May be called several times for one object.
    fn visit(&mut self, object: u32) -> bool;
}
