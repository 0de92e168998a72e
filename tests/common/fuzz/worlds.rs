//! Worlds of a few hostile meshes over a few frames: every question against all triangles, one by one.

use std::ops::ControlFlow;

use kinora::{
    accel::TravRay,
    collide::{
        CollideError, CollisionConfig, CollisionWorld, Contact, ContactLevel, ContactOptions, ContactTracker,
        Continuous, ConvexHull, Layers, Mover, ObjectId, PartId, Shape, Snapshot, TrianglePair, closest_on_triangle,
        triangle_distance, triangle_meets_box, triangle_meets_capsule, triangle_meets_sphere,
    },
    geom::{Aabb, Ray, exact::TriangleHit},
    glam::{DAffine3, DMat3, Vec3},
};

use crate::{decode::Bytes, integers::triangles_meet, trace::Mesh};

type Named = (PartId, u32, [Vec3; 3]);

/// Every triangle of a snapshot on one of `layers`.
fn all(snapshot: &Snapshot, layers: u32) -> Vec<Named> {
    let mut all = Vec::new();
    for part in snapshot.parts().filter(|p| p.layers().on & layers != 0) {
        for (i, corners) in (0..).zip(part.triangles()) {
            all.push((part.id(), i, corners.map(|c| part.vertices()[c as usize])));
        }
    }
    all
}

/// Every triangle of a part, whatever its layers.
fn of_part(snapshot: &Snapshot, id: PartId) -> impl Iterator<Item = Named> + '_ {
    let part = snapshot.part(id).expect("a part");
    (0..).zip(part.triangles()).map(move |(i, corners)| (id, i, corners.map(|c| part.vertices()[c as usize])))
}

fn transform(bytes: &mut Bytes<'_>) -> DAffine3 {
    let kind = bytes.byte();
    let by = bytes.vec3().as_dvec3();
    match kind & 7 {
        0..=3 => DAffine3::from_translation(by),
        4 => DAffine3::from_scale(by),
        5 => {
            let columns = [bytes.vec3().as_dvec3(), bytes.vec3().as_dvec3(), bytes.vec3().as_dvec3()];
            DAffine3::from_mat3_translation(DMat3::from_cols(columns[0], columns[1], columns[2]), by)
        }
        _ => DAffine3::IDENTITY,
    }
}

/// Adds a mesh or a box; refused exactly when a number is not finite or the box is empty.
fn add(world: &mut CollisionWorld, bytes: &mut Bytes<'_>) {
    let place = transform(bytes);
    if bytes.below(4) == 0 {
        let aabb = Aabb { min: bytes.vec3(), max: bytes.vec3() };
        let fine = !aabb.is_empty() && aabb.min.is_finite() && aabb.max.is_finite() && place.is_finite();
        assert_eq!(world.add_box("box", aabb, place).is_ok(), fine, "{aabb:?}");
        return;
    }
    let mesh: Mesh = bytes.mesh(9, 8);
    let fine = mesh.positions.iter().all(|p| p.is_finite()) && place.is_finite();
    assert_eq!(world.add_mesh("mesh", mesh.positions, mesh.indices, place).is_ok(), fine);
}

/// Changes something, or asks for what is not there.
fn change(world: &mut CollisionWorld, bytes: &mut Bytes<'_>) {
    let object = ObjectId(u32::from(bytes.byte() & 3));
    let parts: Vec<PartId> = world.parts(object).map(Iterator::collect).unwrap_or_default();
    match bytes.byte() % 6 {
        0 | 1 => drop(world.set_transform(object, transform(bytes))),
        2 | 3 => {
            let count = 1 + bytes.below(9);
            let vertices: Vec<Vec3> = (0..count).map(|_| bytes.vec3()).collect();
            drop(world.set_vertices(object, &vertices));
        }
        4 => {
            let layers = Layers { on: u32::from(bytes.byte() & 7), sees: u32::from(bytes.byte() & 7) };
            let part = parts.first().copied().unwrap_or(PartId(9));
            assert_eq!(world.set_layers(part, layers).is_ok(), !parts.is_empty());
        }
        _ if bytes.below(8) == 0 => assert_eq!(world.remove(object).is_ok(), !parts.is_empty()),
        _ => assert!(matches!(
            world.set_time(object, &[]),
            Err(CollideError::NotAScene(_) | CollideError::NoSuchObject(_))
        )),
    }
}

