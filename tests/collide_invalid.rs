//! Invalid input of every public function of `collide`: an error or no hit, and no answer that is not a number.
#![allow(clippy::cast_precision_loss, reason = "small numbers")]

use std::{ops::ControlFlow, sync::Arc};

use kinora::{
    anim::{ActiveClip, Pose},
    collide::{
        BroadPhase, CollideError, CollisionConfig, CollisionWorld, Contact, ContactLevel, ContactOptions,
        ContactTracker, Continuous, ConvexHull, Layers, Mover, ObjectId, PartId, Shape, Snapshot, TrianglePair,
        box_pairs, boxes_meet, closest_on_triangle, oriented_box, ray_box, sweep_box, triangle_contact,
        triangle_distance, triangle_meets_box, triangle_meets_capsule, triangle_meets_sphere, triangles_meet,
    },
    geom::{Aabb, Hit, InstanceId, PrimId, Ray},
    glam::{DAffine3, DQuat, DVec3, Vec3},
    scene::{ClipId, Scene, builtin},
};

const HOSTILE: [f32; 9] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 1e-45, -0.0, -1.0, 3e30];

/// Points with a hostile number on one axis or on all.
fn points() -> Vec<Vec3> {
    let of = |x: f32| [Vec3::splat(x), Vec3::new(x, 0.25, 0.5), Vec3::new(0.25, x, 0.5), Vec3::new(0.5, 0.25, x)];
    HOSTILE.into_iter().flat_map(of).collect()
}

fn boxes() -> Vec<Aabb> {
    let mut boxes =
        vec![Aabb::EMPTY, Aabb { min: Vec3::ONE, max: Vec3::ZERO }, Aabb { min: Vec3::ONE, max: Vec3::ONE }];
    boxes.extend(
        points()
            .into_iter()
            .flat_map(|p| [Aabb { min: p, max: Vec3::ONE }, Aabb { min: Vec3::ZERO, max: p }, Aabb { min: p, max: p }]),
    );
    boxes
}

fn triangles() -> Vec<[Vec3; 3]> {
    let mut all = vec![[Vec3::ZERO; 3], [Vec3::ZERO, Vec3::ONE, Vec3::ONE * 2.0], [Vec3::X, Vec3::Y, Vec3::Z]];
    all.extend(points().into_iter().flat_map(|p| [[p, Vec3::X, Vec3::Y], [Vec3::X, p, p], [p; 3]]));
    all
}

fn is_finite(t: &[Vec3; 3]) -> bool {
    t.iter().all(|p| p.is_finite())
}

fn world() -> CollisionWorld {
    CollisionWorld::new(&CollisionConfig::default()).expect("the default is valid")
}

/// A box, a mesh without area, a mesh without triangles and one without anything.
fn stage() -> (CollisionWorld, Snapshot) {
    let mut world = world();
    let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    world.add_box("box", unit, DAffine3::IDENTITY).expect("a box");
    let flat = vec![Vec3::ZERO, Vec3::ONE, Vec3::ONE * 2.0];
    world.add_mesh("flat", flat.clone(), vec![[0, 1, 2], [0, 0, 0], [1, 1, 2]], DAffine3::IDENTITY).expect("a mesh");
    world.add_mesh("points", flat, vec![], DAffine3::IDENTITY).expect("a mesh");
    world.add_mesh("nothing", vec![], vec![], DAffine3::IDENTITY).expect("a mesh");
    let snapshot = world.snapshot().expect("a snapshot");
    (world, snapshot)
}

