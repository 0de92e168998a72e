//! A ray's walk over the three sorted lists of one volume, or of a whole scene.
//!
//! A cursor is the number of events that the ray has left below it; a box holds the ray on an axis while the rank of its
//! lower end is below the cursor and that of its upper end is not. So there are no status marks to go stale, and a walk may
//! begin anywhere and run either way.

use super::{
    lists::{Event, reseat, seat},
    ranks::{RankWord, Ranks},
    ray::{EventRay, WIDEN},
};
use crate::{accel::Counter, geom::Aabb};

/// Lists of at most this many events are walked over when a volume is opened; longer ones are searched.
const LINEAR: usize = 32;

/// The lists of one volume: its boxes are numbered from 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ListView<'a, W> {
    pub(crate) events: [&'a [Event]; 3],
    pub(crate) ranks: &'a [Ranks<W>],
}

/// A box that the ray is now inside of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entered {
    /// Its number in the volume.
    pub(crate) child: u32,
    /// The axis on which it was entered last, and when; none when the walk began inside.
    pub(crate) at: Option<(usize, f64)>,
}

/// The boxes among which those that hold the start are to be found: the owners of a run of events.
#[derive(Clone, Copy, Debug, Default)]
struct Scan {
    axis: usize,
    next: u32,
    end: u32,
}

/// Where a walk stands.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ListWalk<W> {
    cursors: W,
    /// Number of the next event on each axis; past the list when there is none.
    next: [u32; 3],
    /// When that event is due; infinite when there is none.
    due: [f64; 3],
    /// When the last event on each axis was due, widened.
    recent: [f64; 3],
    /// The ray has left the volume after this.
    end: f64,
    start: f64,
    scan: Scan,
}

/// Passes over the events of `list` that lie behind `now` as the ray runs; returns the cursor.
#[inline(always)]
fn skip<C: Counter>(list: &[Event], ray: &EventRay, axis: usize, now: f64, count: &mut C) -> u32 {
    let back = ray.runs_back(axis);
    let at = |i: usize| if back { list[list.len() - 1 - i] } else { list[i] };
    let mut passed = 0;
    if list.len() > LINEAR {
        let behind = |e: &Event| ray.t(axis, e.value()) * WIDEN < now;
        passed = if back { list.len() - list.partition_point(|e| !behind(e)) } else { list.partition_point(behind) };
    }
    while passed < list.len() {
        let event = at(passed);
        let t = ray.t(axis, event.value());
        let gone = if event.is_max() == back { t <= now } else { t * WIDEN < now };
        if !gone {
            break;
        }
        passed += 1;
    }
    for _ in 0..passed {
        count.skip();
    }
    cursor(if back { list.len() - passed } else { passed })
}

/// The number of events that do not belong to empty boxes, when no box is endless upward: empty ones lie above all others.
#[inline(always)]
fn finite(list: &[Event]) -> usize {
    let mut count = list.len();
    while count > 0 && list[count - 1].value() == f32::INFINITY {
        count -= 1;
    }
    count
}

/// As a cursor; lists are shorter than 2^32.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the build checks the lengths of lists")]
fn cursor(place: usize) -> u32 {
    place as u32
}

/// The cursors of a point, which is inside of a box when it is on a face of it. `hint` names cursors of a place nearby.
#[inline(always)]
pub(super) fn seat_point<W: RankWord, C: Counter>(
    view: &ListView<'_, W>,
    point: [f32; 3],
    hint: Option<[u32; 3]>,
    count: &mut C,
) -> [u32; 3] {
    let mut cursors = [0; 3];
    for axis in 0..3 {
        let list = view.events[axis];
        cursors[axis] = if let Some(hint) = hint {
            let (at, steps) = reseat(list, point[axis], hint[axis] as usize);
            for _ in 0..steps {
                count.skip();
            }
            cursor(at)
        } else {
            cursor(seat(list, point[axis]))
        };
    }
    cursors
}

impl<W: RankWord> ListWalk<W> {
    /// A walk that enters the volume from outside, on `axis` at `now`: in the other axes what lies behind is skipped.
    #[inline(always)]
    pub(crate) fn enter<C: Counter>(
        view: &ListView<'_, W>,
        aabb: Aabb,
        ray: &EventRay,
        axis: usize,
        now: f64,
        count: &mut C,
    ) -> Self {
        let mut cursors = [0; 3];
        for i in 0..3 {
            let list = view.events[i];
            cursors[i] = if i == axis {
                if ray.runs_back(i) { cursor(finite(list)) } else { 0 }
            } else if ray.moves(i) {
                skip(list, ray, i, now, count)
            } else {
                cursor(seat(list, ray.origin[i]))
            };
        }
        Self::at(view, aabb, ray, cursors, now)
    }

    /// A walk that begins inside of the volume, at the ray's origin or, if that is later, at `t_near`. Boxes that hold the
    /// start come first.
    #[inline(always)]
    pub(crate) fn start<C: Counter>(
        view: &ListView<'_, W>,
        aabb: Aabb,
        ray: &EventRay,
        hint: Option<[u32; 3]>,
        count: &mut C,
    ) -> Self {
        let mut cursors = seat_point(view, ray.origin, hint, count);
        if ray.t_near > 0.0 {
            for axis in 0..3 {
                if ray.moves(axis) {
                    cursors[axis] = skip(view.events[axis], ray, axis, ray.t_near, count);
                }
            }
        }
        let mut walk = Self::at(view, aabb, ray, cursors, ray.t_near);
        walk.scan = Scan::new(view, cursors);
        walk
    }

