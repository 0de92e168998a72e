//! From a database's primitives to triangles.

use glam::{DMat3, DMat4, DVec3, Vec3, Vec4};

use super::{
    SpdKind, SpdObject, SpdScene, SpdShape, SpdSurface,
    mesh::{MeshMaker, polygon_normal},
};
use crate::scene::{
    AlphaMode, Camera, CameraId, Light, LightId, LightKind, LocalTransform, Material, MaterialId, Mesh, MeshId,
    MeshPart, NodeId, PartInstance, Projection, Scene, SceneNode,
};

/// Largest distance between a round primitive and its triangles, seen from the scene's eye, over the picture's height
/// there.
const TOLERANCE: f64 = 1.0 / 4096.0;
/// Triangles above which [`SpdScene::tessellate`] cuts round primitives more coarsely.
const BUDGET: usize = 4_000_000;
/// Doublings of the tolerance that are tried.
const COARSEST: i32 = 12;
/// Fewest and most segments around a round primitive.
const SEGMENTS: (f64, f64) = (4.0, 256.0);

impl SpdScene {
    /// The scene as triangles: a part for each surface, a camera, and a light for each of the database's.
    ///
    /// Round primitives are cut finely enough for the scene's own camera at 720 rows or so, and get smooth normals.
    /// Scenes with +Z up are turned so that +Y is up. Light and material models differ: the lights, which know no
    /// falloff, become directional ones through the point that the camera looks at (as the package suggests where
    /// positions are not at hand), but for those of the lattice; glass lets light through without bending it; mirrors
    /// mirror the sky; the background colour is not used.
    ///
    /// Cost: up to about 10 million triangles at the largest size factors.
    pub fn tessellate(&self) -> Scene {
        self.tessellate_within(BUDGET)
    }

    /// As [`SpdScene::tessellate`], with round primitives cut so coarsely that there are at most `triangles`, if they
    /// can be.
    pub fn tessellate_within(&self, triangles: usize) -> Scene {
        let lens = Lens::fitting(self, triangles);
        let parts = (0u32..).zip(&self.surfaces).map(|(i, _)| self.part(i, &lens)).collect();
        let mut scene = Scene {
            file: format!("builtin:spd-{}:{}", self.kind.name(), self.size),
            scene_count: 1,
            materials: self.surfaces.iter().map(material).collect(),
            meshes: vec![Mesh { name: self.kind.name().to_owned(), parts, weights: Vec::new() }],
            ..Scene::default()
        };
        self.add_camera(&mut scene);
        self.add_lights(&mut scene);
        add_node(&mut scene, SceneNode { mesh: Some(MeshId(0)), ..named(self.kind.name()) });
        let node = NodeId(u32::try_from(scene.nodes.len() - 1).unwrap_or(0));
        let instance = |part| PartInstance { node, mesh: MeshId(0), part, copy: None };
        scene.instances = (0u32..).zip(&self.surfaces).map(|(part, _)| instance(part)).collect();
        scene
    }

    /// How far any triangle of [`SpdScene::tessellate_within`] may be from the primitive that it stands for, but for
    /// roundings to f32.
    pub fn chord_error(&self, triangles: usize) -> f64 {
        let lens = Lens::fitting(self, triangles);
        let error = |object: &SpdObject| {
            let (center, radius) = roundness(&object.shape)?;
            Some(sagitta(lens.segments(center, radius), radius))
        };
        self.objects.iter().filter_map(error).fold(0.0, f64::max)
    }

    /// From the database's axes to +Y up.
    pub fn to_y_up(&self, v: DVec3) -> DVec3 {
        match self.kind {
            SpdKind::Tetra | SpdKind::Lattice | SpdKind::Jacks => v,
            _ => DVec3::new(v.x, v.z, -v.y),
        }
    }

    fn part(&self, surface: u32, lens: &Lens) -> MeshPart {
        let mut maker = MeshMaker::new(|v| self.to_y_up(v));
        for object in self.objects.iter().filter(|o| o.surface == surface) {
            match &object.shape {
                SpdShape::Sphere { center, radius } => maker.sphere(*center, *radius, lens.segments(*center, *radius)),
                SpdShape::Cone { base, base_radius, apex, apex_radius } => {
                    let segments = lens.segments((*base + *apex) * 0.5, *base_radius);
                    maker.cone((*base, *base_radius), (*apex, *apex_radius), segments);
                }
                SpdShape::Polygon(corners) => maker.polygon(corners, polygon_normal(corners)),
                SpdShape::Patch { corners, normals } => maker.triangle(corners, normals),
            }
        }
        maker.finish(MaterialId(surface))
    }

    fn add_camera(&self, scene: &mut Scene) {
        let view = &self.view;
        let [from, at, up] = [view.from, view.at, view.up].map(|v| self.to_y_up(v));
        let back = (from - at).normalize();
        let right = up.cross(back).normalize();
        let axes = DMat3::from_cols(right, back.cross(right), back);
        #[expect(clippy::cast_possible_truncation, reason = "an angle")]
        let y_fov = view.angle_deg.to_radians() as f32;
        let projection = Projection::Perspective { y_fov, aspect: Some(1.0), z_near: 0.01, z_far: None };
        scene.cameras.push(Camera { name: "camera".to_owned(), projection });
        let local = LocalTransform::Matrix(DMat4::from_mat3_translation(axes, from));
        add_node(scene, SceneNode { local, camera: Some(CameraId(0)), ..named("camera") });
    }

