//! The automatic hierarchy of the paper: a regular grid on each volume, an object into the cell of its box's centre.

use rayon::prelude::*;

use super::{
    EventsConfig,
    local::append,
    tree::{EventTree, Link, Volume},
};
use crate::geom::Aabb;

/// Depth from which volumes are halved by number of objects: at most 32 more levels for any number.
const GRID_DEPTH: usize = 48;

/// Sets of at least this many objects are divided by several threads.
const PARALLEL: usize = 1 << 13;

/// An object to be put somewhere.
#[derive(Clone, Copy, Debug)]
struct Item {
    aabb: Aabb,
    number: u32,
}

/// What a volume will hold.
#[derive(Debug)]
enum Element {
    Object(u32),
    Volume(Vec<Element>),
}

/// How the objects of a volume are divided.
#[derive(Clone, Copy, Debug)]
enum Division {
    Grid,
    Halves,
}

/// Builds the topology over `count` boxes; the boxes of volumes and the order of events are still to be found.
pub(super) fn build(count: u32, boxes: impl Fn(u32) -> Aabb + Sync, config: &EventsConfig) -> EventTree {
    let items: Vec<Item> = (0..count).into_par_iter().map(|number| Item { aabb: boxes(number), number }).collect();
    let (mut live, dead): (Vec<_>, Vec<_>) = items.into_iter().partition(|item| !item.aabb.is_empty());
    let builder = Builder { config };
    let mut scratch = live.clone();
    let mut elements = builder.divide(&mut live, &mut scratch, 0, Division::Grid);
    drop((live, scratch));
    if !dead.is_empty() {
        // Apart from the others: no ray comes near them while their boxes are empty.
        let dead = Element::Volume(dead.iter().map(|item| Element::Object(item.number)).collect());
        elements = vec![Element::Volume(elements), halved(dead, config.threshold)];
    }
    let mut tree = EventTree::default();
    emit(&mut tree, elements);
    tree
}

/// A volume of objects as volumes of few.
fn halved(element: Element, most: usize) -> Element {
    match element {
        Element::Volume(mut elements) if elements.len() > most.max(2) => {
            let second = elements.split_off(elements.len() / 2);
            Element::Volume([elements, second].map(|half| halved(Element::Volume(half), most)).into())
        }
        few => few,
    }
}

struct Builder<'a> {
    config: &'a EventsConfig,
}

