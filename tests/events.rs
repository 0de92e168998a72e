//! Event lists over plain boxes: each pitfall of the method by name, and the least number of tests.
//!
//! The numbers L1 to L14 are those of the list of pitfalls that the structure was made after.
#![allow(missing_docs, reason = "a test file")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared exactly"
)]

#[path = "common/trace.rs"]
mod trace;

use kinora::{
    accel::{
        Accel, AccelConfig, AnyHit, Closest, Counter, Refit, TravRay, Visitor,
        events::{EventBoxes, EventState, Events, EventsConfig, Form},
        list::{List, ListConfig},
    },
    geom::{Aabb, Hit, Ray},
    glam::Vec3,
    rayon,
    scene::spd::{SpdKind, SpdShape},
    simd::Scalar,
};
use proptest::prelude::*;
use trace::{Mesh, Random};

/// What a walk did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Counts {
    opened: usize,
    tests: usize,
    events: usize,
    skips: usize,
}

impl Counter for Counts {
    fn node(&mut self) {
        self.opened += 1;
    }

    fn prim(&mut self) {
        self.tests += 1;
    }

    fn event(&mut self) {
        self.events += 1;
    }

    fn skip(&mut self) {
        self.skips += 1;
    }
}

/// Notes what it is shown; objects with a hit shorten the ray.
#[derive(Debug, Default)]
struct Seen<'a> {
    objects: Vec<u32>,
    hits: &'a [Option<f64>],
    limit: f64,
}

impl Visitor for Seen<'_> {
    fn t_limit(&self) -> f64 {
        self.limit
    }

    fn visit(&mut self, object: u32) -> bool {
        self.objects.push(object);
        if let Some(Some(t)) = self.hits.get(object as usize) {
            self.limit = self.limit.min(*t);
        }
        false
    }
}

fn config(text: &str) -> EventsConfig {
    let mut config = EventsConfig::default();
    for (key, value) in text.split(',').filter_map(|pair| pair.split_once('=')) {
        config.set(key, value).expect("a setting");
    }
    config
}

/// Both forms, and hierarchies of other grids and thresholds.
const FORMS: [&str; 5] = ["form=flat", "", "threshold=1", "grid=3,threshold=2", "grid=5,threshold=16,large=0.2"];

fn lists(boxes: &[Aabb], text: &str) -> EventBoxes {
    let lists = EventBoxes::build(boxes.len(), |i| boxes[i as usize], &config(text)).expect("few boxes");
    lists.validate(|i| boxes[i as usize]).unwrap_or_else(|v| panic!("{text}: {v:?}"));
    lists
}

fn trav(ray: &Ray) -> TravRay {
    TravRay::new(ray).expect("a ray")
}

/// The boxes that a fresh walk shows, in order.
fn walked(lists: &EventBoxes, ray: &Ray) -> Vec<u32> {
    let ray = trav(ray);
    let mut seen = Seen { limit: f64::from(ray.range().t_far), ..Seen::default() };
    lists.walk(&ray, &mut seen, &mut ());
    seen.objects
}

fn sorted(mut objects: Vec<u32>) -> Vec<u32> {
    objects.sort_unstable();
    objects
}

fn aabb(min: [f32; 3], max: [f32; 3]) -> Aabb {
    Aabb { min: Vec3::from(min), max: Vec3::from(max) }
}

/// When the ray enters and leaves a box, by the arithmetic that the structure documents; exits widened.
fn interval(aabb: &Aabb, ray: &Ray) -> Option<(f64, f64)> {
    let (mut enter, mut exit) = (f64::from(ray.t_near), f64::INFINITY);
    for axis in 0..3 {
        let (min, max) = (aabb.min[axis], aabb.max[axis]);
        if ray.dir[axis] == 0.0 {
            if !(min <= ray.origin[axis] && ray.origin[axis] <= max) {
                return None;
            }
            continue;
        }
        let inv = 1.0 / f64::from(ray.dir[axis]);
        let at = |plane: f32| (f64::from(plane) - f64::from(ray.origin[axis])) * inv;
        let (near, far) = if inv > 0.0 { (at(min), at(max)) } else { (at(max), at(min)) };
        enter = enter.max(near);
        exit = exit.min(far * (1.0 + 2.0_f64.powi(-49)));
    }
    (!aabb.is_empty() && enter <= exit).then_some((enter, exit))
}

