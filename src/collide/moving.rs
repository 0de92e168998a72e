//! Continuous detection between two snapshots: what touches on the way from one pose to the next.

use std::{
    ops::ControlFlow,
    sync::{Arc, OnceLock},
};

use glam::DVec3;
use rayon::prelude::*;

use super::{
    CollideError, ContactOptions, Continuous, Impact, PartId, PartView, Snapshot, TrianglePair, boxes_meet,
    contacts::share_corner, overlapping::grown, surface::unit, tree::Tree, world::PartFrame,
};
use crate::{anim::MotionClass, geom::Aabb, simd::check_float_mode};

/// What of two triangles touches first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Features {
    /// A vertex of the first part and a triangle of the second.
    VertexFace {
        /// The vertex.
        vertex: u32,
        /// The triangle.
        triangle: u32,
    },
    /// A triangle of the first part and a vertex of the second.
    FaceVertex {
        /// The triangle.
        triangle: u32,
        /// The vertex.
        vertex: u32,
    },
    /// An edge of either part, by its vertices.
    EdgeEdge {
        /// Of the first part.
        first: [u32; 2],
        /// Of the second.
        second: [u32; 2],
    },
}

/// A contact that comes about between two snapshots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingContact {
    /// The parts, the lower number first; twice the same within one.
    pub parts: [PartId; 2],
    /// A triangle of each that the features belong to.
    pub triangles: [u32; 2],
    /// What touches.
    pub features: Features,
    /// When, as a share of the step, and how near they come then.
    pub impact: Impact,
    /// Where, at that time: the mean of both features' points.
    pub point: DVec3,
    /// Unit normal of the face, or across both edges, at that time, pointing to the second part as far as that is known; none where
    /// there is no direction.
    pub normal: Option<DVec3>,
}

impl Snapshot {
    /// Every pair of a vertex and a triangle, and of two edges, that come within `settings.min_separation` of each other while all vertices
    /// move along straight lines from this snapshot to `next`; in ascending order of parts, triangles and features.
    ///
    /// No contact is missed and none reported late ([`Continuous`]); pairs of triangles that already meet in this snapshot need not
    /// touch again and are those of [`Snapshot::contact_pairs`]. Each vertex and edge is asked once, for the lowest triangle that it belongs
    /// to. Within a part, features that share a vertex (vertices at one place of the rest pose are one) are left out unless
    /// `options.neighbours` says else. Parts are chosen as there; those that neither move nor have changed are passed over.
    ///
    /// Cost: a walk over trees of the boxes that triangles sweep, then a fraction of a microsecond for each pair of features whose boxes meet,
    /// and some microseconds for a contact; in parallel in the current rayon pool.
    ///
    /// # Errors
    /// When the snapshots are not of one world with the same parts, a setting is NaN or negative, or foreign code changed how this thread computes.
    pub fn moving_contacts(
        &self,
        next: &Self,
        options: &ContactOptions<'_>,
        settings: &Continuous,
    ) -> Result<Vec<MovingContact>, CollideError> {
        check_float_mode()?;
        check_settings(settings)?;
        let (count, other) = (self.part_count(), next.part_count());
        if count != other {
            return Err(CollideError::Count { what: "parts of the next snapshot", actual: other, expected: count });
        }
        for (part, (a, b)) in (0..).map(PartId).zip(self.frames().iter().zip(next.frames())) {
            if !Arc::ptr_eq(&a.shape, &b.shape) {
                return Err(CollideError::OtherPart(part));
            }
        }
        let sweeps: Vec<Sweep<'_>> =
            self.frames().iter().zip(next.frames()).map(|(a, b)| Sweep::new(a, b, settings.min_separation)).collect();
        let trees: Vec<OnceLock<Tree>> = sweeps.iter().map(|_| OnceLock::new()).collect();
        let tree = |part: PartId| trees[part.index()].get_or_init(|| sweeps[part.index()].tree(self));
        let found: Vec<Vec<MovingContact>> = moving_couples(next, &sweeps, options)
            .into_par_iter()
            .map(|[a, b]| {
                let pair =
                    Couple { one: &sweeps[a.index()], other: &sweeps[b.index()], parts: [a, b], options, settings };
                pair.contacts(tree(a), tree(b))
            })
            .collect();
        Ok(found.concat())
    }
}

