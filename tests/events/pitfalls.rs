//! The pitfalls of the method but for the number of tests, which has a file of its own.

use kinora::{
    accel::events::EventState,
    geom::{Aabb, Ray},
    glam::Vec3,
    scene::spd::SpdKind,
};
use proptest::prelude::*;

use crate::{
    Counts, FORMS, Seen, aabb, lists, pierced, pierced_exactly, random_boxes, random_rays, sorted, spd_boxes,
    trace::Random, trav, walked,
};

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