/// The boxes that the ray enters at `limit` or before, by looking at each.
fn pierced(boxes: &[Aabb], ray: &Ray, limit: f64) -> Vec<u32> {
    let limit = limit * (1.0 + 2.0_f64.powi(-49));
    (0..)
        .zip(boxes)
        .filter(|(_, b)| interval(b, ray).is_some_and(|(enter, _)| enter <= limit))
        .map(|(i, _)| i)
        .collect()
}

/// As [`pierced`] for whole numbers, in exact arithmetic without any margin.
fn pierced_exactly(boxes: &[Aabb], ray: &Ray) -> Vec<u32> {
    let whole = |v: Vec3| v.to_array().map(|x| x as i64);
    let (o, d) = (whole(ray.origin), whole(ray.dir));
    let holds = |b: &Aabb| {
        let (min, max) = (whole(b.min), whole(b.max));
        // t as fractions with positive denominators.
        let mut enter = (ray.t_near as i64, 1);
        let mut exit = (ray.t_far as i64, 1);
        for i in 0..3 {
            if d[i] == 0 {
                if o[i] < min[i] || max[i] < o[i] {
                    return false;
                }
                continue;
            }
            let (near, far) = if d[i] > 0 { (min[i], max[i]) } else { (max[i], min[i]) };
            let at = |plane: i64| ((plane - o[i]) * d[i].signum(), d[i].abs());
            if at(near).0 * enter.1 > enter.0 * at(near).1 {
                enter = at(near);
            }
            if at(far).0 * exit.1 < exit.0 * at(far).1 {
                exit = at(far);
            }
        }
        enter.0 * exit.1 <= exit.0 * enter.1
    };
    (0..).zip(boxes).filter(|(_, b)| holds(b)).map(|(i, _)| i).collect()
}

fn random_boxes(random: &mut Random, count: usize, size: f32) -> Vec<Aabb> {
    let one = |_| {
        let (center, half) = (random.vec3(), random.vec3().abs() * size);
        Aabb { min: center - half, max: center + half }
    };
    (0..count).map(one).collect()
}

// L1: marks made by events go stale.

#[test]
fn l01_a_box_left_on_one_axis_before_it_is_entered_on_another_is_met_on_the_way_back() {
    let left_early = aabb([2.0, 4.0, -1.0], [3.0, 6.0, 1.0]);
    let mirror = aabb([5.0, 4.0, -1.0], [5.5, 6.0, 1.0]);
    let boxes = [left_early, mirror, aabb([-9.0, -9.0, -2.0], [-8.0, -8.0, 2.0])];
    for form in FORMS {
        let lists = lists(&boxes, form);
        let mut state = EventState::default();
        let mut seen = Seen { limit: 100.0, hits: &[None, Some(5.0)], ..Seen::default() };
        lists.walk_on(&trav(&Ray::new(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0))), &mut state, &mut seen, &mut ());
        assert_eq!(seen.objects, [1], "{form}");
        let back = trav(&Ray::new(Vec3::new(5.0, 5.0, 0.0), -Vec3::X));
        let mut seen = Seen { limit: 100.0, ..Seen::default() };
        lists.walk_on(&back, &mut state, &mut seen, &mut ());
        assert_eq!(seen.objects, [1, 0], "{form}");
    }
}

// L2: equal coordinates.

