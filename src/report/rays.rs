//! Rays made from a scene: the same for every structure and machine.

use super::{
    measure::{Answer, Ask},
    random::Random,
};
use crate::{
    geom::{Aabb, PrimId, Ray, Triangles},
    glam::{DVec3, Vec3},
};

/// Where the camera stands and looks, as a direction from the middle of the scene.
const BACK: DVec3 = DVec3::new(0.45, 0.35, 1.0);

/// Where the light is, in radii of the scene from its middle.
pub(super) const LIGHT: DVec3 = DVec3::new(-1.2, 2.4, 1.5);

/// How far ambient-occlusion rays reach, in radii of the scene.
const AO_REACH: f64 = 0.4;

/// How far secondary rays start above the surface, in radii of the scene.
const LIFT: f64 = 1.0 / 16_384.0;

/// Side of the tiles that a picture's rays come in: consecutive 16 rays make a packet.
const TILE: usize = 4;

/// What rays are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RayClass {
    /// From a camera that sees the whole scene, through pixel centres, in tiles of 4 x 4.
    Primary,
    /// From the primary hits to one light; any hit ends the ray.
    Shadow,
    /// From the primary hits, cosine-distributed about the normal, of limited reach; any hit ends the ray.
    Ao,
    /// From the primary hits, cosine-distributed, without an end.
    Diffuse,
}

impl RayClass {
    /// Every class.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Shadow, Self::Ao, Self::Diffuse];

    /// Name in the rows.
    pub fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Ao => "ao",
            Self::Diffuse => "diffuse",
        }
    }

    /// What is asked of these rays.
    pub fn ask(self) -> Ask {
        match self {
            Self::Primary | Self::Diffuse => Ask::Closest,
            Self::Shadow | Self::Ao => Ask::Blocked,
        }
    }
}

/// The middle and half the diagonal of a scene's box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    center: DVec3,
    radius: f64,
}

impl Sphere {
    /// `None` for an empty box or one beyond f32.
    pub(super) fn around(bounds: Aabb) -> Option<Self> {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let radius = 0.5 * (max - min).length();
        (!bounds.is_empty() && radius.is_finite())
            .then(|| Self { center: 0.5 * (min + max), radius: radius.max(1e-30) })
    }
}

impl Sphere {
    /// A point given in radii from the middle.
    pub(super) fn beside(self, radii: DVec3) -> DVec3 {
        self.center + radii * self.radius
    }
}

/// Where a picture is taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Eye point.
    pub eye: DVec3,
    /// Point in the middle of the picture.
    pub at: DVec3,
    /// Upwards, roughly.
    pub up: DVec3,
    /// Half of the picture's shorter side at distance 1.
    pub half: f64,
}

impl View {
    /// Of the whole scene: its sphere at 2.5 radii, seen under its own angle.
    pub(super) fn whole(scene: Sphere) -> Self {
        let eye = scene.center + BACK.normalize() * (2.5 * scene.radius);
        Self { eye, at: scene.center, up: DVec3::Y, half: 1.0 / (2.5_f64 * 2.5 - 1.0).sqrt() }
    }
}

/// Rays of a picture of `width` x `height` pixels, both rounded up to whole tiles.
pub(super) fn primary(view: View, [width, height]: [usize; 2]) -> Vec<Ray> {
    let View { eye, at, up, half } = view;
    let back = (eye - at).normalize();
    let right = up.cross(back).normalize();
    let up = back.cross(right);
    let pixel = 2.0 * half / width.min(height).max(1) as f64;
    let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
    let ray = |i: usize| {
        let (tile, inner) = (i / (TILE * TILE), i % (TILE * TILE));
        let x = tile % columns * TILE + inner % TILE;
        let y = tile / columns * TILE + inner / TILE;
        let dx = (x as f64 + 0.5 - width as f64 / 2.0) * pixel;
        let dy = (height as f64 / 2.0 - y as f64 - 0.5) * pixel;
        Ray::new(eye.as_vec3(), (right * dx + up * dy - back).as_vec3())
    };
    (0..columns * rows * TILE * TILE).map(ray).collect()
}

