//! Contacts: which triangles of parts meet, where, and how deep they are in each other.

mod depth;
mod events;

use std::ops::ControlFlow;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{CollideError, Layers, PartId, Snapshot, triangle_contact, triangles_meet, world::PartFrame};
use crate::{anim::MotionClass, simd::check_float_mode};

pub use events::{ContactEvent, ContactLevel, ContactPhase, ContactTracker};

/// Two triangles that meet. Of one part the lower number comes first; of two, the lower part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TrianglePair {
    /// The parts; twice the same within one.
    pub parts: [PartId; 2],
    /// A triangle of each.
    pub triangles: [u32; 2],
}

/// How two triangles meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Which.
    pub pair: TrianglePair,
    /// 0 when they share a point, 1 for a segment, 2 for an area.
    pub dim: u8,
    /// Ends of what they share: of an area its two extreme points that are furthest apart; of a point twice that.
    pub segment: [DVec3; 2],
    /// Mean of the extreme points.
    pub point: DVec3,
    /// Unit direction in which the second triangle leaves the first on the shortest way; its sign is arbitrary where both are as short.
    pub normal: DVec3,
    /// Length of that way: 0 for triangles that only touch, or lie in one plane.
    pub depth: f64,
}

/// A choice of pairs of parts.
pub type PartFilter<'a> = &'a (dyn Fn(PartId, PartId) -> bool + Sync);

/// Which contacts are asked for.
#[derive(Clone, Copy)]
pub struct ContactOptions<'a> {
    /// Parts on one of these layers only.
    pub layers: u32,
    /// Also within each part that deforms.
    pub within: bool,
    /// Within a part, also pairs of triangles that share a vertex, or vertices at one place of the rest pose.
    pub neighbours: bool,
    /// Pairs of parts that count beyond what layers say, the lower number first (twice the same within one); `None` for all.
    pub accept: Option<PartFilter<'a>>,
}

impl Default for ContactOptions<'_> {
    fn default() -> Self {
        Self { layers: Layers::ALL, within: false, neighbours: false, accept: None }
    }
}

impl std::fmt::Debug for ContactOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ContactOptions")
            .field("layers", &self.layers)
            .field("within", &self.within)
            .field("neighbours", &self.neighbours)
            .finish_non_exhaustive()
    }
}

/// Candidates that one task tests.
const BATCH: usize = 4096;

impl Snapshot {
    /// All pairs of triangles of different parts (and within parts, if asked) that share a point: exact, and in ascending order.
    ///
    /// Two parts are looked at when their layers meet ([`Layers::meet`]). Cost: a walk over both trees, and 50 to 100 ns for each pair of
    /// triangles whose boxes meet; in parallel in the current rayon pool.
    ///
    /// # Errors
    /// When foreign code changed how this thread computes.
    pub fn contact_pairs(&self, options: &ContactOptions<'_>) -> Result<Vec<TrianglePair>, CollideError> {
        check_float_mode()?;
        let found: Vec<Vec<TrianglePair>> = self
            .part_couples(options)
            .into_par_iter()
            .map(|[a, b]| if a == b { self.within(a, options.neighbours) } else { self.between(a, b) })
            .collect();
        Ok(found.concat())
    }

    /// As [`Snapshot::contact_pairs`], with where and how deep: some 0.5 µs more a pair.
    ///
    /// # Errors
    /// As there.
    pub fn contacts(&self, options: &ContactOptions<'_>) -> Result<Vec<Contact>, CollideError> {
        let pairs = self.contact_pairs(options)?;
        Ok(pairs.into_par_iter().with_min_len(64).filter_map(|pair| self.contact_of(pair)).collect())
    }

    /// All pairs of triangles of two parts that share a point, in ascending order, whatever their layers; `a` and `b` the same for
    /// those within one part, without neighbours.
    ///
    /// Cost: as [`Snapshot::contact_pairs`].
    ///
    /// # Errors
    /// When there is no such part, or foreign code changed how this thread computes.
    pub fn pairs_between(&self, a: PartId, b: PartId) -> Result<Vec<TrianglePair>, CollideError> {
        check_float_mode()?;
        self.frame(a)?;
        self.frame(b)?;
        let (a, b) = (a.min(b), a.max(b));
        Ok(if a == b { self.within(a, false) } else { self.between(a, b) })
    }

