//! The shared collection of rays with exact answers, through every structure at every SIMD level.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

mod common;
#[path = "common/trace.rs"]
mod trace;

use std::str::FromStr;

use kinora::{
    accel::{AccelKind, AccelSpec},
    geom::{Hit, PrimId, Ray},
    glam::Vec3,
    simd::SimdLevel,
};
use num_rational::BigRational;
use serde_json::Value;
use trace::{Mesh, closest, occluded, rational, round};

fn cases(file: &str) -> Vec<Value> {
    let Some(dir) = common::shared_dir() else { return Vec::new() };
    let text = std::fs::read_to_string(dir.join("hardcases").join(file)).expect("the case file is readable");
    let mut json: Value = serde_json::from_str(&text).expect("the case file is JSON");
    let Value::Array(cases) = json["cases"].take() else { panic!("{file} has no cases") };
    assert!(!cases.is_empty(), "{file} is empty");
    cases
}

fn floats(value: &Value) -> Vec<f32> {
    let numbers = value.as_array().expect("a list of bit patterns");
    numbers.iter().map(|n| f32::from_bits(n.as_u64().expect("a bit pattern") as u32)).collect()
}

fn vectors(value: &Value) -> Vec<Vec3> {
    floats(value).chunks_exact(3).map(Vec3::from_slice).collect()
}

fn ray(case: &Value) -> Ray {
    Ray::new(vectors(&case["origin"])[0], vectors(&case["dir"])[0])
}

fn number(value: &Value) -> BigRational {
    BigRational::from_str(value.as_str().expect("a rational")).expect("a rational")
}

/// The same answer from every structure and level; occlusion agrees with it.
fn answer(mesh: &Mesh, ray: &Ray, id: &str) -> Option<Hit> {
    let mut answers = Vec::new();
    for &kind in AccelKind::ALL {
        let accel = AccelSpec::new(kind).build(&mesh.prims()).expect("a small mesh builds");
        accel.validate(&mesh.prims()).expect("a fresh structure is valid");
        for level in SimdLevel::available() {
            let hit = closest(&accel, &mesh.prims(), &[*ray], level)[0];
            let blocked = occluded(&accel, &mesh.prims(), &[*ray], level)[0];
            assert_eq!(hit.is_some(), blocked, "{id}: {kind} at {level}");
            answers.push(hit);
        }
    }
    assert!(answers.windows(2).all(|w| w[0] == w[1]), "{id}: {answers:?}");
    answers[0]
}

fn check_triangle(case: &Value) {
    let id = case["id"].as_str().expect("an id");
    let mesh = Mesh { positions: vectors(&case["tri"]), indices: vec![[0, 1, 2]] };
    let hit = answer(&mesh, &ray(case), id);
    let expect = &case["expect"];
    // A hit beyond the largest f32 is none.
    let due = expect["hit"] == true && number(&expect["t"]) <= rational(f32::MAX);
    assert_eq!(hit.is_some(), due, "{id}: {hit:?}");
    if let Some(hit) = hit {
        let bary = [&expect["bary"][1], &expect["bary"][2]].map(number);
        assert_eq!(hit.t, round(&number(&expect["t"])), "{id}: t");
        assert_eq!([hit.u, hit.v], [round(&bary[0]), round(&bary[1])], "{id}: u, v");
    }
}

#[test]
fn named_triangles_are_answered_exactly() {
    cases("named_ray_tri.json").iter().for_each(check_triangle);
}

#[test]
fn random_triangles_are_answered_exactly() {
    cases("random_ray_tri.json").iter().for_each(check_triangle);
}

#[test]
fn closed_meshes_do_not_leak() {
    for case in cases("named_ray_mesh.json") {
        let id = case["id"].as_str().expect("an id");
        let indices = case["tris"].as_array().expect("triangles").iter();
        let corner = |t: &Value, i: usize| t[i].as_u64().expect("an index") as u32;
        let mesh = Mesh {
            positions: vectors(&case["verts"]),
            indices: indices.map(|t| [corner(t, 0), corner(t, 1), corner(t, 2)]).collect(),
        };
        let hit = answer(&mesh, &ray(&case), id);
        let expect = &case["expect"];
        assert_eq!(hit.is_some(), expect["hit"] == true, "{id}: {hit:?}");
        if let Some(hit) = hit {
            assert_eq!(hit.t, round(&number(&expect["t"])), "{id}: t");
            let first = expect["first_triangles"].as_array().expect("a list").iter().filter_map(Value::as_u64).min();
            assert_eq!(Some(hit.prim), first.map(|p| PrimId(p as u32)), "{id}: the lowest triangle at that t");
        }
    }
}
