//! Rays in, hits out, both as the bytes of their files.

use std::{borrow::Cow, path::Path, time::Instant};

use kinora::{
    accel::{AnyAccel, PACKET, Precision},
    geom::{Hit, Ray, Triangles},
    glam::Vec3,
    simd::{FloatModeError, SimdLevel},
};
use rayon::prelude::*;

use crate::cli::{error::CliError, geometry::bytes};

/// Bytes of a ray: origin, `t_near`, direction, `t_far`.
pub(super) const RAY_BYTES: usize = 32;

/// Bytes of a hit: triangle, t, u, v.
const HIT_BYTES: usize = 16;

/// Rays that one task takes: what goes in and comes out stays in the cache beside the structure.
const CHUNK: usize = 1024;

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
    /// Casts all rays `repeat` times in the current pool: the hit records of the last time, and the seconds of each.
    ///
    /// # Errors
    /// When foreign code changed how threads compute.
    pub(super) fn run(&self, rays: &[u8], repeat: u32) -> Result<(Vec<u8>, Vec<f64>), FloatModeError> {
        let mut records = vec![0; rays.len() / RAY_BYTES * HIT_BYTES];
        let mut seconds = Vec::with_capacity(repeat as usize);
        for _ in 0..repeat {
            let start = Instant::now();
            let chunks = rays.par_chunks(CHUNK * RAY_BYTES).zip(records.par_chunks_mut(CHUNK * HIT_BYTES));
            // Answers of a run, used again for the next.
            chunks.try_for_each_init(Answers::default, |answers, (rays, out)| {
                self.cast(rays.as_chunks().0, answers, out.as_chunks_mut().0)
            })?;
            seconds.push(start.elapsed().as_secs_f64());
        }
        Ok((records, seconds))
    }

    /// Casts a run of rays on one thread.
    fn cast(
        &self,
        records: &[[u8; RAY_BYTES]],
        answers: &mut Answers,
        out: &mut [[u8; HIT_BYTES]],
    ) -> Result<(), FloatModeError> {
        let rays = decode(records);
        let (prims, simd, forms) = (&self.prims, self.simd, self.precision.into());
        let packet = if self.packet { PACKET } else { 1 };
        if self.any_hit {
            answers.blocked.resize(rays.len(), false);
            self.accel.blocked_as(prims, &rays, packet, simd, forms, &mut answers.blocked)?;
            for (out, &blocked) in out.iter_mut().zip(&answers.blocked) {
                *out = encode_blocked(blocked);
            }
        } else {
            answers.hits.resize(rays.len(), None);
            self.accel.closest_hits_as(prims, &rays, packet, simd, forms, &mut answers.hits)?;
            for (out, hit) in out.iter_mut().zip(&answers.hits) {
                *out = encode_hit(*hit);
            }
        }
        Ok(())
    }
}

/// Answers before they become records.
#[derive(Default)]
struct Answers {
    hits: Vec<Option<Hit>>,
    blocked: Vec<bool>,
}

/// The rays of records, which are what they look like in memory where numbers are little-endian and lie at their places.
fn decode(records: &[[u8; RAY_BYTES]]) -> Cow<'_, [Ray]> {
    if cfg!(target_endian = "little")
        && let Ok(rays) = bytemuck::try_cast_slice(records)
    {
        return Cow::Borrowed(rays);
    }
    Cow::Owned(records.iter().map(decode_one).collect())
}

fn decode_one(record: &[u8; RAY_BYTES]) -> Ray {
    let words: [[u8; 4]; 8] = bytemuck::cast(*record);
    let number = |i: usize| f32::from_le_bytes(words[i]);
    Ray {
        origin: Vec3::new(number(0), number(1), number(2)),
        t_near: number(3),
        dir: Vec3::new(number(4), number(5), number(6)),
        t_far: number(7),
    }
}

#[inline(always)]
fn encode(prim: u32, [t, u, v]: [f32; 3]) -> [u8; HIT_BYTES] {
    bytemuck::cast([prim.to_le_bytes(), t.to_le_bytes(), u.to_le_bytes(), v.to_le_bytes()])
}

#[inline(always)]
fn encode_hit(hit: Option<Hit>) -> [u8; HIT_BYTES] {
    match hit {
        Some(hit) => encode(hit.prim.0, [hit.t, hit.u, hit.v]),
        None => encode(MISS, [f32::INFINITY, 0.0, 0.0]),
    }
}

#[inline(always)]
fn encode_blocked(blocked: bool) -> [u8; HIT_BYTES] {
    if blocked { encode(0, [0.0; 3]) } else { encode_hit(None) }
}
