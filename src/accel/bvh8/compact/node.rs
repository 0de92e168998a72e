//! Boxes in 256 steps of their node's box.
//!
//! # Why no box is lost
//! A plane is read as `fl(origin + q * step)`, with q from 0 to 255 and the step a power of two from 2^-126 to 2^119, or 0 where the node is flat. The product has
//! at most eight bits and neither overflows nor underflows, so it is exact, and one rounding is left, fused or not: a plane is the same f32 on every
//! machine. What q is written is checked by the very same sum: a lower plane may not come out above that of the child, an upper one not below.
//!
//! Let d be `fl(plane - origin)`, off by at most `2^-24 d`, which is at most `2^-16 step`. For a lower plane q is `floor(d / step)`; where it comes out above, q - 1 does
//! not: `origin + (q - 1) step` is at most `plane - step + 2^-16 step`, and rounding is monotone. q = 0 is the origin, which is no more than any lower plane.
//! Upper planes mirror this. The step is the least whose q = 255 comes out at or above the node's own upper plane, so no child asks for more.
//!
//! Where the node's box is so large that no such step is left, the step is infinite: all planes are infinite or NaN, which no test takes for a bound. Rays that f32
//! boxes are proven for never meet one.

use crate::{
    accel::{
        bvh8::node::{EightNode, Link},
        wide::{WIDTH, WideNode},
    },
    geom::Aabb,
    simd::{Lanes, Scalar, Simd},
};

/// Bits below the exponent of an f32.
const EXPONENT: u32 = 23;
/// The exponent bits of the greatest step.
const GREATEST: u32 = 246;
/// Those of infinity.
const NO_STEP: u32 = 255;
/// The greatest q.
const MOST: f32 = 255.0;

/// The lower planes of eight boxes by axis, a row of anything, and the upper ones.
pub(super) type Rows = [[f32; WIDTH]; WIDTH];

/// Eight children's boxes.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::accel) struct Steps {
    /// The children, in the order of their triangles; [`Link::NONE`] after the last.
    links: [Link; WIDTH],
    /// The lower corner of the box around all children.
    origin: [f32; 3],
    /// The exponent bits of the steps.
    exponents: [u8; 3],
    /// Bits of the children that have a box.
    present: u8,
    /// `[axis][min, max][child]`.
    planes: [[[u8; WIDTH]; 2]; 3],
}

const _: () = assert!(size_of::<Steps>() == 96);

impl WideNode for Steps {
    type Word = Link;

    #[inline(always)]
    fn word(&self, slot: usize) -> Link {
        self.links[slot]
    }
}

/// A power of two by its exponent bits.
#[inline(always)]
fn power(exponent: u32) -> f32 {
    f32::from_bits(exponent << EXPONENT)
}

/// The exponent bits of the step between two planes.
#[inline(always)]
fn exponent(low: f32, high: f32) -> u32 {
    let extent = high - low;
    if extent <= 0.0 {
        return 0;
    }
    let least = (extent.to_bits() >> EXPONENT).max(8) - 7;
    let exponent = least + u32::from(MOST * power(least) + low < high);
    if exponent > GREATEST { NO_STEP } else { exponent }
}

/// Bits of the boxes that are not empty.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "a bit a child")]
fn present<S: Simd>(rows: &Rows) -> u8 {
    S::F8::load(&rows[0]).le(S::F8::load(&rows[4])) as u8
}

impl Steps {
    #[inline(always)]
    fn step(&self, axis: usize) -> f32 {
        power(u32::from(self.exponents[axis]))
    }

