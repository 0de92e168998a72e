//! New boxes in one sweep from the last node to the first: children are numbered behind their parents, so their boxes wait on a stack.

use std::ops::Range;

use super::{
    leaf::Corners,
    node::{Rows, Steps},
};
use crate::{
    accel::{
        sah::{self, BLOCK},
        topology::MAX_LEAF,
        wide::{
            Place, WIDTH, WideNode,
            refit::{Item, Items, Store, Subtree, Swept, TASK_NODES},
        },
    },
    geom::{Aabb, Triangles},
    glam::Vec3,
    simd::{Halves, Lanes, Simd, SimdLevel, Stack, Task, dispatch, prefetch},
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
        let (weight, mut areas) = (WEIGHTS[own.len() - 1], [0.0; 16]);
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
/// [`Gathered::leaf`] does it.
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

/// By how many triangles vertices are asked for before they are needed, those of one in four.
const AHEAD: usize = 24;

/// What is gathered from the children of nodes. Triangles of a block have lanes of their own: on machines with eight lanes two have the first vector, two the second.
struct Gathered<S: Simd> {
    /// Parts of the half areas of the triangles' own boxes.
    areas: [S::F; 2],
    /// Sums of the coordinates of a node's leaves: finite when all of these are, overflows aside.
    places: S::F,
    /// The ends of the box around a node's leaves.
    low: S::F,
    high: S::F,
    /// Parts of the half areas of nodes and leaves, times the cost of a visit.
    costs: S::D4,
}

impl<S: Simd> Gathered<S> {
    /// Begins another node.
    #[inline(always)]
    fn begin(&mut self) {
        self.places = S::F::splat(0.0);
        (self.low, self.high) = (S::F::splat(f32::INFINITY), S::F::splat(f32::NEG_INFINITY));
    }

    /// Writes the ends of the box around the triangles of a leaf; false where one has the last vertex of all, which [`Simd::corners`] does not load.
    #[inline(always)]
    fn leaf(
        &mut self,
        records: &[[u32; 4]],
        own: Range<usize>,
        from: &[[f32; 3]],
        weight: f64,
        ends: &mut [f32; WIDTH],
    ) -> bool {
        let (mut low, mut high) = (S::F::splat(f32::INFINITY), S::F::splat(f32::NEG_INFINITY));
        let (mut first, end) = (own.start, own.end);
        while first < end {
            let count = (end - first).min(BLOCK);
            if let Some(&[a, b, c, _]) = records.get(first.wrapping_sub(AHEAD)) {
                prefetch(from, a as usize);
                prefetch(from, b as usize);
                prefetch(from, c as usize);
            }
            let Some(corners) = S::corners(from, &records[first..], count) else { return false };
            for part in 0..16 / S::F::LEN {
                let [a, b, c] = corners[part];
                self.places = self.places + (a + b + c);
                let (least, most) = (a.min(b).min(c), a.max(b).max(c));
                let extent = most - least;
                let own = S::F::load(&OWN[(count - 1) & 3][part * S::F::LEN..]);
                self.areas[part] = self.areas[part] + extent * S::rotated(extent) * own;
                (low, high) = (least.min(low), most.max(high));
            }
            first += BLOCK;
        }
        (self.low, self.high) = (low.min(self.low), high.max(self.high));
        let (low, high) = (S::least_four(low), S::greatest_four(high));
        low.store(ends);
        high.store(&mut ends[4..]);
        self.visit(low, high, weight);
        true
    }

    /// Adds what a visit of a child costs.
    #[inline(always)]
    fn visit(&mut self, low: S::F4, high: S::F4, weight: f64) {
        // Neither negative, as those of empty boxes, nor infinite.
        let extent = (high - low).max(S::F4::splat(0.0)).min(S::F4::splat(f32::MAX));
        let parts = S::widen(extent) * S::widen(extent.rotated());
        self.costs = self.costs + parts * S::D4::splat(weight);
    }

    /// True when no vertex was NaN or infinite.
    #[inline(always)]
    fn are_finite(&self) -> bool {
        let zero = S::F::splat(0.0);
        (self.places * zero).le(zero) == S::F::ALL
    }
}

/// All lanes of two vectors of eight numbers, or of one of sixteen.
#[inline(always)]
fn lanes<S: Simd>([first, second]: [S::F; 2]) -> [f32; 16] {
    let mut out = [0.0; 16];
    second.store(&mut out[16 - S::F::LEN..]);
    first.store(&mut out);
    out
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

/// Costs of visiting leaves, per unit of area, by how many triangles they have less one.
static WEIGHTS: [f64; MAX_LEAF] = {
    let mut weights = [0.0; MAX_LEAF];
    let mut i = 0;
    while i < MAX_LEAF {
        weights[i] = sah::COST_BLOCK * (i / BLOCK + 1) as f64;
        i += 1;
    }
    weights
};

/// The ends of the children's boxes of a node, each with a fourth number, and the same by column.
struct Kids {
    ends: Rows,
    rows: Rows,
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
        let (records, from) = (bytemuck::cast_slice(items), bytemuck::cast_slice(prims.positions));
        let (zero, costs) = (S::F::splat(0.0), S::D4::splat(0.0));
        let mut gathered = Gathered::<S> { areas: [zero; 2], places: zero, low: zero, high: zero, costs };
        let mut waiting = Stack::<[f32; WIDTH], TASK_NODES>::new();
        let mut kids = Kids { ends: [EMPTY; WIDTH], rows: [[0.0; WIDTH]; WIDTH] };
        for node in nodes.iter_mut().rev() {
            let (areas, costs, mut are_whole) = (gathered.areas, gathered.costs, true);
            let (mut low, mut high) = (S::F4::load(&EMPTY), S::F4::load(&EMPTY[4..]));
            gathered.begin();
            kids.ends = [EMPTY; WIDTH];
            for slot in 0..WIDTH {
                let link = node.word(slot);
                if !link.is_leaf() {
                    let Some(below) = waiting.pop() else { continue };
                    kids.ends[slot] = below;
                    let ends = (S::F4::load(&below), S::F4::load(&below[4..]));
                    (low, high) = (ends.0.min(low), ends.1.max(high));
                    gathered.visit(ends.0, ends.1, sah::COST_TRAVERSE);
                    continue;
                }
                if link.is_none() {
                    break;
                }
                let own = link.triangles();
                let weight = WEIGHTS[(own.len() - 1) % MAX_LEAF];
                let own = own.start - first_item..own.end - first_item;
                are_whole &= gathered.leaf(records, own, from, weight, &mut kids.ends[slot]);
            }
            let mut around = EMPTY;
            if are_whole && gathered.are_finite() {
                S::least_four(gathered.low).min(low).store(&mut around);
                S::greatest_four(gathered.high).max(high).store(&mut around[4..]);
            } else {
                let mut sums = Sums { areas: lanes::<S>(areas), costs: [0.0; 4] };
                costs.store(&mut sums.costs);
                around = again(node, &mut kids, (items, first_item), prims, &mut sums);
                gathered.areas = [S::F::load(&sums.areas), S::F::load(&sums.areas[16 - S::F::LEN..])];
                gathered.costs = S::D4::load(&sums.costs);
            }
            if is_empty(&around) {
                node.clear();
                around = EMPTY;
            } else {
                S::eight_columns(&kids.ends, &mut kids.rows);
                node.set::<S>(&kids.rows, &around);
            }
            waiting.push(around);
        }
        let Some([a, b, c, _, d, e, f, _]) = waiting.pop() else { return Swept::EMPTY };
        let mut costs = [0.0; 4];
        gathered.costs.store(&mut costs);
        let own_area = sum_of(&lanes::<S>(gathered.areas));
        let aabb = Aabb { min: Vec3::new(a, b, c), max: Vec3::new(d, e, f) };
        Swept { aabb, cost: costs[0] + costs[1] + costs[2], own_area }
    }
}

/// Sums by lane.
struct Sums {
    areas: [f32; 16],
    costs: [f64; 4],
}

/// Takes the children of a node once more, without the triangles that are not there: the ends of the box around them.
#[cold]
#[inline(never)]
fn again(
    node: &Steps,
    kids: &mut Kids,
    (items, first_item): (&[Corners], usize),
    prims: &Triangles<'_>,
    sums: &mut Sums,
) -> [f32; WIDTH] {
    let mut around = EMPTY;
    for slot in 0..WIDTH {
        let link = node.word(slot);
        if link.is_none() {
            break;
        }
        let mut weight = sah::COST_TRAVERSE;
        if link.is_leaf() {
            let own = link.triangles();
            weight = WEIGHTS[(own.len() - 1) % MAX_LEAF];
            let own = own.start - first_item..own.end - first_item;
            let aabb = carefully(&items[own], prims, &mut sums.areas);
            let ([a, b, c], [d, e, f]) = (aabb.min.to_array(), aabb.max.to_array());
            kids.ends[slot] = [a, b, c, a, d, e, f, d];
        }
        let ends = &kids.ends[slot];
        let mut extent = [0.0; 3];
        for axis in 0..3 {
            around[axis] = around[axis].min(ends[axis]);
            around[axis + 4] = around[axis + 4].max(ends[axis + 4]);
            extent[axis] = f64::from((ends[axis + 4] - ends[axis]).clamp(0.0, f32::MAX));
        }
        for axis in 0..3 {
            sums.costs[axis] += extent[axis] * extent[(axis + 1) % 3] * weight;
        }
    }
    around
}
