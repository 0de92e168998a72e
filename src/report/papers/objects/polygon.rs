use glam::{DVec2, DVec3};

use super::solid::{SolidHit, SolidRay};

/// A plane polygon; what is inside is decided by the parity of crossings, so it may be concave.
#[derive(Clone, Debug)]
pub struct Polygon {
    corners: Box<[DVec3]>,
    /// The corners without the coordinate in which the normal is largest.
    flat: Box<[DVec2]>,
    dropped: usize,
    normal: DVec3,
}

impl Polygon {
    /// Corners counter-clockwise seen from the front. Without area it is never hit.
    pub(super) fn new(corners: &[DVec3]) -> Self {
        let first = corners.first().copied().unwrap_or_default();
        let sum = corners.windows(2).fold(DVec3::ZERO, |sum, p| sum + (p[0] - first).cross(p[1] - first));
        let normal = sum.normalize_or_zero();
        let size = normal.abs();
        let dropped = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
        let flat = corners.iter().map(|&p| without(p, dropped)).collect();
        Self { corners: corners.into(), flat, dropped, normal }
    }

    pub(super) fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    /// The crossing of the line, whatever the ray's range.
    pub(super) fn hit(&self, ray: &SolidRay) -> Option<SolidHit> {
        let speed = ray.dir.dot(self.normal);
        let t = (self.corners.first()? - ray.origin).dot(self.normal) / speed;
        if !t.is_finite() || !self.surrounds(without(ray.at(t), self.dropped)) {
            return None;
        }
        Some(SolidHit { t, n_geom: self.normal, n_shade: self.normal })
    }

    /// An edge counts where it passes `p`'s height, its lower end included, to the right of `p`.
    fn surrounds(&self, p: DVec2) -> bool {
        let mut inside = false;
        let Some(&(mut a)) = self.flat.last() else { return false };
        for &b in &self.flat {
            if (a.y > p.y) != (b.y > p.y) {
                // The lower end first, so that both polygons beside an edge decide alike.
                let (low, high) = if a.y < b.y { (a, b) } else { (b, a) };
                inside ^= (high - low).perp_dot(p - low) > 0.0;
            }
            a = b;
        }
        inside
    }
}

fn without(p: DVec3, axis: usize) -> DVec2 {
    match axis {
        0 => DVec2::new(p.y, p.z),
        1 => DVec2::new(p.z, p.x),
        _ => DVec2::new(p.x, p.y),
    }
}

/// A triangle with normals to interpolate.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    pub(super) corners: [DVec3; 3],
    normals: [DVec3; 3],
    normal: DVec3,
}

impl Patch {
    pub(super) fn new(corners: [DVec3; 3], normals: [DVec3; 3]) -> Self {
        let [a, b, c] = corners;
        Self { corners, normals, normal: (b - a).cross(c - a).normalize_or_zero() }
    }

    /// The crossing of the line, whatever the ray's range.
    ///
    /// # Source
    /// T. Möller and B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997, in f64.
    pub(super) fn hit(&self, ray: &SolidRay) -> Option<SolidHit> {
        let [a, b, c] = self.corners;
        let (e1, e2, from) = (b - a, c - a, ray.origin - a);
        let p = ray.dir.cross(e2);
        let inv = 1.0 / e1.dot(p);
        let q = from.cross(e1);
        let (u, v, t) = (from.dot(p) * inv, ray.dir.dot(q) * inv, e2.dot(q) * inv);
        if !(u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t.is_finite()) {
            return None;
        }
        let [na, nb, nc] = self.normals;
        let n_shade = (na * (1.0 - u - v) + nb * u + nc * v).normalize_or(self.normal);
        Some(SolidHit { t, n_geom: self.normal, n_shade })
    }
}
