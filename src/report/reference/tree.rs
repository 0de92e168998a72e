use rayon::prelude::*;

use super::{
    exact::{self, Meeting},
    float::{self, Found},
    interval::Interval,
    truth::{Accepted, Truth},
};
use crate::{
    geom::{Aabb, PrimId, Ray, Triangles},
    glam::{DVec3, Vec3},
};

/// Most triangles in a leaf.
const LEAF: usize = 4;

/// Relative slack of a plane's t: a difference, a reciprocal and a product round three times, 3 * 2^-53 together.
const SLACK: f64 = 8.0 * f64::EPSILON;

/// Widest interval of t that counts as known, relative; of u and v, absolute: 2^-41.
const KNOWN: f64 = 1.0 / 2_199_023_255_552.0;

/// A box over the triangles of a range of slots, or over two boxes: the next node and `right`.
#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Aabb,
    /// Leaf: its first slot. Else: the second child.
    first: u32,
    /// Leaf: its number of slots. Else 0.
    count: u32,
}

/// A triangle in the order of the leaves.
#[derive(Clone, Copy, Debug)]
struct Slot {
    prim: PrimId,
    corners: [Vec3; 3],
}

/// A tracer for large sets: f64 with bounds, integers in doubt.
///
/// The triangles lie in a tree of boxes split at the median of their middles. A box is passed over when f64 proves, with slack, that
/// the ray does not meet it before the nearest hit; nothing else is left out.
#[derive(Clone, Debug)]
pub struct Reference {
    nodes: Vec<Node>,
    slots: Vec<Slot>,
}

impl Reference {
    /// Prepares the triangles; those with a corner that is not finite are never met.
    ///
    /// Cost: O(n log n), 100 bytes a triangle.
    ///
    /// # Panics
    /// When a triangle names a vertex that does not exist.
    pub fn new(prims: &Triangles<'_>) -> Self {
        let numbers = 0..u32::try_from(prims.len()).unwrap_or(u32::MAX);
        let slot = |i| Slot { prim: PrimId(i), corners: prims.corners(PrimId(i)) };
        let all = numbers.map(slot).filter(|s| s.corners.iter().all(|c| c.is_finite()));
        let mut slots: Vec<Slot> = all.collect();
        let mut nodes = Vec::new();
        if !slots.is_empty() {
            split(&mut nodes, &mut slots, 0);
        }
        Self { nodes, slots }
    }

    /// What `ray` meets first.
    pub fn closest(&self, ray: &Ray) -> Option<Truth> {
        let mut search = Search { ray: *ray, met: Vec::new(), high: f64::INFINITY };
        self.walk(ray, &mut search);
        search.truth()
    }

    /// What each ray meets first, in the current rayon pool.
    pub fn all_closest(&self, rays: &[Ray]) -> Vec<Option<Truth>> {
        rays.par_iter().with_min_len(256).map(|ray| self.closest(ray)).collect()
    }

    /// True when `ray` meets any triangle.
    pub fn blocked(&self, ray: &Ray) -> bool {
        let mut any = Any { ray: *ray, met: false };
        self.walk(ray, &mut any);
        any.met
    }

    /// Shows `visit` every triangle of every leaf that the ray may meet, the nearer leaves first.
    fn walk(&self, ray: &Ray, visit: &mut impl Visit) {
        let Some((near, far)) = exact::range(ray) else { return };
        let line = Line::new(ray, near, far);
        let mut open = Vec::with_capacity(64);
        if let Some(entry) = self.nodes.first().and_then(|root| line.entry(&root.bounds, visit.limit())) {
            open.push((entry, 0_usize));
        }
        while let Some((entry, at)) = open.pop() {
            if entry > visit.limit() {
                continue;
            }
            let node = &self.nodes[at];
            if node.count > 0 {
                let first = node.first as usize;
                self.slots[first..first + node.count as usize].iter().for_each(|slot| visit.slot(slot));
                continue;
            }
            let children = [at + 1, node.first as usize];
            let [a, b] = children.map(|c| line.entry(&self.nodes[c].bounds, visit.limit()).map(|t| (t, c)));
            let (nearer, farther) = match (a, b) {
                (Some(x), Some(y)) if x.0 > y.0 => (b, a),
                _ => (a, b),
            };
            open.extend(farther.into_iter().chain(nearer));
        }
    }
}