#[test]
fn l02_flat_and_touching_boxes_are_entered_before_they_are_left_in_both_directions() {
    let point = aabb([1.0; 3], [1.0; 3]);
    let sheet = aabb([0.0, 0.0, 1.0], [2.0, 2.0, 1.0]);
    let touching = [aabb([0.0; 3], [1.0; 3]), aabb([1.0; 3], [2.0; 3])];
    let boxes = [point, sheet, touching[0], touching[1], aabb([0.0; 3], [2.0; 3])];
    for form in FORMS {
        let lists = lists(&boxes, form);
        for sign in [1.0, -1.0] {
            let ray = Ray::new(Vec3::ONE - Vec3::ONE * sign * 3.0, Vec3::ONE * sign);
            assert_eq!(sorted(walked(&lists, &ray)), [0, 1, 2, 3, 4], "{form} {sign}");
            // Along the common edge of the touching boxes.
            let ray = Ray::new(Vec3::new(1.0, 1.0, 1.0 - 3.0 * sign), Vec3::Z * sign);
            assert_eq!(sorted(walked(&lists, &ray)), [0, 1, 2, 3, 4], "{form} {sign}");
        }
    }
}

// L3: times on different axes are rounded differently.

#[test]
fn l03_a_box_that_the_ray_touches_in_one_point_is_met_whatever_the_rounding() {
    let mut random = Random(5);
    let mut close = 0;
    for round in 0..400 {
        let dir = Vec3::new(random.unit(), random.unit(), random.unit());
        let dir = Vec3::from(dir.to_array().map(|x| (x * 1000.0).round() + 0.5));
        let t = 1.0 + random.below(64) as f32;
        // Exact: t * dir has few bits.
        let corner = dir * t;
        let mut boxes = random_boxes(&mut random, 6, 0.5)
            .iter()
            .map(|b| Aabb { min: b.min + corner, max: b.max + corner })
            .collect::<Vec<_>>();
        // The ray meets this edge and nothing else of the box: it leaves one axis where it enters another.
        let mut touched = Aabb { min: corner - 1.0, max: corner + 1.0 };
        let (ahead, behind) = [(0, 1), (1, 2), (2, 0)][round % 3];
        for (axis, is_ahead) in [(ahead, true), (behind, false)] {
            let upward = (dir[axis] > 0.0) == is_ahead;
            if upward { touched.min[axis] = corner[axis] } else { touched.max[axis] = corner[axis] }
        }
        boxes.push(touched);
        let ray = Ray::new(Vec3::ZERO, dir);
        let at = |axis: usize| f64::from(corner[axis]) * (1.0 / f64::from(dir[axis]));
        close += usize::from(at(ahead) > at(behind));
        for form in FORMS {
            assert!(walked(&lists(&boxes, form), &ray).contains(&6), "{form} round {round} {ray:?}");
        }
    }
    assert!(close > 20, "{close} cases have the wrong order");
}

// L4: axes that the ray does not move along.

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn l04_l05_rays_on_whole_numbers_meet_exactly_the_closed_boxes_that_they_meet(
        boxes in prop::collection::vec((prop::array::uniform3(-8_i8..8), prop::array::uniform3(0_u8..5)), 1..50),
        origin in prop::array::uniform3(-10_i8..10),
        dir in prop::array::uniform3(-3_i8..4),
        t_near in 0_u8..3,
        length in 0_u8..20,
    ) {
        let boxes: Vec<_> = boxes.into_iter().map(|(min, size)| {
            let min = Vec3::from(min.map(f32::from));
            Aabb { min, max: min + Vec3::from(size.map(f32::from)) }
        }).collect();
        let ray = Ray {
            t_near: f32::from(t_near),
            t_far: f32::from(t_near + length),
            ..Ray::new(Vec3::from(origin.map(f32::from)), Vec3::from(dir.map(f32::from)))
        };
        prop_assume!(ray.dir != Vec3::ZERO);
        let due = pierced_exactly(&boxes, &ray);
        for form in FORMS {
            // Each once: duplicates would stay.
            prop_assert_eq!(sorted(walked(&lists(&boxes, form), &ray)), due.clone(), "{}", form);
        }
    }
}

