//! Triangles as rays meet them: places on them and footprints of pixels.

use super::{
    rays::RayMaker,
    wide::{Floats, V2, V3},
};

/// A triangle as a ray meets it, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch<F> {
    pub(crate) corners: [V3<F>; 3],
    /// Weights of the corners.
    pub(crate) weights: [F; 3],
    /// Cross product of the edges: normal of the file's winding times twice the area.
    pub(crate) cross: V3<F>,
    /// Change of the weights of the second and third corner for one pixel right and one down.
    steps: [V2<F>; 2],
}

impl<F: Floats> Patch<F> {
    /// The place with weights `u` and `v` of the second and third corner; its footprint is a point until
    /// [`Patch::with_steps`] or [`Patch::with_width`].
    #[inline(always)]
    pub(crate) fn new(corners: [V3<F>; 3], u: F, v: F) -> Self {
        let [a, b, c] = corners;
        let none = V2 { x: F::splat(0.0), y: F::splat(0.0) };
        let weights = [F::splat(1.0) - u - v, u, v];
        Self { corners, weights, cross: (b - a).cross(c - a), steps: [none; 2] }
    }

    /// Sets the footprint that a pixel of the camera's picture has here, seen along `dir` at `t`.
    ///
    /// # Source
    /// Igehy, "Tracing Ray Differentials", 1999, section 3.1: the transfer to the plane.
    #[cfg_attr(not(debug_assertions), inline(always))]
    #[must_use]
    pub(crate) fn with_steps(mut self, rays: &RayMaker, dir: V3<F>, t: F) -> Self {
        let slope = F::splat(1.0) / self.cross.dot(dir);
        let [right, down] = rays.pixel_steps(t);
        let right = self.weight_change(right - dir * (right.dot(self.cross) * slope));
        let down = self.weight_change(down - dir * (down.dot(self.cross) * slope));
        self.steps = [right, down];
        self
    }

    /// Sets a round footprint `width` across, in metres.
    #[cfg_attr(not(debug_assertions), inline(always))]
    #[must_use]
    pub(crate) fn with_width(mut self, width: F) -> Self {
        let edge = (self.corners[1] - self.corners[0]).unit_or(V3::splat(glam::Vec3::X));
        let other = self.cross.cross(edge).unit_or(V3::splat(glam::Vec3::Y));
        self.steps = [self.weight_change(edge * width), self.weight_change(other * width)];
        self
    }

    /// Change of the second and third weight for a step `d` in the triangle's plane.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn weight_change(&self, d: V3<F>) -> V2<F> {
        let inv = F::splat(1.0) / self.cross.length_squared();
        let [a, b, c] = self.corners;
        V2 { x: d.cross(c - a).dot(self.cross) * inv, y: (b - a).cross(d).dot(self.cross) * inv }
    }

    /// The footprint, as changes of the weights of the second and third corner.
    #[inline(always)]
    pub(crate) fn steps(&self) -> [V2<F>; 2] {
        self.steps
    }

    /// Width of the footprint in metres: the longer of its two steps.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn width(&self) -> F {
        let [a, b, c] = self.corners;
        let (e1, e2) = (b - a, c - a);
        let [right, down] = self.steps;
        let right = (e1 * right.x + e2 * right.y).length_squared();
        let down = (e1 * down.x + e2 * down.y).length_squared();
        right.max(down).sqrt()
    }

    /// Numbers at the corners, here.
    #[inline(always)]
    pub(crate) fn blend(&self, a: F, b: F, c: F) -> F {
        let [w, u, v] = self.weights;
        a * w + b * u + c * v
    }

    /// Vectors at the corners, here.
    #[inline(always)]
    pub(crate) fn blend3(&self, [a, b, c]: [V3<F>; 3]) -> V3<F> {
        let [w, u, v] = self.weights;
        a * w + b * u + c * v
    }
}
