use arrayvec::ArrayVec;

use super::{build::MAX_DEPTH, node::KdNode};
use crate::accel::{
    Counter, TravRay,
    leaves::{Leaves, Line, NARROW, WIDEN},
    query::{GROW, ORDINARY_MAX, SHRINK, round_up},
};

/// Absolute slack of f32 comparisons: above every underflow they may meet.
const SLACK: f32 = f32::MIN_POSITIVE;

/// A number type to walk in: f32 for ordinary rays, f64 for all.
pub(in crate::accel) trait Real: Copy + PartialOrd {
    fn limit(leaves: &impl Leaves) -> Self;
}

impl Real for f32 {
    #[inline(always)]
    fn limit(leaves: &impl Leaves) -> Self {
        leaves.t_cull() + SLACK
    }
}

impl Real for f64 {
    #[inline(always)]
    fn limit(leaves: &impl Leaves) -> Self {
        leaves.t_limit()
    }
}

/// Where a ray crosses a split.
///
/// # Proof that no leaf is missed
/// `(split - o) * inv` has the sign of the exact crossing and, widened, bounds it on both sides ([`SHRINK`], [`GROW`]; in f64 the
/// roundings are below 16 * 2^-53). So an exact t at which the ray is on the near side of the plane or in it is at most `high`, one on the far side or in it at
/// least `low`, up to an underflow that `SLACK` covers; the intervals that a walk keeps contain every such t. A ray
/// along the plane (`inv` infinite) has a crossing of +inf or -inf according to its side, and NaN, which fails both comparisons and so visits both
/// children, when it lies in the plane.
pub(in crate::accel) trait Crossing: Copy {
    type T: Real;
    /// Bounds of the crossing, the lower first where it is not negative.
    fn bounds(&self, axis: usize, split: f32) -> (Self::T, Self::T);
    /// True when the ray comes from above.
    fn is_backward(&self, axis: usize) -> bool;
    fn max(a: Self::T, b: Self::T) -> Self::T;
    fn min(a: Self::T, b: Self::T) -> Self::T;
}

/// Crossings in f32. Rows have a fourth entry, so that a node's two axis bits need no check.
#[derive(Clone, Copy, Debug)]
pub(in crate::accel) struct Fast {
    origin: [f32; 4],
    inv_low: [f32; 4],
    inv_high: [f32; 4],
}

impl Fast {
    #[inline(always)]
    pub(in crate::accel) fn new(ray: &TravRay) -> Self {
        let (o, inv) = (ray.range().origin, ray.inv());
        let (low, high) = (inv * SHRINK, inv * GROW);
        Self {
            origin: [o.x, o.y, o.z, 0.0],
            inv_low: [low.x, low.y, low.z, 0.0],
            inv_high: [high.x, high.y, high.z, 0.0],
        }
    }
}

impl Crossing for Fast {
    type T = f32;

    #[inline(always)]
    fn bounds(&self, axis: usize, split: f32) -> (f32, f32) {
        let delta = split - self.origin[axis & 3];
        (delta * self.inv_low[axis & 3], delta * self.inv_high[axis & 3] + SLACK)
    }

    #[inline(always)]
    fn is_backward(&self, axis: usize) -> bool {
        self.inv_low[axis & 3] < 0.0
    }

    #[inline(always)]
    fn max(a: f32, b: f32) -> f32 {
        if a > b { a } else { b }
    }

    #[inline(always)]
    fn min(a: f32, b: f32) -> f32 {
        if a < b { a } else { b }
    }
}

/// Crossings in f64.
#[derive(Clone, Copy, Debug)]
pub(in crate::accel) struct Wide<'a>(pub(in crate::accel) &'a Line);

impl Crossing for Wide<'_> {
    type T = f64;

    #[inline(always)]
    fn bounds(&self, axis: usize, split: f32) -> (f64, f64) {
        let t = self.0.t(axis, f64::from(split));
        (t * NARROW, t * WIDEN)
    }

    #[inline(always)]
    fn is_backward(&self, axis: usize) -> bool {
        self.0.inv[axis] < 0.0
    }

    #[inline(always)]
    fn max(a: f64, b: f64) -> f64 {
        if a > b { a } else { b }
    }

    #[inline(always)]
    fn min(a: f64, b: f64) -> f64 {
        if a < b { a } else { b }
    }
}

/// True when f32 crossings are proven for this ray and splits up to `reach` from 0.
#[inline(always)]
pub(in crate::accel) fn is_ordinary(ray: &TravRay, reach: f32) -> bool {
    ray.is_ordinary() && reach <= ORDINARY_MAX
}

/// Walks the subtree at `root` front to back for t within `[t_in, t_out]`; true when a leaf ended the walk.
///
/// `nodes` number their children from the slice's start. `read_base` is the address that the reads are counted at.
#[inline(always)]
pub(in crate::accel) fn walk<X: Crossing, L: Leaves, C: Counter>(
    nodes: &[KdNode],
    root: usize,
    (t_in, t_out): (X::T, X::T),
    crossing: &X,
    leaves: &mut L,
    count: &mut C,
) -> bool {
    let mut stack = ArrayVec::<(u32, X::T, X::T), MAX_DEPTH>::new();
    let (mut at, mut t_min, mut t_max) = (root, t_in, t_out);
    loop {
        let node = nodes[at];
        count.node();
        count.read(at * size_of::<KdNode>(), size_of::<KdNode>());
        if node.is_leaf() {
            if leaves.leaf(node.units(), count) {
                return true;
            }
            let limit = X::T::limit(leaves);
            loop {
                match stack.pop() {
                    None => return false,
                    Some((next, from, to)) if from <= limit => {
                        (at, t_min, t_max) = (next as usize, from, to);
                        break;
                    }
                    Some(_) => {}
                }
            }
            continue;
        }
        let axis = node.axis();
        let (low, high) = crossing.bounds(axis, node.split());
        let (near, far) = if crossing.is_backward(axis) { (node.upper(), at + 1) } else { (at + 1, node.upper()) };
        if high < t_min {
            at = far;
        } else if low > t_max {
            at = near;
        } else {
            #[expect(clippy::cast_possible_truncation, reason = "nodes are numbered by 30 bits")]
            stack.push((far as u32, X::max(low, t_min), t_max));
            at = near;
            t_max = X::min(high, t_max);
        }
    }
}

/// An interval in f32 around one in f64, for [`Fast`].
#[inline(always)]
pub(in crate::accel) fn outward((t_in, t_out): (f64, f64)) -> (f32, f32) {
    (-round_up(-t_in.min(f64::from(f32::MAX))), round_up(t_out.min(f64::from(f32::MAX))) + SLACK)
}
