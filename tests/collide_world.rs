//! Queries of collision worlds against brute force: every triangle, one by one, with exact predicates.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

mod common;
#[path = "common/integers.rs"]
mod integers;
#[path = "common/trace.rs"]
mod trace;

use std::{ops::ControlFlow, sync::Arc};

use kinora::{
    anim::{ActiveClip, Pose, deform},
    collide::{
        CollideError, CollisionConfig, CollisionWorld, ContactOptions, ConvexHull, Layers, Mover, PartId, Shape, Side,
        Snapshot, TrianglePair, closest_on_triangle, oriented_box, triangle_distance, triangle_meets_box,
        triangle_meets_capsule, triangle_meets_sphere, triangles_meet,
    },
    geom::{Aabb, Hit, InstanceId, PrimId, Ray, exact::TriangleHit},
    glam::{DAffine3, DQuat, DVec3, Vec3},
    scene::{ClipId, Scene, builtin, import},
};
use proptest::{collection::vec, prelude::*};
use trace::Mesh;

fn empty() -> CollisionWorld {
    CollisionWorld::new(&CollisionConfig::default()).expect("the default is valid")
}

/// Small multiples of a quarter, which meet and coincide often.
fn point(n: i8) -> impl Strategy<Value = Vec3> {
    [-n..=n, -n..=n, -n..=n].prop_map(|p| Vec3::from(p.map(f32::from)) * 0.25)
}

/// Triangles near places of a grid, some without area.
fn soup(most: usize) -> impl Strategy<Value = Mesh> {
    let triangle = (point(12), [point(4), point(4), point(4)]).prop_map(|(at, t)| t.map(|p| p + at));
    vec(triangle, 0..most).prop_map(|triangles| Mesh::soup(&triangles))
}

fn add(world: &mut CollisionWorld, mesh: &Mesh) {
    world.add_mesh("soup", mesh.positions.clone(), mesh.indices.clone(), DAffine3::IDENTITY).expect("a valid mesh");
}

/// Whether a triangle is met.
type Meets<'a> = Box<dyn Fn(&[Vec3; 3]) -> bool + 'a>;

fn world_of(meshes: &[&Mesh]) -> Snapshot {
    let mut world = empty();
    for mesh in meshes {
        add(&mut world, mesh);
    }
    world.snapshot().expect("a snapshot")
}

fn triangles(mesh: &Mesh) -> impl Iterator<Item = (u32, [Vec3; 3])> + '_ {
    (0..mesh.indices.len()).map(|i| (i as u32, mesh.corners(i)))
}

fn brute_pairs(a: &Mesh, b: &Mesh, parts: [u32; 2]) -> Vec<TrianglePair> {
    let parts = parts.map(PartId);
    let pair = |x, y| TrianglePair { parts, triangles: [x, y] };
    let all = triangles(a).flat_map(|(x, s)| triangles(b).map(move |(y, t)| (x, y, s, t)));
    let all = all.filter(|(x, y, ..)| parts[0] != parts[1] || x < y);
    all.filter(|(.., s, t)| integers::triangles_meet(s, t)).map(|(x, y, ..)| pair(x, y)).collect()
}

fn share_place(a: &[Vec3; 3], b: &[Vec3; 3]) -> bool {
    a.iter().any(|p| b.contains(p))
}

