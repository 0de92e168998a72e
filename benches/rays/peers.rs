//! Kinora and others behind one surface.

use std::time::Duration;

use bvh::{aabb::Bounded, bounding_hierarchy::BHShape};
use kinora::{
    accel::AnyAccel,
    geom::{Ray, Triangles},
    glam::{Vec3, Vec3A},
    simd::SimdLevel,
};
use nalgebra::{Point3, Vector3};
use obvhs::{
    BvhBuildParams, bvh2,
    cwbvh::{CwBvh, builder::build_cwbvh_from_tris},
    ray::RayHit,
    rt_triangle::RtTriangle,
    triangle::Triangle,
};
use parry3d::{
    math::Vector,
    shape::{CompositeShapeRef, TriMesh, TriMeshFlags},
};

use crate::scene::Scene;

/// Triangle and distance.
pub(crate) type Hit = Option<(u32, f32)>;

/// A built structure.
pub(crate) trait Peer {
    /// The closest hit of every ray.
    fn closest(&self, rays: &[Ray]) -> Vec<Hit>;
    /// Whether every ray hits anything.
    fn blocked(&self, rays: &[Ray]) -> Vec<bool>;
}

/// All of them, ours first.
pub(crate) const NAMES: [&str; 6] = ["kinora bvh8", "kinora compact", "obvhs bvh2", "obvhs cwbvh", "bvh", "parry3d"];

pub(crate) fn build(name: &str, scene: &Scene) -> Box<dyn Peer> {
    match name {
        "kinora bvh8" => Box::new(Ours::build("bvh8", scene)),
        "kinora compact" => Box::new(Ours::build("bvh8:layout=compact", scene)),
        "obvhs bvh2" => Box::new(Two::build(scene)),
        "obvhs cwbvh" => Box::new(Wide::build(scene)),
        "bvh" => Box::new(Tree::build(scene)),
        _ => Box::new(Parry::build(scene)),
    }
}

struct Ours {
    accel: AnyAccel,
    positions: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
}

impl Ours {
    fn build(spec: &str, scene: &Scene) -> Self {
        let (positions, indices) = (scene.positions.clone(), scene.indices.clone());
        let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 0 };
        let spec: kinora::accel::AccelSpec = spec.parse().expect("a structure of ours");
        Self { accel: spec.build(&prims).expect("the scene builds"), positions, indices }
    }

    fn prims(&self) -> Triangles<'_> {
        Triangles { positions: &self.positions, indices: &self.indices, topology_epoch: 0 }
    }
}

impl Peer for Ours {
    fn closest(&self, rays: &[Ray]) -> Vec<Hit> {
        let mut hits = vec![None; rays.len()];
        self.accel.closest_hits(&self.prims(), rays, 1, SimdLevel::best(), &mut hits).expect("a common float mode");
        hits.into_iter().map(|hit| hit.map(|h| (h.prim.0, h.t))).collect()
    }

    fn blocked(&self, rays: &[Ray]) -> Vec<bool> {
        let mut blocked = vec![false; rays.len()];
        self.accel.blocked(&self.prims(), rays, 1, SimdLevel::best(), &mut blocked).expect("a common float mode");
        blocked
    }
}

fn obvhs_triangles(scene: &Scene) -> Vec<Triangle> {
    let triangle = |&indices: &[u32; 3]| {
        let [v0, v1, v2] = indices.map(|i| Vec3A::from(scene.positions[i as usize]));
        Triangle { v0, v1, v2 }
    };
    scene.indices.iter().map(triangle).collect()
}

fn obvhs_ray(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin.into(), ray.dir.into(), ray.t_near, ray.t_far)
}

fn obvhs_hit(hit: RayHit, prims: &[u32]) -> Hit {
    (hit.primitive_id != u32::MAX).then(|| (prims[hit.primitive_id as usize], hit.t))
}

struct Two {
    bvh: bvh2::Bvh2,
    triangles: Vec<RtTriangle>,
}

impl Two {
    fn build(scene: &Scene) -> Self {
        let own = obvhs_triangles(scene);
        let bvh = bvh2::builder::build_bvh2_from_tris(&own, BvhBuildParams::medium_build(), &mut Duration::default());
        let triangles = bvh.primitive_indices.iter().map(|&i| (&own[i as usize]).into()).collect();
        Self { bvh, triangles }
    }
}

impl Peer for Two {
    fn closest(&self, rays: &[Ray]) -> Vec<Hit> {
        let one = |ray: &Ray| {
            let mut hit = RayHit::none();
            self.bvh.ray_traverse(obvhs_ray(ray), &mut hit, |ray, i| self.triangles[i].intersect(ray));
            obvhs_hit(hit, &self.bvh.primitive_indices)
        };
        rays.iter().map(one).collect()
    }

    fn blocked(&self, rays: &[Ray]) -> Vec<bool> {
        let one = |ray: &Ray| !self.bvh.ray_traverse_miss(obvhs_ray(ray), |ray, i| self.triangles[i].intersect(ray));
        rays.iter().map(one).collect()
    }
}

struct Wide {
    bvh: CwBvh,
    triangles: Vec<RtTriangle>,
}

