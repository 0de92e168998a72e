//! `refit/<triangles>/<structure>`: refitting to the next of two poses, one thread.
//!
//! Beside each stands what memory allows: the bytes that a refit has to read and write, computed from sizes, at the rate at which so many are copied.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "meshes/mod.rs"]
mod meshes;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use kinora::accel::{AccelKind, AccelSpec, AnyAccel, Refit};

/// Every structure, and the other layout of `bvh8`.
fn specs() -> Vec<AccelSpec> {
    let compact = "bvh8:layout=compact".parse().expect("known settings");
    AccelKind::ALL.iter().map(|&kind| AccelSpec::new(kind)).chain([compact]).collect()
}

/// Bytes that a refit reads and writes: vertices, and triangles where the structure does not name vertices itself; what is rewritten twice.
fn bytes(accel: &AnyAccel, spec: &AccelSpec, mesh: &meshes::Mesh) -> usize {
    let (stats, vertices) = (accel.stats(), size_of_val(&mesh.positions[..]));
    if spec.to_string().contains("compact") {
        vertices + stats.total_bytes + stats.node_bytes
    } else {
        vertices + size_of_val(&mesh.indices[..]) + 2 * stats.total_bytes
    }
}

/// Bytes a second, read and written, when so many are copied; the best of several turns.
fn copy_rate(bytes: usize) -> f64 {
    let (from, mut to) = (vec![1_u8; bytes / 2], vec![0_u8; bytes / 2]);
    let mut best = f64::INFINITY;
    for _ in 0..20 {
        let began = std::time::Instant::now();
        to.copy_from_slice(std::hint::black_box(&from));
        std::hint::black_box(&mut to);
        best = best.min(began.elapsed().as_secs_f64());
    }
    bytes as f64 / best
}

fn refit(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one");
    for side in [50, 200] {
        let poses = [meshes::dented_sphere(side, 0.0), meshes::dented_sphere(side, 0.1)];
        let count = poses[0].indices.len();
        let mut group = criterion.benchmark_group(format!("refit/{count}"));
        group.throughput(Throughput::Elements(count as u64));
        for spec in specs() {
            let accel = spec.build(&poses[0].prims()).expect("the sphere builds");
            let mut out = accel.clone();
            if accel.refit_into(&mut out, &poses[1].prims()) == Refit::NeedsRebuild {
                continue;
            }
            let touched = bytes(&accel, &spec, &poses[0]);
            let rate = copy_rate(touched);
            println!(
                "{spec}: {:.1} bytes a triangle, {:.1} GB/s copied, so at most {:.0} M triangles/s",
                touched as f64 / count as f64,
                rate * 1e-9,
                rate / touched as f64 * count as f64 * 1e-6,
            );
            let mut next = 0;
            group.bench_function(spec.to_string(), |b| {
                b.iter(|| {
                    next = 1 - next;
                    pool.install(|| accel.refit_into(&mut out, &poses[next].prims()))
                });
            });
        }
    }
}

criterion_group!(benches, refit);
criterion_main!(benches);
