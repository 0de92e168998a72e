//! New boxes in one sweep from the last node to the first: children are numbered behind their parents, so their boxes wait on a stack.

use std::ops::Range;

use super::{
    leaf::Corners,
    node::{Rows, Steps},
};
use crate::{
    accel::{
        sah::{self, BLOCK},
        wide::{
            Place, WIDTH, WideNode,
            refit::{Item, Items, Store, Subtree, Swept, TASK_NODES},
        },
    },
    geom::{Aabb, Triangles},
    glam::Vec3,
    simd::{Lanes, Simd, SimdLevel, Stack, Task, dispatch},
};

/// Boxes go into the nodes in steps.
#[derive(Clone, Copy)]
pub(in crate::accel) struct IntoSteps;

impl Store<Steps> for IntoSteps {
    fn store(&mut self, _number: usize, aabbs: &[Aabb; WIDTH], node: &mut Steps) {
        node.set_aabbs(aabbs);
    }

    fn split(self, _number: usize) -> (Self, Self) {
        (self, self)
    }
}

impl Item<Steps> for Corners {
    fn leaf(items: &mut [Self], own: Range<usize>, prims: &Triangles<'_>) -> Swept {
        let (weight, mut areas) = (weight(own.len()), [0.0; 16]);
        let aabb = carefully(&items[own], prims, &mut areas);
        Swept { aabb, cost: sah::half_area(aabb) * weight, own_area: sum_of(&areas) }
    }

    fn small<B: Store<Steps>, R: Items<Steps>>(
        subtree: &mut Subtree<'_, Steps, Self, B, R>,
        prims: &Triangles<'_>,
    ) -> Swept {
        let Subtree { nodes, items, first_item, .. } = subtree;
        dispatch(SimdLevel::best(), Sweep { nodes, items, first_item: *first_item, prims })
    }
}

/// Cost of visiting a leaf, per unit of area.
#[inline(always)]
fn weight(triangles: usize) -> f64 {
    sah::COST_BLOCK * triangles.div_ceil(BLOCK) as f64
}

/// The sum of half areas by their parts: three numbers of each four.
#[inline(always)]
fn sum_of(parts: &[f32; 16]) -> f64 {
    let mut sum = 0.0;
    for i in 0..4 {
        sum += f64::from(parts[4 * i]) + f64::from(parts[4 * i + 1]) + f64::from(parts[4 * i + 2]);
    }
    sum
}

/// The box around those triangles of a leaf whose corners are all finite. Parts of the half areas of their own boxes are added to `areas`, as
/// [`Leaves::take`] does it.
fn carefully(own: &[Corners], prims: &Triangles<'_>, areas: &mut [f32; 16]) -> Aabb {
    let mut around = Aabb::EMPTY;
    for (i, corners) in own.iter().enumerate() {
        let [a, b, c] = corners.vertices.map(|vertex| prims.positions[vertex as usize]);
        if a.is_finite() && b.is_finite() && c.is_finite() {
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            let extent = high - low;
            for axis in 0..3 {
                areas[4 * (i % BLOCK) + axis] += extent[axis] * extent[(axis + 1) % 3];
            }
            around = around.union(Aabb { min: low, max: high });
        }
    }
    around
}

/// Ones in the lanes of the triangles that a block has, by their number less one.
static OWN: [[f32; 16]; BLOCK] = {
    let mut rows = [[0.0; 16]; BLOCK];
    let mut last = 0;
    while last < BLOCK {
        let mut lane = 0;
        while lane < 4 * last + 4 {
            rows[last][lane] = 1.0;
            lane += 1;
        }
        last += 1;
    }
    rows
};

/// Sums over the triangles of a node's leaves, each triangle of a block in lanes of its own: on machines with eight lanes two in the first, two in the second.
struct Leaves<S: Simd> {
    /// Parts of the half areas of their own boxes.
    areas: [S::F; 2],
    /// Coordinates: finite when all of them are, overflows aside.
    places: S::F,
}

impl<S: Simd> Leaves<S> {
    #[inline(always)]
    fn new() -> Self {
        Self { areas: [S::F::splat(0.0); 2], places: S::F::splat(0.0) }
    }

