//! Many rays at once: for callers who need no filter and no counts.

use super::{AnyAccel, PACKET};
use crate::{
    geom::{Forms, Hit, Ray, Triangles},
    simd::{FloatModeError, SimdLevel, check_float_mode},
};

impl AnyAccel {
    /// The closest hit of every ray, in order, into `out`; a ray that can hit nothing (see [`TravRay::new`](super::TravRay::new)) misses.
    ///
    /// Rays go singly where `packet` is 1, else in packets of up to `packet` consecutive ones, which pays for rays close together; structures that answer
    /// many single rays at once take those that point apart by themselves. The answers do not depend on it, nor on `level`. On the calling thread; no allocation.
    ///
    /// # Errors
    /// When foreign code changed how this thread computes; `out` is then unchanged.
    ///
    /// # Panics
    /// When `out` is shorter than `rays`, `packet` is 0 or above [`PACKET`], or the machine lacks `level`.
    pub fn closest_hits(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        level: SimdLevel,
        out: &mut [Option<Hit>],
    ) -> Result<(), FloatModeError> {
        self.closest_hits_as(prims, rays, packet, level, Forms::EXACT, out)
    }

    /// As [`AnyAccel::closest_hits`], tested as `forms` says. Where a form is fast, the answers depend on `packet` and `level` to within their
    /// errors.
    ///
    /// # Errors
    /// As there.
    ///
    /// # Panics
    /// As there.
    pub fn closest_hits_as(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        level: SimdLevel,
        forms: Forms,
        out: &mut [Option<Hit>],
    ) -> Result<(), FloatModeError> {
        assert!((1..=PACKET).contains(&packet), "packets of {packet} rays");
        check_float_mode()?;
        self.closest_all(level, prims, rays, packet, forms, &mut out[..rays.len()]);
        Ok(())
    }

    /// Whether every ray is blocked, as [`AnyAccel::closest_hits`].
    ///
    /// # Errors
    /// As there.
    ///
    /// # Panics
    /// As there.
    pub fn blocked(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        level: SimdLevel,
        out: &mut [bool],
    ) -> Result<(), FloatModeError> {
        self.blocked_as(prims, rays, packet, level, Forms::EXACT, out)
    }

    /// As [`AnyAccel::blocked`], tested as `forms` says; see [`AnyAccel::closest_hits_as`].
    ///
    /// # Errors
    /// As there.
    ///
    /// # Panics
    /// As there.
    pub fn blocked_as(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        level: SimdLevel,
        forms: Forms,
        out: &mut [bool],
    ) -> Result<(), FloatModeError> {
        assert!((1..=PACKET).contains(&packet), "packets of {packet} rays");
        check_float_mode()?;
        self.occluded_all(level, prims, rays, packet, forms, &mut out[..rays.len()]);
        Ok(())
    }
}