#[test]
fn l04_an_axis_without_motion_has_no_events() {
    let boxes: Vec<_> = (0..100_u8).map(|i| aabb([f32::from(i), 0.0, 0.0], [f32::from(i) + 0.5, 1.0, 1.0])).collect();
    let lists = lists(&boxes, "form=flat");
    for zero in [0.0, -0.0] {
        let mut counts = Counts::default();
        let mut seen = Seen { limit: 100.0, ..Seen::default() };
        let ray = Ray::new(Vec3::new(50.25, -1.0, 0.5), Vec3::new(zero, 1.0, zero));
        lists.walk(&trav(&ray), &mut seen, &mut counts);
        assert_eq!(seen.objects, [50]);
        // The y axis alone: the entries of all boxes, then the exit of the first ends the walk or not.
        assert!((100..=200).contains(&counts.events), "{counts:?}");
    }
}

// L5: an origin on an event.

#[test]
fn l05_a_ray_that_begins_on_a_face_is_inside_of_both_boxes_that_share_it() {
    let boxes = [aabb([0.0; 3], [1.0; 3]), aabb([1.0, 0.0, 0.0], [2.0, 1.0, 1.0]), aabb([5.0; 3], [6.0; 3])];
    for form in FORMS {
        let lists = lists(&boxes, form);
        for dir in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Z, Vec3::new(1.0, 1.0, 1.0), Vec3::new(-1.0, 0.5, -0.25)] {
            let ray = Ray { t_far: 0.25, ..Ray::new(Vec3::new(1.0, 0.5, 0.5), dir) };
            assert_eq!(sorted(walked(&lists, &ray)), [0, 1], "{form} {dir}");
            let state = lists.state_at(ray.origin);
            let mut seen = Seen { limit: 0.25, ..Seen::default() };
            lists.walk_at(&trav(&ray), &state, &mut seen, &mut ());
            assert_eq!(sorted(seen.objects), [0, 1], "{form} {dir} from the state of the point");
        }
    }
}

// L6: the origin of a secondary ray is not quite where its parent ended.

#[test]
fn l06_cursors_are_seated_again_wherever_the_next_ray_begins() {
    let mut random = Random(11);
    let boxes = random_boxes(&mut random, 300, 0.3);
    for form in FORMS {
        let lists = lists(&boxes, form);
        let mut state = EventState::default();
        let mut place = Vec3::ZERO;
        for step in 0..300 {
            // Small offsets mostly, sometimes another place altogether, at times with t_near.
            let offset = [1e-6, 1e-3, 0.1, 2.0][step % 4];
            let origin = place + random.vec3() * offset;
            let t_near = if step % 5 == 0 { 0.25 } else { 0.0 };
            let ray = Ray { t_near, ..Ray::new(origin, random.vec3()) };
            let t_far = f64::from(random.unit().abs());
            let mut seen = Seen { limit: t_far, ..Seen::default() };
            lists.walk_on(&trav(&ray), &mut state, &mut seen, &mut ());
            assert_eq!(sorted(seen.objects), pierced(&boxes, &ray, t_far), "{form} step {step}");
            place = ray.at(t_far as f32);
        }
    }
}

// L7: objects behind the camera are objects.

#[test]
fn l07_what_lay_behind_one_ray_is_met_by_the_next() {
    let boxes: Vec<_> = (0..40_u8).map(|i| aabb([f32::from(i), 0.0, 0.0], [f32::from(i) + 0.5, 1.0, 1.0])).collect();
    for form in FORMS {
        let lists = lists(&boxes, form);
        let mut state = lists.state_at(Vec3::new(20.25, 0.5, 0.5));
        let walk = |dir: Vec3, state: &mut EventState| {
            let mut seen = Seen { limit: 100.0, ..Seen::default() };
            lists.walk_on(&trav(&Ray::new(Vec3::new(20.25, 0.5, 0.5), dir)), state, &mut seen, &mut ());
            seen.objects
        };
        assert_eq!(walk(Vec3::X, &mut state), (20..40).collect::<Vec<_>>(), "{form}");
        assert_eq!(walk(-Vec3::X, &mut state), (0..=20).rev().collect::<Vec<_>>(), "{form}");
        assert_eq!(walk(Vec3::X, &mut state), (20..40).collect::<Vec<_>>(), "{form}");
    }
}

