use super::{
    Grug, StepMode,
    build::{BOUNDS, Bounds},
};
use crate::accel::{
    Counter, TravRay,
    grid::lattice::Dda,
    kdtree::{
        node::KdNode,
        traverse::{self, Crossing, Fast, Wide},
    },
    leaves::{ByPointer, Leaves, Line, RareCounter, RareLeaves},
};

/// Address that reads of the table are counted from; nodes are counted from 0.
const TABLE: usize = usize::MAX / 2 + 1;

impl Grug {
    #[inline(always)]
    pub(super) fn walk<L: Leaves, C: Counter>(&self, ray: &TravRay, leaves: &mut L, count: &mut C) -> bool {
        let line = Line::new(ray.range());
        let Some(interval) = line.clip_to(&self.bounds, leaves.t_limit()) else { return false };
        if self.lattice.is_near(&line) && traverse::is_ordinary(ray, self.reach) {
            self.walk_groups(&line, interval, &Fast::new(ray), leaves, count)
        } else {
            self.walk_wide(&line, interval, leaves.rare(), count)
        }
    }

    #[cold]
    #[inline(never)]
    fn walk_wide(
        &self,
        line: &Line,
        interval: (f64, f64),
        leaves: &mut dyn RareLeaves,
        count: &mut dyn Counter,
    ) -> bool {
        let (leaves, count) = (&mut ByPointer(leaves), &mut RareCounter(count));
        if self.lattice.is_near(line) {
            return self.walk_groups(line, interval, &Wide(line), leaves, count);
        }
        // From so far away planes of cells cannot be told apart in f64.
        let mut last = None;
        self.lattice.bisect(line, interval, &mut |cell, t0, t1| {
            if t0 > leaves.t_limit() {
                return false;
            }
            count.step();
            let group = self.look_up(cell, count);
            // The interval of a cell may end before that of its group.
            let fresh = last.replace((group, t1)) != Some((group, t1));
            fresh && self.walk_tree(group, (t0, t1), &Wide(line), leaves, count)
        })
    }

    /// Where a cell's group is.
    #[inline(always)]
    fn look_up<C: Counter>(&self, cell: [u32; 3], count: &mut C) -> usize {
        let place = self.hash.of(cell);
        count.read(TABLE + place * size_of::<u32>(), size_of::<u32>());
        self.table[place] as usize
    }

    #[inline(always)]
    fn walk_tree<X: Interval, L: Leaves, C: Counter>(
        &self,
        group: usize,
        interval: (f64, f64),
        crossing: &X,
        leaves: &mut L,
        count: &mut C,
    ) -> bool {
        traverse::walk(&self.nodes, group + BOUNDS, X::interval(interval), crossing, leaves, count)
    }

    /// From group to group.
    #[inline(always)]
    fn walk_groups<X: Interval, L: Leaves, C: Counter>(
        &self,
        line: &Line,
        (mut t_in, t_end): (f64, f64),
        crossing: &X,
        leaves: &mut L,
        count: &mut C,
    ) -> bool {
        let mut dda = Dda::new(&self.lattice, line, t_in);
        loop {
            let group = self.look_up(dda.cell, count);
            let bounds = Bounds::read(&self.nodes, group);
            count.read(group * size_of::<KdNode>(), BOUNDS * size_of::<KdNode>());
            let (axis, t_out) = self.exit(line, &bounds);
            let t_last = if t_out < t_end { t_out } else { t_end };
            if self.walk_tree(group, (t_in, t_last), crossing, leaves, count) {
                return true;
            }
            // A hit at or before the exit is final: what is hit before it is in a group that was visited.
            if t_out > t_end || t_out > leaves.t_limit() {
                return false;
            }
            match self.mode {
                StepMode::Dda => loop {
                    count.step();
                    let (axis, _) = dda.crossing();
                    dda.cross(&self.lattice, line, axis);
                    if !(bounds.first[axis]..bounds.end[axis]).contains(&dda.cell[axis]) {
                        break;
                    }
                },
                StepMode::Exit => {
                    count.step();
                    let backward = line.inv[axis] < 0.0;
                    let cell = if backward { bounds.first[axis] - 1 } else { bounds.end[axis] };
                    dda.jump(&self.lattice, line, axis, cell, t_out);
                }
            }
            t_in = t_out;
        }
    }

    /// The axis by which the ray leaves a group, and when; infinite when it leaves the lattice there.
    #[inline(always)]
    fn exit(&self, line: &Line, bounds: &Bounds) -> (usize, f64) {
        let mut exit = (0, f64::INFINITY);
        for axis in 0..3 {
            let inv = line.inv[axis];
            let (plane, last) =
                if inv < 0.0 { (bounds.first[axis], 0) } else { (bounds.end[axis], self.lattice.cells[axis]) };
            if plane == last || inv.is_infinite() {
                continue;
            }
            let t = line.t(axis, self.lattice.plane(axis, plane));
            if t < exit.1 {
                exit = (axis, t);
            }
        }
        exit
    }
}

/// Crossings that can take over an interval in f64.
trait Interval: Crossing {
    fn interval(interval: (f64, f64)) -> (Self::T, Self::T);
}

impl Interval for Fast {
    #[inline(always)]
    fn interval(interval: (f64, f64)) -> (f32, f32) {
        traverse::outward(interval)
    }
}

impl Interval for Wide<'_> {
    #[inline(always)]
    fn interval(interval: (f64, f64)) -> (f64, f64) {
        interval
    }
}
