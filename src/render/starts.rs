//! Where secondary rays start, for hits that come from anywhere: what a block does with its lanes, by itself.

use glam::Vec3;

use super::{
    departure::Departure,
    offset::off_surface,
    patch::Patch,
    wide::{LANES, Row, V3, put3},
};
use crate::{
    geom::Precision,
    simd::{Lanes, Simd, SimdLevel, Task, dispatch},
};

/// A ray that is about to leave a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaving {
    pub(crate) corners: [Vec3; 3],
    /// Weights of the second and third corner.
    pub(crate) weights: [f32; 2],
    /// Where it goes.
    pub(crate) dir: Vec3,
}

/// The starts of all rays, in the form of [`Forms::offset`](crate::geom::Forms) that `offset` names.
///
/// # Panics
/// When `out` is shorter than `leaving`.
pub(crate) fn starts(leaving: &[Leaving], offset: Precision, level: SimdLevel, out: &mut [Vec3]) {
    dispatch(level, Starts { leaving, offset, out: &mut out[..leaving.len()] });
}

struct Starts<'a> {
    leaving: &'a [Leaving],
    offset: Precision,
    out: &'a mut [Vec3],
}

impl Task for Starts<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        for (leaving, out) in self.leaving.chunks(S::F::LEN).zip(self.out.chunks_mut(S::F::LEN)) {
            let rows = block::<S>(leaving, self.offset);
            for (lane, out) in out.iter_mut().enumerate() {
                let lane = lane & (LANES - 1);
                *out = Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane]);
            }
        }
    }
}

/// The starts of a block of at most as many rays as there are lanes.
#[inline(always)]
fn block<S: Simd>(leaving: &[Leaving], offset: Precision) -> [Row; 3] {
    let (mut corners, mut dirs, mut weights) = ([[[0.0; LANES]; 3]; 3], [[0.0; LANES]; 3], [[0.0; LANES]; 2]);
    for (lane, l) in leaving.iter().enumerate() {
        for (rows, corner) in corners.iter_mut().zip(l.corners) {
            put3(rows, lane, corner);
        }
        put3(&mut dirs, lane, l.dir);
        [weights[0][lane & (LANES - 1)], weights[1][lane & (LANES - 1)]] = l.weights;
    }
    let [a, b, c] = &corners;
    let [u, v] = &weights;
    let patch = Patch::new([V3::<S::F>::load(a), V3::load(b), V3::load(c)], S::F::load(u), S::F::load(v));
    let (point, dir) = (patch.blend3(patch.corners), V3::load(&dirs));
    let n_geom = patch.cross.unit_or(dir);
    let start = match offset {
        Precision::Exact => {
            let mask = if leaving.len() >= 32 { u32::MAX } else { (1 << leaving.len()) - 1 };
            Departure::new(&patch, point, mask).origin(n_geom, dir)
        }
        Precision::Fast => off_surface(point, n_geom, dir),
    };
    start.rows()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::exact::side;

    #[test]
    fn exact_starts_lie_on_the_side_they_leave_to_at_every_level_alike() {
        let random = |i: u64, what: u64| {
            let bits = crate::render::pattern::hash(i << 8 | what);
            f32::from_bits(0x3f80_0000 | (bits >> 9)) * 2.0 - 3.0
        };
        let vector = |i: u64, what: u64| Vec3::new(random(i, what), random(i, what + 1), random(i, what + 2));
        let leaving: Vec<Leaving> = (0..1003)
            .map(|i| {
                let u = f32::midpoint(random(i, 20), 1.0);
                let v = f32::midpoint(random(i, 21), 1.0) * (1.0 - u);
                let corners = [0, 4, 8].map(|what| vector(i, what) * 10.0);
                Leaving { corners, weights: [u, v], dir: vector(i, 12) }
            })
            .collect();
        for offset in Precision::ALL {
            let mut first: Option<Vec<Vec3>> = None;
            for level in SimdLevel::available() {
                let mut out = vec![Vec3::ZERO; leaving.len()];
                starts(&leaving, offset, level, &mut out);
                assert!(*first.get_or_insert_with(|| out.clone()) == out, "{offset:?}, {level:?}");
                for (l, start) in leaving.iter().zip(&out) {
                    let [a, b, c] = l.corners;
                    let point = a + (b - a) * l.weights[0] + (c - a) * l.weights[1];
                    assert!(start.distance(point) < 0.05, "{offset:?}: {l:?}");
                    let leaves_to = crate::geom::exact::slope(&l.corners, l.dir);
                    assert!(offset == Precision::Fast || side(&l.corners, *start) == leaves_to, "{l:?}");
                }
            }
        }
    }
}
