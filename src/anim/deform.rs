//! Pose to world-space vertices: the one geometry that is traced, touched, measured and printed.
//!
//! Each vertex is morphed, then skinned or placed, all in `f64`, and rounded once to `f32`; a coordinate beyond
//! the range of `f32` becomes the largest finite one. Vertices are taken in blocks that stay in the first
//! cache level; the loops are plain arithmetic on arrays, compiled for the machine's SIMD level, and give the
//! same bits on each.

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use super::{
    Pose,
    deform_fast::DeformFast,
    pose::{JointColumns, JointRow},
};
#[cfg(doc)]
use crate::geom::Forms;
use crate::{
    geom::Precision,
    scene::{Influences, MeshPart, PartInstance, Scene},
    simd::{Simd, SimdLevel, Task, dispatch},
};

/// Vertices worked on together.
const BLOCK: usize = 64;

/// Vertices a parallel task takes.
pub const DEFORM_GRAIN: usize = 4096;

/// What takes morphed mesh-space vertices to the world.
#[derive(Clone, Copy, Debug)]
pub(super) enum Placement<'a> {
    /// One matrix for all.
    Whole(DAffine3),
    /// A blend of joint matrices each.
    Skinned {
        /// Joints and weights.
        influences: &'a Influences,
        /// Joint matrices.
        palette: &'a [JointColumns],
        /// The same, rounded.
        fast_palette: &'a [JointRow],
    },
}

/// How an instance is placed: by its skin if node and part have one, else by its node and copy.
pub(super) fn placement<'a>(scene: &'a Scene, pose: &'a Pose, instance: PartInstance) -> Placement<'a> {
    let node = &scene.nodes[instance.node.index()];
    if let (Some(skin), Some(influences)) = (node.skin, &scene.part(instance).influences) {
        let palette = pose.palette(skin);
        if !palette.is_empty() && influences.per_vertex > 0 {
            return Placement::Skinned { influences, palette, fast_palette: pose.fast_palette(skin) };
        }
    }
    Placement::Whole(world_from_instance(scene, pose, instance))
}

/// The matrix that takes every rest position of a part instance to the world, if one does: no skin, no morph targets.
pub(crate) fn whole_placement(scene: &Scene, pose: &Pose, instance: PartInstance) -> Option<DAffine3> {
    match placement(scene, pose, instance) {
        Placement::Whole(matrix) if scene.part(instance).targets.is_empty() => Some(matrix),
        _ => None,
    }
}

/// The global transform of an instance's node with that of its copy applied first.
fn world_from_instance(scene: &Scene, pose: &Pose, instance: PartInstance) -> DAffine3 {
    let world_from_node = pose.world_from_node(instance.node);
    let copies = scene.nodes[instance.node.index()].copies.as_deref();
    match (copies, instance.copy) {
        (Some(copies), Some(copy)) => {
            super::transform::product(world_from_node, &super::transform::from_trs(&copies[copy as usize]))
        }
        _ => *world_from_node,
    }
}

/// Writes the world-space vertices of one part instance: morph, then skin or place, in `f64`, rounded once.
///
/// `out` has the part's vertex count; POSITION accessor order. A skinned part ignores its node's transform and
/// copies; its weights are divided by their sum, and a vertex whose weights sum to zero follows its first
/// joint (the skin's first where it names none that exists). No allocation, one thread.
///
/// # Panics
/// When `out` has another length than the part has vertices.
pub fn deform(scene: &Scene, pose: &Pose, instance: PartInstance, out: &mut [Vec3]) {
    assert_eq!(out.len(), scene.part(instance).positions.len(), "one place a vertex");
    deform_range(scene, pose, instance, 0, out);
}

/// [`deform`] for the vertices `first .. first + out.len()`.
///
/// # Panics
/// When the range goes past the part's vertices.
pub fn deform_range(scene: &Scene, pose: &Pose, instance: PartInstance, first: usize, out: &mut [Vec3]) {
    deform_range_at(SimdLevel::best(), scene, pose, instance, first, out);
}

/// [`deform_range`] compiled for a given level; the bits do not depend on it.
///
/// # Panics
/// When the range goes past the part's vertices or the machine lacks `level`.
pub fn deform_range_at(
    level: SimdLevel,
    scene: &Scene,
    pose: &Pose,
    instance: PartInstance,
    first: usize,
    out: &mut [Vec3],
) {
    deform_range_as(Precision::Exact, level, scene, pose, instance, first, out);
}

