use arrayvec::ArrayVec;
use glam::{DVec3, Vec3};

use crate::collide::predicates::Projection;

/// A triangle by its extreme points: three, the two ends of a segment, or one.
pub(super) struct Shape {
    /// Corner numbers and places.
    pub(super) corners: ArrayVec<(u8, Vec3), 3>,
}

impl Shape {
    /// As [`Shape::new`], for a triangle that has an area unless it `may_be_flat`.
    pub(super) fn of(corners: &[Vec3; 3], may_be_flat: bool) -> Self {
        let [a, b, c] = *corners;
        if may_be_flat { Self::new(*corners) } else { Self { corners: [(0, a), (1, b), (2, c)].into() } }
    }

    pub(super) fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        let all = [(0, a), (1, b), (2, c)];
        let [x, y, z] = corners.map(Vec3::as_dvec3);
        if Projection::spreading(a, b, c, (y - x).cross(z - x)).is_some() {
            return Self { corners: all.into() };
        }
        // On one line: its ends are the least and the greatest in any order that follows the line.
        let least = all.iter().copied().reduce(|p, q| if before(q.1, p.1) { q } else { p });
        let greatest = all.iter().copied().reduce(|p, q| if before(p.1, q.1) { q } else { p });
        let greatest = greatest.filter(|q| least.is_none_or(|p| p.1 != q.1));
        Self { corners: least.into_iter().chain(greatest).collect() }
    }

    /// The edges by the places of their ends in `corners`, the lower corner number first.
    pub(super) fn edges(&self) -> &'static [[usize; 2]] {
        match self.corners.len() {
            3 => &[[0, 1], [1, 2], [0, 2]],
            2 => &[[0, 1]],
            _ => &[],
        }
    }

    pub(super) fn place(&self, at: usize) -> Vec3 {
        self.corners[at].1
    }

    /// Corner numbers of an edge's ends, the lower first.
    pub(super) fn names(&self, [i, j]: [usize; 2]) -> [u8; 2] {
        let (i, j) = (self.corners[i].0, self.corners[j].0);
        [i.min(j), i.max(j)]
    }

    /// The projection in which the triangle has an area.
    pub(super) fn projection(&self) -> Option<Projection> {
        let [(_, a), (_, b), (_, c)] = self.corners[..] else { return None };
        Projection::spreading(a, b, c, normal(a, b, c))
    }
}

fn normal(a: Vec3, b: Vec3, c: Vec3) -> DVec3 {
    let [a, b, c] = [a, b, c].map(Vec3::as_dvec3);
    (b - a).cross(c - a)
}

/// By x, then y, then z.
fn before(p: Vec3, q: Vec3) -> bool {
    p.to_array() < q.to_array()
}
