//! Rays of a picture after the databases' rules.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    super::objects::{SolidHit, SolidRay, Solids},
    counts::{RayCounts, RayTally, Recorder},
    walker::Walker,
};
use crate::{
    accel::{TravRay, Visitor},
    geom::{Aabb, Ray},
    scene::spd::{SpdScene, SpdSurface, SpdView},
};

/// Pixels along a side of the pictures that statistics are published of; rays go through their corners.
pub const PIXELS: u32 = 512;
/// Depth beyond which no ray is spawned; rays from the eye have depth 1.
const DEPTH: u32 = 5;
/// Part of the scene's size that a ray moves on before it may meet something.
const OFFSET: f64 = 1e-6;

/// Where published counts read the databases' rules differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rules {
    /// The package's own: the view's angle lies between the centres of the outermost pixel rows; normals face the ray,
    /// so that shadow rays from within glass start at its inside.
    Readme,
    /// Those of Havran and Sixta, inferred from their counts: the angle lies between the outermost rays; glass keeps
    /// its outward normal, also for rays from within.
    Havran,
}

/// Which rays of a picture are cast.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RaySet {
    /// Those from the eye alone.
    Primary,
    /// Shadow, reflected and refracted rays too.
    All,
}

/// Casts the rays of a square picture through its pixels' corners, rows in parallel in the current rayon pool.
///
/// # Source
/// The rules are those of the Standard Procedural Databases' Readme, "Testing Procedures": eye rays at depth 1, none
/// below 5; reflecting and transmitting surfaces spawn reflected rays, transmitting ones refracted rays by Snell's law;
/// a shadow ray goes to every light that the surface does not face away from.
#[derive(Debug)]
pub struct Tracer<'a, W> {
    scene: &'a SpdScene,
    solids: &'a Solids,
    walker: &'a W,
    eye: EyeRays,
    rules: Rules,
    rays: RaySet,
    offset: f64,
}

/// What a row of the picture counts.
struct Row<'c, C> {
    counts: RayCounts,
    recorder: &'c mut C,
}

impl<'a, W: Walker> Tracer<'a, W> {
    /// Prepares a picture of (pixels along a side, which rays). `walker` is a structure over `solids`' boxes, `solids`
    /// those of `scene`.
    pub fn new(scene: &'a SpdScene, solids: &'a Solids, walker: &'a W, rules: Rules, picture: (u32, RaySet)) -> Self {
        let (pixels, rays) = picture;
        let bounds = solids.boxes().iter().fold(Aabb::EMPTY, |all, b| all.union(*b));
        let offset = f64::from(bounds.diagonal()) * OFFSET;
        Self { scene, solids, walker, eye: EyeRays::new(&scene.view, rules, pixels), rules, rays, offset }
    }

    /// Casts all rays. The counts do not depend on the structure.
    pub fn trace<C: Recorder>(&self) -> (RayCounts, C) {
        let seat = self.walker.seat(self.eye.origin);
        let rows: Vec<_> = (0..=self.eye.pixels)
            .into_par_iter()
            .map(|y| {
                let mut recorder = C::default();
                let mut row = Row { counts: RayCounts::default(), recorder: &mut recorder };
                for x in 0..=self.eye.pixels {
                    let mut state = seat.clone();
                    let hit = self.closest(&self.eye.ray(x, y), &mut state, &mut row.counts.primary, row.recorder);
                    if let (Some(hit), RaySet::All) = (hit, self.rays) {
                        self.shade(&hit, &state, 1, &mut row);
                    }
                }
                (row.counts, recorder)
            })
            .collect();
        let mut sum = (RayCounts::default(), C::default());
        for (counts, recorder) in rows {
            sum.0 += counts;
            sum.1.merge(recorder);
        }
        sum
    }

    /// The ray from the eye through the corner right of `x` and below `y` pixels.
    pub fn eye_ray(&self, x: u32, y: u32) -> Ray {
        self.eye.ray(x, y)
    }

    fn closest<C: Recorder>(
        &self,
        ray: &Ray,
        state: &mut W::State,
        tally: &mut RayTally,
        recorder: &mut C,
    ) -> Option<Hit> {
        tally.rays += 1;
        let walked = TravRay::new(ray)?;
        let solid_ray = SolidRay::from(ray);
        let mut nearest = Nearest { solids: self.solids, ray: solid_ray, best: None, tests: 0 };
        self.walker.walk_on(&walked, state, &mut nearest, recorder);
        let (best, tests) = (nearest.best, nearest.tests);
        (0..tests).for_each(|_| recorder.test());
        let (object, hit) = best?;
        tally.hits += 1;
        Some(Hit { point: solid_ray.at(hit.t), dir: solid_ray.dir.normalize(), object, surface: hit })
    }