/// All hits by `t`, then by part and triangle.
fn brute_hits(meshes: &[&Mesh], ray: &Ray) -> Vec<Hit> {
    let Some(trav) = kinora::accel::TravRay::new(ray) else { return Vec::new() };
    let mut hits: Vec<(TriangleHit, u32, u32)> = Vec::new();
    for (part, mesh) in (0..).zip(meshes) {
        hits.extend(triangles(mesh).filter_map(|(i, t)| TriangleHit::test(trav.range(), t).map(|hit| (hit, part, i))));
    }
    hits.sort_by(|a, b| a.0.cmp_t(&b.0, trav.range()).then((a.1, a.2).cmp(&(b.1, b.2))));
    let named = |(hit, part, prim): &(TriangleHit, u32, u32)| {
        let [t, u, v] = hit.tuv(trav.range());
        Hit { t, u, v, prim: PrimId(*prim), instance: InstanceId(*part) }
    };
    hits.iter().map(named).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn contacts_are_those_of_exact_brute_force(a in soup(60), b in soup(60), moved in soup(60)) {
        let mut world = empty();
        add(&mut world, &a);
        add(&mut world, &b);
        let check = |snapshot: &Snapshot, a: &Mesh| -> Result<(), TestCaseError> {
            let options = ContactOptions { within: true, neighbours: true, ..ContactOptions::default() };
            let mut due = brute_pairs(a, a, [0, 0]);
            due.extend(brute_pairs(a, &b, [0, 1]));
            due.extend(brute_pairs(&b, &b, [1, 1]));
            due.sort_unstable();
            prop_assert_eq!(&snapshot.contact_pairs(&options).unwrap(), &due);
            let contacts = snapshot.contacts(&options).unwrap();
            prop_assert_eq!(contacts.iter().map(|c| c.pair).collect::<Vec<_>>(), due);
            for contact in &contacts {
                prop_assert!(contact.depth >= 0.0 && contact.depth.is_finite());
                prop_assert!((contact.normal.length() - 1.0).abs() < 1e-12, "{contact:?}");
                let corners = |i: usize| {
                    let mesh = if contact.pair.parts[i].0 == 0 { a } else { &b };
                    mesh.corners(contact.pair.triangles[i] as usize)
                };
                for point in contact.segment.iter().chain([&contact.point]) {
                    for i in 0..2 {
                        let near = closest_on_triangle(point.as_vec3(), &corners(i)).unwrap();
                        prop_assert!(near.distance < 1e-5, "{contact:?} {near:?}");
                    }
                }
            }
            Ok(())
        };
        check(&world.snapshot().unwrap(), &a)?;
        // The same number of vertices elsewhere: trees are refitted.
        if let Some(positions) = moved.positions.get(..a.positions.len()) {
            let moved = Mesh { positions: positions.to_vec(), indices: a.indices.clone() };
            world.set_vertices(kinora::collide::ObjectId(0), positions).unwrap();
            check(&world.snapshot().unwrap(), &moved)?;
        }
    }

    #[test]
    fn neighbours_are_those_that_share_a_place_at_rest(a in soup(60)) {
        let options = ContactOptions { within: true, ..ContactOptions::default() };
        let pairs = world_of(&[&a]).contact_pairs(&options).unwrap();
        let apart = |p: &TrianglePair| {
            let [x, y] = p.triangles.map(|i| a.corners(i as usize));
            !share_place(&x, &y)
        };
        let due: Vec<_> = brute_pairs(&a, &a, [0, 0]).into_iter().filter(apart).collect();
        prop_assert_eq!(pairs, due);
    }

    #[test]
    fn rays_hit_what_brute_force_hits_in_its_order(
        a in soup(60), b in soup(60), origin in point(20), dir in point(4), far in prop::sample::select(vec![1.0, 7.5, f32::INFINITY]),
    ) {
        let snapshot = world_of(&[&a, &b]);
        let ray = Ray { t_far: far, ..Ray::new(origin, dir) };
        let due = brute_hits(&[&a, &b], &ray);
        let all: Vec<_> = snapshot.all_hits(&ray, Layers::ALL).unwrap().iter().map(|h| h.hit).collect();
        prop_assert_eq!(&all, &due);
        let first = snapshot.closest_hit(&ray, Layers::ALL).unwrap();
        prop_assert_eq!(first.map(|h| h.hit), due.first().copied());
        prop_assert_eq!(snapshot.any_hit(&ray, Layers::ALL).unwrap(), !due.is_empty());
        let odd = |hit: &Hit| hit.prim.0 % 2 == 1;
        let filtered = snapshot.closest_hit_where(&ray, Layers::ALL, odd).unwrap();
        prop_assert_eq!(filtered.map(|h| h.hit), due.iter().copied().find(odd));
        prop_assert_eq!(snapshot.any_hit_where(&ray, Layers::ALL, odd).unwrap(), due.iter().any(odd));
        let mut batch = [None; 3];
        snapshot.closest_hits(&[ray, ray, ray], Layers::ALL, &mut batch).unwrap();
        prop_assert_eq!(batch, [due.first().copied(); 3]);
        if let Some(hit) = first {
            let at = ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(hit.hit.t);
            prop_assert!((hit.surface.point - at).length() < 1e-4, "{hit:?}");
            let n = hit.surface.n_geom.unwrap();
            prop_assert_eq!(hit.side == Side::Back, n.dot(ray.dir.as_dvec3()) > 0.0);
        }
    }

    #[test]
    fn batches_answer_as_single_rays(
        a in soup(60), rays in vec((point(20), point(4), 0_u8..5), 1..70), away: bool, on in 1_u32..4, layers in 1_u32..4,
    ) {
        let mut world = empty();
        add(&mut world, &a);
        if away {
            // A part on another layer.
            add(&mut world, &a);
            world.set_layers(PartId(1), Layers { on: 0b100, ..Layers::default() }).unwrap();
        }
        world.set_layers(PartId(0), Layers { on, ..Layers::default() }).unwrap();
        let snapshot = world.snapshot().unwrap();
        let ray = |&(origin, dir, far): &(Vec3, Vec3, u8)| {
            let t_far = if far == 0 { f32::INFINITY } else { f32::from(far) };
            Ray { t_far, ..Ray::new(origin, dir) }
        };
        let rays: Vec<Ray> = rays.iter().map(ray).collect();
        for layers in [layers, Layers::ALL] {
            let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
            snapshot.closest_hits(&rays, layers, &mut hits).unwrap();
            snapshot.any_hits(&rays, layers, &mut blocked).unwrap();
            for ((ray, hit), blocked) in rays.iter().zip(&hits).zip(&blocked) {
                let due = snapshot.closest_hit(ray, layers).unwrap().map(|h| h.hit);
                prop_assert_eq!((*hit, *blocked), (due, due.is_some()), "{:?}", ray);
            }
        }
    }

    #[test]
    fn overlaps_are_those_of_every_triangle_asked(
        a in soup(60), b in soup(40), min in point(12), size in point(12), other in [point(12), point(12), point(12)], radius in 0_u8..12,
    ) {
        let snapshot = world_of(&[&a, &b]);
        let radius = f32::from(radius) * 0.25;
        let aabb = Aabb { min, max: min + size.abs() };
        let hull = ConvexHull::new(&other).unwrap();
        let turned = oriented_box(min.as_dvec3(), size.abs().as_dvec3(), DQuat::from_xyzw(0.5, 0.5, 0.5, 0.5)).unwrap();
        let shapes: Vec<(Shape<'_>, Meets<'_>)> = vec![
            (Shape::Box(aabb), Box::new(|t| triangle_meets_box(t, &aabb))),
            (Shape::Sphere { center: min, radius }, Box::new(|t| triangle_meets_sphere(t, min, radius))),
            (
                Shape::Capsule { from: min, to: other[0], radius },
                Box::new(|t| triangle_meets_capsule(t, min, other[0], radius)),
            ),
            (Shape::Triangle(other), Box::new(|t| integers::triangles_meet(t, &other))),
            (Shape::Hull(&hull), Box::new(|t| integers::triangles_meet(t, &other))),
            (Shape::Hull(&turned), Box::new(|t| turned.meets_triangle(t))),
        ];
        for (shape, meets) in &shapes {
            let all = [(0, &a), (1, &b)].into_iter().flat_map(|(part, mesh)| triangles(mesh).map(move |(i, t)| (part, i, t)));
            let due: Vec<_> = all.filter(|(.., t)| meets(t)).map(|(part, i, _)| (part, i)).collect();
            let found = snapshot.overlaps(shape, Layers::ALL).unwrap();
            let found: Vec<_> = found.iter().map(|o| (o.surface.part.0, o.surface.triangle)).collect();
            prop_assert_eq!(&found, &due, "{:?}", shape);
            let first = snapshot.first_overlap(shape, Layers::ALL).unwrap();
            prop_assert_eq!(first.map(|o| (o.surface.part.0, o.surface.triangle)), due.first().copied());
            prop_assert_eq!(snapshot.any_overlap(shape, Layers::ALL).unwrap(), !due.is_empty());
            let mut calls = 0;
            snapshot.each_overlap(shape, Layers::ALL, |_| {
                calls += 1;
                if calls == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            }).unwrap();
            prop_assert_eq!(calls, due.len().min(2));
        }
        let of_part = snapshot.overlaps(&Shape::Part(PartId(1)), Layers::ALL).unwrap();
        let mut due: Vec<u32> = brute_pairs(&a, &b, [0, 1]).iter().map(|p| p.triangles[0]).collect();
        due.dedup();
        prop_assert_eq!(of_part.iter().map(|o| o.surface.triangle).collect::<Vec<_>>(), due);
    }

    #[test]
    fn distances_are_the_least_over_all_triangles(a in soup(60), b in soup(40), p in point(30), within in 0_u8..40) {
        let snapshot = world_of(&[&a, &b]);
        let nearest = |mesh: &Mesh, part: u32| {
            let all = triangles(mesh).map(|(i, t)| (closest_on_triangle(p, &t).unwrap().distance, part, i));
            all.min_by(|x, y| x.0.total_cmp(&y.0).then(x.2.cmp(&y.2)))
        };
        let due = [nearest(&a, 0), nearest(&b, 1)].into_iter().flatten().min_by(|x, y| x.0.total_cmp(&y.0));
        let named = |c: &kinora::collide::ClosestPoint| (c.distance, c.surface.part.0, c.surface.triangle);
        let found = snapshot.closest_point(p, f64::INFINITY, Layers::ALL).unwrap();
        prop_assert_eq!(found.as_ref().map(named), due);
        let on_second = snapshot.closest_point_on(PartId(1), p, f64::INFINITY).unwrap();
        prop_assert_eq!(on_second.as_ref().map(named), nearest(&b, 1));
        let limit = f64::from(within) * 0.25;
        let near = snapshot.closest_point(p, limit, Layers::ALL).unwrap();
        prop_assert_eq!(near.as_ref().map(named), due.filter(|d| d.0 <= limit));

        let all = triangles(&a).flat_map(|(x, s)| triangles(&b).map(move |(y, t)| (triangle_distance(&s, &t).unwrap().distance, x, y)));
        let due = all.min_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
        let found = snapshot.distance_between(PartId(0), PartId(1), f64::INFINITY).unwrap();
        prop_assert_eq!(found.map(|d| (d.distance, d.surfaces[0].triangle, d.surfaces[1].triangle)), due);
        if let Some(found) = found {
            let apart = (found.surfaces[1].point - found.surfaces[0].point).length();
            prop_assert!((apart - found.distance).abs() < 1e-9);
        }
        let near = snapshot.distance_between(PartId(0), PartId(1), limit).unwrap();
        prop_assert_eq!(near.map(|d| d.distance), due.map(|d| d.0).filter(|&d| d <= limit));
    }

    #[test]
    fn sweeps_are_never_late_and_hardly_early(a in soup(60), at in point(30), to in point(8), motion in point(60), radius in 0_u8..6) {
        let snapshot = world_of(&[&a]);
        let radius = f32::from(radius) * 0.125;
        let movers = [
            Mover::Sphere { center: at, radius },
            Mover::Capsule { from: at, to: at + to, radius },
            Mover::Box(Aabb { min: at, max: at + to.abs() }),
        ];
        for mover in movers {
            // Steps that are powers of two of the motion, so that places are exact.
            let touches = |share: f32, grown: f32| {
                let by = motion * share;
                triangles(&a).any(|(_, t)| match mover {
                    Mover::Sphere { center, radius } => triangle_meets_sphere(&t, center + by, radius + grown),
                    Mover::Capsule { from, to, radius } => triangle_meets_capsule(&t, from + by, to + by, radius + grown),
                    Mover::Box(aabb) => triangle_meets_box(&t, &Aabb { min: aabb.min + by - grown, max: aabb.max + by + grown }),
                })
            };
            let steps = 64_u8;
            let share = |i: u8| f32::from(i) / f32::from(steps);
            let late = (0..=steps).find(|&i| touches(share(i), 0.0));
            let hit = snapshot.sweep(&mover, motion, Layers::ALL).unwrap();
            if let Some(first) = late {
                prop_assert!(hit.is_some_and(|h| h.time <= f64::from(share(first)) + 1e-9), "{mover:?} {hit:?} late at {first}");
            }
            if let Some(hit) = hit {
                prop_assert!((0.0..=1.0).contains(&hit.time));
                prop_assert!(touches(hit.time as f32, 1e-3), "{mover:?} {hit:?} touches nothing");
            }
        }
    }
}

