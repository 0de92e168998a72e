//! Signed distances of a few solids and their smooth unions.

use glam::DVec3;

/// A solid; distances are exact outside a rounded cone and close to exact near an ellipsoid.
#[derive(Clone, Copy)]
pub enum Solid {
    /// The hull of two balls.
    Cone { a: DVec3, b: DVec3, radius_a: f64, radius_b: f64 },
    /// An ellipsoid with half axes along the given orthonormal directions (the third is their cross product).
    Ellipsoid { center: DVec3, radii: DVec3, x: DVec3, y: DVec3 },
}

impl Solid {
    /// The hull of the balls at `a` and `b`.
    pub fn cone(a: DVec3, b: DVec3, radius_a: f64, radius_b: f64) -> Self {
        Self::Cone { a, b, radius_a, radius_b }
    }

    /// An ellipsoid along the coordinate axes.
    pub fn ellipsoid(center: DVec3, radii: DVec3) -> Self {
        Self::Ellipsoid { center, radii, x: DVec3::X, y: DVec3::Y }
    }

    /// Signed distance of `p`, negative inside.
    pub fn distance(&self, p: DVec3) -> f64 {
        match *self {
            Self::Cone { a, b, radius_a, radius_b } => {
                let axis = b - a;
                let along = ((p - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
                (p - a - axis * along).length() - (radius_a + (radius_b - radius_a) * along)
            }
            Self::Ellipsoid { center, radii, x, y } => {
                let d = p - center;
                let local = DVec3::new(d.dot(x), d.dot(y), d.dot(x.cross(y)));
                let (k0, k1) = ((local / radii).length(), (local / (radii * radii)).length());
                if k1 > 0.0 { k0 * (k0 - 1.0) / k1 } else { -radii.min_element() }
            }
        }
    }

    /// A ball that contains the solid.
    pub fn ball(&self) -> (DVec3, f64) {
        match *self {
            Self::Cone { a, b, radius_a, radius_b } => (0.5 * (a + b), 0.5 * (b - a).length() + radius_a.max(radius_b)),
            Self::Ellipsoid { center, radii, .. } => (center, radii.max_element()),
        }
    }
}

/// Smooth minimum: rounds the inner edge of a union over a width of about `k`.
pub fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h / (4.0 * k)
}

/// Smooth maximum: rounds the outer edge of an intersection.
pub fn smooth_max(a: f64, b: f64, k: f64) -> f64 {
    -smooth_min(-a, -b, k)
}

/// The gradient of `field` at `p` by central differences of step `h`, scaled to length one.
pub fn normal(field: &impl Fn(DVec3) -> f64, p: DVec3, h: f64) -> DVec3 {
    let slope = |axis: DVec3| field(p + axis * h) - field(p - axis * h);
    DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).normalize_or(DVec3::Y)
}

/// `p` moved onto the zero surface of `field` by `steps` Newton steps.
pub fn project(field: &impl Fn(DVec3) -> f64, mut p: DVec3, steps: usize) -> DVec3 {
    for _ in 0..steps {
        p -= normal(field, p, 5e-4) * field(p);
    }
    p
}
