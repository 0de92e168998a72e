//! The ordered walk of one ray: nearest child first.

use arrayvec::ArrayVec;

use super::{Place, Tree, WIDTH, WideNode, Word};
use crate::{
    accel::{
        Closest, Counter, HitSink, TravRay,
        block::{BlockRay, TriBlock},
        topology::MAX_DEPTH,
    },
    geom::Triangles,
    simd::Simd,
};

/// Length of stacks: all children but one at every level.
const MAX_STACK: usize = MAX_DEPTH * (WIDTH - 1);

/// Children to visit, the next last.
type Stack<T, M> = ArrayVec<(Word<T>, M), MAX_STACK>;

/// A key for entries that are not negative.
#[inline(always)]
pub(in crate::accel) fn key32(entry: f32, slot: usize) -> u64 {
    u64::from(entry.to_bits()) << 32 | slot as u64
}

/// As [`key32`]; entries that differ in their last bits alone count as equal.
#[inline(always)]
pub(in crate::accel) fn key64(entry: f64, slot: usize) -> u64 {
    entry.to_bits() & !7 | slot as u64
}

/// A way to test the children of a node: by f32 vectors for ordinary rays, by f64 scalars for all.
pub(in crate::accel) trait Kernel<T: Tree + ?Sized> {
    /// What is kept of a child until it is visited.
    type Mark: Copy;
    /// The marks of all children of a node.
    type Kids;

    /// Any marks.
    fn kids() -> Self::Kids;
    /// Bits of the children that the ray may meet before the limit; their marks are written.
    fn test(&self, node: &T::Node, mark: Self::Mark, kids: &mut Self::Kids) -> u32;
    /// The mark of a child.
    fn mark(kids: &Self::Kids, slot: usize) -> Self::Mark;
    /// The slot of a child in the lowest three bits, below a number that grows with the entry into the child.
    fn key(kids: &Self::Kids, slot: usize) -> u64;
    /// Nothing beyond the best hit counts any more.
    fn limit(&mut self, best: &Closest);
    /// The mark within the limit; `None` when the child lies beyond.
    fn reopened(&self, mark: Self::Mark) -> Option<Self::Mark>;
    /// False when the ray surely misses all triangles of a block of a leaf.
    fn may_meet<S: Simd>(&self, block: &TriBlock, mark: Self::Mark) -> bool;
}

/// Number of the lowest set bit, in a form that bounds checks understand.
#[inline(always)]
fn first(hits: u32) -> usize {
    (hits.trailing_zeros() & 7) as usize
}

