//! Brings a hierarchy to new boxes, bottom-up: volumes, events, order, ranks.

use super::{
    lists::{Event, Inversions},
    local::ListMut,
    ranks::Ranks,
    tree::{EventTree, Link, Volume, Word},
};
use crate::{accel::sah, geom::Aabb};

/// Subtrees of fewer volumes are refitted by one task.
const TASK_VOLUMES: usize = 512;

/// What a refit found out. Sums are taken in the order of the tree, whatever the schedule.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Swept {
    pub(super) inversions: Inversions,
    /// Sum over volumes of half area times boxes held.
    pub(super) cost: f64,
    /// Sum of the half areas of the objects' boxes.
    pub(super) own_area: f64,
}

impl Swept {
    fn plus(self, other: Self) -> Self {
        Self {
            inversions: self.inversions.plus(other.inversions),
            cost: self.cost + other.cost,
            own_area: self.own_area + other.own_area,
        }
    }
}

/// Takes the objects' boxes; `fresh` when the events are in no order yet.
pub(super) fn refit(tree: &mut EventTree, boxes: &(impl Fn(u32) -> Aabb + Sync), fresh: bool) -> Swept {
    let EventTree { volumes, links, ranks, events: [x, y, z] } = tree;
    let run = Run { volumes, ranks, events: [x, y, z], first_volume: 0, first_child: 0 };
    run.subtree(&Source { links, boxes, fresh })
}

/// What all tasks read.
struct Source<'a, F> {
    links: &'a [Link],
    boxes: &'a F,
    fresh: bool,
}

/// Consecutive whole subtrees, and the numbers of their first volume and child.
struct Run<'a> {
    volumes: &'a mut [Volume],
    ranks: &'a mut [Ranks<Word>],
    events: [&'a mut [Event]; 3],
    first_volume: usize,
    first_child: usize,
}

impl Run<'_> {
    fn reborrow(&mut self) -> Run<'_> {
        let [x, y, z] = &mut self.events;
        Run { volumes: self.volumes, ranks: self.ranks, events: [x, y, z], ..*self }
    }

    /// Lists of a volume of this run.
    fn lists(&mut self, volume: Volume) -> ListMut<'_, Word> {
        let first = volume.first as usize - self.first_child;
        let end = first + volume.count as usize;
        let [x, y, z] = &mut self.events;
        let events = 2 * first..2 * end;
        ListMut {
            events: [&mut x[events.clone()], &mut y[events.clone()], &mut z[events]],
            ranks: &mut self.ranks[first..end],
        }
    }

    /// Refits one subtree, its root last.
    fn subtree<F: Fn(u32) -> Aabb + Sync>(mut self, source: &Source<'_, F>) -> Swept {
        if self.volumes.len() < TASK_VOLUMES {
            return self.sweep(source);
        }
        let root = self.volumes[0];
        let children = root.first as usize + root.count as usize;
        let (mut top, mut below) = self.split(1, children);
        let links = &source.links[root.first as usize..children];
        let swept = below.reborrow().fork(links, source);
        let (aabb, own) = top.lists(root).take(links, below.volumes, below.first_volume, source);
        top.volumes[0].aabb = aabb;
        swept.plus(own)
    }

    /// Refits the subtrees that `links` name, in two tasks if there are several.
    fn fork<F: Fn(u32) -> Aabb + Sync>(self, links: &[Link], source: &Source<'_, F>) -> Swept {
        let is_volume = |link: &Link| link.target().is_err();
        let count = links.iter().filter(|link| is_volume(link)).count();
        let mut volumes = (0..links.len()).filter(|&at| is_volume(&links[at]));
        match (count, volumes.nth(count / 2)) {
            (_, None) => Swept::default(),
            (1, _) => self.subtree(source),
            (_, Some(middle)) => {
                let (Ok(number) | Err(number)) = links[middle].target();
                let at = number as usize - self.first_volume;
                let child = self.volumes[at].first as usize;
                let (first, second) = self.split(at, child);
                let (first_links, second_links) = links.split_at(middle);
                let (first, second) =
                    rayon::join(|| first.fork(first_links, source), || second.fork(second_links, source));
                first.plus(second)
            }
        }
    }

    /// Volumes come before those within them, so one backward sweep meets the inner ones first.
    fn sweep<F: Fn(u32) -> Aabb + Sync>(&mut self, source: &Source<'_, F>) -> Swept {
        let mut swept = Swept::default();
        for at in (0..self.volumes.len()).rev() {
            let volume = self.volumes[at];
            let links = &source.links[volume.first as usize..(volume.first + volume.count) as usize];
            let first_below = self.first_volume + at + 1;
            let mut run = self.reborrow();
            let (volumes, below) = std::mem::take(&mut run.volumes).split_at_mut(at + 1);
            let (aabb, own) = run.lists(volume).take(links, below, first_below, source);
            volumes[at].aabb = aabb;
            swept = swept.plus(own);
        }
        swept
    }
}

impl<'a> Run<'a> {
    /// The first `volumes` volumes of this run, whose lists end before number `child`, and the others.
    fn split(self, volumes: usize, child: usize) -> (Run<'a>, Run<'a>) {
        let at = child - self.first_child;
        let (volumes0, volumes1) = self.volumes.split_at_mut(volumes);
        let (ranks0, ranks1) = self.ranks.split_at_mut(at);
        let [(x0, x1), (y0, y1), (z0, z1)] = self.events.map(|list| list.split_at_mut(2 * at));
        let first = Run { volumes: volumes0, ranks: ranks0, events: [x0, y0, z0], ..self };
        let second = Run {
            volumes: volumes1,
            ranks: ranks1,
            events: [x1, y1, z1],
            first_volume: self.first_volume + volumes,
            first_child: child,
        };
        (first, second)
    }
}

impl ListMut<'_, Word> {
    /// Takes the boxes of what `links` name into the lists of a volume; the box around all. `volumes` are those from number
    /// `first_volume` on.
    fn take<F: Fn(u32) -> Aabb + Sync>(
        mut self,
        links: &[Link],
        volumes: &[Volume],
        first_volume: usize,
        source: &Source<'_, F>,
    ) -> (Aabb, Swept) {
        let mut around = Aabb::EMPTY;
        let mut own_area = 0.0;
        for (child, link) in links.iter().enumerate() {
            let aabb = match link.target() {
                Ok(object) => {
                    let aabb = (source.boxes)(object);
                    own_area += sah::half_area(aabb);
                    aabb
                }
                Err(volume) => volumes[volume as usize - first_volume].aabb,
            };
            if !aabb.is_empty() {
                around = around.union(aabb);
            }
            self.place(child, aabb);
        }
        let inversions = self.settle(source.fresh);
        (around, Swept { inversions, cost: sah::half_area(around) * links.len() as f64, own_area })
    }
}
