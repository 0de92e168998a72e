//! Continuous detection between snapshots against every pair of features, and the hard shared motions through a world.
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

mod common;

use std::collections::BTreeSet;

use kinora::{
    collide::{
        CollisionConfig, CollisionWorld, ContactOptions, Continuous, Features, ObjectId, PartId, Snapshot,
        TrianglePair, triangles_meet,
    },
    glam::{DAffine3, DVec3, Vec3},
};
use proptest::{collection::vec, prelude::*};

/// A strip of triangles over `points`, each sharing an edge with the next.
fn strip(points: &[Vec3]) -> Vec<[u32; 3]> {
    (2..points.len() as u32).map(|i| [i - 2, i - 1, i]).collect()
}

fn points(count: usize) -> impl Strategy<Value = Vec<Vec3>> {
    vec([-8_i8..8, -8_i8..8, -8_i8..8].prop_map(|p| Vec3::from(p.map(f32::from)) * 0.25), count)
}

fn step(start: [&[Vec3]; 2], end: [&[Vec3]; 2]) -> [Snapshot; 2] {
    let mut world = CollisionWorld::new(&CollisionConfig::default()).unwrap();
    for points in start {
        world.add_mesh("strip", points.to_vec(), strip(points), DAffine3::IDENTITY).unwrap();
    }
    let before = world.snapshot().unwrap();
    for (object, points) in (0..).map(ObjectId).zip(end) {
        world.set_vertices(object, points).unwrap();
    }
    [before, world.snapshot().unwrap()]
}

fn edges(triangles: &[[u32; 3]]) -> BTreeSet<[u32; 2]> {
    let of = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[a, b]| [a.min(b), a.max(b)]);
    triangles.iter().flat_map(of).collect()
}

/// Features of two parts that touch on the way, every pair asked; edges by ascending vertices.
fn brute(before: &Snapshot, after: &Snapshot, parts: [u32; 2], settings: &Continuous) -> BTreeSet<Features> {
    let view = |s: &Snapshot, i: usize| {
        let part = s.part(PartId(parts[i])).unwrap();
        let wide: Vec<DVec3> = part.vertices().iter().map(|v| v.as_dvec3()).collect();
        (wide, part.triangles().to_vec())
    };
    let within = parts[0] == parts[1];
    let ([a0, b0], [a1, b1]) = ([view(before, 0), view(before, 1)], [view(after, 0), view(after, 1)]);
    let place = |i: usize, v: u32| before.part(PartId(parts[i])).unwrap().vertices()[v as usize];
    let near = |x: &[u32], y: &[u32]| within && x.iter().any(|&p| y.iter().any(|&q| place(0, p) == place(1, q)));
    let mut found = BTreeSet::new();
    let used = |t: &[[u32; 3]]| t.iter().flatten().copied().collect::<BTreeSet<u32>>();
    let mut faces = |points: &(Vec<DVec3>, Vec<[u32; 3]>),
                     later: &[DVec3],
                     mesh: &(Vec<DVec3>, Vec<[u32; 3]>),
                     moved: &[DVec3],
                     first: bool| {
        for vertex in used(&points.1) {
            for (triangle, corners) in (0..).zip(&mesh.1) {
                let near = if first { near(&[vertex], corners) } else { near(corners, &[vertex]) };
                if near {
                    continue;
                }
                let at = |p: &[DVec3], m: &[DVec3]| {
                    [p[vertex as usize], m[corners[0] as usize], m[corners[1] as usize], m[corners[2] as usize]]
                };
                if settings.vertex_face(&at(&points.0, &mesh.0), &at(later, moved)).is_some() {
                    found.insert(if first {
                        Features::VertexFace { vertex, triangle }
                    } else {
                        Features::FaceVertex { triangle, vertex }
                    });
                }
            }
        }
    };
    faces(&a0, &a1.0, &b0, &b1.0, true);
    if !within {
        faces(&b0, &b1.0, &a0, &a1.0, false);
    }
    for first in edges(&a0.1) {
        for second in edges(&b0.1) {
            if near(&first, &second) || (within && first >= second) {
                continue;
            }
            let at = |a: &[DVec3], b: &[DVec3]| {
                [a[first[0] as usize], a[first[1] as usize], b[second[0] as usize], b[second[1] as usize]]
            };
            if settings.edge_edge(&at(&a0.0, &b0.0), &at(&a1.0, &b1.0)).is_some() {
                found.insert(Features::EdgeEdge { first, second });
            }
        }
    }
    found
}

