use glam::DVec3;

use super::{
    bounds,
    solid::{SolidHit, SolidRay},
};
use crate::geom::Aabb;

/// A sphere.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    pub(super) center: DVec3,
    pub(super) radius: f64,
}

impl Sphere {
    /// Both crossings of the line in order of t, whatever the ray's range.
    pub(super) fn hits(&self, ray: &SolidRay) -> [Option<SolidHit>; 2] {
        let middle = ray.nearest_to(self.center);
        let beside = ray.at(middle) - self.center;
        let inside = self.radius * self.radius - beside.length_squared();
        if inside < 0.0 {
            return [None; 2];
        }
        let half = (inside / ray.dir.length_squared()).sqrt();
        [middle - half, middle + half].map(|t| {
            let normal = (ray.at(t) - self.center) / self.radius;
            Some(SolidHit { t, n_geom: normal, n_shade: normal })
        })
    }

    pub(super) fn aabb(&self) -> Aabb {
        bounds::outward(self.center - self.radius, self.center + self.radius)
    }
}