    /// Rays that a hit spawns. `state` is the structure's at the hit.
    fn shade<C: Recorder>(&self, hit: &Hit, state: &W::State, depth: u32, row: &mut Row<'_, C>) {
        let surface = &self.scene.surfaces[self.scene.objects[hit.object as usize].surface as usize];
        let entering = hit.surface.n_geom.dot(hit.dir) < 0.0;
        let side = if entering { 1.0 } else { -1.0 };
        let normal = hit.surface.n_shade * side;
        let glass = surface.transmittance > 0.0;
        let lit = if glass && self.rules == Rules::Havran { 1.0 } else { side };
        for &light in &self.scene.lights {
            let way = (light - hit.point) * lit;
            if way.dot(hit.surface.n_shade) > 0.0 && way.dot(hit.surface.n_geom) > 0.0 {
                self.shadow(hit, light, state, row);
            }
        }
        if depth == DEPTH {
            return;
        }
        let reflected = || hit.dir - normal * (2.0 * hit.dir.dot(normal));
        if surface.specular > 0.0 || glass {
            self.spawn(hit, reflected(), state, depth, row);
        }
        if let Some(dir) = refracted(surface, hit.dir, normal, entering) {
            self.spawn(hit, dir, state, depth, row);
        }
    }

    fn spawn<C: Recorder>(&self, hit: &Hit, dir: DVec3, state: &W::State, depth: u32, row: &mut Row<'_, C>) {
        let mut state = state.clone();
        let ray = self.ray(hit.point, dir, f64::INFINITY);
        if let Some(next) = self.closest(&ray, &mut state, &mut row.counts.secondary, row.recorder) {
            self.shade(&next, &state, depth + 1, row);
        }
    }

    fn shadow<C: Recorder>(&self, hit: &Hit, light: DVec3, state: &W::State, row: &mut Row<'_, C>) {
        let way = light - hit.point;
        let distance = way.length();
        let ray = self.ray(hit.point, way / distance, distance);
        row.counts.shadow.rays += 1;
        let Some(walked) = TravRay::new(&ray) else { return };
        let mut any = Any { solids: self.solids, ray: SolidRay::from(&ray), found: false, tests: 0 };
        self.walker.walk_at(&walked, state, &mut any, row.recorder);
        let (found, tests) = (any.found, any.tests);
        (0..tests).for_each(|_| row.recorder.test());
        row.counts.shadow.hits += u64::from(found);
    }

    #[expect(clippy::cast_possible_truncation, reason = "rays are those of the rounded numbers")]
    fn ray(&self, origin: DVec3, dir: DVec3, t_far: f64) -> Ray {
        Ray { origin: origin.as_vec3(), dir: dir.as_vec3(), t_near: self.offset as f32, t_far: t_far as f32 }
    }
}

/// A point where a ray ended.
struct Hit {
    point: DVec3,
    /// Unit direction of the ray.
    dir: DVec3,
    object: u32,
    surface: SolidHit,
}

/// The direction behind the surface; none for opaque surfaces and under total reflection. `normal` is on the ray's side.
fn refracted(surface: &SpdSurface, dir: DVec3, normal: DVec3, entering: bool) -> Option<DVec3> {
    if surface.transmittance <= 0.0 {
        return None;
    }
    let eta = if entering { 1.0 / surface.ior } else { surface.ior };
    let cos = -dir.dot(normal);
    let rest = 1.0 - eta * eta * (1.0 - cos * cos);
    (rest >= 0.0).then(|| dir * eta + normal * (eta * cos - rest.sqrt()))
}

/// The nearest hit, equal t to the lower object.
struct Nearest<'a> {
    solids: &'a Solids,
    ray: SolidRay,
    best: Option<(u32, SolidHit)>,
    tests: u64,
}

impl Visitor for Nearest<'_> {
    fn t_limit(&self) -> f64 {
        self.ray.t_far
    }

    fn visit(&mut self, object: u32) -> bool {
        self.tests += 1;
        if let Some(hit) = self.solids.hit(&self.ray, object)
            && self.best.is_none_or(|(best, b)| (hit.t, object) < (b.t, best))
        {
            self.ray.t_far = hit.t;
            self.best = Some((object, hit));
        }
        false
    }
}

/// Whether anything is hit.
struct Any<'a> {
    solids: &'a Solids,
    ray: SolidRay,
    found: bool,
    tests: u64,
}

impl Visitor for Any<'_> {
    fn t_limit(&self) -> f64 {
        self.ray.t_far
    }

    fn visit(&mut self, object: u32) -> bool {
        self.tests += 1;
        self.found = self.found || self.solids.hit(&self.ray, object).is_some();
        self.found
    }
}

/// Rays from the eye through the corners of pixels.
#[derive(Clone, Copy, Debug)]
struct EyeRays {
    origin: Vec3,
    forward: DVec3,
    /// From one pixel to the next, at distance 1.
    right: DVec3,
    down: DVec3,
    pixels: u32,
}

impl EyeRays {
    fn new(view: &SpdView, rules: Rules, pixels: u32) -> Self {
        let forward = (view.at - view.from).normalize();
        let right = forward.cross(view.up).normalize();
        let across = if rules == Rules::Readme { pixels.max(2) - 1 } else { pixels };
        let step = 2.0 * libm::tan(view.angle_deg.to_radians() / 2.0) / f64::from(across);
        let down = forward.cross(right) * step;
        Self { origin: view.from.as_vec3(), forward, right: right * step, down, pixels }
    }

    fn ray(&self, x: u32, y: u32) -> Ray {
        let place = |i: u32| f64::from(i) - f64::from(self.pixels) / 2.0;
        let dir = self.forward + self.right * place(x) + self.down * place(y);
        Ray::new(self.origin, dir.normalize().as_vec3())
    }
}