    /// Sets the boxes of the children; `around` is the one around them all, which is not empty: lower corner, any number, upper corner, any number.
    #[inline(always)]
    pub(super) fn set<S: Simd>(&mut self, rows: &Rows, around: &[f32; WIDTH]) {
        self.present = present::<S>(rows);
        for axis in 0..3 {
            let (start, end) = (around[axis], around[axis + 4]);
            let bits = exponent(start, end);
            #[expect(clippy::cast_possible_truncation, reason = "at most 255")]
            let byte = bits as u8;
            (self.origin[axis], self.exponents[axis]) = (start, byte);
            // Of flat and boundless nodes every q is 0.
            let inverse = if bits == 0 || bits == NO_STEP { 0.0 } else { power(254 - bits) };
            let (origin, step, inverse) = (S::F8::splat(start), S::F8::splat(power(bits)), S::F8::splat(inverse));
            let (zero, one, most) = (S::F8::splat(0.0), S::F8::splat(1.0), S::F8::splat(MOST));
            let (low, high) = (S::F8::load(&rows[axis]), S::F8::load(&rows[axis + 4]));
            let q = ((low - origin) * inverse).floor();
            let above = low.lt(q.mul_add_loose(step, origin));
            // The clamps are for children that are not there.
            self.planes[axis][0] = S::to_bytes(S::F8::select(above, q - one, q).max(zero).min(most));
            let q = -((origin - high) * inverse).floor();
            let below = q.mul_add_loose(step, origin).lt(high);
            self.planes[axis][1] = S::to_bytes(S::F8::select(below, q + one, q).max(zero).min(most));
        }
    }

    /// As [`Steps::set`], from boxes.
    pub(super) fn set_aabbs(&mut self, aabbs: &[Aabb; WIDTH]) {
        let all = aabbs.iter().fold(Aabb::EMPTY, |all, &aabb| all.union(aabb));
        if all.is_empty() {
            self.clear();
            return;
        }
        let mut rows = [[0.0; WIDTH]; WIDTH];
        for (child, &aabb) in aabbs.iter().enumerate() {
            let aabb = if aabb.is_empty() { Aabb::EMPTY } else { aabb };
            for axis in 0..3 {
                (rows[axis][child], rows[axis + 4][child]) = (aabb.min[axis], aabb.max[axis]);
            }
        }
        let ([a, b, c], [d, e, f]) = (all.min.to_array(), all.max.to_array());
        let around = [a, b, c, 0.0, d, e, f, 0.0];
        self.set::<Scalar>(&rows, &around);
    }

    /// No boxes.
    pub(super) fn clear(&mut self) {
        *self = EightNode::new(self.links);
    }
}

impl EightNode for Steps {
    fn new(links: [Link; WIDTH]) -> Self {
        Self { links, origin: [0.0; 3], exponents: [0; 3], present: 0, planes: [[[0; WIDTH]; 2]; 3] }
    }

    #[inline(always)]
    fn planes<S: Simd>(&self, axis: usize, side: usize) -> S::F8 {
        let q = S::of_bytes(&self.planes[axis][side]);
        q.mul_add_loose(S::F8::splat(self.step(axis)), S::F8::splat(self.origin[axis]))
    }

    #[inline(always)]
    fn plane(&self, axis: usize, side: usize, child: usize) -> f32 {
        f32::from(self.planes[axis][side][child]) * self.step(axis) + self.origin[axis]
    }

    #[inline(always)]
    fn present(&self) -> u32 {
        u32::from(self.present)
    }

    #[inline(always)]
    fn links(&self) -> &[Link; WIDTH] {
        &self.links
    }

    fn set_link(&mut self, child: usize, link: Link) {
        self.links[child] = link;
    }

    fn check(&self, aabbs: &[Aabb; WIDTH]) -> Result<(), String> {
        for (child, due) in aabbs.iter().enumerate() {
            if (self.present >> child & 1 == 1) == due.is_empty() {
                return Err(format!("child {child} is there or not, and its box is {due:?}"));
            }
            for axis in 0..3 {
                let (low, high) = (self.plane(axis, 0, child), self.plane(axis, 1, child));
                // NaN is no bound.
                if !due.is_empty() && (low > due.min[axis] || high < due.max[axis]) {
                    return Err(format!("child {child}: {low} to {high} on axis {axis}, box {due:?}"));
                }
            }
        }
        let mut fresh = *self;
        fresh.set_aabbs(aabbs);
        if fresh == *self { Ok(()) } else { Err(format!("{self:?}, due {fresh:?}")) }
    }
}