// L8: what opening costs.

#[test]
fn l08_events_passed_over_at_opening_are_counted_apart() {
    let boxes: Vec<_> = (0..64_u8)
        .map(|i| [i % 8, i / 8].map(f32::from))
        .map(|[x, y]| aabb([x, y, 0.0], [x + 0.5, y + 0.5, 1.0]))
        .collect();
    let ray = trav(&Ray::new(Vec3::new(7.25, 7.25, -1.0), Vec3::new(0.0, 1e-3, 1.0)));
    let counts = |form: &str| {
        let mut counts = Counts::default();
        let mut seen = Seen { limit: 2.0, ..Seen::default() };
        lists(&boxes, form).walk(&ray, &mut seen, &mut counts);
        assert_eq!(seen.objects, [63]);
        counts
    };
    let (flat, tree) = (counts("form=flat"), counts(""));
    // The flat list is searched in y: 15 events begin behind the ray in each of 8 rows, and one more in its own.
    assert_eq!(flat.skips, 7 * 16 + 8);
    assert!(tree.skips > 0 && tree.skips < flat.skips, "{tree:?}");
    assert!(tree.events < flat.events && tree.opened > 1 && flat.opened == 0, "{tree:?} {flat:?}");
}

// L9: children on the face through which their volume is entered.

#[test]
fn l09_children_on_the_face_of_their_volume_are_met() {
    // Every box shares all three near faces with the volume around it, at all levels.
    let boxes: Vec<_> = (1..60_u8).map(|i| aabb([0.0; 3], [f32::from(i), f32::from(60 - i), 1.0])).collect();
    for form in FORMS {
        let lists = lists(&boxes, form);
        for (origin, dir) in [
            (Vec3::new(-1.0, 0.5, 0.5), Vec3::X),
            (Vec3::splat(-1.0), Vec3::ONE),
            (Vec3::new(0.0, -2.0, 0.0), Vec3::Y),
            (Vec3::new(0.5, 0.5, 7.0), -Vec3::Z),
        ] {
            let ray = Ray::new(origin, dir);
            assert_eq!(sorted(walked(&lists, &ray)), pierced(&boxes, &ray, f64::from(f32::MAX)), "{form} {ray:?}");
            assert_eq!(walked(&lists, &ray).len(), 59, "{form} {ray:?}");
        }
    }
}

// L10: the automatic hierarchy.

/// Boxes of the database's objects.
fn spd_boxes(kind: SpdKind, size: u32) -> Vec<Aabb> {
    let around = |shape: &SpdShape| match shape {
        SpdShape::Sphere { center, radius } => {
            Aabb { min: (*center - *radius).as_vec3(), max: (*center + *radius).as_vec3() }
        }
        SpdShape::Cone { base, base_radius, apex, apex_radius } => {
            let ends = [(*base, *base_radius), (*apex, *apex_radius)];
            Aabb::from_points(ends.iter().flat_map(|(p, r)| [(*p - *r).as_vec3(), (*p + *r).as_vec3()]))
        }
        SpdShape::Polygon(corners) => Aabb::from_points(corners.iter().map(|c| c.as_vec3())),
        SpdShape::Patch { corners, .. } => Aabb::from_points(corners.iter().map(|c| c.as_vec3())),
    };
    kind.generate(size).expect("a small size").objects.iter().map(|object| around(&object.shape)).collect()
}

#[test]
fn l10_the_tetrahedron_gives_the_balanced_tree_of_the_paper() {
    // A grid of 2 x 2 x 2 of which four cells are used at each level.
    for levels in 2..7 {
        let boxes = spd_boxes(SpdKind::Tetra, levels);
        let stats = lists(&boxes, "").stats();
        assert_eq!(boxes.len(), 4_usize.pow(levels));
        assert_eq!((stats.depth, stats.nodes), (levels as usize, (4_usize.pow(levels) - 1) / 3), "{levels} levels");
    }
}

