//! What is not an ordinary box, and what must not matter.

use kinora::{
    accel::{
        AccelConfig, BuildError,
        events::{EventBoxes, EventsConfig, Form},
    },
    geom::{Aabb, Ray},
    glam::Vec3,
    rayon,
};

use crate::{FORMS, Seen, aabb, lists, random_boxes, random_rays, shifted, sorted, trace::Random, trav, walked};

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

#[test]
fn more_boxes_than_numbers_allow_for_are_an_error() {
    for count in [(1 << 30) + 1, usize::MAX] {
        let built = EventBoxes::build(count, |_| Aabb::EMPTY, &EventsConfig::default());
        assert!(matches!(built, Err(BuildError::TooMany { limit, actual, .. }) if limit == 1 << 30 && actual == count));
    }
}
