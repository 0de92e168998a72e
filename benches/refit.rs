//! `refit/<triangles>/<structure>`: refitting to the next of two poses, one thread.
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
use kinora::accel::{AccelKind, AccelSpec, Refit};

fn refit(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one");
    for side in [50, 200] {
        let poses = [meshes::dented_sphere(side, 0.0), meshes::dented_sphere(side, 0.1)];
        let count = poses[0].indices.len();
        let mut group = criterion.benchmark_group(format!("refit/{count}"));
        group.throughput(Throughput::Elements(count as u64));
        for &kind in AccelKind::ALL {
            let accel = AccelSpec::new(kind).build(&poses[0].prims()).expect("the sphere builds");
            let mut out = accel.clone();
            if accel.refit_into(&mut out, &poses[1].prims()) == Refit::NeedsRebuild {
                continue;
            }
            let mut next = 0;
            group.bench_function(kind.name(), |b| {
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
