//! Rays in, hits out, both as the bytes of their files.

use std::{path::Path, time::Instant};

use kinora::{
    accel::{AnyAccel, AnyHit, Closest, PACKET, Precision, TravRay},
    geom::{Hit, Ray, Triangles},
    glam::Vec3,
    simd::{Simd, SimdLevel, Task, dispatch},
};
use rayon::prelude::*;

use crate::cli::{error::CliError, geometry::bytes};

/// Bytes of a ray: origin, `t_near`, direction, `t_far`.
pub(super) const RAY_BYTES: usize = 32;

/// Bytes of a hit: triangle, t, u, v.
const HIT_BYTES: usize = 16;

/// Rays that one task takes.
const CHUNK: usize = 4096;

const MISS: u32 = u32::MAX;

/// The ray records of a file, without its header.
///
/// # Errors
/// A usage error naming the file.
pub(super) fn read_rays(path: &Path) -> Result<Vec<u8>, CliError> {
    let mut content = bytes::read(path)?;
    bytes::records(path, &content, "RAY1", RAY_BYTES)?;
    content.drain(..8);
    Ok(content)
}

/// Number of records that are no miss.
pub(super) fn count_hits(records: &[u8]) -> usize {
    records.as_chunks::<HIT_BYTES>().0.iter().filter(|r| r[..4] != MISS.to_le_bytes()).count()
}

/// What to ask, and how.
pub(super) struct Queries<'a> {
    pub(super) accel: &'a AnyAccel,
    pub(super) prims: Triangles<'a>,
    pub(super) simd: SimdLevel,
    pub(super) precision: Precision,
    pub(super) any_hit: bool,
    pub(super) packet: bool,
}

impl Queries<'_> {
    /// The ray of a record; `None` when it can hit nothing.
    #[inline(always)]
    fn ray(&self, record: &[u8; RAY_BYTES]) -> Option<TravRay> {
        TravRay::with_forms(&decode(record), self.precision.into())
    }

    /// Casts all rays `repeat` times in the current pool: the hit records of the last time, and the seconds of each.
    pub(super) fn run(&self, rays: &[u8], repeat: u32) -> (Vec<u8>, Vec<f64>) {
        let mut records = vec![0; rays.len() / RAY_BYTES * HIT_BYTES];
        let cast = |records: &mut Vec<u8>| {
            let start = Instant::now();
            let chunks = rays.par_chunks(CHUNK * RAY_BYTES).zip(records.par_chunks_mut(CHUNK * HIT_BYTES));
            chunks.for_each(|(rays, out)| {
                let (rays, out) = (rays.as_chunks().0, out.as_chunks_mut().0);
                dispatch(self.simd, Chunk { queries: self, rays, out });
            });
            start.elapsed().as_secs_f64()
        };
        let seconds = (0..repeat).map(|_| cast(&mut records)).collect();
        (records, seconds)
    }
}

/// A run of rays, cast by one thread.
struct Chunk<'a> {
    queries: &'a Queries<'a>,
    rays: &'a [[u8; RAY_BYTES]],
    out: &'a mut [[u8; HIT_BYTES]],
}

impl Task for Chunk<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        match (self.queries.packet, self.queries.any_hit) {
            (false, false) => self.closest::<S>(),
            (false, true) => self.occluded::<S>(),
            (true, _) => self.packets::<S>(),
        }
    }
}

#[inline(always)]
fn decode(record: &[u8; RAY_BYTES]) -> Ray {
    let number = |i: usize| f32::from_le_bytes([record[i], record[i + 1], record[i + 2], record[i + 3]]);
    Ray {
        origin: Vec3::new(number(0), number(4), number(8)),
        t_near: number(12),
        dir: Vec3::new(number(16), number(20), number(24)),
        t_far: number(28),
    }
}

#[inline(always)]
fn encode(prim: u32, [t, u, v]: [f32; 3]) -> [u8; HIT_BYTES] {
    let mut record = [0; HIT_BYTES];
    record[..4].copy_from_slice(&prim.to_le_bytes());
    record[4..8].copy_from_slice(&t.to_le_bytes());
    record[8..12].copy_from_slice(&u.to_le_bytes());
    record[12..].copy_from_slice(&v.to_le_bytes());
    record
}

#[inline(always)]
fn encode_hit(hit: Option<Hit>) -> [u8; HIT_BYTES] {
    hit.map_or_else(|| encode(MISS, [f32::INFINITY, 0.0, 0.0]), |h| encode(h.prim.0, [h.t, h.u, h.v]))
}

#[inline(always)]
fn encode_blocked(blocked: bool) -> [u8; HIT_BYTES] {
    if blocked { encode(0, [0.0; 3]) } else { encode_hit(None) }
}

impl Chunk<'_> {
    #[inline(always)]
    fn closest<S: Simd>(self) {
        let Queries { accel, prims, .. } = self.queries;
        for (record, out) in self.rays.iter().zip(self.out) {
            let hit = self.queries.ray(record).and_then(|ray| {
                let mut best = Closest::new(&ray);
                accel.closest::<S, _, _>(prims, &ray, &mut best, &AnyHit, &mut ());
                best.hit(&ray)
            });
            *out = encode_hit(hit);
        }
    }

    #[inline(always)]
    fn occluded<S: Simd>(self) {
        let Queries { accel, prims, .. } = self.queries;
        for (record, out) in self.rays.iter().zip(self.out) {
            let ray = self.queries.ray(record);
            *out = encode_blocked(ray.is_some_and(|ray| accel.occluded::<S, _, _>(prims, &ray, &AnyHit, &mut ())));
        }
    }

    /// Lanes whose ray is none keep a stand-in that is not active.
    #[inline(always)]
    fn packets<S: Simd>(self) {
        let Queries { accel, prims, any_hit, .. } = self.queries;
        let Some(stand_in) = TravRay::with_forms(&Ray::new(Vec3::ZERO, Vec3::X), self.queries.precision.into()) else {
            return;
        };
        let sinks = [AnyHit; PACKET];
        for (records, out) in self.rays.chunks(PACKET).zip(self.out.chunks_mut(PACKET)) {
            let mut rays = [stand_in; PACKET];
            let mut active = 0;
            for (i, record) in records.iter().enumerate() {
                if let Some(ray) = self.queries.ray(record) {
                    rays[i] = ray;
                    active |= 1 << i;
                }
            }
            let (rays, sinks) = (&rays[..records.len()], &sinks[..records.len()]);
            if *any_hit {
                let blocked = accel.occluded_packet::<S, _, _>(prims, rays, active, sinks, &mut ());
                for (i, out) in out.iter_mut().enumerate() {
                    *out = encode_blocked((blocked >> i) & 1 == 1);
                }
            } else {
                let mut best = [Closest::new(&stand_in); PACKET];
                for (best, ray) in best.iter_mut().zip(rays) {
                    *best = Closest::new(ray);
                }
                let best = &mut best[..records.len()];
                accel.closest_packet::<S, _, _>(prims, rays, active, best, sinks, &mut ());
                for ((out, best), ray) in out.iter_mut().zip(best).zip(rays) {
                    *out = encode_hit(best.hit(ray));
                }
            }
        }
    }
}