/// Makes the node over `slots`, the first of which has the number `offset`, and all below it.
fn split(nodes: &mut Vec<Node>, slots: &mut [Slot], offset: u32) {
    let bounds = Aabb::from_points(slots.iter().flat_map(|s| s.corners));
    let at = nodes.len();
    let count = u32::try_from(slots.len()).unwrap_or(u32::MAX);
    nodes.push(Node { bounds, first: offset, count });
    if slots.len() <= LEAF {
        return;
    }
    let middles = Aabb::from_points(slots.iter().map(middle));
    let extent = middles.max.as_dvec3() - middles.min.as_dvec3();
    let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
    let half = slots.len() / 2;
    slots.select_nth_unstable_by(half, |a, b| {
        middle(a)[axis].total_cmp(&middle(b)[axis]).then_with(|| a.prim.cmp(&b.prim))
    });
    let (left, right) = slots.split_at_mut(half);
    split(nodes, left, offset);
    nodes[at].first = u32::try_from(nodes.len()).unwrap_or(u32::MAX);
    nodes[at].count = 0;
    split(nodes, right, offset + u32::try_from(half).unwrap_or(u32::MAX));
}

/// The middle of a triangle's box.
fn middle(slot: &Slot) -> Vec3 {
    let [a, b, c] = slot.corners.map(|c| c * 0.5);
    a.min(b).min(c) + a.max(b).max(c)
}

/// A ray ready for boxes.
struct Line {
    origin: DVec3,
    dir: DVec3,
    inv: DVec3,
    near: f64,
    far: f64,
}

impl Line {
    fn new(ray: &Ray, near: f32, far: f32) -> Self {
        let dir = ray.dir.as_dvec3();
        Self { origin: ray.origin.as_dvec3(), dir, inv: dir.recip(), near: near.into(), far: far.into() }
    }

    /// At most the t at which the ray enters the box; `None` when it surely does not meet it up to `limit`.
    fn entry(&self, bounds: &Aabb, limit: f64) -> Option<f64> {
        let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (mut near, mut far) = (self.near, self.far.min(limit));
        for axis in 0..3 {
            let (low, high) = (low[axis] - self.origin[axis], high[axis] - self.origin[axis]);
            if self.dir[axis] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (low * self.inv[axis], high * self.inv[axis]);
            let (enters, leaves) = (a.min(b), a.max(b));
            near = near.max(enters - SLACK * enters.abs());
            far = far.min(leaves + SLACK * leaves.abs());
        }
        (near <= far).then_some(near)
    }
}

/// What looks at the triangles of a walk.
trait Visit {
    /// No triangle beyond this t is of interest.
    fn limit(&self) -> f64;
    fn slot(&mut self, slot: &Slot);
}

/// A triangle that is surely met within the ray's range.
#[derive(Clone, Copy, Debug)]
struct Met {
    slot: Slot,
    tuv: [Interval; 3],
}

/// Where `ray` surely meets the triangle within its range.
fn met(ray: &Ray, slot: &Slot) -> Option<Met> {
    let (near, far) = exact::range(ray)?;
    let (near, far) = (f64::from(near), f64::from(far));
    match float::test(ray, &slot.corners) {
        Found::Miss => None,
        Found::Hit([t, ..]) if t.high < near || t.low > far => None,
        Found::Hit(tuv @ [t, ..]) if t.low >= near && t.high <= far => Some(Met { slot: *slot, tuv }),
        _ => exact::meeting(ray, &slot.corners)
            .map(|m| Met { slot: *slot, tuv: [&m.t, &m.u, &m.v].map(|x| Interval::around(x.to_f64(), 0.0)) }),
    }
}

/// All triangles that may be the nearest.
struct Search {
    ray: Ray,
    met: Vec<Met>,
    /// At least the least t.
    high: f64,
}

impl Visit for Search {
    fn limit(&self) -> f64 {
        self.high
    }

    fn slot(&mut self, slot: &Slot) {
        if let Some(found) = met(&self.ray, slot).filter(|m| m.tuv[0].low <= self.high) {
            self.high = self.high.min(found.tuv[0].high);
            self.met.push(found);
        }
    }
}