#[test]
fn tests_of_primitives_answer_nothing_to_what_is_not_finite() {
    let unit = [Vec3::ZERO, Vec3::X, Vec3::Y];
    for t in triangles() {
        let fine = is_finite(&t);
        assert!(fine || !triangles_meet(&t, &unit) && !triangles_meet(&unit, &t), "{t:?}");
        assert_eq!(triangle_contact(&t, &unit).is_some(), triangles_meet(&t, &unit), "{t:?}");
        let contact = triangle_contact(&unit, &t);
        assert!(contact.is_none_or(|c| c.points.iter().all(|p| p.is_finite())), "{t:?}");
        assert_eq!(triangle_distance(&t, &unit).is_some(), fine, "{t:?}");
        assert!(triangle_distance(&unit, &t).is_none_or(|n| n.distance.is_finite()), "{t:?}");
        for p in points() {
            let near = closest_on_triangle(p, &t);
            assert_eq!(near.is_some(), fine && p.is_finite(), "{p} {t:?}");
            assert!(near.is_none_or(|n| n.distance.is_finite() && n.points[1].is_finite()), "{p} {t:?}");
            for radius in HOSTILE {
                let ball = triangle_meets_sphere(&t, p, radius);
                let capsule = triangle_meets_capsule(&t, p, Vec3::ZERO, radius);
                let whole = fine && p.is_finite() && radius.is_finite() && radius >= 0.0;
                assert!(whole || !(ball || capsule), "{t:?} {p} {radius}");
            }
        }
        for aabb in boxes() {
            let met = triangle_meets_box(&t, &aabb);
            assert!(!met || (fine && !aabb.is_empty()), "{t:?} {aabb:?}");
        }
    }
}

#[test]
fn boxes_without_an_inside_meet_nothing() {
    let all = boxes();
    let mut broad = BroadPhase::default();
    for [i, j] in box_pairs(&all) {
        assert!(!all[i as usize].is_empty() && !all[j as usize].is_empty());
    }
    assert_eq!(broad.update(&all), box_pairs(&all));
    assert_eq!(broad.update(&all[1..]), box_pairs(&all[1..]));
    assert_eq!(broad.update(&[]), [[0; 2]; 0]);
    let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
    for aabb in &all {
        assert!(!aabb.is_empty() || !boxes_meet(aabb, &unit));
        for p in points() {
            let passage = sweep_box(aabb, p, &unit);
            assert!(passage.is_none() || (!aabb.is_empty() && p.is_finite()), "{aabb:?} {p}");
            assert!(passage.is_none_or(|x| x.enter >= 0.0 && x.exit <= 1.0 && x.enter <= x.exit), "{aabb:?} {p}");
            for ray in [
                Ray::new(p, Vec3::X),
                Ray::new(Vec3::ZERO, p),
                Ray { t_near: p.x, t_far: p.y, ..Ray::new(Vec3::ZERO, Vec3::ONE) },
            ] {
                let passage = ray_box(&ray, aabb);
                assert!(passage.is_none_or(|x| !x.enter.is_nan() && x.enter <= x.exit), "{ray:?} {aabb:?}");
            }
        }
    }
}

#[test]
fn hulls_of_hostile_points_are_errors_or_hold_their_points() {
    for p in points() {
        let hull = ConvexHull::new(&[p, Vec3::X, Vec3::Y, Vec3::Z]);
        assert_eq!(hull.is_ok(), p.is_finite(), "{p}");
        if let Ok(hull) = hull {
            assert!(hull.contains(p) && hull.contains(Vec3::X) && hull.center().is_finite(), "{p}");
            assert!(points().iter().all(|&q| q.is_finite() || !hull.contains(q)));
        }
        for place in [DAffine3::from_translation(p.as_dvec3()), DAffine3::from_scale(p.as_dvec3())] {
            let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
            let hull = ConvexHull::of_box(&unit, &place);
            assert!(hull.is_err() || p.is_finite(), "{p}");
        }
        for (center, half) in [(p, Vec3::ONE), (Vec3::ZERO, p)] {
            let hull = oriented_box(center.as_dvec3(), half.as_dvec3(), DQuat::IDENTITY);
            let fine = p.is_finite() && half.cmpge(Vec3::ZERO).all();
            assert!(hull.is_err() || fine, "{center} {half}");
        }
    }
    assert!(oriented_box(DVec3::ZERO, DVec3::ONE, DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0)).is_err());
    for points in [
        vec![Vec3::ONE; 9],
        vec![Vec3::ZERO, Vec3::X, Vec3::X * 3.0],
        vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE.with_z(0.0)],
    ] {
        let hull = ConvexHull::new(&points).expect("finite points");
        assert!(points.iter().all(|&p| hull.contains(p)) && !hull.contains(Vec3::NEG_ONE), "{points:?}");
    }
}

