//! The shared collection of triangles, boxes and rays with exact answers.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; bit patterns"
)]

mod common;

use std::str::FromStr;

use kinora::{
    collide::{
        Passage, box_pairs, boxes_meet, ray_box, sweep_box, triangle_contact, triangle_distance, triangles_meet,
    },
    geom::{Aabb, Ray},
    glam::{DVec3, Vec3},
};
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive};
use serde_json::Value;

fn cases(file: &str) -> Vec<Value> {
    let Some(dir) = common::shared_dir() else { return Vec::new() };
    let text = std::fs::read_to_string(dir.join("hardcases").join(file)).expect("the case file is readable");
    let mut json: Value = serde_json::from_str(&text).expect("the case file is JSON");
    let Value::Array(cases) = json["cases"].take() else { panic!("{file} has no cases") };
    assert!(!cases.is_empty(), "{file} is empty");
    cases
}

fn id(case: &Value) -> &str {
    case["id"].as_str().expect("an id")
}

fn floats(value: &Value) -> Vec<f32> {
    let numbers = value.as_array().expect("a list of bit patterns");
    numbers.iter().map(|n| f32::from_bits(n.as_u64().expect("a bit pattern") as u32)).collect()
}

fn vec3(value: &Value) -> Vec3 {
    Vec3::from_slice(&floats(value))
}

fn triangle(value: &Value) -> [Vec3; 3] {
    let v = floats(value);
    [0, 3, 6].map(|i| Vec3::from_slice(&v[i..i + 3]))
}

fn number(value: &Value) -> BigRational {
    BigRational::from_str(value.as_str().expect("a rational")).expect("a rational")
}

/// `|a - b| <= bound * size`, exactly.
fn close(a: f64, b: &BigRational, bound: f64, size: f64) -> bool {
    let exact = |x: f64| BigRational::from_float(x).expect("finite");
    (exact(a) - b).abs() <= exact(bound) * exact(size)
}

fn is_at(point: DVec3, due: &Value, size: f64) -> bool {
    (0..3).all(|axis| close(point[axis], &number(&due[axis]), 2.0_f64.powi(-31), size))
}

fn check_triangles(case: &Value) {
    let (a, b) = (triangle(&case["a"]), triangle(&case["b"]));
    let expect = &case["expect"];
    let due = expect["intersects"] == true;
    assert_eq!(triangles_meet(&a, &b), due, "{}", id(case));
    assert_eq!(triangles_meet(&b, &a), due, "{} the other way round", id(case));
    let contact = triangle_contact(&a, &b);
    assert_eq!(contact.is_some(), due, "{}: {contact:?}", id(case));
    check_distance(case, &a, &b);
    let Some(contact) = contact else { return };
    assert_eq!(Some(i64::from(contact.dim)), expect["dim"].as_i64(), "{}: {contact:?}", id(case));
    let points = expect["points"].as_array().expect("points");
    assert_eq!(contact.points.len(), points.len(), "{}: {contact:?}", id(case));
    let size = a.iter().chain(&b).map(|c| f64::from(c.abs().max_element())).fold(0.0, f64::max);
    for due in points {
        assert!(contact.points.iter().any(|&p| is_at(p, due, size)), "{}: {due} is not in {contact:?}", id(case));
    }
}

fn check_distance(case: &Value, a: &[Vec3; 3], b: &[Vec3; 3]) {
    let nearest = triangle_distance(a, b);
    assert_eq!(nearest.is_some(), case["expect"]["valid"] == true, "{}", id(case));
    if let Some(nearest) = nearest {
        let due = case["expect"]["dist"].as_f64().expect("a distance");
        let size = a.iter().chain(b).map(|c| f64::from(c.abs().max_element())).fold(0.0, f64::max);
        assert!((nearest.distance - due).abs() <= size * 2.0_f64.powi(-44), "{}: {nearest:?} for {due}", id(case));
        assert_eq!(nearest.distance == 0.0, case["expect"]["intersects"] == true, "{}", id(case));
    }
}

#[test]
fn named_triangles_are_decided_exactly() {
    cases("named_tri_tri.json").iter().for_each(check_triangles);
}

#[test]
fn random_triangles_are_decided_exactly() {
    cases("random_tri_tri.json").iter().for_each(check_triangles);
}

#[test]
fn box_pairs_are_complete_and_no_more() {
    for case in cases("named_aabb_pairs.json") {
        let list = case["boxes"].as_array().expect("boxes").iter().map(floats);
        let boxes: Vec<_> =
            list.map(|v| Aabb { min: Vec3::from_slice(&v[..3]), max: Vec3::from_slice(&v[3..]) }).collect();
        let index = |v: &Value| v.as_u64().expect("an index") as u32;
        let mut due: Vec<[u32; 2]> = case["expect"]["pairs"]
            .as_array()
            .expect("pairs")
            .iter()
            .map(|p| [index(&p[0]).min(index(&p[1])), index(&p[0]).max(index(&p[1]))])
            .collect();
        due.sort_unstable();
        assert_eq!(box_pairs(&boxes), due, "{}", id(&case));
        for i in 0..boxes.len() {
            for j in 0..boxes.len() {
                let pair = [i.min(j) as u32, i.max(j) as u32];
                let meet = boxes_meet(&boxes[i], &boxes[j]);
                assert_eq!(meet, due.contains(&pair) || (i == j && !boxes[i].is_empty()), "{}: {i} {j}", id(&case));
            }
        }
    }
}

fn check_passage(case: &Value, passage: Option<Passage>, enter: &str, exit: &str) {
    let expect = &case["expect"];
    assert_eq!(passage.is_some(), expect["hit"] == true, "{}: {passage:?}", id(case));
    if let Some(passage) = passage {
        for (value, due) in [(passage.enter, number(&expect[enter])), (passage.exit, number(&expect[exit]))] {
            let size = due.abs().to_f64().expect("in range");
            assert!(close(value, &due, 2.0_f64.powi(-51), size), "{}: {value} for {due}", id(case));
        }
    }
}

#[test]
fn moving_boxes_touch_when_they_do() {
    for case in cases("named_aabb_sweep.json") {
        let a = Aabb { min: vec3(&case["a_min"]), max: vec3(&case["a_max"]) };
        let b = Aabb { min: vec3(&case["b_min"]), max: vec3(&case["b_max"]) };
        check_passage(&case, sweep_box(&a, vec3(&case["disp"]), &b), "toi", "last");
    }
}

#[test]
fn rays_meet_boxes_exactly() {
    for case in cases("named_ray_aabb.json") {
        let ray = Ray::new(vec3(&case["origin"]), vec3(&case["dir"]));
        let aabb = Aabb { min: vec3(&case["min"]), max: vec3(&case["max"]) };
        check_passage(&case, ray_box(&ray, &aabb), "t_enter", "t_exit");
    }
}
