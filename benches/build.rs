//! `build/<triangles>/<structure>`: building over a dented sphere, one thread.
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
use kinora::accel::{AccelKind, AccelSpec};

fn build(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one");
    for side in [50, 200] {
        let mesh = meshes::dented_sphere(side, 0.0);
        let mut group = criterion.benchmark_group(format!("build/{}", mesh.indices.len()));
        group.throughput(Throughput::Elements(mesh.indices.len() as u64));
        for &kind in AccelKind::ALL {
            let spec = AccelSpec::new(kind);
            group.bench_function(kind.name(), |b| b.iter(|| pool.install(|| spec.build(&mesh.prims()))));
        }
    }
}

criterion_group!(benches, build);
criterion_main!(benches);