/// Pairs of triangles that meet, by one sort along an axis over all of them.
fn swept_pairs(snapshot: &Snapshot, accept: &dyn Fn(PartId, PartId) -> bool) -> Vec<TrianglePair> {
    let mut all = Vec::new();
    for part in snapshot.parts() {
        let corners = |t: &[u32; 3]| t.map(|i| part.vertices()[i as usize]);
        all.extend((0..).zip(part.triangles()).map(|(i, t)| (part.id(), i, corners(t))));
    }
    let boxes: Vec<_> = all.iter().map(|t| Aabb::from_points(t.2)).collect();
    let mut pairs = Vec::new();
    for [x, y] in kinora::collide::box_pairs(&boxes) {
        let ((a, i, s), (b, j, t)) = (&all[x as usize], &all[y as usize]);
        if accept(*a, *b) && triangles_meet(s, t) {
            pairs.push(TrianglePair { parts: [*a, *b], triangles: [*i, *j] });
        }
    }
    pairs.sort_unstable();
    pairs
}

fn figure() -> Arc<Scene> {
    Arc::new(builtin::load("walk").expect("built-in scenes are valid"))
}

#[test]
fn vertices_are_those_of_the_exact_pose_and_static_ones_are_shared() {
    let scene = figure();
    let mut world = empty();
    let id = world.add_scene(scene.clone(), DAffine3::IDENTITY).unwrap();
    let rest = world.snapshot().unwrap();
    for time_s in [0.0, 0.25, 0.7] {
        let clips = [ActiveClip { clip: ClipId(0), time_s }];
        world.set_time(id, &clips).unwrap();
        let snapshot = world.snapshot().unwrap();
        let mut pose = Pose::rest(&scene);
        pose.evaluate(&scene, &clips, &DAffine3::IDENTITY);
        for (part, &instance) in snapshot.parts().zip(&scene.instances) {
            let mut due = vec![Vec3::ZERO; part.vertices().len()];
            deform(&scene, &pose, instance, &mut due);
            assert_eq!(part.vertices(), due, "part {:?} at {time_s}", part.id());
        }
        // The same pose, evaluated by the caller.
        world.set_pose(id, Arc::new(pose)).unwrap();
        let again = world.snapshot().unwrap();
        assert!(again.parts().zip(snapshot.parts()).all(|(a, b)| a.vertices() == b.vertices()));
    }
    assert_ne!(rest.bounds(), Aabb::EMPTY);
    assert!(rest.parts().any(|p| !p.path().is_empty()));
}