impl Snapshot {
    /// When two triangles first come within `settings.min_separation` of each other on the way to `next`, by all of their features but those
    /// with a vertex in common; at the start for triangles that already meet. `None` only if they surely do not. Cost: some microseconds.
    ///
    /// # Errors
    /// As [`Snapshot::moving_contacts`], and when there is no such part or triangle.
    pub fn first_impact(
        &self,
        next: &Self,
        pair: TrianglePair,
        settings: &Continuous,
    ) -> Result<Option<Impact>, CollideError> {
        let sweep = |i: usize| {
            let (before, after) = (self.frame(pair.parts[i])?, next.frame(pair.parts[i])?);
            let (triangle, count) = (pair.triangles[i], before.len());
            if !Arc::ptr_eq(&before.shape, &after.shape) {
                return Err(CollideError::OtherPart(pair.parts[i]));
            }
            if triangle as usize >= count {
                return Err(CollideError::NoSuchTriangle { part: pair.parts[i], triangle, count });
            }
            Ok(Sweep::new(before, after, settings.min_separation))
        };
        check_settings(settings)?;
        if self.contact(pair)?.is_some() {
            return Ok(Some(Impact { time: 0.0, gap: 0.0, place: [0.0; 2] }));
        }
        let (one, other) = (sweep(0)?, sweep(1)?);
        let options = &ContactOptions { neighbours: true, ..ContactOptions::default() };
        let couple = Couple { one: &one, other: &other, parts: pair.parts, options, settings };
        let mut found = Vec::new();
        couple.features(pair.triangles, [ALL_FEATURES; 2], &mut found);
        Ok(found.iter().map(|c| c.impact).min_by(|a, b| a.time.total_cmp(&b.time)))
    }

    /// Whether two triangles of a part share a vertex, or vertices at one place of the rest pose.
    ///
    /// # Errors
    /// When there is no such part or triangle.
    pub fn are_neighbours(&self, part: PartId, triangles: [u32; 2]) -> Result<bool, CollideError> {
        let frame = self.frame(part)?;
        let count = frame.len();
        let corners = |triangle: u32| {
            let known = frame.shape.welded().get(triangle as usize);
            known.copied().ok_or(CollideError::NoSuchTriangle { part, triangle, count })
        };
        let [a, b] = triangles;
        Ok(share_corner(&corners(a)?, &corners(b)?))
    }
}

fn check_settings(settings: &Continuous) -> Result<(), CollideError> {
    for (what, value) in [("tolerance", settings.tolerance), ("separation", settings.min_separation)] {
        if value.is_nan() || value < 0.0 || value.is_infinite() {
            return Err(CollideError::OutOfRange { what, value });
        }
    }
    Ok(())
}

/// Every vertex and edge of a triangle.
const ALL_FEATURES: u8 = 0b11_1111;

/// Pairs of parts whose swept boxes meet and that may touch, ascending.
fn moving_couples(next: &Snapshot, sweeps: &[Sweep<'_>], options: &ContactOptions<'_>) -> Vec<[PartId; 2]> {
    let bounds = Tree::build(sweeps.len(), |i| sweeps[i as usize].bounds);
    let mut couples = Vec::new();
    bounds.own_pairs(&mut |a: u32, b: u32| {
        couples.push([a.min(b), a.max(b)].map(PartId));
        ControlFlow::Continue(())
    });
    let on = |part: PartId| sweeps[part.index()].after.layers.on & options.layers != 0;
    let layers = |part: PartId| sweeps[part.index()].after.layers;
    couples.retain(|&[a, b]| on(a) && on(b) && layers(a).meet(layers(b)));
    if options.within {
        let deforms = |p: &PartView<'_>| p.class() == MotionClass::Deforming;
        couples.extend(next.parts().filter(deforms).map(|p| [p.id(); 2]).filter(|&[a, _]| on(a)));
    }
    couples.retain(|&[a, b]| options.accept.is_none_or(|accept| accept(a, b)));
    couples.retain(|&[a, b]| sweeps[a.index()].moved || sweeps[b.index()].moved);
    couples.sort_unstable();
    couples
}

/// A part on its way from one snapshot to the next.
struct Sweep<'a> {
    before: &'a PartFrame,
    after: &'a PartFrame,
    moved: bool,
    /// Around everything on its way, and half of the separation.
    bounds: Aabb,
    margin: f32,
}

