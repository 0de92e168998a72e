use glam::Vec3;

use super::{actor::Actor, layout::Chunk};
use crate::{anim::deform_range_as, geom::Precision, simd::SimdLevel};

/// Writes the world-space vertices of a run of chunks, in parallel in the current rayon pool.
///
/// No allocation; the same bits for any number of threads.
pub(super) fn deform_chunks(precision: Precision, chunks: &[Chunk], actors: &[Actor], out: &mut [Vec3]) {
    match chunks {
        [] => {}
        [only] => {
            let actor = &actors[only.actor];
            let level = SimdLevel::best();
            deform_range_as(precision, level, &actor.scene, &actor.pose, only.part, only.vertices.start, out);
        }
        _ => {
            let (left, right) = chunks.split_at(chunks.len() / 2);
            let (left_out, right_out) = out.split_at_mut(left.iter().map(|c| c.vertices.len()).sum());
            rayon::join(
                || deform_chunks(precision, left, actors, left_out),
                || deform_chunks(precision, right, actors, right_out),
            );
        }
    }
}