    /// Writes the ends of the box around the triangles of a leaf; false where it has the last vertex of all, which [`Simd::vertices`] does not load.
    #[inline(always)]
    fn take(&mut self, items: &[Corners], own: Range<usize>, positions: &[[f32; 3]], ends: &mut [f32; WIDTH]) -> bool {
        let (mut low, mut high) = (S::F::splat(f32::INFINITY), S::F::splat(f32::NEG_INFINITY));
        let (mut first, end) = (own.start, own.end);
        while first < end {
            let last = (end - first).min(BLOCK) - 1;
            // The last triangle of a block stands in for those that it lacks.
            for group in (0..BLOCK).step_by(S::F::LEN / 4) {
                let (mut a, mut b, mut c) = ([0; BLOCK], [0; BLOCK], [0; BLOCK]);
                for i in 0..S::F::LEN / 4 {
                    [a[i], b[i], c[i]] = items[first + (group + i).min(last)].vertices;
                }
                let Some(a) = S::vertices(positions, &a) else { return false };
                let Some(b) = S::vertices(positions, &b) else { return false };
                let Some(c) = S::vertices(positions, &c) else { return false };
                self.places = self.places + (a + b + c);
                let (least, most) = (a.min(b).min(c), a.max(b).max(c));
                let extent = most - least;
                let areas = &mut self.areas[group * 4 / S::F::LEN];
                *areas = *areas + extent * S::rotated(extent) * S::F::load(&OWN[last & 3][4 * group..]);
                (low, high) = (least.min(low), most.max(high));
            }
            first += BLOCK;
        }
        S::least_four(low).store(ends);
        S::greatest_four(high).store(&mut ends[4..]);
        true
    }

    /// True when no vertex was NaN or infinite.
    #[inline(always)]
    fn are_finite(&self) -> bool {
        let zero = S::F::splat(0.0);
        (self.places * zero).le(zero) == S::F::ALL
    }

    #[inline(always)]
    fn own_area(&self) -> f64 {
        let mut parts = [0.0; 16];
        self.areas[1].store(&mut parts[16 - S::F::LEN..]);
        self.areas[0].store(&mut parts);
        sum_of(&parts)
    }
}

/// What is known of a subtree that was swept.
#[derive(Clone, Copy)]
struct Below {
    /// Lower and upper corner, each with a fourth number.
    ends: [f32; WIDTH],
    cost: f64,
    own_area: f64,
}

/// The ends of an empty box.
const EMPTY: [f32; WIDTH] = {
    let (low, high) = (f32::INFINITY, f32::NEG_INFINITY);
    [low, low, low, low, high, high, high, high]
};

#[inline(always)]
fn is_empty(ends: &[f32; WIDTH]) -> bool {
    ends[0] > ends[4]
}

/// The children of a node.
struct Kids {
    /// Lower and upper corners, each with a fourth number.
    ends: Rows,
    /// The same by column.
    rows: Rows,
    /// What a visit costs, per unit of area.
    weights: [f64; WIDTH],
    /// Costs of what is below.
    costs: [f64; WIDTH],
    /// Bits of those that have a box.
    present: u8,
}

/// A subtree, with the number of the first item of its leaves.
struct Sweep<'a> {
    nodes: &'a mut [Steps],
    items: &'a [Corners],
    first_item: usize,
    prims: &'a Triangles<'a>,
}

