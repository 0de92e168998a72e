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

mod least;
mod limits;
mod motion;
mod pitfalls;
mod states;
#[path = "../common/trace.rs"]
mod trace;

use kinora::{
    accel::{
        AccelConfig, Counter, TravRay, Visitor,
        events::{EventBoxes, EventsConfig},
    },
    geom::{Aabb, Ray},
    glam::Vec3,
    scene::spd::{SpdKind, SpdShape},
};
use trace::Random;

/// What a walk did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Counts {
    pub(crate) opened: usize,
    pub(crate) tests: usize,
    pub(crate) events: usize,
    pub(crate) skips: usize,
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
pub(crate) struct Seen<'a> {
    pub(crate) objects: Vec<u32>,
    pub(crate) hits: &'a [Option<f64>],
    pub(crate) limit: f64,
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

pub(crate) fn config(text: &str) -> EventsConfig {
    let mut config = EventsConfig::default();
    for (key, value) in text.split(',').filter_map(|pair| pair.split_once('=')) {
        config.set(key, value).expect("a setting");
    }
    config
}

/// Both forms, and hierarchies of other grids and thresholds.
pub(crate) const FORMS: [&str; 5] =
    ["form=flat", "", "threshold=1", "grid=3,threshold=2", "grid=5,threshold=16,large=0.2"];

pub(crate) fn lists(boxes: &[Aabb], text: &str) -> EventBoxes {
    let lists = EventBoxes::build(boxes.len(), |i| boxes[i as usize], &config(text)).expect("few boxes");
    lists.validate(|i| boxes[i as usize]).unwrap_or_else(|v| panic!("{text}: {v:?}"));
    lists
}

pub(crate) fn trav(ray: &Ray) -> TravRay {
    TravRay::new(ray).expect("a ray")
}

/// The boxes that a fresh walk shows, in order.
pub(crate) fn walked(lists: &EventBoxes, ray: &Ray) -> Vec<u32> {
    let ray = trav(ray);
    let mut seen = Seen { limit: f64::from(ray.range().t_far), ..Seen::default() };
    lists.walk(&ray, &mut seen, &mut ());
    seen.objects
}

pub(crate) fn sorted(mut objects: Vec<u32>) -> Vec<u32> {
    objects.sort_unstable();
    objects
}

pub(crate) fn aabb(min: [f32; 3], max: [f32; 3]) -> Aabb {
    Aabb { min: Vec3::from(min), max: Vec3::from(max) }
}

/// When the ray enters and leaves a box, by the arithmetic that the structure documents; exits widened.
pub(crate) fn interval(aabb: &Aabb, ray: &Ray) -> Option<(f64, f64)> {
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
pub(crate) fn pierced(boxes: &[Aabb], ray: &Ray, limit: f64) -> Vec<u32> {
    let limit = limit * (1.0 + 2.0_f64.powi(-49));
    (0..)
        .zip(boxes)
        .filter(|(_, b)| interval(b, ray).is_some_and(|(enter, _)| enter <= limit))
        .map(|(i, _)| i)
        .collect()
}

/// As [`pierced`] for whole numbers, in exact arithmetic without any margin.
pub(crate) fn pierced_exactly(boxes: &[Aabb], ray: &Ray) -> Vec<u32> {
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

pub(crate) fn random_boxes(random: &mut Random, count: usize, size: f32) -> Vec<Aabb> {
    let one = |_| {
        let (center, half) = (random.vec3(), random.vec3().abs() * size);
        Aabb { min: center - half, max: center + half }
    };
    (0..count).map(one).collect()
}

/// Boxes of the database's objects.
pub(crate) fn spd_boxes(kind: SpdKind, size: u32) -> Vec<Aabb> {
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

pub(crate) fn random_rays(random: &mut Random, count: usize, boxes: &[Aabb]) -> Vec<Ray> {
    let boxes: Vec<_> = boxes.iter().copied().filter(|b| !b.is_empty()).collect();
    let around = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
    let mut ray = |i: usize| {
        let target = boxes[random.below(boxes.len())].center();
        let origin = if i.is_multiple_of(2) {
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

pub(crate) fn shifted(boxes: &[Aabb], random: &mut Random, by: f32) -> Vec<Aabb> {
    boxes
        .iter()
        .map(|b| {
            let d = random.vec3() * by;
            Aabb { min: b.min + d, max: b.max + d }
        })
        .collect()
}