#[test]
fn l10_large_objects_go_into_an_element_of_their_own() {
    // All centres in one cell: a wall, a floor and many small boxes in a corner.
    let mut boxes = vec![aabb([0.0; 3], [100.0, 1.0, 100.0]), aabb([0.0; 3], [1.0, 100.0, 100.0])];
    boxes.extend((0..50_u8).map(|i| {
        let at = f32::from(i) * 0.5;
        aabb([at, 25.0 - at, at], [at + 0.4, 25.4 - at, at + 0.4])
    }));
    let stats = lists(&boxes, "").stats();
    assert!(stats.depth <= 6, "{stats:?}");
    // Equal boxes: no cell, no size tells them apart.
    let equal = vec![aabb([0.0; 3], [1.0; 3]); 1000];
    let stats = lists(&equal, "").stats();
    assert!(stats.depth <= 11, "{stats:?}");
    // Sizes that halve: each level puts one apart; the depth is bounded all the same.
    let nested: Vec<_> = (0..250).map(|i| aabb([0.0; 3], [2.0_f32.powi(i - 125); 3])).collect();
    let stats = lists(&nested, "").stats();
    assert!(stats.depth <= 48 + 32, "{stats:?}");
}

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

fn random_rays(random: &mut Random, count: usize, boxes: &[Aabb]) -> Vec<Ray> {
    let boxes: Vec<_> = boxes.iter().copied().filter(|b| !b.is_empty()).collect();
    let around = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
    let mut ray = |i: usize| {
        let target = boxes[random.below(boxes.len())].center();
        let origin = if i % 2 == 0 {
            around.center() + random.vec3() * around.diagonal()
        } else {
            boxes[random.below(boxes.len())].max
        };
        let mut dir = target - origin;
        if random.below(4) == 0 {
            dir[random.below(3)] = 0.0;
        }
        let t_near = if random.below(4) == 0 { random.unit().abs() } else { 0.0 };
        Ray { t_near, ..Ray::new(origin, if dir == Vec3::ZERO { Vec3::X } else { dir }) }
    };
    (0..count).map(&mut ray).collect()
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
        let size = (1..).take_while(|&n| kind.object_count(n) < 1000).last().unwrap_or(1);
        let boxes = spd_boxes(kind, size);
        let rays = random_rays(&mut random, 25, &boxes);
        assert!(tests_are_the_least(&boxes, &rays, &mut random) > 25, "{}", kind.name());
    }
}

// L13: arrays.

#[test]
fn l13_an_event_takes_eight_bytes_and_a_box_80_in_the_flat_form() {
    let boxes = random_boxes(&mut Random(1), 1000, 0.1);
    assert_eq!(lists(&boxes, "form=flat").stats().node_bytes, 1000 * (6 * 8 + 32));
    let tree = lists(&boxes, "").stats();
    assert!(tree.node_bytes < 1000 * 150, "{tree:?}");
}

// L14: trends in N rather than the paper's own ray set.

#[test]
fn l14_events_grow_with_the_number_of_boxes_in_the_flat_form_and_hardly_in_the_hierarchy() {
    let events = |size: u32, form: &str| {
        let boxes = spd_boxes(SpdKind::Tetra, size);
        let lists = lists(&boxes, form);
        let rays = random_rays(&mut Random(4), 200, &boxes);
        let mut counts = Counts::default();
        for ray in &rays {
            let mut seen = Seen { limit: 100.0, ..Seen::default() };
            lists.walk(&trav(ray), &mut seen, &mut counts);
        }
        (counts.events + counts.skips) as f64 / rays.len() as f64
    };
    // 256 times the objects.
    let flat = events(6, "form=flat") / events(2, "form=flat");
    let tree = events(6, "") / events(2, "");
    assert!(flat > 100.0 && tree < 12.0, "flat {flat}, tree {tree}");
}

