//! Groups of cells: the part of a kd-tree whose splits are planes of the grid, down to its leaves; below those, free kd-trees.

#![expect(clippy::cast_possible_truncation, reason = "nodes are numbered by 30 bits, cells by 9 an axis")]

use glam::Vec3;

use super::{GrugConfig, table::Hash};
use crate::{
    accel::{
        grid::lattice::Lattice,
        kdtree::{
            build::{Builder, Emitted, MAX_DEPTH, Params, Ref, Task, bounds, depth_limit, refs, room, shared_room},
            node::KdNode,
        },
        sah::BLOCK,
        shapes::{Shapes, intersection},
    },
    geom::Aabb,
};

/// Nodes that hold a group's bounds before its root.
pub(super) const BOUNDS: usize = 3;

/// Aligned nodes of fewer objects are built by one task.
const TASK: usize = 4096;

/// Planes that are tried along an axis.
const PLANES: u32 = 64;

/// The finest grid: nine bits an axis.
pub(super) const MAX_RES: u32 = 512;

/// Cells a group below which `res=auto` tries a finer grid.
const CELLS_PER_GROUP: usize = 8;

/// The least extent of an axis, as a part of the greatest.
const THIN: f64 = 1.0 / 256.0;

/// Cells of a group: the first, and the one after the last, of each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Bounds {
    pub(super) first: [u32; 3],
    pub(super) end: [u32; 3],
}

impl Bounds {
    /// As three nodes.
    fn nodes(self) -> [KdNode; BOUNDS] {
        std::array::from_fn(|i| KdNode::raw([self.first[i], self.end[i]]))
    }

    /// The bounds before a root.
    #[inline(always)]
    pub(super) fn read(nodes: &[KdNode], group: usize) -> Self {
        let [x, y, z] = [nodes[group].words(), nodes[group + 1].words(), nodes[group + 2].words()];
        Self { first: [x[0], y[0], z[0]], end: [x[1], y[1], z[1]] }
    }

    pub(super) fn cells(self) -> impl Iterator<Item = [u32; 3]> {
        let Self { first: [x0, y0, z0], end: [x1, y1, z1] } = self;
        (x0..x1).flat_map(move |x| (y0..y1).flat_map(move |y| (z0..z1).map(move |z| [x, y, z])))
    }

    fn extent(self, axis: usize) -> u32 {
        self.end[axis] - self.first[axis]
    }
}

/// What a build makes.
#[derive(Debug)]
pub(super) struct Built {
    pub(super) bounds: Aabb,
    pub(super) lattice: Lattice,
    pub(super) hash: Hash,
    pub(super) table: Vec<u32>,
    pub(super) nodes: Vec<KdNode>,
    pub(super) items: Vec<u32>,
    pub(super) groups: Vec<u32>,
}

/// Builds at the resolution asked for, or at the first with enough cells a group.
pub(super) fn build(shapes: &(impl Shapes + ?Sized), config: &GrugConfig) -> Built {
    let refs = refs(shapes);
    let bounds = bounds(&refs);
    let mut res = config.res.unwrap_or_else(|| first_guess(refs.len()));
    let (lattice, forest) = loop {
        let lattice = lattice(&bounds, res);
        let builder = Builder { shapes, params: config.tree.params(BLOCK), unit: BLOCK };
        let forest = Aligned { builder, lattice: &lattice }.forest(refs.clone());
        let cells = (res as usize).pow(3);
        if config.res.is_some() || res == MAX_RES || cells >= CELLS_PER_GROUP * forest.groups.len() {
            break (lattice, forest);
        }
        res *= 2;
    };
    let hash = Hash { bits: res.trailing_zeros(), order: config.order };
    let mut table = vec![0; hash.len()];
    for &group in &forest.groups {
        for cell in Bounds::read(&forest.emitted.nodes, group as usize).cells() {
            table[hash.of(cell)] = group;
        }
    }
    let Forest { emitted: Emitted { nodes, items }, groups } = forest;
    Built { bounds, lattice, hash, table, nodes, items, groups }
}