impl Builder<'_> {
    /// What the volume of `items` holds. `scratch` is as long as `items`.
    fn divide(&self, items: &mut [Item], scratch: &mut [Item], depth: usize, division: Division) -> Vec<Element> {
        if items.len() <= self.config.threshold {
            return items.iter().map(|item| Element::Object(item.number)).collect();
        }
        let bounds = items.iter().fold(Aabb::EMPTY, |all, item| all.union(item.aabb));
        if matches!(division, Division::Halves) || depth >= GRID_DEPTH {
            return self.halves(items, scratch, depth);
        }
        let sizes = sort_into_cells(items, scratch, &bounds, self.config.grid);
        if sizes.len() > 1 {
            return self.elements(items, scratch, &sizes, depth, &vec![Division::Grid; sizes.len()]);
        }
        let large = self.large_first(items, scratch, &bounds);
        if large == 0 || large == items.len() {
            return self.halves(items, scratch, depth);
        }
        let sizes = [large, items.len() - large];
        self.elements(items, scratch, &sizes, depth, &[Division::Halves, Division::Grid])
    }

    /// The elements of consecutive runs of `items`.
    fn elements(
        &self,
        items: &mut [Item],
        scratch: &mut [Item],
        sizes: &[usize],
        depth: usize,
        divisions: &[Division],
    ) -> Vec<Element> {
        let parallel = items.len() >= PARALLEL;
        let (mut items, mut scratch) = (items, scratch);
        let mut runs = Vec::with_capacity(sizes.len());
        for (&size, &division) in sizes.iter().zip(divisions) {
            let (run, rest) = items.split_at_mut(size);
            let (space, more) = scratch.split_at_mut(size);
            (items, scratch) = (rest, more);
            runs.push((run, space, division));
        }
        let element = |(run, space, division): (&mut [Item], &mut [Item], Division)| match run {
            [only] => Element::Object(only.number),
            _ => Element::Volume(self.divide(run, space, depth + 1, division)),
        };
        if parallel { runs.into_par_iter().map(element).collect() } else { runs.into_iter().map(element).collect() }
    }

    /// Two halves along the widest axis of the centres, by number of objects.
    fn halves(&self, items: &mut [Item], scratch: &mut [Item], depth: usize) -> Vec<Element> {
        let centers = Aabb::from_points(items.iter().map(|item| item.aabb.center()));
        let extent = centers.extent();
        let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
        let half = items.len() / 2;
        let center = |item: &Item| item.aabb.center()[axis];
        items.select_nth_unstable_by(half, |a, b| center(a).total_cmp(&center(b)).then(a.number.cmp(&b.number)));
        let sizes = [half, items.len() - half];
        self.elements(items, scratch, &sizes, depth, &[Division::Halves; 2])
    }

    /// Brings the objects that cover a large part of the volume to the front, in order; their number. Large on two axes if
    /// there are such, or else on one.
    fn large_first(&self, items: &mut [Item], scratch: &mut [Item], bounds: &Aabb) -> usize {
        let least = bounds.extent().as_dvec3() * self.config.large;
        let extents = |item: &Item| (0..3).filter(|&i| f64::from(item.aabb.extent()[i]) > least[i]).count();
        let most = items.iter().map(extents).max().unwrap_or(0);
        let is_large = |item: &Item| extents(item) >= most.clamp(1, 2);
        let large = items.iter().filter(|item| is_large(item)).count();
        let (mut front, mut back) = (0, large);
        for item in items.iter() {
            let at = if is_large(item) { &mut front } else { &mut back };
            scratch[*at] = *item;
            *at += 1;
        }
        items.copy_from_slice(scratch);
        large
    }
}

/// Sorts `items` by the cells of a grid on `bounds`, keeping their order within a cell; the sizes of occupied cells.
fn sort_into_cells(items: &mut [Item], scratch: &mut [Item], bounds: &Aabb, grid: usize) -> Vec<usize> {
    let min = bounds.min.as_dvec3();
    let scale = (bounds.max.as_dvec3() - min).recip() * grid as f64;
    let cell = |item: &Item| {
        let center = (item.aabb.min.as_dvec3() + item.aabb.max.as_dvec3()) * 0.5;
        (0..3).fold(0, |cell, axis| cell * grid + slice((center[axis] - min[axis]) * scale[axis], grid))
    };
    let mut starts = vec![0; grid * grid * grid];
    for item in items.iter() {
        starts[cell(item)] += 1;
    }
    let sizes: Vec<usize> = starts.iter().copied().filter(|&size| size > 0).collect();
    if sizes.len() > 1 {
        let mut next = 0;
        for start in &mut starts {
            next += std::mem::replace(start, next);
        }
        for item in items.iter() {
            let at = &mut starts[cell(item)];
            scratch[*at] = *item;
            *at += 1;
        }
        items.copy_from_slice(scratch);
    }
    sizes
}

/// The slice of a grid that a place in it lies in; a volume without extent has one slice.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates; NaN is slice 0")]
fn slice(place: f64, grid: usize) -> usize {
    (place as usize).min(grid - 1)
}

/// Appends a volume and all within it, depth first.
#[expect(clippy::cast_possible_truncation, reason = "the number of objects is checked by the build")]
fn emit(tree: &mut EventTree, elements: Vec<Element>) -> Link {
    let (number, first) = (tree.volumes.len() as u32, tree.links.len());
    let count = elements.len() as u32;
    tree.volumes.push(Volume { aabb: Aabb::EMPTY, first: first as u32, count });
    tree.links.extend(elements.iter().map(|_| Link::object(0)));
    append(&mut tree.events, &mut tree.ranks, count);
    for (at, element) in elements.into_iter().enumerate() {
        tree.links[first + at] = match element {
            Element::Object(number) => Link::object(number),
            Element::Volume(elements) => emit(tree, elements),
        };
    }
    Link::volume(number)
}
