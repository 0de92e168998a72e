//! `traverse/<scene>/<structure>/<rays>`: rays against a dented sphere, one thread, exact precision.
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
use kinora::{
    accel::{AccelKind, AccelSpec, AnyAccel, AnyHit, Closest, PACKET, TravRay},
    geom::{Ray, Triangles},
    simd::{Simd, SimdLevel, Task, dispatch},
};

#[derive(Clone, Copy)]
enum Query {
    Closest,
    Occluded,
    ClosestPacket,
    OccludedPacket,
}

#[derive(Clone, Copy)]
struct Cast<'a> {
    accel: &'a AnyAccel,
    prims: Triangles<'a>,
    rays: &'a [Ray],
    query: Query,
}

impl Task for Cast<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self) -> usize {
        match self.query {
            Query::Closest => self.singly(|ray| {
                let mut best = Closest::new(ray);
                self.accel.closest::<S, _, _>(&self.prims, ray, &mut best, &AnyHit, &mut ());
                best.hit(ray).is_some()
            }),
            Query::Occluded => self.singly(|ray| self.accel.occluded::<S, _, _>(&self.prims, ray, &AnyHit, &mut ())),
            Query::ClosestPacket => self.together(|rays, active| {
                let mut best: [Closest; PACKET] = std::array::from_fn(|i| Closest::new(&rays[i]));
                self.accel.closest_packet::<S, _, _>(&self.prims, rays, active, &mut best, &[AnyHit; PACKET], &mut ());
                best.iter().zip(rays).filter(|(best, ray)| best.hit(ray).is_some()).count()
            }),
            Query::OccludedPacket => self.together(|rays, active| {
                let sinks = [AnyHit; PACKET];
                let blocked = self.accel.occluded_packet::<S, _, _>(&self.prims, rays, active, &sinks, &mut ());
                blocked.count_ones() as usize
            }),
        }
    }
}

impl Cast<'_> {
    #[inline(always)]
    fn singly(&self, hits: impl Fn(&TravRay) -> bool) -> usize {
        self.rays.iter().filter_map(TravRay::new).filter(hits).count()
    }

    #[inline(always)]
    fn together(&self, hits: impl Fn(&[TravRay; PACKET], u32) -> usize) -> usize {
        let packets = self.rays.as_chunks::<PACKET>().0.iter();
        packets
            .map(|rays| {
                let rays = rays.map(|ray| TravRay::new(&ray).expect("benched rays are rays"));
                hits(&rays, u32::MAX >> (32 - PACKET))
            })
            .sum()
    }
}

fn traverse(criterion: &mut Criterion) {
    let mesh = meshes::dented_sphere(224, 0.0);
    let sets = [("camera", meshes::camera_rays(256)), ("scattered", meshes::scattered_rays(65_536))];
    for &kind in AccelKind::ALL.iter().filter(|&&k| k != AccelKind::List) {
        let accel = AccelSpec::new(kind).build(&mesh.prims()).expect("the sphere builds");
        let mut group = criterion.benchmark_group(format!("traverse/sphere/{kind}"));
        for (name, rays) in &sets {
            group.throughput(Throughput::Elements(rays.len() as u64));
            let queries = [
                ("closest", Query::Closest),
                ("occluded", Query::Occluded),
                ("closest_packet", Query::ClosestPacket),
                ("occluded_packet", Query::OccludedPacket),
            ];
            for (what, query) in queries {
                let cast = Cast { accel: &accel, prims: mesh.prims(), rays, query };
                group.bench_function(format!("{name}/{what}"), |b| b.iter(|| dispatch(SimdLevel::best(), cast)));
            }
        }
    }
}

criterion_group!(benches, traverse);
criterion_main!(benches);