#[test]
fn worlds_refuse_what_is_not_finite_or_not_there() {
    let (mut world, _) = stage();
    let none = ObjectId(99);
    for text in ["", "bvh9", "bvh8:leaf=0", "bvh8:leaf=x", "list:leaf=3"] {
        let config = CollisionConfig { accel: text.to_owned(), ..CollisionConfig::default() };
        assert!(CollisionWorld::new(&config).is_err(), "{text:?}");
    }
    let config = CollisionConfig { top: "tree".to_owned(), ..CollisionConfig::default() };
    assert!(CollisionWorld::new(&config).is_err());
    for p in points().into_iter().filter(|p| !p.is_finite()) {
        let place = DAffine3::from_translation(p.as_dvec3());
        let unit = Aabb { min: Vec3::ZERO, max: Vec3::ONE };
        assert!(world.add_box("box", unit, place).is_err());
        assert!(world.add_box("box", Aabb { min: Vec3::ZERO, max: p }, DAffine3::IDENTITY).is_err());
        assert!(world.add_mesh("mesh", vec![p], vec![[0; 3]], DAffine3::IDENTITY).is_err());
        assert!(world.add_mesh("mesh", vec![], vec![], place).is_err());
        assert!(world.add_scene(Arc::default(), place).is_err());
        assert!(world.set_transform(ObjectId(0), place).is_err());
        assert!(world.set_vertices(ObjectId(0), &[p; 8]).is_err());
    }
    assert!(world.add_mesh("mesh", vec![], vec![[0; 3]], DAffine3::IDENTITY).is_err());
    for count in [0, 7, 9] {
        assert!(matches!(world.set_vertices(ObjectId(0), &vec![Vec3::ZERO; count]), Err(CollideError::Count { .. })));
    }
    assert!(world.remove(none).is_err() && world.parts(none).is_err() && world.set_time(none, &[]).is_err());
    assert!(world.set_transform(none, DAffine3::IDENTITY).is_err() && world.set_vertices(none, &[]).is_err());
    let pose = Arc::new(Pose::rest(&Scene::default()));
    assert!(world.set_pose(none, pose.clone()).is_err());
    assert!(matches!(world.set_pose(ObjectId(0), pose.clone()), Err(CollideError::NotAScene(_))));
    let scene =
        world.add_scene(Arc::new(builtin::load("walk").expect("a scene")), DAffine3::IDENTITY).expect("a scene");
    assert!(matches!(world.set_pose(scene, pose), Err(CollideError::PoseOfAnotherScene(_))));
    assert!(matches!(world.set_vertices(scene, &[]), Err(CollideError::NotAMesh(_))));
    for time_s in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let clips = [ActiveClip { clip: ClipId(0), time_s }];
        assert!(matches!(world.set_time(scene, &clips), Err(CollideError::NotFinite { .. })));
    }
    let clips = [ActiveClip { clip: ClipId(77), time_s: 0.0 }];
    assert!(matches!(world.set_time(scene, &clips), Err(CollideError::NoSuchClip { .. })));
    for time_s in [-1e300, 1e300] {
        world.set_time(scene, &[ActiveClip { clip: ClipId(0), time_s }]).expect("any finite time");
        assert!(world.snapshot().expect("a pose").bounds().min.is_finite());
    }
}

#[test]
fn rays_with_hostile_numbers_hit_nothing_or_finite_points() {
    let (_, snapshot) = stage();
    let good = Ray::new(Vec3::new(-1.0, 0.4, 0.6), Vec3::X);
    for p in points() {
        for ray in
            [Ray::new(p, Vec3::X), Ray::new(good.origin, p), Ray { t_near: p.x, ..good }, Ray { t_far: p.x, ..good }]
        {
            let all = snapshot.all_hits(&ray, Layers::ALL).expect("a ray is never refused");
            let first = snapshot.closest_hit(&ray, Layers::ALL).expect("as above");
            assert_eq!(first.map(|h| h.hit), all.first().map(|h| h.hit), "{ray:?}");
            assert_eq!(snapshot.any_hit(&ray, Layers::ALL).expect("as above"), !all.is_empty());
            assert!(all.iter().all(|h| h.hit.t.is_finite() && h.surface.point.is_finite()), "{ray:?}");
            assert!(snapshot.closest_hit_where(&ray, Layers::ALL, |_| false).expect("as above").is_none());
            assert!(!snapshot.any_hit_where(&ray, 0, |_| true).expect("as above"));
        }
    }
    let (mut hits, mut blocked) = ([None; 2], [false; 3]);
    assert!(matches!(snapshot.closest_hits(&[good], Layers::ALL, &mut hits), Err(CollideError::Count { .. })));
    assert!(matches!(snapshot.any_hits(&[good], Layers::ALL, &mut blocked), Err(CollideError::Count { .. })));
    assert!(snapshot.closest_hits(&[], Layers::ALL, &mut []).is_ok());
    let hit = |instance, prim| Hit { t: 1.0, u: 0.0, v: 0.0, prim: PrimId(prim), instance: InstanceId(instance) };
    assert!(matches!(snapshot.named(&good, &hit(0, 12)), Err(CollideError::NoSuchTriangle { .. })));
    assert!(matches!(snapshot.named(&good, &hit(4, 0)), Err(CollideError::NoSuchPart { .. })));
}