fn rays(snapshot: &Snapshot, bytes: &mut Bytes<'_>, layers: u32) {
    let (origin, dir) = (bytes.vec3(), bytes.vec3());
    let ray = Ray { t_far: if bytes.byte() & 1 == 0 { f32::INFINITY } else { bytes.float() }, ..Ray::new(origin, dir) };
    let mut due = Vec::new();
    if let Some(trav) = TravRay::new(&ray) {
        let range = *trav.range();
        for (part, i, corners) in all(snapshot, layers) {
            due.extend(TriangleHit::test(&range, corners).map(|hit| (hit, part.0, i)));
        }
        due.sort_by(|a, b| a.0.cmp_t(&b.0, &range).then((a.1, a.2).cmp(&(b.1, b.2))));
    }
    let due: Vec<_> = due.iter().map(|d| (d.1, d.2)).collect();
    let hits = snapshot.all_hits(&ray, layers).expect("rays are never refused");
    let found: Vec<_> = hits.iter().map(|h| (h.surface.part.0, h.surface.triangle)).collect();
    assert_eq!(found, due, "{ray:?}");
    let first = snapshot.closest_hit(&ray, layers).expect("as above");
    assert_eq!(first.map(|h| (h.surface.part.0, h.surface.triangle)), due.first().copied(), "{ray:?}");
    assert_eq!(snapshot.any_hit(&ray, layers).expect("as above"), !due.is_empty(), "{ray:?}");
    let mut batch = [None; 2];
    snapshot.closest_hits(&[ray; 2], layers, &mut batch).expect("as above");
    assert_eq!(batch, [first.map(|h| h.hit); 2]);
    for hit in &hits {
        let s = &hit.surface;
        assert!(s.point.is_finite() && s.barycentric.iter().all(|w| w.is_finite()), "{hit:?}");
        assert!(s.n_geom.is_none_or(|n| (n.length() - 1.0).abs() < 1e-9), "{hit:?}");
    }
}

/// Whether a triangle is met, in a test of its own.
type Meets<'a> = Box<dyn Fn(&[Vec3; 3]) -> bool + 'a>;

fn overlaps(snapshot: &Snapshot, bytes: &mut Bytes<'_>, layers: u32) {
    let (p, q, r) = (bytes.vec3(), bytes.vec3(), bytes.vec3());
    let radius = bytes.float();
    let (aabb, other) = (Aabb { min: p, max: q }, [p, q, r]);
    let hull = ConvexHull::new(&other);
    let finite = |points: &[Vec3]| points.iter().all(|p| p.is_finite());
    assert_eq!(hull.is_ok(), finite(&other));
    let round = radius.is_finite() && radius >= 0.0;
    let mut shapes: Vec<(Shape<'_>, bool, Meets<'_>)> = vec![
        (Shape::Box(aabb), !aabb.is_empty(), Box::new(|t| triangle_meets_box(t, &aabb))),
        (
            Shape::Sphere { center: p, radius },
            round && p.is_finite(),
            Box::new(|t| triangle_meets_sphere(t, p, radius)),
        ),
        (
            Shape::Capsule { from: p, to: q, radius },
            round && finite(&[p, q]),
            Box::new(|t| triangle_meets_capsule(t, p, q, radius)),
        ),
        (Shape::Triangle(other), finite(&other), Box::new(|t| triangles_meet(t, &other))),
    ];
    if let Ok(hull) = &hull {
        shapes.push((Shape::Hull(hull), true, Box::new(|t| triangles_meet(t, &other))));
    }
    for (shape, fine, meets) in &shapes {
        let Ok(found) = snapshot.overlaps(shape, layers) else {
            assert!(!fine, "{shape:?} is refused");
            assert!(snapshot.any_overlap(shape, layers).is_err());
            continue;
        };
        assert!(*fine, "{shape:?} is not refused");
        let due: Vec<_> = all(snapshot, layers).into_iter().filter(|t| meets(&t.2)).map(|t| (t.0, t.1)).collect();
        assert_eq!(found.iter().map(|o| (o.surface.part, o.surface.triangle)).collect::<Vec<_>>(), due, "{shape:?}");
        assert_eq!(snapshot.any_overlap(shape, layers).expect("not refused"), !due.is_empty());
        let mut calls = 0;
        let stop = |_| {
            calls += 1;
            ControlFlow::Break(())
        };
        snapshot.each_overlap(shape, layers, stop).expect("not refused");
        assert_eq!(calls, due.len().min(1));
        assert!(found.iter().all(|o| o.surface.point.is_finite()), "{found:?}");
    }
}

