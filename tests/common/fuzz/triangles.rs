//! Two triangles: the same answer whichever comes first and however corners are ordered, and that of integers.

use kinora::{
    collide::{TriangleContact, triangle_contact, triangles_meet},
    glam::{DVec3, Vec3},
};

use crate::{decode::Bytes, integers::triangles_meet as meet_by_integers};

const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];

/// Corners of both from a few points, so that they share some.
fn triangles(bytes: &mut Bytes<'_>) -> [[Vec3; 3]; 2] {
    let shared = bytes.byte();
    let a: [Vec3; 3] = std::array::from_fn(|_| bytes.vec3());
    let b = std::array::from_fn(|i| match shared >> (2 * i) & 3 {
        0 => a[bytes.below(3)],
        1 => {
            // A point of an edge, or of the plane, as well as f32 can.
            let (s, t) = (f32::from(bytes.byte() & 7) * 0.25 - 0.5, f32::from(bytes.byte() & 7) * 0.25 - 0.5);
            a[0] + (a[1] - a[0]) * s + (a[2] - a[0]) * t
        }
        _ => bytes.vec3(),
    });
    [a, b]
}

/// True when `p` is in `points`, up to the error that points may have.
fn holds(points: &[DVec3], p: DVec3, size: f64) -> bool {
    points.iter().any(|q| (*q - p).abs().max_element() <= size * 2.0_f64.powi(-30))
}

fn check_contact(due: &TriangleContact, contact: &TriangleContact, size: f64) {
    assert_eq!((due.dim, due.points.len()), (contact.dim, contact.points.len()), "{due:?} {contact:?}");
    assert!(contact.points.iter().all(|&p| holds(&due.points, p, size)), "{due:?} {contact:?}");
}

/// Decodes `data` and asserts everything.
pub(crate) fn check(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    let [a, b] = triangles(&mut bytes);
    let meet = triangles_meet(&a, &b);
    assert_eq!(meet, meet_by_integers(&a, &b), "{a:?} {b:?}");
    let contact = triangle_contact(&a, &b);
    assert_eq!(meet, contact.is_some(), "{a:?} {b:?}");
    let size = a.iter().chain(&b).map(|c| f64::from(c.abs().max_element())).fold(0.0, f64::max);
    if let Some(contact) = &contact {
        let dims = [1, 2, 3, 4, 5, 6].map(|n: u8| (n - 1).min(2));
        assert_eq!(contact.dim, dims[contact.points.len() - 1]);
        assert!(contact.points.iter().all(|p| p.is_finite() && p.abs().max_element() <= size * (1.0 + 1e-9)));
    }
    for order_a in ORDERS {
        for order_b in [ORDERS[usize::from(data.len() as u8 % 6)], ORDERS[0], ORDERS[4]] {
            let (x, y) = (order_a.map(|i| a[i]), order_b.map(|i| b[i]));
            for (x, y) in [(&x, &y), (&y, &x)] {
                assert_eq!(triangles_meet(x, y), meet, "{x:?} {y:?}");
                match (&contact, triangle_contact(x, y)) {
                    (Some(due), Some(contact)) => check_contact(due, &contact, size),
                    (due, contact) => assert_eq!(due.is_some(), contact.is_some(), "{x:?} {y:?}"),
                }
            }
        }
    }
}