    #[inline(always)]
    fn at(view: &ListView<'_, W>, aabb: Aabb, ray: &EventRay, cursors: [u32; 3], start: f64) -> Self {
        let mut walk = Self {
            cursors: W::pack(cursors),
            next: [u32::MAX; 3],
            due: [f64::INFINITY; 3],
            recent: [f64::NEG_INFINITY; 3],
            end: ray.leaves(aabb),
            start,
            scan: Scan::default(),
        };
        for axis in 0..3 {
            if ray.moves(axis) {
                walk.next[axis] = cursors[axis].wrapping_sub(u32::from(ray.runs_back(axis)));
                walk.look(view, ray, axis);
            }
        }
        walk
    }

    /// Finds out when the next event on `axis` is due.
    #[inline(always)]
    fn look(&mut self, view: &ListView<'_, W>, ray: &EventRay, axis: usize) {
        let event = view.events[axis].get(self.next[axis] as usize);
        self.due[axis] = event.map_or(f64::INFINITY, |e| ray.t(axis, e.value()));
    }

    /// The next event is due then; while boxes around the start are left, the start.
    #[inline(always)]
    pub(crate) fn t(&self) -> f64 {
        if self.scan.next < self.scan.end { self.start } else { self.due[self.soonest()] }
    }

    /// True when nothing of the volume is left to come.
    #[inline(always)]
    pub(crate) fn is_over(&self) -> bool {
        self.t() > self.end
    }

    /// Cursors on the three axes.
    #[inline(always)]
    pub(crate) fn cursors(&self) -> [u32; 3] {
        [0, 1, 2].map(|axis| self.cursors.get(axis))
    }

    /// True when the walk stands inside of a box.
    #[inline(always)]
    pub(crate) fn is_inside(&self, ranks: &Ranks<W>) -> bool {
        ranks.hold(self.cursors)
    }

    /// Leaves out the boxes around the start: the caller knows them.
    pub(crate) fn forget_start(&mut self) {
        self.scan = Scan::default();
    }

    /// Number of events among which the boxes around the start are to be found.
    pub(crate) fn start_length(&self) -> usize {
        (self.scan.end - self.scan.next) as usize
    }

    #[inline(always)]
    fn soonest(&self) -> usize {
        let first = usize::from(self.due[1] < self.due[0]);
        if self.due[2] < self.due[first] { 2 } else { first }
    }

    /// Handles events until one makes the ray enter a box, or the next one is due after `until`.
    #[inline(always)]
    pub(crate) fn next<C: Counter>(
        &mut self,
        view: &ListView<'_, W>,
        ray: &EventRay,
        until: f64,
        count: &mut C,
    ) -> Option<Entered> {
        if self.scan.next < self.scan.end
            && let Some(child) = self.scan_start(view, count)
        {
            return Some(Entered { child, at: None });
        }
        let until = if until < self.end { until } else { self.end };
        loop {
            let axis = self.soonest();
            let t = self.due[axis];
            // `until` may be infinite, and so is `t` when no event is left.
            if t > until || t == f64::INFINITY {
                return None;
            }
            count.event();
            let back = ray.runs_back(axis);
            let event = view.events[axis][self.next[axis] as usize];
            self.cursors = self.cursors.stepped(axis, back);
            self.next[axis] = if back { self.next[axis].wrapping_sub(1) } else { self.next[axis] + 1 };
            self.look(view, ray, axis);
            // After an exit its box no longer holds the ray.
            let child = event.owner();
            if view.ranks[child as usize].hold(self.cursors) {
                return Some(Entered { child, at: Some((axis, t)) });
            }
            let others = self.recent[(axis + 1) % 3].max(self.recent[(axis + 2) % 3]);
            self.recent[axis] = t * WIDEN;
            if t <= others && event.is_max() == back && self.is_near_miss(view, ray, axis, child, t) {
                return Some(Entered { child, at: Some((axis, t)) });
            }
        }
    }

    /// True when `child`, entered on `axis` at `t`, was left on other axes so shortly before that rounding may have put the
    /// events into the wrong order.
    #[cold]
    #[inline(never)]
    fn is_near_miss(&self, view: &ListView<'_, W>, ray: &EventRay, axis: usize, child: u32, t: f64) -> bool {
        let ranks = &view.ranks[child as usize];
        (0..3).all(|i| {
            let cursor = self.cursors.get(i);
            let [min, max] = ranks.get(i);
            if i == axis || (min < cursor && cursor <= max) {
                return true;
            }
            let (was_entered, exit) = if ray.runs_back(i) { (cursor <= max, min) } else { (min < cursor, max) };
            let exit = view.events[i][exit as usize];
            ray.moves(i) && was_entered && ray.t(i, exit.value()) * WIDEN >= t
        })
    }

    /// The next box that holds the start.
    fn scan_start<C: Counter>(&mut self, view: &ListView<'_, W>, count: &mut C) -> Option<u32> {
        let Scan { axis, next, end } = self.scan;
        // Below the cursor the lower ends count, above it the upper ones: one of each box.
        let above = next >= self.cursors.get(axis);
        for at in next..end {
            count.skip();
            let event = view.events[axis][at as usize];
            let child = event.owner();
            if event.is_max() == above && view.ranks[child as usize].hold(self.cursors) {
                self.scan.next = at + 1;
                return Some(child);
            }
        }
        self.scan.next = end;
        None
    }
}

impl Scan {
    /// The shortest run of events that names every box around the cursors: below or above one of them.
    fn new<W>(view: &ListView<'_, W>, cursors: [u32; 3]) -> Self {
        let mut best = Self { axis: 0, next: 0, end: cursors[0] };
        for (axis, at) in cursors.into_iter().enumerate() {
            let len = cursor(view.events[axis].len());
            for (next, end) in [(0, at), (at, len)] {
                if end - next < best.end - best.next {
                    best = Self { axis, next, end };
                }
            }
        }
        best
    }
}
