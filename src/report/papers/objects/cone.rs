use glam::DVec3;

use super::{
    bounds,
    solid::{SolidHit, SolidRay},
};
use crate::geom::Aabb;

/// The mantle of a cone frustum, open at both ends; a cylinder when its radii agree.
#[derive(Clone, Copy, Debug)]
pub struct Cone {
    base: DVec3,
    apex: DVec3,
    /// Unit vector from base to apex.
    axis: DVec3,
    height: f64,
    base_radius: f64,
    apex_radius: f64,
    /// Change of the radius along the axis.
    slope: f64,
}

impl Cone {
    /// Between two different centres, with positive radii.
    pub(super) fn new((base, base_radius): (DVec3, f64), (apex, apex_radius): (DVec3, f64)) -> Self {
        let height = base.distance(apex);
        let axis = (apex - base) / height;
        Self { base, apex, axis, height, base_radius, apex_radius, slope: (apex_radius - base_radius) / height }
    }

    /// Crossings of the line with the mantle in order of t, whatever the ray's range.
    pub(super) fn hits(&self, ray: &SolidRay) -> [Option<SolidHit>; 2] {
        // A point is on the double cone when its distance from the axis is the radius at its height.
        let shift = ray.nearest_to((self.base + self.apex) * 0.5);
        let from = ray.at(shift) - self.base;
        let (height, climb) = (from.dot(self.axis), ray.dir.dot(self.axis));
        let (radius, growth) = (self.base_radius + self.slope * height, self.slope * climb);
        let a = ray.dir.length_squared() - climb * climb - growth * growth;
        let b = from.dot(ray.dir) - height * climb - radius * growth;
        let c = from.length_squared() - height * height - radius * radius;
        roots(a, b, c).map(|s| {
            let s = s?;
            let up = height + climb * s;
            if !(0.0..=self.height).contains(&up) {
                return None;
            }
            let out = from + ray.dir * s - self.axis * up;
            let normal = (out - self.axis * (self.slope * (self.base_radius + self.slope * up))).normalize_or_zero();
            Some(SolidHit { t: shift + s, n_geom: normal, n_shade: normal })
        })
    }

    pub(super) fn aabb(&self) -> Aabb {
        // A disc reaches radius * sin(angle between its axis and the coordinate axis) to either side.
        let reach = (DVec3::ONE - self.axis * self.axis).max(DVec3::ZERO);
        let reach = DVec3::from_array(reach.to_array().map(f64::sqrt));
        let (base, apex) = (reach * self.base_radius, reach * self.apex_radius);
        bounds::outward((self.base - base).min(self.apex - apex), (self.base + base).max(self.apex + apex))
    }
}

/// Real solutions of `a x^2 + 2 b x + c = 0` in rising order.
fn roots(a: f64, b: f64, c: f64) -> [Option<f64>; 2] {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 {
        return [None; 2];
    }
    // The sum of two numbers of the same sign, so that nothing cancels.
    let q = -(b + discriminant.sqrt().copysign(b));
    let solutions = [(q, a), (c, q)].map(|(over, under)| {
        let x = over / under;
        (under != 0.0 && x.is_finite()).then_some(x)
    });
    match solutions {
        [Some(x), Some(y)] if x > y => [Some(y), Some(x)],
        other => other,
    }
}
