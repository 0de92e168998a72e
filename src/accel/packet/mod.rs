//! Packets: up to sixteen rays, one to a lane.

mod alone;
mod answer;
mod bounded;
mod boxes;
mod lanes;
mod leaf;
mod nearest;
mod records;

pub(crate) use boxes::PacketBoxes;
pub(crate) use lanes::LanePacket;
pub(in crate::accel) use leaf::Spread;
pub(in crate::accel) use nearest::Nearest;

use super::{Closest, TravRay, slabs::Lines};
use crate::geom::Precision;

/// Most rays in a packet.
pub const PACKET: usize = 16;

/// A bit for every ray.
const ALL: u32 = u32::MAX >> (32 - PACKET);

/// Up to this many open rays are tested one by one.
const FEW: u32 = 2;

type Row = [f32; PACKET];

/// The rays of a packet by component. Triangle tests in f64 widen what they load.
#[derive(Clone, Copy)]
pub(in crate::accel) struct PacketRays {
    pub(in crate::accel) origin32: [[f32; PACKET]; 3],
    pub(in crate::accel) dir32: [[f32; PACKET]; 3],
    pub(in crate::accel) t_near32: Row,
    /// Nothing beyond counts any more.
    pub(in crate::accel) t_cull: Row,
    t_far: Row,
    /// `|dir|∞`.
    scale: Row,
    /// Bound on the errors of U, V and W of every triangle within the reach, as [`BlockRay::new`](super::block::BlockRay::new) derives it.
    uv_error: [f64; PACKET],
    /// Where the rays cross planes, once [`PacketRays::prepare`] was called.
    pub(in crate::accel) lines: Lines,
    /// Bits of the rays that run downward, by axis.
    pub(in crate::accel) backward: [u32; 3],
    common_origin: bool,
    /// The greatest `|dir|∞`.
    longest: f32,
    /// Bound on `|origin - first origin|₁`.
    spread: f32,
    /// Greatest coordinate of the triangles to come, as in [`BlockRay::new`].
    reach: f32,
    /// Products of what the rays and the triangles hold neither overflow in f32 nor lose more than [`TINY`] by underflow.
    moderate: bool,
    /// Triangles are tested as [`Forms::leaves`](crate::geom::Forms) names it.
    fast: bool,
}

/// Magnitudes of coordinates and directions up to which volumes in f32 do not overflow: 2^30.
const MODERATE: f32 = 1_073_741_824.0;

/// [`BOUND`] for f32, with room for the roundings of the bound itself, which is evaluated in f32.
const BOUND32: f32 = 20.0 / 16_777_216.0;

/// Above what volumes of moderate numbers lose by underflow: products off by 2^-150, a few of them, times factors below 2^32.
const TINY: f32 = f32::from_bits((127 - 110) << 23);

impl PacketRays {
    /// No rays.
    pub(in crate::accel) const EMPTY: Self = Self {
        origin32: [[0.0; PACKET]; 3],
        dir32: [[0.0; PACKET]; 3],
        t_near32: [0.0; PACKET],
        t_cull: [0.0; PACKET],
        t_far: [0.0; PACKET],
        scale: [0.0; PACKET],
        uv_error: [0.0; PACKET],
        lines: Lines::EMPTY,
        backward: [0; 3],
        common_origin: false,
        longest: 0.0,
        spread: 0.0,
        reach: 0.0,
        moderate: false,
        fast: false,
    };

    /// Spreads up to [`PACKET`] rays, at least one; lanes without a ray repeat the last and must not be active. The blocks that they are
    /// tested with stay within `reach` of 0.
    #[inline(always)]
    pub(in crate::accel) fn new(rays: &[TravRay], reach: f32) -> Self {
        // Filled in place: a struct of this size made elsewhere would be copied.
        let mut out = Self::EMPTY;
        out.reach = reach;
        out.fast = rays[0].forms().leaves == Precision::Fast;
        let mut differing = 0;
        let first = rays[0].range().origin;
        for i in 0..PACKET {
            let range = rays[i.min(rays.len() - 1)].range();
            for axis in 0..3 {
                out.origin32[axis][i] = range.origin[axis];
                out.dir32[axis][i] = range.dir[axis];
                differing |= range.origin[axis].to_bits() ^ first[axis].to_bits();
            }
            let scale = range.dir.abs().max_element();
            out.scale[i] = scale;
            out.longest = if scale > out.longest { scale } else { out.longest };
            out.t_near32[i] = range.t_near;
            out.t_cull[i] = range.t_far;
            out.t_far[i] = range.t_far;
        }
        out.common_origin = differing == 0;
        let (mut low, mut high) = (first, first);
        if !out.common_origin {
            for ray in rays {
                (low, high) = (ray.range().origin.min(low), ray.range().origin.max(high));
            }
            out.spread = (high - low).element_sum();
        }
        let far = low.abs().max(high.abs()).max_element().max(reach).max(out.longest);
        out.moderate = far <= MODERATE;
        out
    }

    /// Takes over a ray's best hit.
    #[inline(always)]
    pub(in crate::accel) fn set_limit(&mut self, ray: usize, best: &Closest) {
        self.t_cull[ray] = best.t_cull();
    }
}

/// Numbers of the set bits.
#[inline(always)]
pub(in crate::accel) fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then(|| mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        bit
    })
}