impl<'a> Sweep<'a> {
    fn new(before: &'a PartFrame, after: &'a PartFrame, separation: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "moved up past the rounding")]
        let margin = if separation > 0.0 { ((separation * 0.5) as f32).next_up() } else { 0.0 };
        let moved = !Arc::ptr_eq(&before.positions, &after.positions);
        let mut sweep = Self { before, after, moved, bounds: Aabb::EMPTY, margin };
        sweep.bounds = sweep.widened(before.bounds.union(after.bounds));
        sweep
    }

    fn widened(&self, aabb: Aabb) -> Aabb {
        if self.margin > 0.0 && !aabb.is_empty() { grown(aabb, self.margin) } else { aabb }
    }

    /// Around vertices on their way.
    fn around(&self, vertices: &[u32]) -> Aabb {
        let both = |&v: &u32| [self.before.positions[v as usize], self.after.positions[v as usize]];
        self.widened(Aabb::from_points(vertices.iter().flat_map(both)))
    }

    fn tree(&self, from: &Snapshot) -> Tree {
        let triangles = self.after.shape.triangles();
        let mut tree = Tree::clone(from.tree_of(self.before));
        tree.refit(&|i: u32| self.around(&triangles[i as usize]));
        tree
    }

    fn start(&self, vertex: u32) -> DVec3 {
        self.before.positions[vertex as usize].as_dvec3()
    }

    fn end(&self, vertex: u32) -> DVec3 {
        self.after.positions[vertex as usize].as_dvec3()
    }

    fn triangle(&self, triangle: u32) -> [u32; 3] {
        self.after.shape.triangles()[triangle as usize]
    }
}

/// Two parts that may touch.
struct Couple<'a> {
    one: &'a Sweep<'a>,
    other: &'a Sweep<'a>,
    parts: [PartId; 2],
    options: &'a ContactOptions<'a>,
    settings: &'a Continuous,
}

/// Triangles that one task takes.
const BATCH: usize = 1024;

