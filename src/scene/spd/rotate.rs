//! Rotations that come out alike on every machine.

use glam::DVec3;

/// `v` turned by `angle` (radians) about the unit vector `axis`, counter-clockwise seen from its tip.
pub(super) fn rotated(v: DVec3, axis: DVec3, angle: f64) -> DVec3 {
    turned(v, axis, libm::cos(angle), libm::sin(angle))
}

/// As [`rotated`] with the angle's cosine and sine (Rodrigues).
pub(super) fn turned(v: DVec3, axis: DVec3, cos: f64, sin: f64) -> DVec3 {
    v * cos + axis.cross(v) * sin + axis * (axis.dot(v) * (1.0 - cos))
}

/// Cosine and sine of `angle` as a point of the plane z = 0.
pub(super) fn on_circle(angle: f64) -> DVec3 {
    DVec3::new(libm::cos(angle), libm::sin(angle), 0.0)
}
