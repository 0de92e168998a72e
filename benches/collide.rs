//! `collide/<what>/<case>`: the primitives of collision on batches of cases, a throughput of cases; one thread.
//!
//! First of all, or with `peers` as the argument alone, whole scenes against parry3d, with ratios; `peers tubes rays` takes those two of
//! `boxes`, `tubes`, `cloth`, `rays`, `closest`, `steps`.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "small numbers"
)]

#[path = "../tests/common/ccd.rs"]
mod ccd;
#[path = "../tests/common/mod.rs"]
mod common;
mod peers;
#[path = "../tests/common/trace.rs"]
mod trace;

use std::hint::black_box;

use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, measurement::WallTime};
use kinora::{
    collide::{Continuous, box_pairs, closest_on_triangle, triangle_contact, triangle_distance, triangles_meet},
    geom::Aabb,
    glam::{DVec3, Vec3},
};
use trace::Random;

type Pair = [[Vec3; 3]; 2];

const CASES: usize = 4000;

/// Pairs of triangles by how hard they are to tell.
fn pairs() -> Vec<(&'static str, Vec<Pair>)> {
    let mut random = Random(1);
    let mut triangle = |center: Vec3, size: f32| [0; 3].map(|_| center + random.vec3() * size);
    let make = |case: &mut dyn FnMut(usize) -> Pair| (0..CASES).map(case).collect::<Vec<_>>();
    let mut near = Random(2);
    let flat = |t: [Vec3; 3]| t.map(|p| p.with_z(0.25));
    vec![
        ("apart", make(&mut |_| [triangle(Vec3::ZERO, 1.0), triangle(Vec3::splat(1.5), 1.0)])),
        ("across", make(&mut |_| [triangle(Vec3::ZERO, 1.0), triangle(Vec3::ZERO, 1.0)])),
        ("near", make(&mut |_| [triangle(Vec3::ZERO, 0.1), triangle(near.vec3() * 0.15, 0.1)])),
        (
            "shared-edge",
            make(&mut |_| {
                let [a, b] = [triangle(Vec3::ZERO, 1.0), triangle(Vec3::ZERO, 1.0)];
                [a, [a[1], a[0], b[2]]]
            }),
        ),
        ("one-plane", make(&mut |_| [flat(triangle(Vec3::ZERO, 1.0)), flat(triangle(Vec3::ZERO, 1.0))])),
    ]
}

fn group<'a>(criterion: &'a mut Criterion, name: &str, cases: usize) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(format!("collide/{name}"));
    group.throughput(Throughput::Elements(cases as u64));
    group
}

fn triangles(criterion: &mut Criterion) {
    for (case, pairs) in pairs() {
        let mut group = group(criterion, "triangles", pairs.len());
        group.bench_function(format!("meet/{case}"), |b| {
            b.iter(|| pairs.iter().filter(|[x, y]| triangles_meet(x, y)).count());
        });
        group.bench_function(format!("contact/{case}"), |b| {
            b.iter(|| pairs.iter().filter(|[x, y]| black_box(triangle_contact(x, y)).is_some()).count());
        });
        group.bench_function(format!("distance/{case}"), |b| {
            b.iter(|| pairs.iter().filter_map(|[x, y]| triangle_distance(x, y)).map(|n| n.distance).sum::<f64>());
        });
        group.bench_function(format!("closest/{case}"), |b| {
            b.iter(|| pairs.iter().filter_map(|[x, y]| closest_on_triangle(x[0], y)).map(|n| n.distance).sum::<f64>());
        });
    }
}

type Step = (bool, [DVec3; 4], [DVec3; 4]);

/// Corners within a unit cube that move together by up to a tenth and against each other by less.
fn ordinary() -> Vec<Step> {
    let mut random = Random(3);
    let mut vector = |size: f64| random.vec3().as_dvec3() * size;
    (0..CASES)
        .map(|i| {
            let start = [0; 4].map(|_| vector(0.5));
            let motion = vector(0.1);
            let end = [
                start[0] + motion + vector(0.1),
                start[1] + vector(0.02),
                start[2] + vector(0.02),
                start[3] + vector(0.02),
            ];
            (i % 2 == 0, start, end)
        })
        .collect()
}

fn steps(criterion: &mut Criterion) {
    let mut sets = vec![("ordinary", ordinary())];
    if let Some(shared) = common::shared_dir() {
        sets.push(("shared", ccd::queries(&shared).into_iter().map(|q| (q.is_face, q.start, q.end)).collect()));
    }
    for (name, steps) in sets {
        for (kind, separation) in [("contact", 0.0), ("separation", 0.01)] {
            let settings = Continuous { min_separation: separation, ..Continuous::default() };
            let ask = |&(is_face, ref start, ref end): &Step| {
                if is_face { settings.vertex_face(start, end) } else { settings.edge_edge(start, end) }
            };
            group(criterion, "steps", steps.len()).bench_function(format!("{kind}/{name}"), |b| {
                b.iter(|| steps.iter().filter(|s| ask(s).is_some()).count());
            });
        }
    }
}

fn boxes(criterion: &mut Criterion) {
    for count in [1000, 10_000] {
        let mut random = Random(4);
        // Density 1, edges of 0.6 to 1: some two pairs a box.
        let side = (count as f32).cbrt();
        let boxes: Vec<_> = (0..count)
            .map(|_| {
                let min = (random.vec3() * 0.5 + 0.5) * side;
                Aabb { min, max: min + 0.8 + random.vec3() * 0.2 }
            })
            .collect();
        group(criterion, "boxes", count)
            .bench_function(format!("pairs/{count}"), |b| b.iter(|| box_pairs(&boxes).len()));
    }
}

criterion_group!(benches, triangles, steps, boxes);

fn main() {
    let argument = |name: &str| std::env::args().any(|a| a == name);
    // `cargo test --benches` asks for a short run, criterion's filters for a part of its own.
    let filtered = std::env::args().skip(1).any(|a| !a.starts_with('-'));
    if argument("peers") || !(filtered || argument("--test")) {
        peers::run();
    }
    if !argument("peers") {
        benches();
        Criterion::default().configure_from_args().final_summary();
    }
}