impl Couple<'_> {
    fn contacts(&self, tree: &Tree, other: &Tree) -> Vec<MovingContact> {
        let within = self.parts[0] == self.parts[1];
        let mut candidates = Vec::new();
        if within {
            tree.own_pairs(&mut |a: u32, b: u32| {
                candidates.push([a.min(b), a.max(b)]);
                ControlFlow::Continue(())
            });
        } else {
            tree.pairs_with(other, &mut |a: u32, b: u32| {
                candidates.push([a, b]);
                ControlFlow::Continue(())
            });
        }
        let (of_one, of_other) = (self.one.after.shape.owned(), self.other.after.shape.owned());
        let run = |run: &[[u32; 2]]| {
            let mut found = Vec::new();
            for &triangles in run {
                let [x, y] = triangles.map(|t| t as usize);
                self.features(triangles, [of_one[x], of_other[y]], &mut found);
            }
            found
        };
        let mut found: Vec<MovingContact> = if candidates.len() <= 2 * BATCH {
            run(&candidates)
        } else {
            candidates.par_chunks(BATCH).map(run).collect::<Vec<_>>().concat()
        };
        found.sort_by_key(|c| (c.triangles, c.features));
        found
    }

    /// Asks some of the features of two triangles.
    fn features(&self, [x, y]: [u32; 2], [owns_a, owns_b]: [u8; 2], found: &mut Vec<MovingContact>) {
        let (a, b) = (self.one.triangle(x), self.other.triangle(y));
        let (box_a, box_b) = (self.one.around(&a), self.other.around(&b));
        for i in 0..3 {
            if owns_a >> i & 1 == 1 && boxes_meet(&self.one.around(&[a[i]]), &box_b) {
                self.vertex_face(Features::VertexFace { vertex: a[i], triangle: y }, [x, y], found);
            }
            if owns_b >> i & 1 == 1 && boxes_meet(&self.other.around(&[b[i]]), &box_a) {
                self.vertex_face(Features::FaceVertex { triangle: x, vertex: b[i] }, [x, y], found);
            }
        }
        for i in (0..3).filter(|i| owns_a >> (i + 3) & 1 == 1) {
            let first = [a[i], a[(i + 1) % 3]];
            let around = self.one.around(&first);
            if !boxes_meet(&around, &box_b) {
                continue;
            }
            for j in (0..3).filter(|j| owns_b >> (j + 3) & 1 == 1) {
                let second = [b[j], b[(j + 1) % 3]];
                if boxes_meet(&around, &self.other.around(&second)) {
                    self.edge_edge(first, second, [x, y], found);
                }
            }
        }
    }

    /// Whether two vertices are one, or lie at one place of the rest pose; only within a part.
    fn are_one(&self, a: u32, b: u32) -> bool {
        a == b || self.one.after.shape.welded_vertex(a) == self.one.after.shape.welded_vertex(b)
    }

    fn are_neighbours(&self, a: &[u32], b: &[u32]) -> bool {
        let within = self.parts[0] == self.parts[1];
        within && a.iter().any(|&a| b.iter().any(|&b| a == b || (!self.options.neighbours && self.are_one(a, b))))
    }

    fn vertex_face(&self, features: Features, triangles: [u32; 2], found: &mut Vec<MovingContact>) {
        let (point, face, vertex, triangle) = match features {
            Features::VertexFace { vertex, triangle } => (self.one, self.other, vertex, triangle),
            Features::FaceVertex { triangle, vertex } => (self.other, self.one, vertex, triangle),
            Features::EdgeEdge { .. } => return,
        };
        let corners = face.triangle(triangle);
        if self.are_neighbours(&[vertex], &corners) {
            return;
        }
        let [a, b, c] = corners;
        let start = [point.start(vertex), face.start(a), face.start(b), face.start(c)];
        let end = [point.end(vertex), face.end(a), face.end(b), face.end(c)];
        let Some(impact) = self.settings.vertex_face(&start, &end) else { return };
        let [p, a, b, c] = at(&start, &end, impact.time);
        let [u, v] = impact.place;
        let on_face = a + (b - a) * u + (c - a) * v;
        let normal = unit((b - a).cross(c - a));
        // From the first part to the second, by where they were before.
        let before = (start[1] + start[2] + start[3]) / 3.0 - start[0];
        let towards = if matches!(features, Features::VertexFace { .. }) { before } else { -before };
        let normal = normal.map(|n| if n.dot(towards) < 0.0 { -n } else { n });
        found.push(self.contact(triangles, features, impact, (p + on_face) * 0.5, normal));
    }

    fn edge_edge(&self, first: [u32; 2], second: [u32; 2], triangles: [u32; 2], found: &mut Vec<MovingContact>) {
        if self.are_neighbours(&first, &second) {
            return;
        }
        let ([a, b], [c, d]) = (first, second);
        let start = [self.one.start(a), self.one.start(b), self.other.start(c), self.other.start(d)];
        let end = [self.one.end(a), self.one.end(b), self.other.end(c), self.other.end(d)];
        let Some(impact) = self.settings.edge_edge(&start, &end) else { return };
        let [a, b, c, d] = at(&start, &end, impact.time);
        let [u, v] = impact.place;
        let (p, q) = (a + (b - a) * u, c + (d - c) * v);
        let before = (start[2] + start[3]) - (start[0] + start[1]);
        let normal = unit((b - a).cross(d - c)).map(|n| if n.dot(before) < 0.0 { -n } else { n });
        let features = Features::EdgeEdge { first, second };
        found.push(self.contact(triangles, features, impact, (p + q) * 0.5, normal));
    }

    fn contact(
        &self,
        triangles: [u32; 2],
        features: Features,
        impact: Impact,
        point: DVec3,
        normal: Option<DVec3>,
    ) -> MovingContact {
        MovingContact { parts: self.parts, triangles, features, impact, point, normal }
    }
}

/// Corners on their way at a time.
fn at(start: &[DVec3; 4], end: &[DVec3; 4], time: f64) -> [DVec3; 4] {
    std::array::from_fn(|i| start[i] + (end[i] - start[i]) * time)
}
