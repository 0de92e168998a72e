//! Nodes: eight boxes by component, and what they stand for.

use glam::{Mat4, Vec3, Vec4};

use super::{NONE, WIDTH};
use crate::{
    geom::Aabb,
    simd::{Lanes, Simd},
};

/// A box as two vectors, whose fourth numbers count for nothing.
#[derive(Clone, Copy, Debug)]
pub(in crate::collide) struct Ends {
    pub(in crate::collide) low: Vec4,
    pub(in crate::collide) high: Vec4,
}

impl Ends {
    pub(in crate::collide) const EMPTY: Self = Self { low: Vec4::INFINITY, high: Vec4::NEG_INFINITY };

    /// The box, or the empty one where it has NaN or no inside.
    #[inline(always)]
    pub(in crate::collide) fn new(aabb: &Aabb) -> Self {
        if aabb.is_empty() {
            return Self::EMPTY;
        }
        Self { low: aabb.min.extend(0.0), high: aabb.max.extend(0.0) }
    }

    #[inline(always)]
    pub(in crate::collide) fn aabb(&self) -> Aabb {
        Aabb { min: self.low.truncate(), max: self.high.truncate() }
    }

    #[inline(always)]
    pub(in crate::collide) fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// As [`Aabb::half_area`].
    #[inline(always)]
    pub(in crate::collide) fn half_area(&self) -> f32 {
        self.aabb().half_area()
    }
}

/// Eight boxes by component, and what each stands for.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(in crate::collide) struct Node {
    pub(in crate::collide) min: [[f32; WIDTH]; 3],
    pub(in crate::collide) max: [[f32; WIDTH]; 3],
    /// Items of a leaf, [`NONE`] where there is none; else numbers of child nodes, with [`super::LEAF`] for leaves.
    pub(in crate::collide) links: [u32; WIDTH],
    /// Number of places in use, from the first on.
    pub(in crate::collide) count: u32,
    pub(in crate::collide) is_leaf: bool,
}

impl Node {
    pub(in crate::collide) fn new(is_leaf: bool) -> Self {
        let (min, max) = ([[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]);
        Self { min, max, links: [NONE; WIDTH], count: 0, is_leaf }
    }

    /// Takes all boxes, empty ones where no place is in use: the least box around them, and the sum of half their areas.
    #[inline(always)]
    pub(in crate::collide) fn take(&mut self, ends: &[Ends; WIDTH]) -> (Ends, f32) {
        let [a, b, c, d, e, f, g, h] = ends;
        let all = a.union(*b).union(c.union(*d)).union(e.union(*f).union(g.union(*h)));
        let first = self.take_half::<0>([a, b, c, d]);
        let second = self.take_half::<4>([e, f, g, h]);
        let sum = first + second;
        (all, (sum.x + sum.y) + (sum.z + sum.w))
    }

    /// Half of [`Node::take`]; half the boxes' areas.
    #[inline(always)]
    fn take_half<const AT: usize>(&mut self, [a, b, c, d]: [&Ends; 4]) -> Vec4 {
        let low = Mat4::from_cols(a.low, b.low, c.low, d.low).transpose();
        let high = Mat4::from_cols(a.high, b.high, c.high, d.high).transpose();
        for (row, axis) in self.min.iter_mut().zip([low.x_axis, low.y_axis, low.z_axis]) {
            row[AT..AT + 4].copy_from_slice(&axis.to_array());
        }
        for (row, axis) in self.max.iter_mut().zip([high.x_axis, high.y_axis, high.z_axis]) {
            row[AT..AT + 4].copy_from_slice(&axis.to_array());
        }
        let x = (high.x_axis - low.x_axis).max(Vec4::ZERO);
        let y = (high.y_axis - low.y_axis).max(Vec4::ZERO);
        let z = (high.z_axis - low.z_axis).max(Vec4::ZERO);
        x * (y + z) + y * z
    }

    #[inline(always)]
    pub(in crate::collide) fn get(&self, lane: usize) -> Aabb {
        let pick = |planes: &[[f32; WIDTH]; 3]| Vec3::new(planes[0][lane], planes[1][lane], planes[2][lane]);
        Aabb { min: pick(&self.min), max: pick(&self.max) }
    }

    /// Places whose closed box meets a closed box; exact.
    #[inline(always)]
    pub(in crate::collide) fn meets<S: Simd>(&self, aabb: &Aabb) -> u32 {
        let mut mask = (1_u32 << self.count) - 1;
        for axis in 0..3 {
            let (low, high) = (S::F8::load(&self.min[axis]), S::F8::load(&self.max[axis]));
            mask &= low.le(S::F8::splat(aabb.max[axis])) & S::F8::splat(aabb.min[axis]).le(high);
        }
        mask
    }
}