#[test]
fn contacts_of_two_figures_are_those_of_brute_force() {
    let scene = figure();
    let mut world = empty();
    let first = world.add_scene(scene.clone(), DAffine3::IDENTITY).unwrap();
    world.add_scene(scene, DAffine3::from_translation(DVec3::new(0.15, 0.02, 0.1))).unwrap();
    for time_s in [0.0, 0.4] {
        world.set_time(first, &[ActiveClip { clip: ClipId(0), time_s }]).unwrap();
        let snapshot = world.snapshot().unwrap();
        let own = |p: PartId| snapshot.part(p).unwrap().object();
        let accept = |a: PartId, b: PartId| own(a) != own(b);
        let options = ContactOptions { accept: Some(&accept), ..ContactOptions::default() };
        let found = snapshot.contact_pairs(&options).unwrap();
        assert_eq!(found, swept_pairs(&snapshot, &accept));
        assert!(!found.is_empty());
    }
}

#[test]
fn answers_are_the_same_from_every_thread_and_pool() {
    let scene = figure();
    let mut world = empty();
    world.add_scene(scene.clone(), DAffine3::IDENTITY).unwrap();
    world.add_scene(scene, DAffine3::from_translation(DVec3::new(0.1, 0.0, 0.1))).unwrap();
    let snapshot = world.snapshot().unwrap();
    let ask = || {
        let options = ContactOptions { within: true, ..ContactOptions::default() };
        let bounds = snapshot.bounds();
        let ray = Ray::new(bounds.min - 1.0, bounds.center() - bounds.min + 1.0);
        let near = snapshot.closest_point(bounds.min, f64::INFINITY, Layers::ALL).unwrap();
        (snapshot.contacts(&options).unwrap(), snapshot.all_hits(&ray, Layers::ALL).unwrap(), near)
    };
    let due = ask();
    std::thread::scope(|scope| {
        let others: Vec<_> = (0..4).map(|_| scope.spawn(ask)).collect();
        for other in others {
            assert_eq!(other.join().unwrap(), due);
        }
    });
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(ask), due);
    }
}

