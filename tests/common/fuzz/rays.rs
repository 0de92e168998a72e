//! Random soups and rays: every structure at every SIMD level against `list`, and `list` against integers.

use kinora::{
    accel::{AccelKind, AccelSpec, AnyAccel},
    geom::{Hit, Ray},
    simd::SimdLevel,
};

use crate::{
    decode::Bytes,
    integers::closest_by_integers,
    trace::{Mesh, closest, in_packets, occluded},
};

/// Rays that integers answer too; they take most of the time.
const BY_INTEGERS: usize = 3;

pub(crate) fn build(kind: AccelKind, mesh: &Mesh) -> AnyAccel {
    let accel = AccelSpec::new(kind).build(&mesh.prims()).expect("a small mesh builds");
    accel.validate(&mesh.prims()).unwrap_or_else(|v| panic!("{kind}: {v:?}"));
    accel
}

/// A hit's bits, so that -0 is not 0 and NaN equals itself.
fn bits(hits: &[Option<Hit>]) -> Vec<Option<[u32; 5]>> {
    hits.iter().map(|h| h.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim.0, h.instance.0])).collect()
}

/// Asserts that `accel` answers as `due` says, singly and in packets, closest and any, at every level.
pub(crate) fn answers(accel: &AnyAccel, mesh: &Mesh, rays: &[Ray], due: &[Option<Hit>]) {
    let blocked_due: Vec<_> = due.iter().map(Option::is_some).collect();
    let kind = accel.kind();
    for level in SimdLevel::available() {
        let hits = closest(accel, &mesh.prims(), rays, level);
        assert_eq!(bits(&hits), bits(due), "{kind} at {level}: {rays:?} {mesh:?}");
        let blocked = occluded(accel, &mesh.prims(), rays, level);
        assert_eq!(blocked, blocked_due, "{kind} at {level}, any: {rays:?} {mesh:?}");
        let (hits, blocked) = in_packets(accel, &mesh.prims(), rays, level);
        assert_eq!(bits(&hits), bits(due), "{kind} at {level}, packets: {rays:?} {mesh:?}");
        assert_eq!(blocked, blocked_due, "{kind} at {level}, packets, any: {rays:?} {mesh:?}");
    }
}

/// Decodes `data` and asserts everything.
pub(crate) fn check(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    let mesh = bytes.mesh(24, 24);
    let rays: Vec<_> = (0..=bytes.below(12)).map(|_| bytes.ray(&mesh)).collect();
    let list = build(AccelKind::List, &mesh);
    let due = closest(&list, &mesh.prims(), &rays, SimdLevel::Scalar);
    for (ray, hit) in rays.iter().zip(&due).take(BY_INTEGERS) {
        let exact = closest_by_integers(ray, &mesh);
        assert_eq!(bits(&[*hit]), bits(&[exact]), "list against integers: {ray:?} {mesh:?}");
    }
    for &kind in AccelKind::ALL {
        answers(&build(kind, &mesh), &mesh, &rays, &due);
    }
}
