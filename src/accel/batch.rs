//! Many rays at once: for callers who need no filter and no counts.

use std::ops::Range;

use glam::Vec3A;

use super::{AnyAccel, PACKET};
use crate::{
    geom::{Forms, Hit, Ray, Triangles},
    simd::{FloatModeError, SimdLevel, check_float_mode},
};

impl AnyAccel {
    /// The closest hit of every ray, in order, into `out`; a ray that can hit nothing (see [`TravRay::new`]) misses.
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
        let out = &mut out[..rays.len()];
        for (run, together) in runs(rays, packet, self.streams()) {
            let (rays, out) = (&rays[run.clone()], &mut out[run]);
            self.closest_all(level, prims, rays, if together { packet } else { 1 }, forms, out);
        }
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
        let out = &mut out[..rays.len()];
        for (run, together) in runs(rays, packet, self.streams()) {
            let (rays, out) = (&rays[run.clone()], &mut out[run]);
            self.occluded_all(level, prims, rays, if together { packet } else { 1 }, forms, out);
        }
        Ok(())
    }
}

/// Splits rays, where packets begin, into runs that go together in packets and runs that do not. With `streams` a structure answers rays apart faster than packets of
/// rays that point into different directions.
fn runs(rays: &[Ray], packet: usize, streams: bool) -> impl Iterator<Item = (Range<usize>, bool)> + '_ {
    let mut at = 0;
    let together = move |at: usize| packet > 1 && !(streams && points_apart(&rays[at..rays.len().min(at + packet)]));
    std::iter::from_fn(move || {
        let first = at;
        let kind = (first < rays.len()).then(|| together(first))?;
        while at < rays.len() && together(at) == kind {
            at = if packet == 1 { rays.len() } else { rays.len().min(at + packet) };
        }
        Some((first..at, kind))
    })
}

/// Directions of a packet may differ by this part of the longest component.
const NARROW: f32 = 0.5;

/// True when rays point into too different directions to go together.
fn points_apart(rays: &[Ray]) -> bool {
    let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for ray in rays {
        let dir = Vec3A::from(ray.dir);
        (low, high) = (low.min(dir), high.max(dir));
    }
    (high - low).max_element() > NARROW * low.abs().max(high.abs()).max_element()
}