#[test]
fn layers_say_what_is_hit_and_what_touches() {
    let mut world = empty();
    let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    for i in 0..3 {
        world.add_box("box", unit, DAffine3::from_translation(DVec3::X * 0.5 * f64::from(i))).unwrap();
    }
    let ray = Ray::new(Vec3::new(-1.0, 0.4, 0.6), Vec3::X);
    let parts = |snapshot: &Snapshot| -> Vec<[u32; 2]> {
        let mut pairs: Vec<_> =
            snapshot.contact_pairs(&ContactOptions::default()).unwrap().iter().map(|p| p.parts.map(|p| p.0)).collect();
        pairs.dedup();
        pairs
    };
    assert_eq!(parts(&world.snapshot().unwrap()), [[0, 1], [0, 2], [1, 2]]);
    world.set_layers(PartId(0), Layers { on: 0b10, sees: 0b100 }).unwrap();
    world.set_layers(PartId(2), Layers { on: 0b100, sees: 0b10 }).unwrap();
    let snapshot = world.snapshot().unwrap();
    assert_eq!(parts(&snapshot), [[0, 2]], "the second is on a layer that neither sees");
    let hit = |layers| snapshot.closest_hit(&ray, layers).unwrap().map(|h| h.surface.part.0);
    assert_eq!(
        [hit(1), hit(0b10), hit(0b100), hit(0b1000), hit(Layers::ALL)],
        [Some(1), Some(0), Some(2), None, Some(0)]
    );
    let near = |layers| snapshot.closest_point(Vec3::NEG_ONE, 100.0, layers).unwrap().map(|c| c.surface.part.0);
    assert_eq!([near(1), near(0b100), near(0)], [Some(1), Some(2), None]);
    // On no layer nothing is found, by whichever question.
    for part in 0..3 {
        world.set_layers(PartId(part), Layers { on: 0, sees: u32::MAX }).unwrap();
    }
    let hidden = world.snapshot().unwrap();
    let (mut hits, mut blocked) = ([None; 1], [false; 1]);
    hidden.closest_hits(&[ray], Layers::ALL, &mut hits).unwrap();
    hidden.any_hits(&[ray], Layers::ALL, &mut blocked).unwrap();
    assert_eq!((hits, blocked), ([None; 1], [false; 1]));
    assert!(hidden.closest_hit(&ray, Layers::ALL).unwrap().is_none() && !hidden.any_hit(&ray, Layers::ALL).unwrap());
    assert!(hidden.all_hits(&ray, Layers::ALL).unwrap().is_empty());
    assert!(hidden.closest_point(Vec3::NEG_ONE, 100.0, Layers::ALL).unwrap().is_none());
    assert!(hidden.overlaps(&Shape::Box(unit), Layers::ALL).unwrap().is_empty());
    let boxed = Mover::Box(Aabb { min: Vec3::splat(-2.0), max: Vec3::NEG_ONE });
    assert!(hidden.sweep(&boxed, Vec3::splat(4.0), Layers::ALL).unwrap().is_none());
    assert!(parts(&hidden).is_empty());
}

