//! States: one for a camera, and one handed from ray to ray.

use kinora::{
    accel::{
        Accel, AnyHit, Closest,
        events::Events,
        list::{List, ListConfig},
    },
    geom::{Hit, Ray},
    glam::Vec3,
    simd::Scalar,
};

use crate::{
    Counts, FORMS, Seen, config, lists, pierced, random_boxes, sorted,
    trace::{Mesh, Random},
    trav,
};

#[test]
fn one_state_serves_all_rays_of_a_camera() {
    let mut random = Random(23);
    let boxes = random_boxes(&mut random, 500, 0.2);
    for eye in [Vec3::splat(-3.0), Vec3::ZERO, boxes[7].min] {
        for form in FORMS {
            let lists = lists(&boxes, form);
            let state = lists.state_at(eye);
            for _ in 0..50 {
                let ray = Ray::new(eye, random.vec3());
                let (mut fresh, mut shared) = (Counts::default(), Counts::default());
                let mut seen = [(); 2].map(|()| Seen { limit: 5.0, ..Seen::default() });
                lists.walk(&trav(&ray), &mut seen[0], &mut fresh);
                lists.walk_at(&trav(&ray), &state, &mut seen[1], &mut shared);
                let [fresh_seen, shared_seen] = seen.map(|s| sorted(s.objects));
                assert_eq!(fresh_seen, shared_seen, "{form} {ray:?}");
                assert_eq!(fresh.events, shared.events, "{form}");
                assert!(shared.skips <= fresh.skips, "{form}: {shared:?} {fresh:?}");
            }
        }
    }
    let nowhere = lists(&boxes, "").state_at(Vec3::new(f32::NAN, 0.0, 0.0));
    let ray = Ray::new(Vec3::splat(-3.0), Vec3::ONE);
    let mut seen = Seen { limit: 100.0, ..Seen::default() };
    lists(&boxes, "").walk_at(&trav(&ray), &nowhere, &mut seen, &mut ());
    assert_eq!(sorted(seen.objects), pierced(&boxes, &ray, 100.0));
}

/// A chain of reflected rays within a closed room of triangles.
fn reflected(mesh: &Mesh, hit: &Hit, ray: &Ray) -> Ray {
    let [a, b, c] = mesh.corners(hit.prim.0 as usize);
    let normal = (b - a).cross(c - a);
    let dir = ray.dir - normal * (2.0 * ray.dir.dot(normal) / normal.dot(normal));
    let side = if ray.dir.dot(normal) < 0.0 { 1e-4 } else { -1e-4 };
    Ray::new(ray.at(hit.t) + normal / normal.length() * side, dir)
}

#[test]
fn a_chain_of_reflected_rays_through_inherited_cursors_gives_the_hits_of_list() {
    let mut random = Random(31);
    let mut corners: Vec<_> = (0..300)
        .map(|_| {
            let v = random.vec3();
            [v, v + random.vec3() * 0.3, v + random.vec3() * 0.3]
        })
        .collect();
    // Walls, so that no ray gets away.
    for axis in 0..3 {
        for side in [-2.0, 2.0] {
            let wall = |u: f32, v: f32| {
                let mut p = Vec3::ZERO;
                p[axis] = side;
                p[(axis + 1) % 3] = u;
                p[(axis + 2) % 3] = v;
                p
            };
            corners.push([wall(-2.0, -2.0), wall(2.0, -2.0), wall(-2.0, 2.0)]);
            corners.push([wall(2.0, 2.0), wall(2.0, -2.0), wall(-2.0, 2.0)]);
        }
    }
    let mesh = Mesh::soup(&corners);
    let prims = mesh.prims();
    let list = List::build(&prims, &ListConfig).expect("a mesh");
    for form in FORMS {
        let events = Events::build(&prims, &config(form)).expect("a mesh");
        let (mut bounces, mut inherited, mut fresh) = (0, Counts::default(), Counts::default());
        for start in 0..20 {
            let mut ray = Ray::new(Vec3::new(0.0, 0.0, -1.5), Random(start).vec3());
            let mut state = events.boxes().state_at(ray.origin);
            for _ in 0..20 {
                let trav = trav(&ray);
                let mut best = [(); 3].map(|()| Closest::new(&trav));
                list.closest::<Scalar, _, _>(&prims, &trav, &mut best[0], &AnyHit, &mut ());
                events.closest_from::<Scalar, _, _>(&prims, &trav, &mut state, &mut best[1], &AnyHit, &mut inherited);
                events.closest::<Scalar, _, _>(&prims, &trav, &mut best[2], &AnyHit, &mut fresh);
                let [due, from_state, from_nothing] = best.map(|b| b.hit(&trav));
                assert_eq!(from_state, due, "{form} {ray:?}");
                assert_eq!(from_nothing, due, "{form} {ray:?}");
                let Some(hit) = due else { break };
                ray = reflected(&mesh, &hit, &ray);
                bounces += 1;
            }
        }
        assert!(bounces > 350, "{form}: {bounces}");
        assert_eq!((inherited.tests, inherited.events), (fresh.tests, fresh.events), "{form}");
    }
}

#[test]
fn a_ray_that_goes_on_where_its_parent_ended_looks_for_nothing() {
    let mut random = Random(37);
    let boxes = random_boxes(&mut random, 2000, 0.1);
    for form in FORMS {
        let lists = lists(&boxes, form);
        let mut place = Vec3::ZERO;
        let mut state = lists.state_at(place);
        let (mut inherited, mut fresh) = (Counts::default(), Counts::default());
        for _ in 0..200 {
            // Inward on the whole.
            let ray = Ray::new(place, random.vec3() - place);
            let t_far = 0.25 * f64::from(random.unit().abs());
            let mut seen = [(); 2].map(|()| Seen { limit: t_far, ..Seen::default() });
            lists.walk_on(&trav(&ray), &mut state, &mut seen[0], &mut inherited);
            lists.walk(&trav(&ray), &mut seen[1], &mut fresh);
            let [from_state, from_nothing] = seen.map(|s| sorted(s.objects));
            assert_eq!(from_state, from_nothing, "{form}");
            place = ray.at(t_far as f32);
        }
        assert_eq!((inherited.tests, inherited.events), (fresh.tests, fresh.events), "{form}");
        if form == "form=flat" {
            assert!(inherited.skips * 10 < fresh.skips, "{inherited:?} {fresh:?}");
        }
    }
}

#[test]
fn a_state_of_another_structure_or_of_before_a_refit_changes_no_answer() {
    let mut random = Random(41);
    let (before, after) = (random_boxes(&mut random, 200, 0.3), random_boxes(&mut random, 200, 0.3));
    for form in FORMS {
        let mut moved = lists(&before, form);
        let state = moved.state_at(Vec3::ZERO);
        let foreign = lists(&after, form).state_at(Vec3::ZERO);
        moved.refit(|i| after[i as usize]);
        for state in [state, foreign] {
            let ray = Ray::new(Vec3::ZERO, random.vec3());
            let mut seen = Seen { limit: 2.0, ..Seen::default() };
            moved.walk_on(&trav(&ray), &mut state.clone(), &mut seen, &mut ());
            assert_eq!(sorted(seen.objects), pierced(&after, &ray, 2.0), "{form}");
        }
    }
}