/// Without the order in which features were asked.
fn named(features: Features, within: bool) -> Features {
    match features {
        Features::FaceVertex { triangle, vertex } if within => Features::VertexFace { vertex, triangle },
        Features::EdgeEdge { first, second } => {
            let up = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
            let (first, second) = (up(first), up(second));
            if within && second < first {
                Features::EdgeEdge { first: second, second: first }
            } else {
                Features::EdgeEdge { first, second }
            }
        }
        other => other,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn what_touches_on_the_way_is_what_every_pair_of_features_says(
        a in points(6), b in points(6), c in points(6), d in points(6), separation in prop::sample::select(vec![0.0, 0.125]),
    ) {
        let [before, after] = step([&a, &b], [&c, &d]);
        let settings = Continuous { min_separation: separation, ..Continuous::default() };
        let options = ContactOptions { within: true, ..ContactOptions::default() };
        let found = before.moving_contacts(&after, &options, &settings).unwrap();
        for parts in [[0, 0], [0, 1], [1, 1]] {
            let due = brute(&before, &after, parts, &settings);
            let of_parts = found.iter().filter(|c| c.parts == parts.map(PartId));
            let told: BTreeSet<_> = of_parts.map(|c| named(c.features, parts[0] == parts[1])).collect();
            prop_assert_eq!(told, due, "parts {:?}", parts);
        }
        for contact in &found {
            prop_assert!((0.0..=1.0).contains(&contact.impact.time) && contact.point.is_finite());
        }
    }

    #[test]
    fn triangles_that_meet_later_touched_before(a in points(3), b in points(3), c in points(3), d in points(3)) {
        let [before, after] = step([&a, &b], [&c, &d]);
        let settings = Continuous::default();
        let pair = TrianglePair { parts: [PartId(0), PartId(1)], triangles: [0, 0] };
        let first = before.first_impact(&after, pair, &settings).unwrap();
        let corner = |points: &[Vec3]| [points[0], points[1], points[2]];
        if triangles_meet(&corner(&a), &corner(&b)) {
            prop_assert_eq!(first.map(|i| i.time), Some(0.0));
        }
        // Quarters of the step are exact: whatever meets there touched by then.
        for quarter in 0..=4_u8 {
            let share = f32::from(quarter) * 0.25;
            let at = |from: &[Vec3], to: &[Vec3]| [0, 1, 2].map(|i: usize| from[i] + (to[i] - from[i]) * share);
            if triangles_meet(&at(&a, &c), &at(&b, &d)) {
                prop_assert!(first.is_some_and(|i| i.time <= f64::from(share)), "{first:?} at {share}");
            }
        }
    }
}

#[test]
fn resting_parts_and_bad_settings() {
    let flat = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let high = flat.map(|p| p + Vec3::Z);
    let [before, after] = step([&flat, &high], [&flat, &high]);
    let options = ContactOptions::default();
    assert_eq!(before.moving_contacts(&after, &options, &Continuous::default()).unwrap(), []);
    for tolerance in [f64::NAN, -1.0, f64::INFINITY] {
        let settings = Continuous { tolerance, ..Continuous::default() };
        assert!(before.moving_contacts(&after, &options, &settings).is_err());
    }
    let low = high.map(|p| p - Vec3::Z * 2.0);
    let [before, after] = step([&flat, &high], [&flat, &low]);
    let found = before.moving_contacts(&after, &options, &Continuous::default()).unwrap();
    assert!(found.iter().all(|c| (c.impact.time - 0.5).abs() < 1e-6), "{found:?}");
    let lone = ContactOptions { accept: Some(&|a, b| a == b), ..options };
    assert!(!found.is_empty() && before.moving_contacts(&after, &lone, &Continuous::default()).unwrap().is_empty());
}