/// Offers the triangles below a node or leaf, nearest children first.
#[inline(always)]
pub(in crate::accel) fn closest<S: Simd, T: Tree, N: Kernel<T>, C: Counter, K: HitSink>(
    tree: &T,
    mut test: N,
    (mut word, mut mark): (Word<T>, N::Mark),
    (ray, prims): (&TravRay, &Triangles<'_>),
    best: &mut Closest,
    sink: &K,
    count: &mut C,
) {
    let (block_ray, mut room) = (BlockRay::new(ray, tree.reach()), TriBlock::EMPTY);
    let mut stack = Stack::<T, N::Mark>::new();
    let mut kids = N::kids();
    loop {
        if word.is_leaf() {
            for i in 0..tree.span(word) {
                let block = tree.block((word, i), prims, &mut room, count);
                if test.may_meet::<S>(block, mark) {
                    block.closest::<S, C, K>(ray, &block_ray, best, sink, count);
                }
            }
            test.limit(best);
        } else {
            count.node();
            let node = tree.node(word.index());
            let mut hits = test.test(node, mark, &mut kids);
            if hits != 0 {
                let near = first(hits);
                hits &= hits - 1;
                if hits == 0 {
                    (word, mark) = (node.word(near).predicted(), N::mark(&kids, near));
                    continue;
                }
                let far = first(hits);
                hits &= hits - 1;
                if hits == 0 {
                    let (near, far) = if N::key(&kids, far) < N::key(&kids, near) { (far, near) } else { (near, far) };
                    stack.push((node.word(far), N::mark(&kids, far)));
                    (word, mark) = (node.word(near).predicted(), N::mark(&kids, near));
                    continue;
                }
                let mut keys = [N::key(&kids, near), N::key(&kids, far), 0, 0, 0, 0, 0, 0];
                let mut len = 2;
                while hits != 0 {
                    keys[len & 7] = N::key(&kids, first(hits));
                    hits &= hits - 1;
                    len += 1;
                }
                sort(&mut keys, len);
                for &key in keys[1..len].iter().rev() {
                    let slot = (key & 7) as usize;
                    stack.push((node.word(slot), N::mark(&kids, slot)));
                }
                let near = (keys[0] & 7) as usize;
                (word, mark) = (node.word(near), N::mark(&kids, near));
                continue;
            }
        }
        (word, mark) = loop {
            let Some((word, mark)) = stack.pop() else { return };
            if let Some(mark) = test.reopened(mark) {
                break (word, mark);
            }
        };
    }
}

/// Sorts the first `len` keys, at least three: most nodes that more than two children are left of have three or four, which take no branches.
#[inline(always)]
pub(in crate::accel) fn sort(keys: &mut [u64; WIDTH], len: usize) {
    if len <= 4 {
        if len == 3 {
            keys[3] = u64::MAX;
        }
        let [a, b, c, d] = [keys[0], keys[1], keys[2], keys[3]];
        let ((a, b), (c, d)) = (ordered(a, b), ordered(c, d));
        let ((a, c), (b, d)) = (ordered(a, c), ordered(b, d));
        let (b, c) = ordered(b, c);
        (keys[0], keys[1], keys[2], keys[3]) = (a, b, c, d);
        return;
    }
    for i in 1..len {
        let key = keys[i & 7];
        let mut at = i;
        while at > 0 && keys[(at - 1) & 7] > key {
            keys[at & 7] = keys[(at - 1) & 7];
            at -= 1;
        }
        keys[at & 7] = key;
    }
}

#[inline(always)]
fn ordered(a: u64, b: u64) -> (u64, u64) {
    (a.min(b), a.max(b))
}

/// True when a triangle below a node or leaf is hit. Any hit ends the walk; children are followed in their own order.
#[inline(always)]
pub(in crate::accel) fn occluded<S: Simd, T: Tree, N: Kernel<T>, C: Counter, K: HitSink>(
    tree: &T,
    test: &N,
    (mut word, mut mark): (Word<T>, N::Mark),
    (ray, prims): (&TravRay, &Triangles<'_>),
    sink: &K,
    count: &mut C,
) -> bool {
    let (block_ray, mut room) = (BlockRay::new(ray, tree.reach()), TriBlock::EMPTY);
    let mut stack = Stack::<T, N::Mark>::new();
    let mut kids = N::kids();
    loop {
        if word.is_leaf() {
            for i in 0..tree.span(word) {
                let block = tree.block((word, i), prims, &mut room, count);
                if test.may_meet::<S>(block, mark) && block.occluded::<S, C, K>(ray, &block_ray, sink, count) {
                    return true;
                }
            }
        } else {
            count.node();
            let node = tree.node(word.index());
            let mut hits = test.test(node, mark, &mut kids);
            if hits != 0 {
                let slot = first(hits);
                hits &= hits - 1;
                (word, mark) = (node.word(slot).predicted(), N::mark(&kids, slot));
                while hits != 0 {
                    let slot = first(hits);
                    hits &= hits - 1;
                    stack.push((node.word(slot), N::mark(&kids, slot)));
                }
                continue;
            }
        }
        match stack.pop() {
            Some(next) => (word, mark) = next,
            None => return false,
        }
    }
}