#[test]
fn bad_input_is_an_error_and_changes_nothing() {
    let mut world = empty();
    let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    let id = world.add_box("box", unit, DAffine3::IDENTITY).unwrap();
    let before = world.snapshot().unwrap();
    let nan = DAffine3::from_translation(DVec3::NAN);
    let far = kinora::collide::ObjectId(7);
    assert!(matches!(world.set_transform(id, nan), Err(CollideError::NotFinite { .. })));
    assert!(matches!(world.set_transform(far, DAffine3::IDENTITY), Err(CollideError::NoSuchObject(_))));
    assert!(matches!(world.set_vertices(id, &[Vec3::ZERO]), Err(CollideError::Count { .. })));
    assert!(matches!(world.set_vertices(id, &[Vec3::NAN; 8]), Err(CollideError::NotFinite { .. })));
    assert!(matches!(world.set_time(id, &[]), Err(CollideError::NotAScene(_))));
    assert!(matches!(world.add_box("none", Aabb::EMPTY, DAffine3::IDENTITY), Err(CollideError::EmptyBox { .. })));
    let bad = world.add_mesh("bad", vec![Vec3::ZERO; 2], vec![[0, 1, 2]], DAffine3::IDENTITY);
    assert!(matches!(bad, Err(CollideError::IndexOutOfRange { triangle: 0, vertex: 2, count: 2 })));
    assert!(matches!(world.set_layers(PartId(9), Layers::default()), Err(CollideError::NoSuchPart { .. })));
    let after = world.snapshot().unwrap();
    assert_eq!(before.part_count(), after.part_count());
    let sphere = |center, radius| Shape::Sphere { center, radius };
    for shape in
        [sphere(Vec3::NAN, 1.0), sphere(Vec3::ZERO, f32::NAN), sphere(Vec3::ZERO, -1.0), sphere(Vec3::INFINITY, 1.0)]
    {
        assert!(after.overlaps(&shape, Layers::ALL).is_err(), "{shape:?}");
    }
    assert!(after.overlaps(&Shape::Box(Aabb::EMPTY), Layers::ALL).is_err());
    assert!(after.overlaps(&Shape::Part(PartId(5)), Layers::ALL).is_err());
    assert!(after.closest_point(Vec3::NAN, 1.0, Layers::ALL).is_err());
    assert!(after.closest_point(Vec3::ZERO, -1.0, Layers::ALL).is_err());
    assert!(after.sweep(&Mover::Box(unit), Vec3::NAN, Layers::ALL).is_err());
    assert!(after.surface(PartId(0), 99, 0.0, 0.0).is_err());
    for ray in [Ray::new(Vec3::NAN, Vec3::X), Ray::new(Vec3::ZERO, Vec3::ZERO)] {
        assert!(after.closest_hit(&ray, Layers::ALL).unwrap().is_none());
        assert!(after.all_hits(&ray, Layers::ALL).unwrap().is_empty());
    }
    // Beyond f32: the snapshot says so, and works again once the object is back.
    world.set_transform(id, DAffine3::from_scale(DVec3::splat(1e300))).unwrap();
    assert!(matches!(world.snapshot(), Err(CollideError::BeyondF32 { .. })));
    world.set_transform(id, DAffine3::IDENTITY).unwrap();
    assert_eq!(world.snapshot().unwrap().bounds(), unit);
    world.remove(id).unwrap();
    assert!(matches!(world.set_transform(id, DAffine3::IDENTITY), Err(CollideError::NoSuchObject(_))));
    let gone = world.snapshot().unwrap();
    assert_eq!((gone.part_count(), gone.triangle_count()), (1, 0));
    assert!(gone.closest_hit(&Ray::new(Vec3::new(-1.0, 0.4, 0.6), Vec3::X), Layers::ALL).unwrap().is_none());
    let settings = kinora::collide::Continuous::default();
    assert!(matches!(
        after.moving_contacts(&gone, &ContactOptions::default(), &settings),
        Err(CollideError::OtherPart(_))
    ));
}