/// Rays that begin where primary ones end, in their order; misses make none.
pub(super) fn secondary(
    class: RayClass,
    scene: Sphere,
    prims: &Triangles<'_>,
    rays: &[Ray],
    answers: &[Answer],
) -> Vec<Ray> {
    let made = rays.iter().zip(answers).enumerate().filter_map(|(i, (ray, answer))| {
        let (prim, t) = answer.hit()?;
        let normal = facing(prims, prim, ray.dir)?;
        let lifted = ray.origin.as_dvec3() + ray.dir.as_dvec3() * f64::from(t) + normal * (LIFT * scene.radius);
        let origin = lifted.as_vec3();
        let dir = match class {
            RayClass::Shadow => scene.center + LIGHT * scene.radius - origin.as_dvec3(),
            _ => cosine(normal, &mut Random::new(1 + class as u64, i as u64)),
        };
        Some(Ray { origin, dir: dir.as_vec3(), t_near: 0.0, t_far: reach(class, scene) })
    });
    made.collect()
}

#[expect(clippy::cast_possible_truncation, reason = "a rounded distance")]
fn reach(class: RayClass, scene: Sphere) -> f32 {
    match class {
        RayClass::Shadow => 1.0,
        RayClass::Ao => (AO_REACH * scene.radius) as f32,
        RayClass::Primary | RayClass::Diffuse => f32::INFINITY,
    }
}

/// The unit normal on the side that a ray comes from.
fn facing(prims: &Triangles<'_>, prim: PrimId, dir: Vec3) -> Option<DVec3> {
    let [a, b, c] = prims.corners(prim).map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a).try_normalize()?;
    Some(if normal.dot(dir.as_dvec3()) > 0.0 { -normal } else { normal })
}

/// A direction about `normal` with density in proportion to the cosine: the normal and a point of the unit sphere.
pub(super) fn cosine(normal: DVec3, random: &mut Random) -> DVec3 {
    loop {
        let point = DVec3::new(random.unit(), random.unit(), random.unit()) * 2.0 - DVec3::ONE;
        let length = point.length();
        let sum = normal + point / length;
        if (1e-3..=1.0).contains(&length) && sum.length_squared() > 1e-6 {
            return sum.normalize();
        }
    }
}

/// `count` of the rays or a few more: whole packets, spread evenly over all.
pub(super) fn spread<T: Copy>(rays: &[T], count: usize) -> Vec<T> {
    let packets = rays.len().div_ceil(TILE * TILE);
    let wanted = count.div_ceil(TILE * TILE).min(packets);
    let packet = |i: usize| rays.chunks(TILE * TILE).nth(i * packets / wanted.max(1)).unwrap_or_default();
    (0..wanted).flat_map(packet).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const BALL: Aabb = Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE };

    #[test]
    fn the_camera_sees_the_scene_and_packets_are_tiles() {
        let sphere = Sphere::around(BALL).unwrap();
        let rays = primary(View::whole(sphere), [64, 32]);
        assert_eq!(rays.len(), 64 * 32);
        let toward = |r: &Ray| r.dir.as_dvec3().normalize().dot(-BACK.normalize());
        let least = rays.iter().map(toward).fold(1.0, f64::min);
        assert!(least > 0.5 && toward(&rays[32 * 16 / 2 + 16 * 4]) > least);
        let apart = (rays[0].dir - rays[15].dir).length();
        assert!(apart < 5.0 * (rays[0].dir - rays[1].dir).length());
    }

    #[test]
    fn cosine_directions_stay_above_the_surface_and_have_the_right_mean() {
        let mut sum = DVec3::ZERO;
        for i in 0..4000 {
            let dir = cosine(DVec3::Y, &mut Random::new(7, i));
            assert!(dir.y > 0.0 && (dir.length() - 1.0).abs() < 1e-12);
            sum += dir / 4000.0;
        }
        assert!((sum.y - 2.0 / 3.0).abs() < 0.02 && sum.x.abs() < 0.03 && sum.z.abs() < 0.03, "{sum}");
    }

    #[test]
    fn a_part_of_the_rays_is_spread_over_all() {
        let rays = primary(View::whole(Sphere::around(BALL).unwrap()), [64, 64]);
        let part = spread(&rays, 100);
        assert_eq!(part.len(), 112);
        assert_eq!(part[..16], rays[..16]);
        assert!(part[96..] != rays[96..112] && rays.ends_with(&part[111..]) == rays.ends_with(&part[96..]));
        assert_eq!(spread(&rays, usize::MAX), rays);
        assert!(spread::<Ray>(&[], 5).is_empty());
    }
}
