use super::{Counts, Stopwatch};
use crate::{
    accel::{AnyAccel, AnyHit, Closest, Counter, PACKET, TravRay},
    geom::{Forms, Hit, InstanceId, PrimId, Ray, Triangles},
    glam::Vec3,
    simd::{Scalar, Simd, SimdLevel, Task, dispatch},
};

/// What is asked of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// The nearest hit.
    Closest,
    /// Whether anything is hit.
    Blocked,
}

/// What a ray met, bit for bit: triangle, t, u, v. A blocked ray is triangle 0 at 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer([u32; 4]);

impl Answer {
    /// Nothing was hit.
    pub const MISS: Self = Self([u32::MAX; 4]);

    #[inline(always)]
    fn of(hit: Option<Hit>) -> Self {
        hit.map_or(Self::MISS, |h| Self([h.prim.0, h.t.to_bits(), h.u.to_bits(), h.v.to_bits()]))
    }

    /// A hit of `prim`.
    pub(in crate::report) fn at(prim: PrimId, t: f32, [u, v]: [f32; 2]) -> Self {
        Self([prim.0, t.to_bits(), u.to_bits(), v.to_bits()])
    }

    #[inline(always)]
    fn blocked(blocked: bool) -> Self {
        if blocked { Self([0; 4]) } else { Self::MISS }
    }

    /// Triangle and t of a hit.
    pub fn hit(self) -> Option<(PrimId, f32)> {
        let [prim, t, ..] = self.0;
        (self != Self::MISS).then(|| (PrimId(prim), f32::from_bits(t)))
    }

    /// All of a hit.
    pub fn found(self) -> Option<Hit> {
        let [prim, t, u, v] = self.0;
        let [t, u, v] = [t, u, v].map(f32::from_bits);
        (self != Self::MISS).then_some(Hit { t, u, v, prim: PrimId(prim), instance: InstanceId(0) })
    }
}

/// Casts rays at a structure.
#[derive(Clone, Copy, Debug)]
pub struct Caster<'a> {
    /// The structure.
    pub accel: &'a AnyAccel,
    /// What it was built over or refitted to.
    pub prims: Triangles<'a>,
    /// Level of the kernels.
    pub simd: SimdLevel,
    /// How rays are tested.
    pub forms: Forms,
}

impl Caster<'_> {
    /// Casts all rays by this thread, singly or in packets of consecutive ones, and returns the seconds it took.
    ///
    /// # Panics
    /// When `out` is shorter than `rays`.
    pub fn cast(&self, rays: &[Ray], ask: Ask, packet: bool, out: &mut [Answer]) -> f64 {
        let watch = Stopwatch::thread();
        let out = &mut out[..rays.len()];
        dispatch(self.simd, Chunk { caster: self, rays, ask, packet, out, count: &mut () });
        watch.seconds()
    }

    /// The answers of all rays, cast singly.
    pub fn answers(&self, rays: &[Ray], ask: Ask) -> Vec<Answer> {
        let mut out = vec![Answer::MISS; rays.len()];
        self.cast(rays, ask, false, &mut out);
        out
    }

    /// Counts what rays cost, cast singly by this thread: all, or as many as [`Counts::work`] below `budget` allows, at least
    /// sixteen. Counts are those of every SIMD level, so the portable kernels count.
    pub fn count(&self, rays: &[Ray], ask: Ask, budget: u64) -> Counts {
        let mut counts = Counts::default();
        let mut out = [Answer::MISS; PACKET];
        for rays in rays.chunks(PACKET) {
            let mut part = Counts { rays: rays.len() as u64, ..Counts::default() };
            let chunk = Chunk { caster: self, rays, ask, packet: false, out: &mut out[..rays.len()], count: &mut part };
            match ask {
                Ask::Closest => chunk.closest::<Scalar>(),
                Ask::Blocked => chunk.blocked::<Scalar>(),
            }
            counts += part;
            if counts.work() > budget {
                break;
            }
        }
        counts
    }
}

struct Chunk<'a, C> {
    caster: &'a Caster<'a>,
    rays: &'a [Ray],
    ask: Ask,
    packet: bool,
    out: &'a mut [Answer],
    count: &'a mut C,
}

impl<C: Counter> Task for Chunk<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        match (self.packet, self.ask) {
            (false, Ask::Closest) => self.closest::<S>(),
            (false, Ask::Blocked) => self.blocked::<S>(),
            (true, _) => self.packets::<S>(),
        }
    }
}

impl<C: Counter> Chunk<'_, C> {
    #[inline(always)]
    fn closest<S: Simd>(self) {
        let Caster { accel, prims, forms, .. } = self.caster;
        for (ray, out) in self.rays.iter().zip(self.out) {
            let hit = TravRay::with_forms(ray, *forms).and_then(|ray| {
                let mut best = Closest::new(&ray);
                accel.closest::<S, _, _>(prims, &ray, &mut best, &AnyHit, self.count);
                best.hit(&ray)
            });
            *out = Answer::of(hit);
        }
    }

    #[inline(always)]
    fn blocked<S: Simd>(self) {
        let Caster { accel, prims, forms, .. } = self.caster;
        for (ray, out) in self.rays.iter().zip(self.out) {
            let ray = TravRay::with_forms(ray, *forms);
            *out = Answer::blocked(ray.is_some_and(|ray| accel.occluded::<S, _, _>(prims, &ray, &AnyHit, self.count)));
        }
    }

    /// Lanes whose ray is none keep a stand-in that is not active.
    #[inline(always)]
    fn packets<S: Simd>(self) {
        let Caster { accel, prims, forms, .. } = self.caster;
        let Some(stand_in) = TravRay::with_forms(&Ray::new(Vec3::ZERO, Vec3::X), *forms) else { return };
        let sinks = [AnyHit; PACKET];
        for (records, out) in self.rays.chunks(PACKET).zip(self.out.chunks_mut(PACKET)) {
            let mut rays = [stand_in; PACKET];
            let mut active = 0;
            for (i, record) in records.iter().enumerate() {
                if let Some(ray) = TravRay::with_forms(record, *forms) {
                    rays[i] = ray;
                    active |= 1 << i;
                }
            }
            let (rays, sinks) = (&rays[..records.len()], &sinks[..records.len()]);
            if self.ask == Ask::Blocked {
                let blocked = accel.occluded_packet::<S, _, _>(prims, rays, active, sinks, self.count);
                for (i, out) in out.iter_mut().enumerate() {
                    *out = Answer::blocked((blocked >> i) & 1 == 1);
                }
            } else {
                let mut best = [Closest::new(&stand_in); PACKET];
                for (best, ray) in best.iter_mut().zip(rays) {
                    *best = Closest::new(ray);
                }
                let best = &mut best[..records.len()];
                accel.closest_packet::<S, _, _>(prims, rays, active, best, sinks, self.count);
                for (i, out) in out.iter_mut().enumerate() {
                    *out = if (active >> i) & 1 == 1 { Answer::of(best[i].hit(&rays[i])) } else { Answer::MISS };
                }
            }
        }
    }
}