/// Where `res=auto` begins: a power of two, at most as many cells as an eighth of the objects for large scenes.
fn first_guess(count: usize) -> u32 {
    let mut res = 4;
    while res < MAX_RES && (2 * res as usize).pow(3) <= count / 8 {
        res *= 2;
    }
    res
}

/// Cells over a box that is 2 units in the last place larger on every side, and nowhere much thinner than it is long.
fn lattice(bounds: &Aabb, res: u32) -> Lattice {
    let inside = if bounds.is_empty() { Aabb { min: Vec3::ZERO, max: Vec3::ONE } } else { *bounds };
    let mut low = inside.min.to_array().map(|x| f64::from(x.next_down().next_down().max(f32::MIN)));
    let mut high = inside.max.to_array().map(|x| f64::from(x.next_up().next_up().min(f32::MAX)));
    let longest = (0..3).map(|i| high[i] - low[i]).fold(0.0, f64::max);
    for axis in 0..3 {
        let missing = longest * THIN - (high[axis] - low[axis]);
        if missing > 0.0 {
            low[axis] -= missing / 2.0;
            high[axis] += missing / 2.0;
        }
    }
    Lattice::new(low, high, [res; 3])
}

/// Trees, each after its bounds.
#[derive(Debug, Default)]
struct Forest {
    emitted: Emitted,
    /// Where each group's bounds begin, ascending.
    groups: Vec<u32>,
}

/// A node above the groups.
struct AlignedTask {
    refs: Vec<Ref>,
    cells: Bounds,
    depth: usize,
    room: usize,
}

struct Aligned<'a, P: ?Sized> {
    builder: Builder<'a, P>,
    lattice: &'a Lattice,
}

