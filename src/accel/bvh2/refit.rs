use super::node::{Link, Pair};
use crate::{
    accel::{
        block::{Sweep, TriBlock},
        sah,
    },
    geom::{Aabb, Triangles},
    simd::{Simd, SimdLevel, Task, dispatch},
};

/// Subtrees of fewer pairs are refitted by one task.
const TASK_PAIRS: usize = 1024;

/// What a refit found out about a subtree. Sums are taken in the order of the tree, whatever the schedule.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Swept {
    /// Sum over the nodes below of half area times cost of a visit.
    pub(super) cost: f64,
    /// Sum of the half areas of the triangles' own boxes.
    pub(super) own_area: f64,
}

impl Swept {
    fn plus(self, other: Self) -> Self {
        Self { cost: self.cost + other.cost, own_area: self.own_area + other.own_area }
    }
}

/// One subtree: the pairs and blocks it owns, and the numbers of the first of each.
struct Subtree<'a> {
    pairs: &'a mut [Pair],
    blocks: &'a mut [TriBlock],
    first_pair: usize,
    first_block: usize,
}

/// Takes new positions into all blocks and boxes, bottom-up; subtrees run in parallel in the current pool.
pub(super) fn refit(pairs: &mut [Pair], blocks: &mut [TriBlock], prims: &Triangles<'_>) -> Swept {
    Subtree { pairs, blocks, first_pair: 0, first_block: 0 }.refit(prims)
}

impl Subtree<'_> {
    fn refit(self, prims: &Triangles<'_>) -> Swept {
        if self.pairs.len() < TASK_PAIRS {
            dispatch(SimdLevel::best(), Small { subtree: self, prims })
        } else {
            self.fork(prims)
        }
    }

    fn fork(self, prims: &Triangles<'_>) -> Swept {
        let Self { pairs, blocks, first_pair, first_block } = self;
        let Some((root, rest)) = pairs.split_first_mut() else { return Swept::default() };
        let below_first = match root.links {
            [first, _] if first.is_leaf() => 0,
            [_, second] if second.is_leaf() => rest.len(),
            [_, second] => second.pair() - first_pair - 1,
        };
        let (pairs0, pairs1) = rest.split_at_mut(below_first);
        let (blocks0, blocks1) = blocks.split_at_mut(root.blocks[0] as usize);
        let second_block = first_block + blocks0.len();
        let second_pair = first_pair + 1 + below_first;
        let links = root.links;
        let ((box0, swept0), (box1, swept1)) = rayon::join(
            || child(links[0], pairs0, blocks0, first_pair + 1, first_block, prims),
            || child(links[1], pairs1, blocks1, second_pair, second_block, prims),
        );
        root.set_aabb(0, box0);
        root.set_aabb(1, box1);
        swept0.plus(swept1)
    }
}

/// A subtree that one task refits.
struct Small<'a> {
    subtree: Subtree<'a>,
    prims: &'a Triangles<'a>,
}

impl Task for Small<'_> {
    type Output = Swept;

    /// Children have higher numbers than their parents, so one backward sweep meets them first.
    #[inline(always)]
    fn run<S: Simd>(self) -> Swept {
        let Self { subtree: Subtree { pairs, blocks, first_pair, first_block }, prims } = self;
        let mut swept = Swept::default();
        for i in (0..pairs.len()).rev() {
            let links = pairs[i].links;
            for (child, link) in links.into_iter().enumerate() {
                let (aabb, below) = if link.is_leaf() {
                    refit_leaf(link, blocks, first_block, prims)
                } else {
                    let aabb = pairs[link.pair() - first_pair].union();
                    (aabb, Swept { cost: sah::half_area(aabb) * sah::COST_TRAVERSE, own_area: 0.0 })
                };
                pairs[i].set_aabb(child, aabb);
                swept = swept.plus(below);
            }
        }
        swept
    }
}

fn child(
    link: Link,
    pairs: &mut [Pair],
    blocks: &mut [TriBlock],
    first_pair: usize,
    first_block: usize,
    prims: &Triangles<'_>,
) -> (Aabb, Swept) {
    if link.is_leaf() {
        return refit_leaf(link, blocks, first_block, prims);
    }
    let swept = Subtree { pairs: &mut *pairs, blocks, first_pair, first_block }.refit(prims);
    let aabb = pairs[0].union();
    (aabb, Swept { cost: sah::half_area(aabb) * sah::COST_TRAVERSE, own_area: 0.0 }.plus(swept))
}

#[inline(always)]
fn refit_leaf(link: Link, blocks: &mut [TriBlock], first_block: usize, prims: &Triangles<'_>) -> (Aabb, Swept) {
    let range = link.blocks();
    let count = range.len();
    if count == 0 {
        return (Aabb::EMPTY, Swept::default());
    }
    let mut aabb = Aabb::EMPTY;
    let mut own_area = 0.0;
    for at in (range.start - first_block..range.end - first_block).rev() {
        let bounds = TriBlock::refit_in_sweep(blocks, at, Sweep::Downward, prims);
        aabb = aabb.union(bounds.aabb);
        own_area += bounds.own_area;
    }
    (aabb, Swept { cost: sah::half_area(aabb) * sah::COST_BLOCK * count as f64, own_area })
}