    /// How two triangles meet; `None` when they do not. Cost: some 0.5 µs. No allocation.
    ///
    /// # Errors
    /// When there is no such part or triangle.
    pub fn contact(&self, pair: TrianglePair) -> Result<Option<Contact>, CollideError> {
        for (part, triangle) in pair.parts.into_iter().zip(pair.triangles) {
            let count = self.frame(part)?.len();
            if triangle as usize >= count {
                return Err(CollideError::NoSuchTriangle { part, triangle, count });
            }
        }
        Ok(self.contact_of(pair))
    }

    /// Parts to look at together, ascending; a part with itself for what is within it.
    pub(super) fn part_couples(&self, options: &ContactOptions<'_>) -> Vec<[PartId; 2]> {
        let frames = self.frames();
        let on = |part: &PartFrame| part.layers.on & options.layers != 0;
        let accept = |[a, b]: [PartId; 2]| options.accept.is_none_or(|accept| accept(a, b));
        let between = |&[a, b]: &[u32; 2]| {
            let (one, other) = (&frames[a as usize], &frames[b as usize]);
            let wanted = on(one) && on(other) && one.layers.meet(other.layers);
            (wanted && accept([PartId(a), PartId(b)])).then_some([PartId(a), PartId(b)])
        };
        let mut couples: Vec<_> = self.part_pairs().iter().filter_map(between).collect();
        if options.within {
            let own =
                self.parts().filter(|p| p.class() == MotionClass::Deforming && p.layers().on & options.layers != 0);
            couples.extend(own.map(|p| [p.id(); 2]).filter(|&couple| accept(couple)));
            couples.sort_unstable();
        }
        couples
    }

    fn between(&self, a: PartId, b: PartId) -> Vec<TrianglePair> {
        let (one, other) = (&*self.frames()[a.index()], &*self.frames()[b.index()]);
        let mut candidates = Vec::new();
        self.tree_of(one).pairs_with(self.tree_of(other), &mut |x: u32, y: u32| {
            candidates.push([x, y]);
            ControlFlow::Continue(())
        });
        meeting(one, other, candidates, [a, b])
    }

    fn within(&self, part: PartId, neighbours: bool) -> Vec<TrianglePair> {
        let frame = &*self.frames()[part.index()];
        let mut candidates = Vec::new();
        let mut push = |x: u32, y: u32| {
            candidates.push([x.min(y), x.max(y)]);
            ControlFlow::Continue(())
        };
        let tree = self.tree_of(frame);
        if neighbours {
            tree.own_pairs(&mut push);
        } else {
            tree.own_pairs_apart(frame.shape.welded(), &mut push);
        }
        meeting(frame, frame, candidates, [part; 2])
    }

    fn contact_of(&self, pair: TrianglePair) -> Option<Contact> {
        let corners = |i: usize| self.frames()[pair.parts[i].index()].corners(pair.triangles[i]);
        describe(pair, &corners(0), &corners(1))
    }
}

/// The candidates that meet, in order.
fn meeting(one: &PartFrame, other: &PartFrame, mut candidates: Vec<[u32; 2]>, parts: [PartId; 2]) -> Vec<TrianglePair> {
    let meet = |&[x, y]: &[u32; 2]| triangles_meet(&one.corners(x), &other.corners(y));
    if candidates.len() <= 2 * BATCH {
        candidates.retain(meet);
    } else {
        let kept = |run: &[[u32; 2]]| run.iter().filter(|pair| meet(pair)).copied().collect::<Vec<_>>();
        candidates = candidates.par_chunks(BATCH).map(kept).collect::<Vec<_>>().concat();
    }
    candidates.sort_unstable();
    candidates.into_iter().map(|triangles| TrianglePair { parts, triangles }).collect()
}

/// Whether two triangles have a corner's number in common.
pub(super) fn share_corner(a: &[u32; 3], b: &[u32; 3]) -> bool {
    a.iter().any(|corner| b.contains(corner))
}

/// How two triangles meet.
fn describe(pair: TrianglePair, a: &[Vec3; 3], b: &[Vec3; 3]) -> Option<Contact> {
    let shared = triangle_contact(a, b)?;
    let points = &shared.points[..];
    let mut segment = [points[0]; 2];
    for (i, &p) in points.iter().enumerate() {
        for &q in &points[i + 1..] {
            if (q - p).length_squared() > (segment[1] - segment[0]).length_squared() {
                segment = [p, q];
            }
        }
    }
    let point = points.iter().sum::<DVec3>() / points.len() as f64;
    let (normal, depth) = depth::shortest_way_out(a, b);
    Some(Contact { pair, dim: shared.dim, segment, point, normal, depth })
}
