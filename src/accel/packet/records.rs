//! Rays from their records into lanes.

use super::{MODERATE, PACKET, PacketRays, Row};
use crate::{
    accel::slabs,
    geom::{Forms, Precision, Ray, exact::BOUND},
    simd::{Lanes, Simd},
};

/// Directions of rays that go together may differ by this part of the longest component.
const NARROW: f32 = 0.3;

impl PacketRays {
    /// Takes up to as many rays as a vector has lanes, at least one: the bits of those that may go together, which are
    /// those that [`TravRay::new`](crate::accel::TravRay::new) takes, that [`slabs::fits`] proves and whose volumes f32 holds. Other lanes repeat one of these.
    #[inline(always)]
    pub(in crate::accel) fn load<S: Simd>(&mut self, rays: &[Ray], reach: f32, forms: Forms) -> u32 {
        let records: &[[f32; 8]] = bytemuck::cast_slice(rays);
        let mut rows = [[0.0; PACKET]; 8];
        if records.len() < S::F::LEN {
            let mut padded = [records[0]; PACKET];
            for (to, record) in padded.iter_mut().zip(records) {
                *to = *record;
            }
            S::columns(&padded, &mut rows);
        } else {
            S::columns(records, &mut rows);
        }
        let mut taken = self.take::<S>(&rows, reach, forms);
        taken &= u32::MAX >> (32 - rays.len().min(S::F::LEN));
        if reach > MODERATE {
            taken = 0;
        }
        if taken != 0 {
            self.derive::<S>(taken);
        }
        taken
    }

    /// Makes the lines that boxes within the reach are tested with.
    #[inline(always)]
    pub(in crate::accel) fn prepare<S: Simd>(&mut self, nodes: Precision) {
        let Self { lines, origin32, dir32, reach, .. } = self;
        lines.fill::<S>(origin32, dir32, *reach, nodes);
    }

    /// What tests of single rays need besides.
    #[inline(always)]
    pub(in crate::accel) fn bound<S: Simd>(&mut self) {
        let [x, y, z] = &self.origin32;
        let reach = S::D::splat(f64::from(self.reach));
        for first in (0..S::F::LEN).step_by(S::D::LEN) {
            let (x, y, z) = (S::load_wide(&x[first..]), S::load_wide(&y[first..]), S::load_wide(&z[first..]));
            let far = x.abs().max(y.abs()).max(z.abs());
            let scale = S::load_wide(&self.scale[first..]) * S::D::splat(40.0 * BOUND);
            (scale * reach * (reach + reach + far)).store(&mut self.uv_error[first..]);
        }
    }

    /// True when the rays in `taken` do not all point nearly where the first does.
    #[inline(always)]
    pub(in crate::accel) fn points_apart<S: Simd>(&self, taken: u32) -> bool {
        let first = (taken.trailing_zeros() & 15) as usize;
        let room = S::F::splat(NARROW * self.longest);
        let mut near = taken;
        for row in &self.dir32 {
            near &= (S::F::load(row) - S::F::splat(row[first])).abs().le(room);
        }
        near != taken
    }

    /// Takes the rows of origins, `t_near`, directions and `t_far`.
    #[inline(always)]
    fn take<S: Simd>(&mut self, rows: &[Row; 8], reach: f32, forms: Forms) -> u32 {
        let zero = S::F::splat(0.0);
        let (near, far) = (S::F::load(&rows[3]), S::F::load(&rows[7]));
        let end = far.min(S::F::splat(f32::MAX));
        let mut taken = near.le(end) & zero.le(far);
        let mut slanted = S::F::ALL;
        let mut size = zero;
        let within = S::F::splat(slabs::farthest(reach).min(MODERATE));
        for axis in 0..3 {
            let place = S::F::load(&rows[axis]);
            place.store(&mut self.origin32[axis]);
            // Adding +0 turns -0 into +0.
            let dir = S::F::load(&rows[4 + axis]) + zero;
            dir.store(&mut self.dir32[axis]);
            self.backward[axis] = dir.lt(zero);
            let length = dir.abs();
            let tilted = S::F::splat(slabs::SLANTED).le(length);
            taken &= place.abs().le(within) & length.le(S::F::splat(MODERATE)) & (tilted | length.le(zero));
            slanted &= tilted;
            size = size.max(length);
        }
        // Rays along a plane.
        let [short, long] = slabs::STEADY;
        taken &= slanted | (S::F::splat(short).le(size) & size.le(S::F::splat(long)));
        near.max(zero).store(&mut self.t_near32);
        let end = end + zero;
        end.store(&mut self.t_far);
        end.store(&mut self.t_cull);
        size.store(&mut self.scale);
        self.reach = reach;
        self.moderate = true;
        self.fast = forms.leaves == Precision::Fast;
        taken
    }

    /// Derives what tests need to know of all rays.
    #[inline(always)]
    fn derive<S: Simd>(&mut self, taken: u32) {
        let first = (taken.trailing_zeros() & 15) as usize;
        if taken != S::F::ALL {
            self.replace_others(taken, first);
        }
        self.longest = S::range(S::F::load(&self.scale), taken)[1];
        let mut differing = 0;
        for row in &self.origin32 {
            let (all, one) = (S::F::load(row), S::F::splat(row[first]));
            differing |= all.lt(one) | one.lt(all);
        }
        self.common_origin = differing == 0;
        self.spread = 0.0;
        if !self.common_origin {
            for row in &self.origin32 {
                let [low, high] = S::range(S::F::load(row), taken);
                self.spread += high - low;
            }
        }
    }

    /// Lines of the other lanes are those of the first.
    #[cold]
    #[inline(never)]
    fn replace_others(&mut self, taken: u32, first: usize) {
        for i in (0..PACKET).filter(|i| taken >> i & 1 == 0) {
            for row in self.origin32.iter_mut().chain(&mut self.dir32) {
                row[i] = row[first];
            }
            self.scale[i] = self.scale[first];
        }
    }

    /// The first of the rays in `left` and all others of the same direction signs, and these.
    #[inline(always)]
    pub(in crate::accel) fn group(&self, left: u32) -> (u32, [bool; 3]) {
        let leader = left.trailing_zeros() & 15;
        let mut members = left;
        let mut backward = [false; 3];
        for (bits, backward) in self.backward.iter().zip(&mut backward) {
            *backward = bits >> leader & 1 == 1;
            members &= if *backward { *bits } else { !bits };
        }
        (members, backward)
    }
}
