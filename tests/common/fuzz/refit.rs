//! Sequences of positions: refitted structures are valid and answer as fresh ones do.

use kinora::{
    accel::{AccelKind, AnyAccel, Refit},
    geom::Ray,
    simd::SimdLevel,
};

use crate::{
    decode::Bytes,
    rays::{answers, build},
    trace::{Mesh, closest},
};

/// Moves some vertices, all of them, back to the first pose, or into one point.
fn moved(mesh: &Mesh, first: &Mesh, bytes: &mut Bytes<'_>) -> Mesh {
    let mut next = mesh.clone();
    match bytes.below(4) {
        0 => next.positions.clone_from(&first.positions),
        1 => {
            let point = bytes.vec3();
            next.positions.fill(point);
        }
        2 => {
            let shift = bytes.vec3();
            next.positions.iter_mut().for_each(|p| *p += shift);
        }
        _ => {
            for _ in 0..=bytes.below(8) {
                let vertex = bytes.below(next.positions.len());
                next.positions[vertex] = bytes.vec3();
            }
        }
    }
    next
}

/// Decodes `data` and asserts everything.
pub(crate) fn check(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    let first = bytes.mesh(24, 24);
    // Two copies each, which take turns as the target of the refit.
    let mut accels: Vec<[AnyAccel; 2]> = AccelKind::ALL
        .iter()
        .map(|&kind| build(kind, &first))
        .filter(AnyAccel::refits)
        .map(|a| [a.clone(), a])
        .collect();
    let mut mesh = first.clone();
    for _ in 0..=bytes.below(5) {
        if bytes.is_empty() {
            break;
        }
        mesh = moved(&mesh, &first, &mut bytes);
        let rays: Vec<Ray> = (0..=bytes.below(4)).map(|_| bytes.ray(&mesh)).collect();
        let fresh = build(AccelKind::List, &mesh);
        let due = closest(&fresh, &mesh.prims(), &rays, SimdLevel::Scalar);
        for [from, to] in &mut accels {
            let kind = from.kind();
            assert_eq!(from.refit_into(to, &mesh.prims()), Refit::Done, "{kind}: {mesh:?}");
            to.validate(&mesh.prims()).unwrap_or_else(|v| panic!("{kind}: {v:?} {mesh:?}"));
            answers(to, &mesh, &rays, &due);
            std::mem::swap(from, to);
        }
    }
    // Another mesh by the same name is not refitted to.
    let mut prims = mesh.prims();
    prims.topology_epoch += 1;
    for [from, to] in &mut accels {
        assert_eq!(from.refit_into(to, &prims), Refit::NeedsRebuild, "{}", from.kind());
    }
}
