//! The flat form: three sorted lists over all boxes.

use std::cell::Cell;

use super::{
    EventState, Seat,
    boxes::BoxWalk,
    lists::{Event, Inversions},
    local::{ListMut, append},
    long::{How, Scratch},
    ranks::{RankWord, Ranks},
    ray::{EventRay, WIDEN},
    walk::{ListView, ListWalk, seat_point},
};
use crate::{accel::Counter, geom::Aabb};

/// Ranks over a whole scene need 32 bits an axis.
type Word = u128;

/// Three lists over all boxes; a box keeps its number.
#[derive(Clone, Debug)]
pub(crate) struct FlatLists {
    events: [Vec<Event>; 3],
    ranks: Vec<Ranks<Word>>,
    bounds: Aabb,
    scratch: Box<[Scratch; 3]>,
}

impl Default for FlatLists {
    fn default() -> Self {
        Self { events: Default::default(), ranks: Vec::new(), bounds: Aabb::EMPTY, scratch: Box::default() }
    }
}

impl FlatLists {
    /// Sorts the ends of `count` boxes, fewer than 2^31.
    pub(crate) fn build(count: u32, boxes: impl Fn(u32) -> Aabb) -> Self {
        let mut lists = Self::default();
        lists.rebuild(count, boxes);
        lists
    }

    /// As [`FlatLists::build`], keeping the memory.
    pub(crate) fn rebuild(&mut self, count: u32, boxes: impl Fn(u32) -> Aabb) {
        self.events.iter_mut().for_each(Vec::clear);
        self.ranks.clear();
        append(&mut self.events, &mut self.ranks, count);
        self.place(boxes);
        self.settle(true, How::Adaptive);
    }

    /// Takes the boxes' new places; there are as many as before.
    pub(crate) fn refit(&mut self, boxes: impl Fn(u32) -> Aabb) -> Inversions {
        self.place(boxes);
        self.settle(false, How::Adaptive)
    }

    /// Writes the boxes' new places; the lists are then out of order until [`FlatLists::settle`].
    pub(crate) fn place(&mut self, boxes: impl Fn(u32) -> Aabb) {
        let [x, y, z] = &mut self.events;
        let mut lists = ListMut { events: [x, y, z], ranks: &mut self.ranks };
        let mut bounds = Aabb::EMPTY;
        for number in 0..lists.ranks.len() {
            #[expect(clippy::cast_possible_truncation, reason = "there are fewer than 2^31 boxes")]
            let aabb = boxes(number as u32);
            if !aabb.is_empty() {
                bounds = bounds.union(aabb);
            }
            lists.place(number, aabb);
        }
        self.bounds = bounds;
    }

    /// Sorts the lists, which are in no order that helps when `fresh`.
    pub(crate) fn settle(&mut self, fresh: bool, how: How) -> Inversions {
        let [x, y, z] = &mut self.events;
        let mut lists = ListMut { events: [x, y, z], ranks: &mut self.ranks };
        lists.settle_long(&mut self.scratch, fresh, how)
    }

    /// Number of boxes.
    pub(crate) fn len(&self) -> usize {
        self.ranks.len()
    }

    /// The least box around all.
    pub(crate) fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Bytes of the lists.
    pub(super) fn bytes(&self) -> usize {
        self.events.iter().map(|list| size_of_val(&list[..])).sum::<usize>() + size_of_val(&self.ranks[..])
    }

    pub(super) fn view(&self) -> ListView<'_, Word> {
        ListView::new(&self.events, &self.ranks, 0, self.ranks.len())
    }

    /// Cursors of a point and the boxes that hold it.
    pub(super) fn seat(&self, point: [f32; 3], state: &mut EventState) {
        let view = self.view();
        let cursors = seat_point(&view, point, None, &mut ());
        state.seats.push(Seat { volume: 0, cursors });
        let word = Word::pack(cursors);
        let inside = (0..).zip(&self.ranks).filter(|(_, ranks)| ranks.hold(word));
        state.inside.extend(inside.map(|(number, _)| number));
    }

    /// Begins a walk over the boxes that `ray` meets.
    #[inline(always)]
    pub(crate) fn walk<C: Counter>(&self, ray: EventRay, count: &mut C) -> FlatWalk<'_> {
        let view = self.view();
        let local = ray.enters(self.bounds).map(|(now, axis)| match axis {
            Some(axis) => ListWalk::enter(&view, self.bounds, &ray, axis, now, count),
            None => ListWalk::start(&view, self.bounds, &ray, None, count),
        });
        FlatWalk { view, ray, local }
    }
}