#[test]
fn questions_with_hostile_numbers_are_errors_or_answered_in_numbers() {
    let (_, snapshot) = stage();
    let radii = HOSTILE.into_iter().chain([0.0, 0.5]);
    for (p, radius) in points().into_iter().flat_map(|p| radii.clone().map(move |r| (p, r))) {
        let shapes = [
            Shape::Sphere { center: p, radius },
            Shape::Capsule { from: p, to: p, radius },
            Shape::Capsule { from: Vec3::ZERO, to: p, radius },
            Shape::Triangle([p, Vec3::X, Vec3::Y]),
        ];
        for shape in shapes {
            let found = snapshot.overlaps(&shape, Layers::ALL);
            let fine = p.is_finite() && (matches!(shape, Shape::Triangle(_)) || (radius.is_finite() && radius >= 0.0));
            assert_eq!(found.is_ok(), fine, "{shape:?}");
            assert!(found.unwrap_or_default().iter().all(|o| o.surface.point.is_finite()), "{shape:?}");
            assert_eq!(snapshot.first_overlap(&shape, Layers::ALL).is_ok(), fine);
            assert_eq!(snapshot.any_overlap(&shape, 0).is_ok(), fine);
            assert_eq!(snapshot.each_overlap(&shape, 1, |_| ControlFlow::Break(())).is_ok(), fine);
        }
        let movers = [
            Mover::Sphere { center: p, radius },
            Mover::Capsule { from: Vec3::ONE, to: p, radius },
            Mover::Box(Aabb { min: p, max: Vec3::splat(radius) }),
        ];
        for mover in movers {
            for motion in [Vec3::ZERO, Vec3::X, Vec3::splat(f32::MAX), Vec3::splat(f32::NAN), p] {
                let hit = snapshot.sweep(&mover, motion, Layers::ALL);
                let finite = p.is_finite() && motion.is_finite() && radius.is_finite();
                assert!(hit.is_err() || finite, "{mover:?} {motion}");
                let sound =
                    |h: &kinora::collide::SweepHit| (0.0..=1.0).contains(&h.time) && h.surface.point.is_finite();
                assert!(hit.ok().flatten().is_none_or(|h| sound(&h)), "{mover:?} {motion}");
            }
        }
        let within = f64::from(radius);
        let near = snapshot.closest_point(p, within, Layers::ALL);
        assert_eq!(near.is_ok(), p.is_finite() && within >= 0.0, "{p} {within}");
        assert!(near.ok().flatten().is_none_or(|n| n.distance.is_finite() && n.surface.point.is_finite()));
        assert_eq!(snapshot.closest_point_on(PartId(0), p, within).is_ok(), p.is_finite() && within >= 0.0);
        assert_eq!(snapshot.distance_between(PartId(0), PartId(1), within).is_ok(), within >= 0.0);
        let signed = snapshot.signed_distance(PartId(0), p);
        assert_eq!((signed.is_ok(), snapshot.winding_number(PartId(0), p).is_ok()), (p.is_finite(), p.is_finite()));
        assert_eq!(snapshot.surface(PartId(0), 0, f64::from(p.x), 0.0).is_ok(), p.x.is_finite(), "{p}");
    }
    for aabb in boxes() {
        assert_eq!(snapshot.overlaps(&Shape::Box(aabb), Layers::ALL).is_ok(), !aabb.is_empty(), "{aabb:?}");
    }
}