/// [`deform_range_at`] in a given precision: [`Precision::Fast`] works in `f32`, as [`Forms::deform`] says, and not quite to the same bits.
///
/// # Panics
/// When the range goes past the part's vertices or the machine lacks `level`.
pub fn deform_range_as(
    precision: Precision,
    level: SimdLevel,
    scene: &Scene,
    pose: &Pose,
    instance: PartInstance,
    first: usize,
    out: &mut [Vec3],
) {
    let part = scene.part(instance);
    assert!(first <= part.positions.len() && out.len() <= part.positions.len() - first, "range within the part");
    let weights = pose.weights(instance.node);
    let placement = placement(scene, pose, instance);
    match precision {
        Precision::Exact => dispatch(level, Deform { part, weights, placement, first, out }),
        Precision::Fast => dispatch(level, DeformFast { part, weights, placement, first, out }),
    }
}

/// [`deform`] in parallel over ranges of vertices, in the current rayon pool, compiled for a given level. The same
/// bits.
///
/// # Panics
/// When `out` has another length than the part has vertices, or the machine lacks `level`.
pub fn deform_parallel(level: SimdLevel, scene: &Scene, pose: &Pose, instance: PartInstance, out: &mut [Vec3]) {
    deform_parallel_as(Precision::Exact, level, scene, pose, instance, out);
}

/// [`deform_parallel`] in a given precision, as [`deform_range_as`].
///
/// # Panics
/// As there.
pub fn deform_parallel_as(
    precision: Precision,
    level: SimdLevel,
    scene: &Scene,
    pose: &Pose,
    instance: PartInstance,
    out: &mut [Vec3],
) {
    assert_eq!(out.len(), scene.part(instance).positions.len(), "one place a vertex");
    if out.len() <= DEFORM_GRAIN {
        return deform_range_as(precision, level, scene, pose, instance, 0, out);
    }
    out.par_chunks_mut(DEFORM_GRAIN)
        .enumerate()
        .for_each(|(chunk, out)| deform_range_as(precision, level, scene, pose, instance, chunk * DEFORM_GRAIN, out));
}

/// The vertices of [`deform`] before they are rounded: what its error is measured against.
///
/// Coordinates beyond the range of `f32` stay as they are. Otherwise as there.
///
/// # Panics
/// When `out` has another length than the part has vertices.
pub fn deform_unrounded(scene: &Scene, pose: &Pose, instance: PartInstance, out: &mut [DVec3]) {
    let part = scene.part(instance);
    assert_eq!(out.len(), part.positions.len(), "one place a vertex");
    let weights = pose.weights(instance.node);
    dispatch(SimdLevel::best(), Deform { part, weights, placement: placement(scene, pose, instance), first: 0, out });
}

/// What a vertex is kept as.
trait Kept: Copy {
    /// From world-space coordinates; the fourth number does not count.
    fn from_wide(v: &[f64; 4]) -> Self;
}

impl Kept for Vec3 {
    #[inline(always)]
    fn from_wide(v: &[f64; 4]) -> Self {
        rounded(v)
    }
}

impl Kept for DVec3 {
    #[inline(always)]
    fn from_wide(v: &[f64; 4]) -> Self {
        Self::new(v[0], v[1], v[2])
    }
}

/// The work of one range.
struct Deform<'a, V> {
    part: &'a MeshPart,
    weights: &'a [f64],
    placement: Placement<'a>,
    first: usize,
    out: &'a mut [V],
}

impl<V: Kept> Task for Deform<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let mut rest = [[0.0; 3]; BLOCK];
        let mut world = [[0.0; 4]; BLOCK];
        for (k, out) in self.out.chunks_mut(BLOCK).enumerate() {
            let first = self.first + k * BLOCK;
            let rest = &mut rest[..out.len()];
            let world = &mut world[..out.len()];
            morph(self.part, self.weights, first, rest);
            match self.placement {
                Placement::Whole(matrix) => place(&JointColumns::from(&matrix), rest, world),
                Placement::Skinned { influences, palette, .. } => match influences.per_vertex {
                    4 => skin::<4>(influences, palette, first, rest, world),
                    8 => skin::<8>(influences, palette, first, rest, world),
                    _ => skin_any(influences, palette, first, rest, world),
                },
            }
            for (out, v) in out.iter_mut().zip(world) {
                *out = V::from_wide(v);
            }
        }
    }
}

/// Rest positions from vertex `first` on, plus the weighted displacements.
#[inline(always)]
fn morph(part: &MeshPart, weights: &[f64], first: usize, block: &mut [[f64; 3]]) {
    let range = first..first + block.len();
    let flat = block.as_flattened_mut();
    let rest: &[f32] = bytemuck::cast_slice(&part.positions[range.clone()]);
    for (v, &p) in flat.iter_mut().zip(rest) {
        *v = f64::from(p);
    }
    for (target, &weight) in part.targets.iter().zip(weights) {
        if weight == 0.0 || target.positions.is_empty() {
            continue;
        }
        let shift: &[f32] = bytemuck::cast_slice(&target.positions[range.clone()]);
        for (v, &d) in flat.iter_mut().zip(shift) {
            *v += weight * f64::from(d);
        }
    }
}

