//! New boxes into old trees, in one sweep from the last node to the first.

use super::{LEAF, Tree, WIDTH, node::Ends};
use crate::{
    geom::{Aabb, Triangles},
    simd::{Simd, SimdLevel, Task, dispatch},
};

/// Boxes by number.
pub(in crate::collide) trait Boxes {
    /// A box; the empty one for those with NaN or without an inside.
    fn ends(&self, number: u32) -> Ends;
}

impl<F: Fn(u32) -> Aabb> Boxes for F {
    #[inline(always)]
    fn ends(&self, number: u32) -> Ends {
        Ends::new(&self(number))
    }
}

impl Boxes for Triangles<'_> {
    /// The corners are finite.
    #[inline(always)]
    fn ends(&self, number: u32) -> Ends {
        let [a, b, c] = self.indices[number as usize];
        let a = self.positions[a as usize].extend(0.0);
        let b = self.positions[b as usize].extend(0.0);
        let c = self.positions[c as usize].extend(0.0);
        Ends { low: a.min(b).min(c), high: a.max(b).max(c) }
    }
}

impl Tree {
    /// Takes the items' new boxes, as many as before. No allocation.
    pub(in crate::collide) fn refit<B: Boxes>(&mut self, boxes: &B) {
        dispatch(SimdLevel::best(), Refit { tree: self, boxes });
    }

    /// Takes the items' boxes into the shape of another tree over as many. No allocation when this one came of it.
    pub(in crate::collide) fn refit_from<B: Boxes>(&mut self, shape: &Self, boxes: &B) {
        if self.build != shape.build {
            self.clone_from(shape);
        }
        self.refit(boxes);
    }
}

struct Refit<'a, B> {
    tree: &'a mut Tree,
    boxes: &'a B,
}

impl<B: Boxes> Task for Refit<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { tree, boxes } = self;
        let (mut areas, mut own) = (0.0_f64, 0.0_f64);
        for number in (0..tree.nodes.len()).rev() {
            let (before, after) = tree.bounds.split_at_mut(number + 1);
            let node = &mut tree.nodes[number];
            let mut ends = [Ends::EMPTY; WIDTH];
            for (lane, ends) in ends.iter_mut().enumerate().take(node.count as usize) {
                let link = node.links[lane];
                *ends = if node.is_leaf { boxes.ends(link) } else { after[(link & !LEAF) as usize - number - 1] };
            }
            let (all, area) = node.take(&ends);
            before[number] = all;
            areas += f64::from(all.half_area());
            if node.is_leaf {
                own += f64::from(area);
            }
        }
        tree.now = if own > 0.0 { areas / own } else { 0.0 };
    }
}