// States: one for a camera, and one handed from ray to ray.

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

// Motion.

fn shifted(boxes: &[Aabb], random: &mut Random, by: f32) -> Vec<Aabb> {
    boxes
        .iter()
        .map(|b| {
            let d = random.vec3() * by;
            Aabb { min: b.min + d, max: b.max + d }
        })
        .collect()
}

#[test]
fn after_hundreds_of_motions_the_lists_are_sorted_and_meet_what_fresh_ones_do() {
    let mut random = Random(51);
    for form in FORMS {
        let mut boxes = random_boxes(&mut random, 300, 0.1);
        let mut moving = lists(&boxes, form);
        for step in 0..300 {
            boxes = shifted(&boxes, &mut random, 0.01);
            if step % 50 == 0 {
                // Gone, and back at a later step.
                boxes[step] = if step % 100 == 0 { Aabb::EMPTY } else { aabb([0.1; 3], [0.2; 3]) };
            }
            moving.refit(|i| boxes[i as usize]);
            if step % 20 == 19 {
                moving.validate(|i| boxes[i as usize]).unwrap_or_else(|v| panic!("{form} step {step}: {v:?}"));
                for ray in random_rays(&mut random, 5, &boxes) {
                    let far = f64::from(f32::MAX);
                    assert_eq!(sorted(walked(&moving, &ray)), pierced(&boxes, &ray, far), "{form} step {step}");
                }
            }
        }
    }
}

#[test]
fn inversions_measure_how_far_boxes_moved_past_each_other() {
    let row = |order: &[u8]| -> Vec<Aabb> {
        order.iter().map(|&i| aabb([f32::from(i) * 2.0, 0.0, 0.0], [f32::from(i) * 2.0 + 1.0, 1.0, 1.0])).collect()
    };
    let mut lists = lists(&row(&[0, 1, 2, 3]), "form=flat");
    let mut refit = |order: &[u8]| {
        let boxes = row(order);
        lists.refit(|i| boxes[i as usize]);
        lists.validate(|i| boxes[i as usize]).expect("sorted");
        (lists.last_inversions().swaps, lists.last_inversions().whole)
    };
    assert_eq!(refit(&[0, 1, 2, 3]), (0, 0));
    // Two neighbours: both ends of one pass both ends of the other, and the ends that were level stay in order of number.
    assert_eq!(refit(&[0, 2, 1, 3]), (4, 0));
    assert_eq!(refit(&[0, 1, 2, 3]), (4, 0));
    // All the other way round: 6 pairs of 4 ends each, more than 8 log 8.
    let (swaps, whole) = refit(&[3, 2, 1, 0]);
    assert_eq!((swaps, whole), (24, 0), "24 is not above 8 * 3");
    let mut long = EventBoxes::build(64, |i| row(&[i as u8])[0], &config("form=flat")).expect("few");
    long.refit(|i| row(&[63 - i as u8])[0]);
    assert_eq!(long.last_inversions().whole, 1, "a reversed list is sorted as a whole");
    long.validate(|i| row(&[63 - i as u8])[0]).expect("sorted");
}

#[test]
fn a_refit_tells_its_inversions_and_leaves_the_original_as_it_was() {
    let mut random = Random(61);
    let mesh = Mesh::soup(&(0..400).map(|_| [random.vec3(), random.vec3(), random.vec3()]).collect::<Vec<_>>());
    let step = |by: f32, random: &mut Random| Mesh {
        positions: mesh.positions.iter().map(|&p| p + random.vec3() * by).collect(),
        indices: mesh.indices.clone(),
    };
    for form in FORMS {
        let accel = Events::build(&mesh.prims(), &config(form)).expect("a mesh");
        let mut out = accel.clone();
        let mut swaps = [0.0_f32, 1e-4, 1e-2].map(|by| {
            out.clone_from(&accel);
            assert_eq!(accel.refit_into(&mut out, &step(by, &mut random).prims()), Refit::Done);
            out.last_inversions().swaps
        });
        assert_eq!(swaps[0], 0, "{form}");
        assert!(swaps.is_sorted() && swaps[2] > 0, "{form}: {swaps:?}");
        swaps[0] = accel.last_inversions().swaps;
        assert_eq!(swaps[0], 0);
        accel.validate(&mesh.prims()).expect("the original is as it was");
    }
}