#[test]
fn snapshots_stay_as_they_were() {
    let mut world = empty();
    let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    let id = world.add_box("box", unit, DAffine3::IDENTITY).unwrap();
    let ray = Ray::new(Vec3::new(-1.0, 0.4, 0.6), Vec3::X);
    let mut kept = Vec::new();
    for i in 0..12_u8 {
        world.set_transform(id, DAffine3::from_translation(DVec3::X * f64::from(i))).unwrap();
        let snapshot = world.snapshot().unwrap();
        if i % 3 == 0 {
            snapshot.closest_hit(&ray, Layers::ALL).unwrap();
            snapshot.overlaps(&Shape::Box(unit), Layers::ALL).unwrap();
        }
        kept.push(snapshot);
    }
    for (i, snapshot) in (0_u8..).zip(&kept) {
        let hit = snapshot.closest_hit(&ray, Layers::ALL).unwrap().expect("a box ahead");
        assert_eq!(hit.hit.t, 1.0 + f32::from(i));
        let near = snapshot.closest_point(Vec3::NEG_ONE, f64::INFINITY, Layers::ALL).unwrap().expect("a box");
        assert_eq!(near.surface.point.x, f64::from(i));
    }
}

/// A mesh of the shared assets at two moments: contacts within it are those of a sweep over all boxes.
#[test]
fn contacts_within_shared_cloth_are_those_of_a_plain_sweep() {
    let Some(shared) = common::shared_dir() else { return };
    let file = shared.join("assets/dynamic/cloth-funnel/cloth-funnel.glb");
    let scene = Arc::new(import::from_path(&file).expect("a valid file"));
    let mut world = empty();
    let id = world.add_scene(scene.clone(), DAffine3::IDENTITY).unwrap();
    for time_s in [0.0, 1.0] {
        let clips: Vec<_> =
            (0..).zip(&scene.clips).take(1).map(|(i, _)| ActiveClip { clip: ClipId(i), time_s }).collect();
        world.set_time(id, &clips).unwrap();
        let snapshot = world.snapshot().unwrap();
        let found = snapshot.contact_pairs(&ContactOptions { within: true, ..ContactOptions::default() }).unwrap();
        let places = |part: PartId, triangle: u32| {
            let rest = &scene.part(scene.instances[part.index()]).positions;
            snapshot.part(part).unwrap().triangles()[triangle as usize].map(|i| rest[i as usize])
        };
        let mut due = swept_pairs(&snapshot, &|_, _| true);
        due.retain(|TrianglePair { parts: [a, b], triangles: [x, y] }| {
            a != b || !share_place(&places(*a, *x), &places(*b, *y))
        });
        assert_eq!(found, due, "at {time_s} s");
    }
}
