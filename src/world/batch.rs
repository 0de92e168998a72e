//! Many rays at once, for callers who need no filter and no SIMD type of their own.

use super::World;
use crate::{
    accel::{LanePacket, PACKET},
    geom::{Hit, Ray},
    simd::{FloatModeError, Simd, SimdLevel, Task, check_float_mode, dispatch},
};

impl World {
    /// The nearest hit of every ray, in order, into `out`: what [`World::nearest_hit`] answers.
    ///
    /// Pays most where consecutive rays run close together. On the calling thread; no allocation.
    ///
    /// # Errors
    /// When foreign code changed how this thread computes; `out` is then unchanged.
    ///
    /// # Panics
    /// When `out` is shorter than `rays`, or the machine lacks `level`.
    pub fn hit_all(&self, rays: &[Ray], level: SimdLevel, out: &mut [Option<Hit>]) -> Result<(), FloatModeError> {
        check_float_mode()?;
        dispatch(level, HitAll { world: self, rays, out: &mut out[..rays.len()] });
        Ok(())
    }

    /// Whether every ray is blocked, in order, into `out`: what [`World::is_blocked`] answers. As [`World::hit_all`].
    ///
    /// # Errors
    /// As there.
    ///
    /// # Panics
    /// As there.
    pub fn block_all(&self, rays: &[Ray], level: SimdLevel, out: &mut [bool]) -> Result<(), FloatModeError> {
        check_float_mode()?;
        dispatch(level, BlockAll { world: self, rays, out: &mut out[..rays.len()] });
        Ok(())
    }
}

struct HitAll<'a> {
    world: &'a World,
    rays: &'a [Ray],
    out: &'a mut [Option<Hit>],
}

impl Task for HitAll<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let mut lanes = LanePacket::EMPTY;
        for (rays, hits) in self.rays.chunks(PACKET).zip(self.out.chunks_mut(PACKET)) {
            self.world.nearest_hits_with::<S>(&mut lanes, rays, hits);
        }
    }
}

struct BlockAll<'a> {
    world: &'a World,
    rays: &'a [Ray],
    out: &'a mut [bool],
}

impl Task for BlockAll<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let mut lanes = LanePacket::EMPTY;
        for (rays, out) in self.rays.chunks(PACKET).zip(self.out.chunks_mut(PACKET)) {
            let blocked = self.world.blocked_with::<S>(&mut lanes, rays);
            for (i, out) in out.iter_mut().enumerate() {
                *out = (blocked >> i) & 1 == 1;
            }
        }
    }
}