impl Search {
    fn truth(mut self) -> Option<Truth> {
        let high = self.high;
        self.met.retain(|m| m.tuv[0].low <= high);
        if let [only] = &self.met[..]
            && let Some(truth) = certain(only)
        {
            return Some(truth);
        }
        self.met.sort_by_key(|m| m.slot.prim);
        let exactly = |m: &Met| Some((m.slot.prim, exact::meeting(&self.ray, &m.slot.corners)?));
        exact::first(self.met.iter().filter_map(exactly).collect::<Vec<(PrimId, Meeting)>>())
    }
}

/// The answer when all its roundings are known.
fn certain(met: &Met) -> Option<Truth> {
    let [t, u, v] = met.tuv;
    let is_known = t.high - t.low <= KNOWN * t.low.abs() && (u.high - u.low).max(v.high - v.low) <= KNOWN;
    let rounded = [u.rounded()?, v.rounded()?];
    let accepted = Accepted { prim: met.slot.prim, u: u.middle(), v: v.middle(), rounded };
    let t_rounded = t.rounded()?;
    is_known.then(|| Truth { t: t.middle(), t_rounded, accepted: vec![accepted] })
}

/// Whether anything is met.
struct Any {
    ray: Ray,
    met: bool,
}

impl Visit for Any {
    fn limit(&self) -> f64 {
        if self.met { f64::NEG_INFINITY } else { f64::INFINITY }
    }

    fn slot(&mut self, slot: &Slot) {
        self.met = self.met || met(&self.ray, slot).is_some();
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "answers are compared bit for bit")]
mod tests {
    use super::*;
    use crate::report::{meshes, random::Random};

    #[test]
    fn every_triangle_is_in_one_leaf_inside_all_boxes_above_it() {
        let mesh = meshes::soup(1000);
        let reference = Reference::new(&mesh.prims());
        let mut seen = vec![0; 1000];
        let mut open = vec![(0, reference.nodes[0].bounds)];
        while let Some((at, above)) = open.pop() {
            let node = &reference.nodes[at];
            assert!(above.contains(node.bounds));
            if node.count == 0 {
                open.extend([(at + 1, node.bounds), (node.first as usize, node.bounds)]);
            }
            for slot in &reference.slots[node.first as usize..][..node.count as usize] {
                seen[slot.prim.0 as usize] += 1;
                assert!(node.bounds.contains(Aabb::from_points(slot.corners)));
            }
        }
        assert!(seen.iter().all(|&n| n == 1));
    }

    #[test]
    fn empty_and_infinite_meshes_are_never_met() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::INFINITY];
        let prims = Triangles { positions: &positions, indices: &[[0, 1, 2]], topology_epoch: 1 };
        let ray = Ray::new(-Vec3::Z, Vec3::Z);
        assert!(Reference::new(&prims).closest(&ray).is_none());
        let none = Triangles { indices: &[], ..prims };
        assert!(!Reference::new(&none).blocked(&ray));
    }

    #[test]
    fn the_tree_finds_what_brute_force_finds_in_a_soup() {
        let mesh = meshes::soup(300);
        let reference = Reference::new(&mesh.prims());
        let mut random = Random::new(3, 1);
        let mut point = || DVec3::new(random.unit(), random.unit(), random.unit()).as_vec3();
        let rays: Vec<Ray> = (0..200).map(|_| Ray::new(point() * 2.0 - 0.5, point() - point())).collect();
        let mut hits = 0;
        for (ray, found) in rays.iter().zip(reference.all_closest(&rays)) {
            let due = exact::closest(ray, &mesh.prims());
            assert_eq!(found.is_some(), due.is_some());
            assert_eq!(reference.blocked(ray), due.is_some());
            if let (Some(found), Some(due)) = (found, due) {
                hits += 1;
                assert_eq!(found.t_rounded, due.t_rounded);
                assert_eq!(found.accepted[0].prim, due.accepted[0].prim);
                assert_eq!(found.accepted[0].rounded, due.accepted[0].rounded);
            }
        }
        assert!(hits > 10, "{hits}");
    }
}
