use glam::DVec3;

use super::{
    bounds,
    cone::Cone,
    polygon::{Patch, Polygon},
    sphere::Sphere,
};
use crate::{
    geom::{Aabb, Ray},
    scene::spd::{SpdScene, SpdShape},
};

/// A ray in f64 with the values of an `f32` one, so that boxes and objects are tested with the same line.
#[derive(Clone, Copy, Debug)]
pub struct SolidRay {
    /// Start point.
    pub origin: DVec3,
    /// Direction of any nonzero length.
    pub dir: DVec3,
    /// Least parameter that counts.
    pub t_near: f64,
    /// Greatest parameter that counts.
    pub t_far: f64,
}

impl From<&Ray> for SolidRay {
    fn from(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.as_dvec3(),
            dir: ray.dir.as_dvec3(),
            t_near: f64::from(ray.t_near),
            t_far: f64::from(ray.t_far),
        }
    }
}

impl SolidRay {
    /// The point at parameter `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.dir * t
    }

    /// True when `t` is in the ray's range; NaN is not.
    pub(super) fn holds(&self, t: f64) -> bool {
        self.t_near <= t && t <= self.t_far
    }

    /// The parameter of the point nearest to `p`: round shapes are solved from there, where nothing large cancels.
    pub(super) fn nearest_to(&self, p: DVec3) -> f64 {
        (p - self.origin).dot(self.dir) / self.dir.length_squared()
    }
}

/// Where a ray meets an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidHit {
    /// Ray parameter.
    pub t: f64,
    /// Outward unit normal of the shape.
    pub n_geom: DVec3,
    /// Unit normal for shading; that of the shape but on patches.
    pub n_shade: DVec3,
}

/// Which hits of an object count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Those on its front, where the ray runs against the outward normal.
    Front,
    /// All.
    Both,
}

/// A primitive ready for rays.
#[derive(Clone, Debug)]
pub enum Solid {
    /// A sphere.
    Sphere(Sphere),
    /// A cone mantle without caps.
    Cone(Cone),
    /// A plane polygon, concave or not.
    Polygon(Polygon),
    /// A triangle with interpolated normals.
    Patch(Patch),
}

impl Solid {
    /// From its shape.
    pub fn new(shape: &SpdShape) -> Self {
        match shape {
            SpdShape::Sphere { center, radius } => Self::Sphere(Sphere { center: *center, radius: *radius }),
            SpdShape::Cone { base, base_radius, apex, apex_radius } => {
                Self::Cone(Cone::new((*base, *base_radius), (*apex, *apex_radius)))
            }
            SpdShape::Polygon(corners) => Self::Polygon(Polygon::new(corners)),
            SpdShape::Patch { corners, normals } => Self::Patch(Patch::new(*corners, *normals)),
        }
    }

    /// The first hit in the ray's range on the wanted sides.
    pub fn hit(&self, ray: &SolidRay, sides: Sides) -> Option<SolidHit> {
        let wanted = |hit: &SolidHit| ray.holds(hit.t) && (sides == Sides::Both || hit.n_geom.dot(ray.dir) < 0.0);
        let first = |hits: [Option<SolidHit>; 2]| hits.into_iter().flatten().find(wanted);
        match self {
            Self::Sphere(sphere) => first(sphere.hits(ray)),
            Self::Cone(cone) => first(cone.hits(ray)),
            Self::Polygon(polygon) => polygon.hit(ray).filter(wanted),
            Self::Patch(patch) => patch.hit(ray).filter(wanted),
        }
    }

    /// A box around the object.
    pub fn aabb(&self) -> Aabb {
        match self {
            Self::Sphere(sphere) => sphere.aabb(),
            Self::Cone(cone) => cone.aabb(),
            Self::Polygon(polygon) => bounds::of_points(polygon.corners()),
            Self::Patch(patch) => bounds::of_points(&patch.corners),
        }
    }
}

/// The objects of a database with their boxes; an object's number is its place in the scene.
#[derive(Clone, Debug)]
pub struct Solids {
    objects: Vec<Solid>,
    sides: Vec<Sides>,
    boxes: Vec<Aabb>,
}

impl Solids {
    /// Those of a scene: opaque surfaces are met from the front only, unless they are two-sided.
    pub fn new(scene: &SpdScene) -> Self {
        let objects: Vec<_> = scene.objects.iter().map(|o| Solid::new(&o.shape)).collect();
        let side = |surface: u32| {
            let surface = &scene.surfaces[surface as usize];
            if surface.two_sided || surface.transmittance > 0.0 { Sides::Both } else { Sides::Front }
        };
        let sides = scene.objects.iter().map(|o| side(o.surface)).collect();
        let boxes = objects.iter().map(Solid::aabb).collect();
        Self { objects, sides, boxes }
    }

    /// Boxes in the order of objects.
    pub fn boxes(&self) -> &[Aabb] {
        &self.boxes
    }

    /// The objects.
    pub fn objects(&self) -> &[Solid] {
        &self.objects
    }

    /// The nearest hit of all, equal t at the lower object, by testing each.
    pub fn closest(&self, ray: &SolidRay) -> Option<(u32, SolidHit)> {
        let mut ray = *ray;
        let mut best = None;
        for object in (0..).take(self.objects.len()) {
            if let Some(hit) = self.hit(&ray, object)
                && best.as_ref().is_none_or(|(_, b): &(u32, SolidHit)| hit.t < b.t)
            {
                ray.t_far = hit.t;
                best = Some((object, hit));
            }
        }
        best
    }

    /// Where `ray` meets an object.
    pub fn hit(&self, ray: &SolidRay, object: u32) -> Option<SolidHit> {
        let object = object as usize;
        self.objects[object].hit(ray, self.sides[object])
    }
}