/// Whether what was found is what is due. Distances are off by up to 2^-45 of the largest coordinate: where that is nothing, the same triangles are due, and where
/// coordinates are huge, a distance within that.
fn is_alike<T: PartialEq>(found: Option<(f64, T, u32)>, due: Option<(f64, T, u32)>, corners: &[Vec3]) -> bool {
    let largest = f64::from(corners.iter().map(|c| c.abs().max_element()).fold(0.0, f32::max));
    let near = |a: f64, b: f64| largest > 16_777_216.0 && (a - b).abs() <= largest * 2.0_f64.powi(-45);
    found == due || found.zip(due).is_some_and(|(found, due)| near(found.0, due.0))
}

fn distances(snapshot: &Snapshot, bytes: &mut Bytes<'_>, layers: u32) {
    let p = bytes.vec3();
    let within = if bytes.byte() & 1 == 0 { f64::INFINITY } else { f64::from(bytes.float()) };
    let found = snapshot.closest_point(p, within, layers);
    assert_eq!(found.is_ok(), p.is_finite() && within >= 0.0, "{p} {within}");
    if let Ok(found) = &found {
        let near = |(part, i, t): Named| closest_on_triangle(p, &t).map(|n| (n.distance, part, i));
        let due = all(snapshot, layers).into_iter().filter_map(near).filter(|n| n.0 <= within);
        let due = due.min_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let found = found.as_ref().map(|c| (c.distance, c.surface.part, c.surface.triangle));
        let mut corners: Vec<Vec3> = all(snapshot, layers).into_iter().flat_map(|t| t.2).collect();
        corners.push(p);
        assert!(is_alike(found, due, &corners), "{found:?}, due {due:?}: {p} {within}");
    }
    for part in snapshot.parts() {
        let signed = snapshot.signed_distance(part.id(), p);
        if let Ok(signed) = signed {
            assert!(signed.distance.is_finite() && (signed.winding == 0 || signed.distance <= 0.0), "{signed:?}");
        }
        for other in snapshot.parts() {
            let parts = [part.id(), other.id()];
            let found = snapshot.distance_between(parts[0], parts[1], f64::INFINITY).expect("parts that are there");
            let of = |id: PartId| of_part(snapshot, id);
            let pairs = of(parts[0]).flat_map(|(_, x, s)| of(parts[1]).map(move |(_, y, t)| (x, y, s, t)));
            let near =
                |(x, y, s, t): (u32, u32, [Vec3; 3], [Vec3; 3])| triangle_distance(&s, &t).map(|n| (n.distance, x, y));
            let due = pairs.filter_map(near).min_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            let found = found.map(|d| (d.distance, d.surfaces[0].triangle, d.surfaces[1].triangle));
            let corners: Vec<Vec3> = parts.into_iter().flat_map(of).flat_map(|t| t.2).collect();
            assert!(is_alike(found, due, &corners), "{found:?}, due {due:?}: {corners:?}");
        }
    }
}

/// What touches at the start or the end of a motion is found, and not late.
fn sweeps(snapshot: &Snapshot, bytes: &mut Bytes<'_>, layers: u32) {
    let (p, q, motion, radius) = (bytes.vec3(), bytes.vec3(), bytes.vec3(), bytes.float());
    let triangles = all(snapshot, layers);
    let movers = [
        Mover::Sphere { center: p, radius },
        Mover::Capsule { from: p, to: q, radius },
        Mover::Box(Aabb { min: p, max: q }),
    ];
    for mover in movers {
        let fine = motion.is_finite()
            && p.is_finite()
            && match mover {
                Mover::Sphere { .. } => radius.is_finite() && radius >= 0.0,
                Mover::Capsule { .. } => q.is_finite() && radius.is_finite() && radius >= 0.0,
                Mover::Box(aabb) => q.is_finite() && !aabb.is_empty(),
            };
        let found = snapshot.sweep(&mover, motion, layers);
        assert_eq!(found.is_ok(), fine, "{mover:?} {motion}");
        let Ok(found) = found else { continue };
        let touches = |by: Vec3| {
            triangles.iter().any(|(.., t)| match mover {
                Mover::Sphere { center, radius } => triangle_meets_sphere(t, center + by, radius),
                Mover::Capsule { from, to, radius } => triangle_meets_capsule(t, from + by, to + by, radius),
                Mover::Box(aabb) => triangle_meets_box(t, &Aabb { min: aabb.min + by, max: aabb.max + by }),
            })
        };
        if touches(Vec3::ZERO) {
            assert!(found.is_some_and(|h| h.time <= 0.0), "{mover:?} {motion} {found:?} touches at the start");
        }
        // The end is exact where nothing rounds.
        let exact = |p: Vec3| (p + motion).as_dvec3() == p.as_dvec3() + motion.as_dvec3();
        if exact(p) && exact(q) && touches(motion) {
            assert!(found.is_some(), "{mover:?} {motion} touches at the end");
        }
        if let Some(hit) = found {
            assert!((0.0..=1.0).contains(&hit.time) && hit.surface.point.is_finite(), "{hit:?}");
            assert!(hit.normal.is_none_or(|n| (n.length() - 1.0).abs() < 1e-9), "{hit:?}");
        }
    }
}