#[test]
fn parts_and_triangles_that_are_not_there_are_errors() {
    let (mut world, snapshot) = stage();
    let (first, none) = (PartId(0), PartId(4));
    assert!(snapshot.part(none).is_err() && snapshot.surface(none, 0, 0.0, 0.0).is_err());
    assert!(snapshot.closest_point_on(none, Vec3::ZERO, 1.0).is_err());
    assert!(
        snapshot.distance_between(first, none, 1.0).is_err() && snapshot.distance_between(none, first, 1.0).is_err()
    );
    assert!(snapshot.signed_distance(none, Vec3::ZERO).is_err() && snapshot.winding_number(none, Vec3::ZERO).is_err());
    assert!(snapshot.overlaps(&Shape::Part(none), Layers::ALL).is_err());
    assert!(snapshot.pairs_between(first, none).is_err() && snapshot.are_neighbours(none, [0, 0]).is_err());
    assert!(snapshot.are_neighbours(first, [0, 12]).is_err());
    assert!(snapshot.surface(first, 12, 0.0, 0.0).is_err());
    let pair = |part, triangle| TrianglePair { parts: [first, part], triangles: [0, triangle] };
    for wrong in [pair(none, 0), pair(first, 12), pair(PartId(2), 0)] {
        assert!(snapshot.contact(wrong).is_err(), "{wrong:?}");
        assert!(snapshot.first_impact(&snapshot, wrong, &Continuous::default()).is_err(), "{wrong:?}");
    }
    // Without triangles there is nothing to answer, and no error.
    for part in [PartId(2), PartId(3)] {
        assert!(snapshot.closest_point_on(part, Vec3::ZERO, f64::INFINITY).expect("a part").is_none());
        assert!(snapshot.distance_between(first, part, f64::INFINITY).expect("parts").is_none());
        assert!(snapshot.overlaps(&Shape::Part(part), Layers::ALL).expect("a part").is_empty());
        assert!(matches!(snapshot.signed_distance(part, Vec3::ZERO), Err(CollideError::NoTriangles(_))));
    }
    assert!(matches!(snapshot.signed_distance(PartId(1), Vec3::ZERO), Ok(_) | Err(CollideError::NotClosed { .. })));
    let (options, other) = (ContactOptions::default(), self::world().snapshot().expect("nothing"));
    for settings in [
        Continuous { tolerance: f64::NAN, ..Continuous::default() },
        Continuous { tolerance: -1.0, ..Continuous::default() },
        Continuous { min_separation: f64::INFINITY, ..Continuous::default() },
        Continuous { min_separation: f64::NAN, ..Continuous::default() },
    ] {
        assert!(snapshot.moving_contacts(&snapshot, &options, &settings).is_err());
        let start = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        for impact in [settings.vertex_face(&start, &start), settings.edge_edge(&start, &start)] {
            assert!(impact.is_none_or(|i| !i.time.is_nan()));
        }
    }
    assert!(snapshot.moving_contacts(&other, &options, &Continuous::default()).is_err());
    assert!(world.set_layers(none, Layers::default()).is_err());
}

#[test]
fn continuous_queries_of_hostile_corners_end() {
    let good = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let numbers = [f64::NAN, f64::INFINITY, f64::MAX, f64::MIN, 5e-324, 1e-300, 1e155, -0.0];
    for max_cells in [0, 1, 64] {
        let settings = Continuous { max_cells, ..Continuous::default() };
        for number in numbers {
            for at in 0..4 {
                let mut bad = good;
                bad[at] = DVec3::new(number, 0.5, -number);
                for (start, end) in [(good, bad), (bad, good), (bad, bad)] {
                    for impact in [settings.vertex_face(&start, &end), settings.edge_edge(&start, &end)] {
                        let sound = |i: &kinora::collide::Impact| (0.0..=1.0).contains(&i.time) && !i.gap.is_nan();
                        assert!(impact.is_none_or(|i| number.is_finite() && sound(&i)), "{start:?} {end:?} {impact:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn trackers_take_any_contacts() {
    let pair = TrianglePair { parts: [PartId(3), PartId(1)], triangles: [7, 7] };
    let point = DVec3::NAN;
    let odd = Contact { pair, dim: 9, segment: [point; 2], point, normal: point, depth: f64::NAN };
    for level in [ContactLevel::Part, ContactLevel::Triangle] {
        let mut tracker = ContactTracker::new(level);
        assert_eq!(tracker.update(&[odd, odd]).len(), 1);
        assert_eq!(tracker.update(&[]).len(), 1);
        assert_eq!(tracker.update(&[]).len(), 0);
    }
}
