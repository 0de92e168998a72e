//! The rays of a picture, a shadow and a bounce for each hit: cast again for every frame.

use std::hint::black_box;

use crate::{
    geom::{Aabb, Hit, Ray},
    glam::{DVec3, Vec3},
    report::{
        measure::Stopwatch,
        random::Random,
        rays::{self, LIGHT, Sphere, View},
    },
    simd::{FloatModeError, SimdLevel},
    world::World,
};

/// Words that are more than a core's own caches hold.
const ELSEWHERE: usize = 1 << 21;

/// The rays and what they met the last time.
#[derive(Clone, Debug)]
pub(super) struct Shots {
    sphere: Sphere,
    level: SimdLevel,
    primary: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    shadow: Vec<Ray>,
    blocked: Vec<bool>,
    bounce: Vec<Ray>,
    bounced: Vec<Option<Hit>>,
    /// What is written over before rays are cast.
    elsewhere: Vec<u64>,
}

impl Shots {
    /// Of a camera that sees all of `reach`; `None` when there is nothing.
    pub(super) fn new(reach: Aabb, size: [usize; 2], level: SimdLevel) -> Option<Self> {
        let sphere = Sphere::around(reach)?;
        let primary = rays::primary(View::whole(sphere), size);
        let n = primary.len();
        Some(Self {
            sphere,
            level,
            primary,
            hits: vec![None; n],
            shadow: Vec::with_capacity(n),
            blocked: vec![false; n],
            bounce: Vec::with_capacity(n),
            bounced: vec![None; n],
            elsewhere: vec![0; ELSEWHERE],
        })
    }

    /// Rays cast the last time.
    pub(super) fn count(&self) -> usize {
        self.primary.len() + self.shadow.len() + self.bounce.len()
    }

    /// Casts all rays at a frame by this thread: the seconds of its processor time that casting took.
    ///
    /// A core's own caches hold nothing of the frame at first, whether it was just made or cast at before.
    pub(super) fn cast(&mut self, world: &World) -> Result<f64, FloatModeError> {
        for word in &mut self.elsewhere {
            *word = word.wrapping_add(1);
        }
        black_box(&mut self.elsewhere);
        let watch = Stopwatch::thread();
        world.hit_all(&self.primary, self.level, &mut self.hits)?;
        let first = watch.seconds();
        self.aim(world);
        let watch = Stopwatch::thread();
        world.block_all(&self.shadow, self.level, &mut self.blocked)?;
        world.hit_all(&self.bounce, self.level, &mut self.bounced)?;
        Ok(first + watch.seconds())
    }

    /// Makes the rays that begin at hits.
    fn aim(&mut self, world: &World) {
        self.shadow.clear();
        self.bounce.clear();
        let light = self.sphere.beside(LIGHT);
        for (i, (ray, hit)) in self.primary.iter().zip(&self.hits).enumerate() {
            let Some(hit) = hit else { continue };
            let [a, b, c] = world.corners(hit.instance, hit.prim).map(Vec3::as_dvec3);
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            let normal = if normal.dot(ray.dir.as_dvec3()) > 0.0 { -normal } else { normal };
            let place = ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(hit.t);
            let to_light = (light - place).as_vec3();
            self.shadow.push(Ray { t_far: 1.0, ..Ray::new(world.leave(hit, to_light), to_light) });
            let dir: DVec3 = rays::cosine(normal, &mut Random::new(1, i as u64));
            self.bounce.push(Ray::new(world.leave(hit, dir.as_vec3()), dir.as_vec3()));
        }
    }

    /// A number that tells answers apart that differ in any bit.
    pub(super) fn digest(&self) -> u64 {
        let mut sum = Digest(0xcbf2_9ce4_8422_2325);
        let met = self.shadow.len();
        self.hits.iter().chain(&self.bounced[..met]).for_each(|hit| sum.hit(hit.as_ref()));
        self.blocked[..met].iter().for_each(|&blocked| sum.add(u32::from(blocked)));
        sum.0
    }
}

/// FNV-1a over words.
struct Digest(u64);

impl Digest {
    fn add(&mut self, word: u32) {
        self.0 = (self.0 ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3);
    }

    fn hit(&mut self, hit: Option<&Hit>) {
        match hit {
            None => self.add(u32::MAX),
            Some(h) => {
                for word in [h.instance.0, h.prim.0, h.t.to_bits(), h.u.to_bits(), h.v.to_bits()] {
                    self.add(word);
                }
            }
        }
    }
}
