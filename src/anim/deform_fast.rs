//! The vertices of [`Forms::deform`](crate::geom::Forms) fast: morphed and skinned in `f32`, joint matrices and morph weights rounded
//! first.
//!
//! Half the bytes a joint and twice the lanes of the `f64` path. Off by a few roundings of the largest term of a sum, so by more than a
//! rounding of the result where joints stand far from the origin for the size of the mesh, and by more the more targets are active. No
//! product is contracted into a sum, so levels give the same bits.

use glam::{DAffine3, Vec3};

use super::{
    deform::{Placement, sole_joint},
    pose::JointRow,
};
use crate::{
    scene::{Influences, MeshPart},
    simd::{Lanes, Simd, Task},
};

/// Vertices worked on together.
const BLOCK: usize = 64;

/// The work of one range.
pub(super) struct DeformFast<'a> {
    pub(super) part: &'a MeshPart,
    pub(super) weights: &'a [f64],
    pub(super) placement: Placement<'a>,
    pub(super) first: usize,
    pub(super) out: &'a mut [Vec3],
}

impl Task for DeformFast<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Self { part, weights, placement, first, out } = self;
        let rest = &part.positions[first..first + out.len()];
        let morphs = part.targets.iter().zip(weights).any(|(target, &w)| w != 0.0 && !target.positions.is_empty());
        if !morphs {
            return place_all::<S>(&placement, first, rest, out);
        }
        let mut block = [Vec3::ZERO; BLOCK];
        for (k, (rest, out)) in rest.chunks(BLOCK).zip(out.chunks_mut(BLOCK)).enumerate() {
            let (first, block) = (first + k * BLOCK, &mut block[..rest.len()]);
            morph(part, weights, first, rest, block);
            place_all::<S>(&placement, first, block, out);
        }
    }
}

/// Rest positions plus the weighted displacements.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the rounding is what makes it fast")]
fn morph(part: &MeshPart, weights: &[f64], first: usize, rest: &[Vec3], block: &mut [Vec3]) {
    block.copy_from_slice(rest);
    let flat: &mut [f32] = bytemuck::cast_slice_mut(block);
    for (target, &weight) in part.targets.iter().zip(weights) {
        if weight == 0.0 || target.positions.is_empty() {
            continue;
        }
        let weight = weight as f32;
        let shift: &[f32] = bytemuck::cast_slice(&target.positions[first..first + rest.len()]);
        for (v, &d) in flat.iter_mut().zip(shift) {
            *v += weight * d;
        }
    }
}

#[inline(always)]
fn place_all<S: Simd>(placement: &Placement<'_>, first: usize, rest: &[Vec3], out: &mut [Vec3]) {
    match placement {
        Placement::Whole(matrix) => place::<S>(matrix, rest, out),
        Placement::Skinned { influences, fast_palette: palette, .. } => match influences.per_vertex {
            4 => skin::<S, 4>(influences, palette, first, rest, out),
            8 => skin::<S, 8>(influences, palette, first, rest, out),
            n => skin_any::<S>(influences, n, palette, first, rest, out),
        },
    }
}

/// One matrix for all vertices.
#[inline(always)]
fn place<S: Simd>(matrix: &DAffine3, rest: &[Vec3], out: &mut [Vec3]) {
    let columns = JointRow::from(matrix);
    for (&p, out) in rest.iter().zip(out) {
        *out = transformed::<S>(&columns.0, p, S::F4::splat(1.0));
    }
}

/// A blend of N joint matrices a vertex.
#[inline(always)]
fn skin<S: Simd, const N: usize>(
    influences: &Influences,
    palette: &[JointRow],
    first: usize,
    rest: &[Vec3],
    out: &mut [Vec3],
) {
    let joints = influences.joints[first * N..].as_chunks::<N>().0;
    let weights = influences.weights[first * N..].as_chunks::<N>().0;
    for (((&p, out), joints), weights) in rest.iter().zip(out).zip(joints).zip(weights) {
        *out = skinned::<S>(joints, weights, palette, p);
    }
}

/// [`skin`] for any number of influences.
#[inline(always)]
fn skin_any<S: Simd>(
    influences: &Influences,
    n: usize,
    palette: &[JointRow],
    first: usize,
    rest: &[Vec3],
    out: &mut [Vec3],
) {
    let joints = influences.joints[first * n..].chunks_exact(n);
    let weights = influences.weights[first * n..].chunks_exact(n);
    for (((&p, out), joints), weights) in rest.iter().zip(out).zip(joints).zip(weights) {
        *out = skinned::<S>(joints, weights, palette, p);
    }
}

/// A vertex placed by the weighted mean of joint matrices; by the sole joint where the weights sum to zero.
#[inline(always)]
fn skinned<S: Simd>(joints: &[u16], weights: &[f32], palette: &[JointRow], p: Vec3) -> Vec3 {
    let mut sum = 0.0;
    for weight in weights {
        sum += weight;
    }
    if sum == 0.0 {
        let sole = sole_joint(joints[0], palette.len());
        return transformed::<S>(&palette[usize::from(sole)].0, p, S::F4::splat(1.0));
    }
    let mut blend = [0.0; 16];
    for at in (0..16).step_by(S::F::LEN) {
        let mut part = S::F::load(&palette[usize::from(joints[0])].0[at..]) * S::F::splat(weights[0]);
        for (&joint, &weight) in joints[1..].iter().zip(&weights[1..]) {
            part = part + S::F::load(&palette[usize::from(joint)].0[at..]) * S::F::splat(weight);
        }
        part.store(&mut blend[at..]);
    }
    transformed::<S>(&blend, p, S::F4::splat(1.0 / sum))
}

/// The matrix with these columns times (p, 1), times `scale`; saturating, NaN stays NaN, zero has no sign.
#[inline(always)]
fn transformed<S: Simd>(columns: &[f32; 16], p: Vec3, scale: S::F4) -> Vec3 {
    let (x, y) = (S::F4::load(columns), S::F4::load(&columns[4..]));
    let (z, t) = (S::F4::load(&columns[8..]), S::F4::load(&columns[12..]));
    let placed = (x * S::F4::splat(p.x) + y * S::F4::splat(p.y)) + (z * S::F4::splat(p.z) + t);
    let placed = placed * scale;
    let placed = S::F4::splat(f32::MIN).max(S::F4::splat(f32::MAX).min(placed)) + S::F4::splat(0.0);
    let mut row = [0.0; 4];
    placed.store(&mut row);
    Vec3::new(row[0], row[1], row[2])
}