fn contacts(snapshot: &Snapshot) -> Vec<Contact> {
    let options = ContactOptions { within: true, neighbours: true, ..ContactOptions::default() };
    let triangles = all(snapshot, Layers::ALL);
    let layers = |part: PartId| snapshot.part(part).expect("a part").layers();
    let mut due = Vec::new();
    for (at, (a, x, s)) in triangles.iter().enumerate() {
        for (b, y, t) in &triangles[at + 1..] {
            let asked = if a == b { layers(*a).on != 0 } else { layers(*a).meet(layers(*b)) };
            if asked && triangles_meet(s, t) {
                due.push(TrianglePair { parts: [*a, *b], triangles: [*x, *y] });
            }
        }
    }
    due.sort_unstable();
    assert_eq!(snapshot.contact_pairs(&options).expect("pairs"), due);
    let contacts = snapshot.contacts(&options).expect("contacts");
    assert_eq!(contacts.iter().map(|c| c.pair).collect::<Vec<_>>(), due);
    for c in &contacts {
        let points = [c.point, c.segment[0], c.segment[1]];
        assert!(points.iter().all(|p| p.is_finite()) && c.depth >= 0.0 && c.depth.is_finite(), "{c:?}");
        assert!((c.normal.length() - 1.0).abs() < 1e-9, "{c:?}");
    }
    contacts
}

/// What meets after a step and did not before has touched, and not before the start.
fn steps(before: &Snapshot, after: &Snapshot) {
    let settings = Continuous::default();
    let options = ContactOptions { within: true, ..ContactOptions::default() };
    let Ok(moving) = before.moving_contacts(after, &options, &settings) else { return };
    for contact in &moving {
        assert!((0.0..=1.0).contains(&contact.impact.time) && contact.point.is_finite(), "{contact:?}");
        assert!(contact.normal.is_none_or(|n| (n.length() - 1.0).abs() < 1e-9), "{contact:?}");
    }
    for pair in after.contact_pairs(&options).expect("pairs") {
        let first = before.first_impact(after, pair, &settings).expect("the same parts");
        assert!(first.is_some_and(|i| (0.0..=1.0).contains(&i.time)), "{pair:?} {first:?}");
    }
}

/// Decodes `data` and asserts everything.
pub(crate) fn check(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    let mut world = CollisionWorld::new(&CollisionConfig::default()).expect("the default is valid");
    for _ in 0..=bytes.below(3) {
        add(&mut world, &mut bytes);
    }
    let mut tracker = ContactTracker::new(ContactLevel::Triangle);
    let mut last: Option<Snapshot> = None;
    for _ in 0..3 {
        match world.snapshot() {
            Ok(snapshot) => {
                let layers = if bytes.below(4) == 0 { u32::from(bytes.byte() & 7) } else { Layers::ALL };
                tracker.update(&contacts(&snapshot));
                rays(&snapshot, &mut bytes, layers);
                overlaps(&snapshot, &mut bytes, layers);
                distances(&snapshot, &mut bytes, layers);
                sweeps(&snapshot, &mut bytes, layers);
                if let Some(last) = &last {
                    steps(last, &snapshot);
                }
                last = Some(snapshot);
            }
            Err(error) => assert!(matches!(error, CollideError::BeyondF32 { .. }), "{error}"),
        }
        if bytes.is_empty() {
            break;
        }
        for _ in 0..=bytes.below(3) {
            change(&mut world, &mut bytes);
        }
    }
}
