//! What one ray carries through structures: its derived values and the best hit so far.

use crate::geom::{Hit, InstanceId, PrimId, Ray, Triangles};

/// Maps a structure's own triangle numbers to the caller's and decides whether a hit counts.
///
/// Both are asked only about triangles that the ray really hits.
pub trait HitSink {
    /// The (instance, prim) that orders equal `t` and is reported; must be monotone in `prim`.
    fn key(&self, prim: PrimId) -> (InstanceId, PrimId);
    /// False to let the ray pass (alpha tests, layers). `hit` carries the key.
    fn accept(&self, hit: &Hit) -> bool;
}

/// A ray with what traversals derive from it, made once a ray.
#[derive(Clone, Copy, Debug)]
pub struct TravRay {
    ray: Ray,
}

impl TravRay {
    /// `None` when the ray can hit nothing: NaN, zero direction, empty range.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Option<Self> {
        Some(Self { ray: *ray })
    }

    /// The ray it was made from.
    #[inline(always)]
    pub fn ray(&self) -> &Ray {
        &self.ray
    }
}

/// The least exact hit so far, over any number of structures.
#[derive(Clone, Copy, Debug)]
pub struct Closest {
    hit: Option<Hit>,
}

impl Closest {
    /// Nothing hit yet.
    #[inline(always)]
    pub fn new(_ray: &TravRay) -> Self {
        Self { hit: None }
    }

    /// The answer.
    #[inline(always)]
    pub fn hit(&self) -> Option<Hit> {
        self.hit
    }

    /// Tests one triangle exactly and keeps it when it beats the best.
    #[inline(always)]
    pub fn offer<K: HitSink>(&mut self, _ray: &TravRay, _prims: &Triangles<'_>, _prim: PrimId, _sink: &K) {}
}