#[test]
fn violations_are_found() {
    let boxes = random_boxes(&mut Random(71), 50, 0.2);
    for form in FORMS {
        let lists = lists(&boxes, form);
        let elsewhere =
            |i: u32| if i == 20 { Aabb { min: boxes[20].min - 0.25, ..boxes[20] } } else { boxes[i as usize] };
        assert!(lists.validate(elsewhere).is_err(), "{form}");
    }
}

#[test]
fn empty_boxes_and_no_boxes_are_met_by_nothing() {
    let ray = Ray::new(Vec3::splat(-1.0), Vec3::ONE);
    for form in FORMS {
        assert!(walked(&lists(&[], form), &ray).is_empty());
        for count in [1, 5, 600] {
            let mut boxes = vec![Aabb::EMPTY; count];
            assert!(walked(&lists(&boxes, form), &ray).is_empty(), "{form}");
            boxes[count / 2] = aabb([0.0; 3], [1.0; 3]);
            for dir in [Vec3::ONE, -Vec3::ONE, Vec3::X] {
                let ray = Ray::new(Vec3::splat(0.5) - dir * 4.0, dir);
                assert_eq!(walked(&lists(&boxes, form), &ray), [count as u32 / 2], "{form}");
            }
        }
    }
}

#[test]
fn an_endless_box_is_met_by_every_ray() {
    let boxes = [aabb([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]), aabb([0.0; 3], [1.0; 3])];
    for form in FORMS {
        let lists = lists(&boxes, form);
        for dir in [Vec3::X, -Vec3::X, Vec3::new(0.5, -1.0, 2.0)] {
            let ray = Ray { t_far: 10.0, ..Ray::new(Vec3::splat(0.5), dir) };
            assert_eq!(sorted(walked(&lists, &ray)), [0, 1], "{form}");
            let mut seen = Seen { limit: f64::INFINITY, ..Seen::default() };
            lists.walk(&trav(&ray), &mut seen, &mut ());
            assert_eq!(sorted(seen.objects), [0, 1], "{form}");
        }
    }
}

#[test]
fn settings_are_checked() {
    let mut config = EventsConfig::default();
    for (key, value) in [("form", "flat"), ("grid", "16"), ("threshold", "1024"), ("large", "0.75")] {
        config.set(key, value).expect("a value in range");
    }
    assert_eq!(config, EventsConfig { form: Form::Flat, grid: 16, threshold: 1024, large: 0.75 });
    let wrong = [
        ("form", "round"),
        ("grid", "1"),
        ("grid", "17"),
        ("threshold", "0"),
        ("large", "0"),
        ("large", "NaN"),
        ("large", "1.5"),
    ];
    for (key, value) in wrong {
        assert!(config.clone().set(key, value).is_err(), "{key}={value}");
    }
}

#[test]
fn builds_and_refits_do_not_depend_on_the_number_of_threads() {
    let mut random = Random(81);
    let boxes = random_boxes(&mut random, 20_000, 0.05);
    let moved = shifted(&boxes, &mut random, 0.01);
    let rays = random_rays(&mut random, 50, &boxes);
    let in_pool = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            ["form=flat", ""].map(|form| {
                let mut lists = lists(&boxes, form);
                lists.refit(|i| moved[i as usize]);
                lists.validate(|i| moved[i as usize]).expect("sorted");
                let seen: Vec<_> = rays.iter().map(|ray| walked(&lists, ray)).collect();
                (format!("{:?} {:?} {}", lists.stats(), lists.last_inversions(), lists.decay()), seen)
            })
        })
    };
    assert_eq!(in_pool(1), in_pool(2));
}