impl Wide {
    fn build(scene: &Scene) -> Self {
        let own = obvhs_triangles(scene);
        let bvh = build_cwbvh_from_tris(&own, BvhBuildParams::medium_build(), &mut Duration::default());
        let triangles = bvh.primitive_indices.iter().map(|&i| (&own[i as usize]).into()).collect();
        Self { bvh, triangles }
    }
}

impl Peer for Wide {
    fn closest(&self, rays: &[Ray]) -> Vec<Hit> {
        let one = |ray: &Ray| {
            let mut hit = RayHit::none();
            self.bvh.ray_traverse(obvhs_ray(ray), &mut hit, |ray, i| self.triangles[i].intersect(ray));
            obvhs_hit(hit, &self.bvh.primitive_indices)
        };
        rays.iter().map(one).collect()
    }

    fn blocked(&self, rays: &[Ray]) -> Vec<bool> {
        let one = |ray: &Ray| !self.bvh.ray_traverse_miss(obvhs_ray(ray), |ray, i| self.triangles[i].intersect(ray));
        rays.iter().map(one).collect()
    }
}

/// A triangle as `bvh` wants it.
struct Shape {
    corners: [Point3<f32>; 3],
    prim: u32,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> bvh::aabb::Aabb<f32, 3> {
        let [a, b, c] = &self.corners;
        bvh::aabb::Aabb::empty().grow(a).grow(b).grow(c)
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Shape {
    /// Möller and Trumbore's test from both sides; that of the crate leaves out back faces.
    fn meets(&self, origin: &Point3<f32>, dir: &Vector3<f32>, [near, far]: [f32; 2]) -> Option<f32> {
        let [a, b, c] = &self.corners;
        let (e1, e2, s) = (b - a, c - a, origin - a);
        let (p, q) = (dir.cross(&e2), s.cross(&e1));
        let inv = 1.0 / e1.dot(&p);
        let (u, v, t) = (s.dot(&p) * inv, dir.dot(&q) * inv, e2.dot(&q) * inv);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= near && t <= far).then_some(t)
    }
}

struct Tree {
    bvh: bvh::bvh::Bvh<f32, 3>,
    shapes: Vec<Shape>,
}

impl Tree {
    fn build(scene: &Scene) -> Self {
        let shape = |(prim, indices): (u32, &[u32; 3])| Shape {
            corners: indices.map(|i| Point3::from(scene.positions[i as usize].to_array())),
            prim,
            node: 0,
        };
        let mut shapes: Vec<_> = (0..).zip(&scene.indices).map(shape).collect();
        Self { bvh: bvh::bvh::Bvh::build(&mut shapes), shapes }
    }
}

impl Peer for Tree {
    /// There is no query for closest hits: boxes come nearest first, until one begins behind the best hit.
    fn closest(&self, rays: &[Ray]) -> Vec<Hit> {
        let one = |ray: &Ray| {
            let (origin, dir) = (Point3::from(ray.origin.to_array()), Vector3::from(ray.dir.to_array()));
            let line = bvh::ray::Ray::new(origin, dir);
            let mut best: Hit = None;
            let mut far = ray.t_far;
            for shape in self.bvh.nearest_traverse_iterator(&line, &self.shapes) {
                if line.intersection_slice_for_aabb(&shape.aabb()).is_some_and(|(near, _)| near > far) {
                    break;
                }
                if let Some(t) = shape.meets(&origin, &dir, [ray.t_near, far]) {
                    (best, far) = (Some((shape.prim, t)), t);
                }
            }
            best
        };
        rays.iter().map(one).collect()
    }

    fn blocked(&self, rays: &[Ray]) -> Vec<bool> {
        let one = |ray: &Ray| {
            let (origin, dir) = (Point3::from(ray.origin.to_array()), Vector3::from(ray.dir.to_array()));
            let line = bvh::ray::Ray::new(origin, dir);
            let mut shapes = self.bvh.traverse_iterator(&line, &self.shapes);
            shapes.any(|shape| shape.meets(&origin, &dir, [ray.t_near, ray.t_far]).is_some())
        };
        rays.iter().map(one).collect()
    }
}

/// Rays begin at 0 there.
struct Parry(TriMesh);

impl Parry {
    fn build(scene: &Scene) -> Self {
        let vertices = scene.positions.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let mesh = TriMesh::with_flags(vertices, scene.indices.clone(), TriMeshFlags::DEFORMABLE);
        Self(mesh.expect("the scene builds"))
    }

    fn cast(&self, ray: &Ray) -> Hit {
        let vector = |v: Vec3| Vector::new(v.x, v.y, v.z);
        let line = parry3d::query::Ray::new(vector(ray.origin), vector(ray.dir));
        CompositeShapeRef(&self.0).cast_local_ray(&line, ray.t_far.min(f32::MAX), false)
    }
}

impl Peer for Parry {
    fn closest(&self, rays: &[Ray]) -> Vec<Hit> {
        rays.iter().map(|ray| self.cast(ray)).collect()
    }

    fn blocked(&self, rays: &[Ray]) -> Vec<bool> {
        rays.iter().map(|ray| self.cast(ray).is_some()).collect()
    }
}