/// The boxes that a ray meets, in the order in which it enters them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlatWalk<'a> {
    view: ListView<'a, Word>,
    ray: EventRay,
    local: Option<ListWalk<Word>>,
}

impl FlatWalk<'_> {
    /// The next box that the ray enters at `limit` or before.
    #[inline(always)]
    pub(crate) fn next<C: Counter>(&mut self, limit: f64, count: &mut C) -> Option<u32> {
        let local = self.local.as_mut()?;
        let limit = limit * WIDEN;
        if local.t() > limit {
            return None;
        }
        local.next(&self.view, &self.ray, limit, count).map(|entered| entered.child)
    }
}

impl BoxWalk for FlatWalk<'_> {
    #[inline(always)]
    fn next<C: Counter>(&mut self, limit: f64, count: &mut C) -> Option<u32> {
        FlatWalk::next(self, limit, count)
    }
}

/// A walk that begins at known cursors and notes the boxes that it meets.
#[derive(Debug)]
pub(super) struct SeatedWalk<'a> {
    walk: FlatWalk<'a>,
    /// Boxes that hold the start and have not been met.
    around: Vec<u32>,
    met: Option<&'a mut Vec<u32>>,
}

thread_local! {
    static AROUND: Cell<Vec<u32>> = const { Cell::new(Vec::new()) };
}

impl Drop for SeatedWalk<'_> {
    fn drop(&mut self) {
        AROUND.set(std::mem::take(&mut self.around));
    }
}

impl FlatLists {
    /// As [`FlatLists::walk`], from the cursors of a seat and the boxes `inside` of which it is; notes what it meets in `met`.
    #[inline(always)]
    pub(super) fn walk_from<'a, C: Counter>(
        &'a self,
        ray: EventRay,
        seats: &[Seat],
        inside: &[u32],
        met: Option<&'a mut Vec<u32>>,
        count: &mut C,
    ) -> SeatedWalk<'a> {
        let mut around = AROUND.take();
        around.clear();
        let walk = match (seats, ray.enters(self.bounds)) {
            ([seat], Some((_, None))) => {
                let view = self.view();
                let mut local = ListWalk::start(&view, self.bounds, &ray, Some(seat.cursors), count);
                let now = local.cursors();
                let crossed = now.iter().zip(seat.cursors).map(|(now, old)| now.abs_diff(old) as usize).sum::<usize>();
                // Far from the seat the boxes around the start are found as they are without one.
                if crossed + inside.len() < local.start_length() || crossed == 0 {
                    around.extend_from_slice(inside);
                    for (axis, (&now, old)) in now.iter().zip(seat.cursors).enumerate() {
                        let events = &view.list(axis)[now.min(old) as usize..now.max(old) as usize];
                        around.extend(events.iter().map(|event| event.owner()));
                    }
                    around.sort_unstable();
                    around.dedup();
                    around.retain(|&number| local.is_inside(&self.ranks[number as usize]));
                    local.forget_start();
                }
                FlatWalk { view, ray, local: Some(local) }
            }
            _ => self.walk(ray, count),
        };
        SeatedWalk { walk, around, met }
    }
}

impl BoxWalk for SeatedWalk<'_> {
    #[inline(always)]
    fn next<C: Counter>(&mut self, limit: f64, count: &mut C) -> Option<u32> {
        let found = self.around.pop().or_else(|| self.walk.next(limit, count))?;
        if let Some(met) = &mut self.met {
            met.push(found);
        }
        Some(found)
    }
}

impl SeatedWalk<'_> {
    /// Notes where the walk stands, and of the boxes it met keeps those that it is still in.
    pub(super) fn leave(mut self, seats: &mut Vec<Seat>) {
        if let (Some(local), Some(met)) = (&self.walk.local, self.met.take()) {
            met.retain(|&number| local.is_inside(&self.walk.view.all_ranks()[number as usize]));
            seats.push(Seat { volume: 0, cursors: local.cursors() });
        }
    }
}