impl<P: Shapes + ?Sized> Aligned<'_, P> {
    fn forest(&self, refs: Vec<Ref>) -> Forest {
        let count = refs.len();
        let cells = Bounds { first: [0; 3], end: self.lattice.cells };
        let mut out = Forest::default();
        self.emit(AlignedTask { refs, cells, depth: depth_limit(count), room: room(count) }, &mut out);
        out
    }

    fn emit(&self, task: AlignedTask, out: &mut Forest) {
        let split = if task.depth == 0 { None } else { self.split(&task.refs, task.cells) };
        let Some([lower, upper]) = split.and_then(|at| self.divide(&task, at)) else {
            return self.group(task, out);
        };
        if task.refs.len() < TASK {
            drop(task);
            self.emit(lower, out);
            self.emit(upper, out);
        } else {
            drop(task);
            let fresh = |task| {
                let mut out = Forest::default();
                self.emit(task, &mut out);
                out
            };
            let (lower, upper) = rayon::join(|| fresh(lower), || fresh(upper));
            out.append(lower);
            out.append(upper);
        }
    }

    /// The plane of the grid that cuts cheapest, by axis and number, when it beats a leaf.
    fn split(&self, refs: &[Ref], cells: Bounds) -> Option<(usize, u32)> {
        let costs = &self.builder.params.costs;
        let size: [f64; 3] =
            std::array::from_fn(|i| self.lattice.plane(i, cells.end[i]) - self.lattice.plane(i, cells.first[i]));
        let area = size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
        let mut best = (costs.leaf(refs.len()), None);
        for axis in 0..3 {
            let extent = cells.extent(axis);
            let planes = extent.min(PLANES);
            if planes < 2 {
                continue;
            }
            // The cell where bin i begins; bins are whole cells.
            let plane =
                |i: u32| cells.first[axis] + (u64::from(extent) * u64::from(i)).div_ceil(u64::from(planes)) as u32;
            let bin = |cell: u32| {
                let within = cell.clamp(cells.first[axis], cells.end[axis] - 1) - cells.first[axis];
                (u64::from(within) * u64::from(planes) / u64::from(extent)) as usize
            };
            let (mut begins, mut ends) = ([0_u32; PLANES as usize], [0_u32; PLANES as usize]);
            for r in refs {
                let (first, last) = self.lattice.range_on(axis, &r.aabb);
                begins[bin(first)] += 1;
                ends[bin(last)] += 1;
            }
            let (b, c) = (size[(axis + 1) % 3], size[(axis + 2) % 3]);
            let (mut below, mut above) = (0, refs.len());
            for i in 1..planes {
                below += begins[i as usize - 1] as usize;
                above -= ends[i as usize - 1] as usize;
                let low = self.lattice.plane(axis, plane(i)) - self.lattice.plane(axis, cells.first[axis]);
                let half = |a: f64| (a * (b + c) + b * c) / area;
                let cost = costs.inner([below, above], [half(low), half(size[axis] - low)]);
                if cost < best.0 {
                    best = (cost, Some((axis, plane(i))));
                }
            }
        }
        best.1
    }

    /// Hands the objects to both sides; `None` when there is no room for it.
    fn divide(&self, task: &AlignedTask, (axis, plane): (usize, u32)) -> Option<[AlignedTask; 2]> {
        let (mut below, mut above) = (task.cells, task.cells);
        below.end[axis] = plane;
        above.first[axis] = plane;
        let (mut lower, mut upper) = (Vec::new(), Vec::new());
        let (below_box, above_box) = (self.around(below), self.around(above));
        for r in &task.refs {
            let (first, last) = self.lattice.range_on(axis, &r.aabb);
            match (first < plane, last >= plane) {
                (true, true) => {
                    lower.extend(self.part(r, below_box));
                    upper.extend(self.part(r, above_box));
                }
                (true, false) => lower.push(*r),
                _ => upper.push(*r),
            }
        }
        let rooms = shared_room(task.room, [lower.len(), upper.len()])?;
        let depth = task.depth - 1;
        Some([
            AlignedTask { refs: lower, cells: below, depth, room: rooms[0] },
            AlignedTask { refs: upper, cells: above, depth, room: rooms[1] },
        ])
    }

    /// The box of a run of cells, grown by what objects may be away from cells that they belong to, and rounded outward.
    fn around(&self, cells: Bounds) -> Aabb {
        let (low, high) = self.lattice.around_run(cells.first, cells.end);
        Aabb { min: Vec3::from_array(low), max: Vec3::from_array(high) }
    }

    fn part(&self, r: &Ref, to: Aabb) -> Option<Ref> {
        let Params { clip, .. } = self.builder.params;
        let aabb = if clip {
            intersection(self.builder.shapes.clipped(r.id.0, self.builder.shapes.aabb(r.id.0), to), r.aabb)
        } else {
            intersection(r.aabb, to)
        };
        (!aabb.is_empty()).then_some(Ref { aabb, id: r.id })
    }

    /// Bounds and a free tree.
    fn group(&self, task: AlignedTask, out: &mut Forest) {
        out.groups.push(out.emitted.nodes.len() as u32);
        out.emitted.nodes.extend(task.cells.nodes());
        let depth = depth_limit(task.refs.len());
        let task =
            Task { refs: task.refs, cell: self.around(task.cells), depth, levels: MAX_DEPTH - 1, room: task.room };
        self.builder.emit(task, &mut out.emitted);
    }
}

impl Forest {
    /// Moves a forest made apart behind this one; bounds are no links and stay.
    fn append(&mut self, part: Self) {
        let (nodes, units) = (self.emitted.nodes.len(), self.emitted.items.len() / BLOCK);
        let ends = part.groups.iter().skip(1).map(|&g| g as usize).chain([part.emitted.nodes.len()]);
        for (&group, end) in part.groups.iter().zip(ends) {
            let (bounds, tree) = part.emitted.nodes[group as usize..end].split_at(BOUNDS);
            self.groups.push(self.emitted.nodes.len() as u32);
            self.emitted.nodes.extend(bounds);
            self.emitted.nodes.extend(tree.iter().map(|node| node.moved(nodes, units)));
        }
        self.emitted.items.extend(part.emitted.items);
    }
}
