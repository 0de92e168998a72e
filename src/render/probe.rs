//! Secondary rays of a block.

use glam::Vec3;

use super::{
    context::FrameContext,
    pattern::Samplers,
    wide::{Floats, LANES, V3, row},
};
use crate::geom::Ray;

/// Secondary rays and the light that each brings when nothing is in its way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Probes<F> {
    /// Lanes that have a ray.
    pub(crate) mask: u32,
    pub(crate) origin: V3<F>,
    pub(crate) dir: V3<F>,
    pub(crate) t_far: F,
    pub(crate) light: V3<F>,
    /// Width of the footprint in metres, for the alpha of what is in the way.
    pub(crate) width: F,
}

/// Points of a block to be lit, a lane each.
pub(crate) trait Points<F> {
    /// Their secondary rays of number `number`; `random` decides which of many.
    fn probes(&self, ctx: &FrameContext<'_>, number: usize, random: &Samplers) -> Probes<F>;
    /// Adds light in the lanes of `mask`.
    fn add(&mut self, mask: u32, light: V3<F>);
    /// Colour towards the viewer and the part of the light behind that is stopped.
    fn result(&self) -> (V3<F>, F);
}

/// Fills lanes without a ray: one that hits nothing.
pub(crate) const NO_RAY: Ray = Ray { origin: Vec3::ZERO, dir: Vec3::ZERO, t_near: 0.0, t_far: 0.0 };

impl<F: Floats> Probes<F> {
    /// The rays, from `t` 0 on.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(crate) fn rays(&self) -> [Ray; LANES] {
        let ([ox, oy, oz], [dx, dy, dz], t_far) = (self.origin.rows(), self.dir.rows(), row(self.t_far));
        let mut rays = [NO_RAY; LANES];
        for (lane, ray) in rays.iter_mut().enumerate() {
            if (self.mask >> lane) & 1 == 1 {
                *ray = Ray {
                    origin: Vec3::new(ox[lane], oy[lane], oz[lane]),
                    dir: Vec3::new(dx[lane], dy[lane], dz[lane]),
                    t_near: 0.0,
                    t_far: t_far[lane],
                };
            }
        }
        rays
    }
}
