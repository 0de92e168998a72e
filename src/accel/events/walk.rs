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

/// The lists of one volume within those of a whole structure; its boxes are numbered from 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ListView<'a, W> {
    /// Of the structure, two for each of its boxes.
    events: [&'a [Event]; 3],
    ranks: &'a [Ranks<W>],
    /// Number of the volume's first box.
    first: usize,
    /// Number of its events on each axis.
    len: usize,
}

impl<'a, W> ListView<'a, W> {
    /// The lists of the `count` boxes from `first` on.
    #[inline(always)]
    pub(crate) fn new(events: &'a [Vec<Event>; 3], ranks: &'a [Ranks<W>], first: usize, count: usize) -> Self {
        let [x, y, z] = events;
        Self { events: [x, y, z], ranks, first, len: 2 * count }
    }

    /// The events on an axis.
    #[inline(always)]
    pub(crate) fn list(&self, axis: usize) -> &'a [Event] {
        &self.events[axis][2 * self.first..2 * self.first + self.len]
    }

    /// The ranks of all boxes.
    pub(crate) fn all_ranks(&self) -> &'a [Ranks<W>] {
        &self.ranks[self.first..self.first + self.len / 2]
    }

    /// One event of an axis.
    #[inline(always)]
    fn event(&self, axis: usize, at: u32) -> Event {
        self.events[axis][2 * self.first + at as usize]
    }

    /// The ranks of a box.
    #[inline(always)]
    fn ranks(&self, child: u32) -> &'a Ranks<W> {
        &self.ranks[self.first + child as usize]
    }

    /// When the ray passes an event; never, when there is none of that number.
    #[inline(always)]
    fn due(&self, ray: &EventRay, axis: usize, at: u32) -> f64 {
        if (at as usize) < self.len { ray.t(axis, self.event(axis, at).value()) } else { f64::INFINITY }
    }
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
    /// When the one after it is due. So the choice of the next event does not wait for memory.
    later: [f64; 3],
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
    let passed = if list.len() <= LINEAR {
        // All are looked at: that takes no branch that depends on the ray.
        let mut passed = 0;
        for event in list {
            passed += usize::from(ray.is_behind(axis, event.value(), now));
        }
        passed
    } else if ray.runs_back(axis) {
        list.len() - list.partition_point(|event| !ray.is_behind(axis, event.value(), now))
    } else {
        list.partition_point(|event| ray.is_behind(axis, event.value(), now))
    };
    for _ in 0..passed {
        count.skip();
    }
    cursor(if ray.runs_back(axis) { list.len() - passed } else { passed })
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

/// The event after number `at`; past the list, wherever that is, when there is none.
#[inline(always)]
fn after(at: u32, back: bool) -> u32 {
    if back { at.wrapping_sub(1) } else { at.wrapping_add(1) }
}

/// The two axes besides each.
const OTHERS: [(usize, usize); 3] = [(1, 2), (2, 0), (0, 1)];

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
        let list = view.list(axis);
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
        for (i, at) in cursors.iter_mut().enumerate() {
            let list = view.list(i);
            *at = if i == axis {
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
            for (axis, at) in cursors.iter_mut().enumerate() {
                if ray.moves(axis) {
                    *at = skip(view.list(axis), ray, axis, ray.t_near, count);
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
            later: [f64::INFINITY; 3],
            recent: [f64::NEG_INFINITY; 3],
            end: ray.leaves(aabb),
            start,
            scan: Scan::default(),
        };
        for (axis, at) in cursors.into_iter().enumerate() {
            if ray.moves(axis) {
                let back = ray.runs_back(axis);
                let next = at.wrapping_sub(u32::from(back));
                walk.next[axis] = next;
                walk.due[axis] = view.due(ray, axis, next);
                walk.later[axis] = view.due(ray, axis, after(next, back));
            }
        }
        walk
    }

    /// The next event is due then; while boxes around the start are left, the start.
    #[inline(always)]
    pub(crate) fn t(&self) -> f64 {
        if self.scan.next < self.scan.end { self.start } else { self.due[self.soonest()] }
    }

    /// The ray has left the volume after this.
    #[inline(always)]
    pub(crate) fn end(&self) -> f64 {
        self.end
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
            let at = self.next[axis];
            let next = after(at, back);
            self.due[axis] = self.later[axis];
            self.later[axis] = view.due(ray, axis, after(next, back));
            self.next[axis] = next;
            self.cursors = self.cursors.stepped(axis, back);
            let event = view.event(axis, at);
            // After an exit its box no longer holds the ray.
            let child = event.owner();
            if view.ranks(child).hold(self.cursors) {
                return Some(Entered { child, at: Some((axis, t)) });
            }
            let others = self.recent[OTHERS[axis].0].max(self.recent[OTHERS[axis].1]);
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
        let ranks = view.ranks(child);
        (0..3).all(|i| {
            let cursor = self.cursors.get(i);
            let [min, max] = ranks.get(i);
            if i == axis || (min < cursor && cursor <= max) {
                return true;
            }
            let (was_entered, exit) = if ray.runs_back(i) { (cursor <= max, min) } else { (min < cursor, max) };
            let exit = view.event(i, exit);
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
            let event = view.event(axis, at);
            let child = event.owner();
            if event.is_max() == above && view.ranks(child).hold(self.cursors) {
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
            let len = cursor(view.list(axis).len());
            for (next, end) in [(0, at), (at, len)] {
                if end - next < best.end - best.next {
                    best = Self { axis, next, end };
                }
            }
        }
        best
    }
}