/// One matrix for all vertices of the block.
#[inline(always)]
fn place(matrix: &JointColumns, rest: &[[f64; 3]], world: &mut [[f64; 4]]) {
    for (p, out) in rest.iter().zip(world) {
        *out = transformed(&matrix.0, p);
    }
}

/// A blend of N joint matrices a vertex.
///
/// Written as whole-array expressions: the vectoriser makes four-wide code of these, which it does not of the
/// same sums in nested loops (measured: 7 against 13 ns a vertex with AVX2).
#[inline(always)]
fn skin<const N: usize>(
    influences: &Influences,
    palette: &[JointColumns],
    first: usize,
    rest: &[[f64; 3]],
    world: &mut [[f64; 4]],
) {
    let joints = influences.joints[first * N..].as_chunks::<N>().0;
    let weights = influences.weights[first * N..].as_chunks::<N>().0;
    for (((p, out), joints), weights) in rest.iter().zip(world).zip(joints).zip(weights) {
        let mut weights = weights.map(f64::from);
        let mut sum = weights.iter().fold(0.0, |sum, w| sum + w);
        let mut joints = *joints;
        if sum == 0.0 {
            joints = [sole_joint(joints[0], palette.len()); N];
            weights = std::array::from_fn(|k| if k == 0 { 1.0 } else { 0.0 });
            sum = 1.0;
        }
        let joints: [&[[f64; 4]; 4]; N] = std::array::from_fn(|k| &palette[usize::from(joints[k])].0);
        let column = |a: usize| {
            let mut blend: [f64; 4] = std::array::from_fn(|i| weights[0] * joints[0][a][i]);
            for k in 1..N {
                blend = std::array::from_fn(|i| blend[i] + weights[k] * joints[k][a][i]);
            }
            blend
        };
        let inv = 1.0 / sum;
        let placed = transformed(&[column(0), column(1), column(2), column(3)], p);
        *out = std::array::from_fn(|i| placed[i] * inv);
    }
}

/// [`skin`] for any number of influences.
#[inline(always)]
fn skin_any(
    influences: &Influences,
    palette: &[JointColumns],
    first: usize,
    rest: &[[f64; 3]],
    world: &mut [[f64; 4]],
) {
    let n = influences.per_vertex;
    let joints = influences.joints[first * n..].chunks_exact(n);
    let weights = influences.weights[first * n..].chunks_exact(n);
    for (((p, out), joints), weights) in rest.iter().zip(world).zip(joints).zip(weights) {
        let (columns, sum) = blended(joints, weights, palette);
        let inv = 1.0 / sum;
        *out = transformed(&columns, p).map(|v| v * inv);
    }
}

/// The joint that a vertex follows whose weights sum to zero: its first, or the skin's first when there is no such
/// joint.
pub(super) fn sole_joint(first: u16, count: usize) -> u16 {
    if usize::from(first) < count { first } else { 0 }
}

/// The weighted sum of joint matrices, not divided, and the sum of the weights; the first joint's matrix and 1
/// when that sum is zero.
#[inline(always)]
pub(super) fn blended(joints: &[u16], weights: &[f32], palette: &[JointColumns]) -> ([[f64; 4]; 4], f64) {
    let sum = weights.iter().fold(0.0, |sum, &w| sum + f64::from(w));
    if sum == 0.0 {
        return (palette[usize::from(sole_joint(joints[0], palette.len()))].0, 1.0);
    }
    let mut blend = [[0.0; 4]; 4];
    for (&joint, &weight) in joints.iter().zip(weights) {
        let weight = f64::from(weight);
        for (b, c) in blend.as_flattened_mut().iter_mut().zip(palette[usize::from(joint)].0.as_flattened()) {
            *b += weight * c;
        }
    }
    (blend, sum)
}

/// The matrix with these columns times (p, 1); the fourth entry is 0.
#[inline(always)]
fn transformed(columns: &[[f64; 4]; 4], p: &[f64; 3]) -> [f64; 4] {
    let [x, y, z, t] = columns;
    std::array::from_fn(|i| x[i] * p[0] + y[i] * p[1] + z[i] * p[2] + t[i])
}

/// One point of mesh space placed by a matrix, as a vertex is.
pub(super) fn placed(matrix: &DAffine3, p: Vec3) -> Vec3 {
    rounded(&transformed(&JointColumns::from(matrix).0, &p.as_dvec3().to_array()))
}

/// To `f32`, saturating; NaN stays NaN, and zero has no sign: where a channel holds the rest value but for the
/// sign of a zero, the bits stay the same.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the one rounding, in range")]
fn rounded(v: &[f64; 4]) -> Vec3 {
    const MAX: f64 = f32::MAX as f64;
    let narrow = |x: f64| x.clamp(-MAX, MAX) as f32 + 0.0;
    Vec3::new(narrow(v[0]), narrow(v[1]), narrow(v[2]))
}
