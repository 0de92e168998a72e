//! The fewest tests that boxes allow.

use kinora::{
    accel::{
        Accel, AnyHit, Closest,
        events::Events,
        list::{List, ListConfig},
    },
    geom::{Aabb, Ray},
    glam::Vec3,
    scene::spd::SpdKind,
    simd::Scalar,
};

use crate::{
    Counts, FORMS, Seen, config, interval, lists, pierced, random_boxes, random_rays, sorted, spd_boxes,
    trace::{Mesh, Random},
    trav,
};

// L11 and L12: the least number of tests.

#[test]
fn l11_only_the_naive_method_tests_every_object() {
    let mesh = Mesh::soup(
        &(0..500)
            .map({
                let mut random = Random(3);
                move |_| {
                    let v = random.vec3();
                    [v, v + random.vec3() * 0.1, v + random.vec3() * 0.1]
                }
            })
            .collect::<Vec<_>>(),
    );
    let naive = List::build(&mesh.prims(), &ListConfig).expect("a mesh");
    let events = Events::build(&mesh.prims(), &config("form=flat")).expect("a mesh");
    let (mut all, mut least) = (Counts::default(), Counts::default());
    let ray = trav(&Ray::new(Vec3::splat(-2.0), Vec3::ONE));
    let [mut first, mut second] = [Closest::new(&ray), Closest::new(&ray)];
    naive.closest::<Scalar, _, _>(&mesh.prims(), &ray, &mut first, &AnyHit, &mut all);
    events.closest::<Scalar, _, _>(&mesh.prims(), &ray, &mut second, &AnyHit, &mut least);
    assert_eq!(all.tests, 500);
    assert!(least.tests < 20, "{least:?}");
}

/// Walks with hits that shorten the ray: the tests are exactly those of the boxes pierced up to the nearest hit.
fn tests_are_the_least(boxes: &[Aabb], rays: &[Ray], random: &mut Random) -> usize {
    let lists = FORMS.map(|form| (form, lists(boxes, form)));
    let mut tests = 0;
    for ray in rays {
        // Some objects are hit somewhere within their boxes.
        let mut hit = |b: &Aabb| {
            let (enter, exit) = interval(b, ray)?;
            let t = enter + (exit - enter) * f64::from(random.unit().abs());
            (random.below(3) == 0 && t.is_finite()).then_some(t)
        };
        let hits: Vec<_> = boxes.iter().map(&mut hit).collect();
        let t_far = f64::from(trav(ray).range().t_far);
        let t_hit = hits.iter().flatten().copied().fold(t_far, f64::min);
        let due = pierced(boxes, ray, t_hit);
        for (form, lists) in &lists {
            let mut seen = Seen { hits: &hits, limit: t_far, ..Seen::default() };
            let mut counts = Counts::default();
            lists.walk(&trav(ray), &mut seen, &mut counts);
            assert_eq!(counts.tests, seen.objects.len());
            assert_eq!(seen.limit, t_hit, "{form} {ray:?}");
            let entries = seen.objects.iter().map(|&i| interval(&boxes[i as usize], ray).expect("pierced").0);
            assert!(entries.is_sorted(), "{form} {ray:?}: not in the order of entry");
            assert_eq!(sorted(seen.objects), due, "{form} {ray:?}");
        }
        tests += due.len();
    }
    tests
}

#[test]
fn l12_tests_are_the_least_on_random_boxes() {
    let mut random = Random(17);
    for (count, size) in [(1, 0.5), (3, 1.0), (40, 0.5), (200, 0.1), (400, 0.5)] {
        let boxes = random_boxes(&mut random, count, size);
        let rays = random_rays(&mut random, 60, &boxes);
        assert!(tests_are_the_least(&boxes, &rays, &mut random) > 20);
    }
}

#[test]
fn l12_tests_are_the_least_on_the_standard_databases() {
    let mut random = Random(18);
    for kind in SpdKind::ALL {
        let size = (1..kind.max_size()).take_while(|&n| kind.object_count(n) < 1000).last().unwrap_or(1);
        let boxes = spd_boxes(kind, size);
        let rays = random_rays(&mut random, 25, &boxes);
        assert!(tests_are_the_least(&boxes, &rays, &mut random) > 25, "{}", kind.name());
    }
}