impl Task for Sweep<'_> {
    type Output = Swept;

    #[inline(always)]
    fn run<S: Simd>(self) -> Swept {
        let Self { nodes, items, first_item, prims } = self;
        let positions: &[[f32; 3]] = bytemuck::cast_slice(prims.positions);
        let mut waiting = Stack::<Below, TASK_NODES>::new();
        let mut kids = Kids {
            ends: [EMPTY; WIDTH],
            rows: [[0.0; WIDTH]; WIDTH],
            weights: [0.0; WIDTH],
            costs: [0.0; WIDTH],
            present: 0,
        };
        for node in nodes.iter_mut().rev() {
            let (mut leaves, mut are_whole) = (Leaves::<S>::new(), true);
            let mut own_area = 0.0;
            (kids.ends, kids.weights, kids.costs) = ([EMPTY; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
            kids.present = 0;
            for slot in 0..WIDTH {
                let link = node.word(slot);
                if link.is_none() {
                    break;
                }
                if link.is_leaf() {
                    let own = link.triangles();
                    kids.weights[slot] = weight(own.len());
                    let own = own.start - first_item..own.end - first_item;
                    are_whole &= leaves.take(items, own, positions, &mut kids.ends[slot]);
                    kids.present |= 1 << slot;
                } else if let Some(below) = waiting.pop() {
                    kids.ends[slot] = below.ends;
                    kids.weights[slot] = sah::COST_TRAVERSE;
                    kids.costs[slot] = below.cost;
                    own_area += below.own_area;
                    kids.present |= u8::from(!is_empty(&below.ends)) << slot;
                }
            }
            own_area += if are_whole && leaves.are_finite() {
                leaves.own_area()
            } else {
                again(node, &mut kids, (items, first_item), prims)
            };
            waiting.push(taken::<S>(node, &mut kids, own_area));
        }
        let Some(Below { ends: [a, b, c, _, d, e, f, _], cost, own_area }) = waiting.pop() else { return Swept::EMPTY };
        Swept { aabb: Aabb { min: Vec3::new(a, b, c), max: Vec3::new(d, e, f) }, cost, own_area }
    }
}

/// Takes the leaves of a node once more, without the triangles that are not there: the sum of half areas of the others' own boxes.
#[cold]
#[inline(never)]
fn again(node: &Steps, kids: &mut Kids, (items, first_item): (&[Corners], usize), prims: &Triangles<'_>) -> f64 {
    let mut areas = [0.0; 16];
    for slot in 0..WIDTH {
        let link = node.word(slot);
        if link.is_leaf() && !link.is_none() {
            let own = link.triangles();
            let around = carefully(&items[own.start - first_item..own.end - first_item], prims, &mut areas);
            let ([a, b, c], [d, e, f]) = (around.min.to_array(), around.max.to_array());
            kids.ends[slot] = [a, b, c, 0.0, d, e, f, 0.0];
            kids.present &= !(u8::from(around.is_empty()) << slot);
        }
    }
    sum_of(&areas)
}

/// Writes the boxes of the children, and sums up.
#[inline(always)]
fn taken<S: Simd>(node: &mut Steps, kids: &mut Kids, own_area: f64) -> Below {
    let ends = &kids.ends;
    let (mut low, mut high) = (S::F4::load(&ends[0]), S::F4::load(&ends[0][4..]));
    for ends in &ends[1..] {
        (low, high) = (low.min(S::F4::load(ends)), high.max(S::F4::load(&ends[4..])));
    }
    let mut out = Below { ends: EMPTY, cost: 0.0, own_area };
    low.store(&mut out.ends);
    high.store(&mut out.ends[4..]);
    if kids.present == 0 {
        node.clear();
        out.ends = EMPTY;
        return out;
    }
    S::eight_columns(&kids.ends, &mut kids.rows);
    node.set::<S>(&kids.rows, &out.ends, kids.present);
    let mut costs = [0.0; WIDTH];
    for first in (0..WIDTH).step_by(S::D::LEN) {
        let (weights, below) = (S::D::load(&kids.weights[first..]), S::D::load(&kids.costs[first..]));
        (below + half_areas::<S>(&kids.rows, first) * weights).store(&mut costs[first..]);
    }
    let [a, b, c, d, e, f, g, h] = costs;
    out.cost = ((a + b) + (c + d)) + ((e + f) + (g + h));
    out
}

/// Half the surface areas of children from number `first` on, as [`sah::half_area`].
#[inline(always)]
fn half_areas<S: Simd>(rows: &Rows, first: usize) -> S::D {
    let zero = S::D::splat(0.0);
    let x = (S::load_wide(&rows[4][first..]) - S::load_wide(&rows[0][first..])).max(zero);
    let y = (S::load_wide(&rows[5][first..]) - S::load_wide(&rows[1][first..])).max(zero);
    let z = (S::load_wide(&rows[6][first..]) - S::load_wide(&rows[2][first..])).max(zero);
    x * y + y * z + z * x
}