    #[expect(clippy::cast_possible_truncation, reason = "a handful of lights")]
    fn add_lights(&self, scene: &mut Scene) {
        let count = self.lights.len();
        let level = (count as f64).sqrt() / (2.0 * count as f64);
        // The lattice stands between its lights, where parallel light would fall along its rows.
        let between = self.kind == SpdKind::Lattice;
        let focus = self.to_y_up(if between { DVec3::splat(0.5) } else { self.view.at });
        for (i, &position) in self.lights.iter().enumerate() {
            let position = self.to_y_up(position);
            let distance = position.distance(focus);
            let (kind, intensity) =
                if between { (LightKind::Point, level * distance * distance) } else { (LightKind::Directional, level) };
            let name = format!("light {i}");
            scene.lights.push(Light {
                name: name.clone(),
                color: Vec3::ONE,
                intensity: intensity as f32,
                range: None,
                kind,
            });
            let back = (position - focus) / distance;
            let right = back.any_orthonormal_vector();
            let axes = DMat3::from_cols(right, back.cross(right), back);
            let local = LocalTransform::Matrix(DMat4::from_mat3_translation(axes, position));
            add_node(scene, SceneNode { local, light: Some(LightId(i as u32)), ..named(&name) });
        }
    }
}

/// How finely round primitives are cut.
#[derive(Clone, Copy, Debug)]
struct Lens {
    eye: DVec3,
    /// Largest chord error over distance.
    slope: f64,
}

impl Lens {
    /// The finest that keeps to a number of triangles.
    fn fitting(scene: &SpdScene, triangles: usize) -> Self {
        let height = 2.0 * libm::tan(scene.view.angle_deg.to_radians() / 2.0);
        let lens = |k: i32| Self { eye: scene.view.from, slope: TOLERANCE * height * f64::from(1 << k) };
        (0..COARSEST).map(lens).find(|lens| lens.triangles(scene) <= triangles).unwrap_or_else(|| lens(COARSEST))
    }

    fn triangles(&self, scene: &SpdScene) -> usize {
        let of = |shape: &SpdShape| match shape {
            SpdShape::Sphere { center, radius } => {
                let cuts = (self.segments(*center, *radius) / 4) as usize;
                12 * cuts * cuts
            }
            SpdShape::Cone { base, base_radius, apex, .. } => {
                2 * self.segments((*base + *apex) * 0.5, *base_radius) as usize
            }
            SpdShape::Polygon(corners) => corners.len(),
            SpdShape::Patch { .. } => 1,
        };
        scene.objects.iter().map(|o| of(&o.shape)).sum()
    }

    /// Segments around a circle of `radius` near `center`: a multiple of 4.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    fn segments(&self, center: DVec3, radius: f64) -> u32 {
        let distance = (center.distance(self.eye) - radius).max(radius);
        // The sagitta of n segments is about radius (pi / n)^2 / 2.
        let needed = std::f64::consts::PI / (2.0 * self.slope * distance / radius).sqrt();
        (needed.clamp(SEGMENTS.0, SEGMENTS.1) as u32).div_ceil(4) * 4
    }
}

/// Bound of the distance between a sphere or cone of `radius` and its triangles.
fn sagitta(segments: u32, radius: f64) -> f64 {
    // A square's middle on a sphere lies at most twice as deep as that of its edges.
    2.0 * radius * (1.0 - libm::cos(std::f64::consts::PI / f64::from(segments)))
}

/// Middle and largest radius of a round shape.
fn roundness(shape: &SpdShape) -> Option<(DVec3, f64)> {
    match shape {
        SpdShape::Sphere { center, radius } => Some((*center, *radius)),
        SpdShape::Cone { base, base_radius, apex, .. } => Some(((*base + *apex) * 0.5, *base_radius)),
        SpdShape::Polygon(_) | SpdShape::Patch { .. } => None,
    }
}

fn named(name: &str) -> SceneNode {
    SceneNode {
        name: name.to_owned(),
        parent: None,
        children: Vec::new(),
        local: LocalTransform::Matrix(DMat4::IDENTITY),
        mesh: None,
        skin: None,
        camera: None,
        light: None,
        weights: None,
        copies: None,
    }
}

fn add_node(scene: &mut Scene, node: SceneNode) {
    let id = NodeId(u32::try_from(scene.nodes.len()).unwrap_or(u32::MAX));
    scene.nodes.push(node);
    scene.eval_order.push(id);
    scene.draw_order.push(id);
}

/// Diffuse and mirrored parts become base colour and metalness, the highlight's exponent a roughness, the part let
/// through an alpha.
#[expect(clippy::cast_possible_truncation, reason = "colours")]
fn material(surface: &SpdSurface) -> Material {
    let solid = surface.diffuse + surface.specular;
    let level = if solid > 0.0 { (solid / (solid + surface.transmittance)).min(1.0) } else { 0.0 };
    let glass = surface.transmittance > 0.0;
    let linear = DVec3::from_array(surface.color.to_array().map(linear));
    let color = (linear * if glass { 1.0 } else { level }).as_vec3();
    Material {
        base_color: Vec4::from((color, if glass { (1.0 - surface.transmittance) as f32 } else { 1.0 })),
        metallic: if solid > 0.0 && !glass { (surface.specular / solid) as f32 } else { 0.0 },
        roughness: if glass {
            0.05
        } else if surface.shine > 0.0 {
            // Blinn's exponent n has the width of a microfacet slope sqrt(2 / (n + 2)); roughness is its root.
            (2.0 / (surface.shine + 2.0)).sqrt().sqrt() as f32
        } else {
            1.0
        },
        alpha_mode: if glass { AlphaMode::Blend } else { AlphaMode::Opaque },
        double_sided: surface.two_sided,
        ..Material::default()
    }
}

/// The package's colours are what its pictures show: sRGB.
fn linear(x: f64) -> f64 {
    if x <= 0.04045 { x / 12.92 } else { libm::pow((x + 0.055) / 1.055, 2.4) }
}
