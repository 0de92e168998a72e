//! Scenes for tests of pictures: parts with materials, lights, a camera.
#![allow(dead_code, unreachable_pub, reason = "each test file uses its share")]
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};
use kinora::{
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy},
    geom::Forms,
    render::{CameraView, Film, RenderSettings, Renderer},
    scene::{
        AlphaMode, Image, ImageId, Light, LightId, LightKind, LocalTransform, Material, MaterialId, Mesh, MeshId,
        MeshPart, NodeId, PartInstance, Scene, SceneNode, TexSampler, Texture, TextureId, TextureRef, Topology, Trs,
    },
    world::World,
};

/// A scene under construction; every node is a root.
#[derive(Debug, Default)]
pub struct Stage {
    pub scene: Scene,
}

/// A placement without rotation.
pub fn at(x: f64, y: f64, z: f64) -> Trs {
    Trs { translation: DVec3::new(x, y, z), ..Trs::IDENTITY }
}

impl Stage {
    fn node(&mut self, place: Trs) -> &mut SceneNode {
        let id = NodeId(self.scene.nodes.len() as u32);
        self.scene.eval_order.push(id);
        self.scene.draw_order.push(id);
        self.scene.nodes.push(SceneNode {
            name: String::new(),
            parent: None,
            children: vec![],
            local: LocalTransform::Trs(place),
            mesh: None,
            skin: None,
            camera: None,
            light: None,
            weights: None,
            copies: None,
        });
        self.scene.nodes.last_mut().unwrap()
    }

    pub fn material(&mut self, material: Material) -> MaterialId {
        self.scene.materials.push(material);
        MaterialId(self.scene.materials.len() as u32 - 1)
    }

    pub fn part(&mut self, mut part: MeshPart, material: Material, place: Trs) -> NodeId {
        part.material = Some(self.material(material));
        let mesh = MeshId(self.scene.meshes.len() as u32);
        self.scene.meshes.push(Mesh { parts: vec![part], ..Mesh::default() });
        self.node(place).mesh = Some(mesh);
        let node = NodeId(self.scene.nodes.len() as u32 - 1);
        self.scene.instances.push(PartInstance { node, mesh, part: 0, copy: None });
        node
    }

    pub fn light(&mut self, kind: LightKind, color: Vec3, intensity: f32, place: Trs) {
        let id = LightId(self.scene.lights.len() as u32);
        self.scene.lights.push(Light { name: String::new(), color, intensity, range: None, kind });
        self.node(place).light = Some(id);
    }

    pub fn texture(&mut self, sampler: TexSampler, size: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> TextureRef {
        let rgba: Vec<u8> = (0..size * size).flat_map(|i| texel(i % size, i / size)).collect();
        let image = ImageId(self.scene.images.len() as u32);
        self.scene.images.push(Image { name: String::new(), width: size, height: size, rgba: rgba.into() });
        let texture = TextureId(self.scene.textures.len() as u32);
        self.scene.textures.push(Texture { image: Some(image), sampler });
        TextureRef { texture, tex_coord: 0, offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE }
    }

    pub fn world(self) -> Arc<World> {
        self.world_with("bvh2")
    }

    pub fn world_with(self, accel: &str) -> Arc<World> {
        self.world_as(accel, Forms::EXACT)
    }

    pub fn world_as(self, accel: &str, forms: Forms) -> Arc<World> {
        let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap());
        let config = FrameConfig { accel: accel.into(), top: "bvh2".into(), policy: RebuildPolicy::Refit, forms, pool };
        let mut frames = FrameLoop::new(config).unwrap();
        frames.add(Arc::new(self.scene), DAffine3::IDENTITY);
        frames.advance(&[&[]]).unwrap().0
    }
}

/// Renders on two threads.
pub fn shoot(world: &World, camera: &CameraView, settings: &RenderSettings, width: u32, height: u32) -> Film {
    let mut film = Film::new(width, height);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    pool.install(|| Renderer::default().render(world, camera, settings, &mut film)).unwrap();
    film
}

/// A camera on the +Z axis that looks at the origin.
pub fn front(distance: f32) -> CameraView {
    CameraView::look_at(Vec3::new(0.0, 0.0, distance), Vec3::ZERO, Vec3::Y, 0.7)
}

/// An unlit colour.
pub fn unlit(color: Vec4, alpha_mode: AlphaMode) -> Material {
    Material { base_color: color, alpha_mode, unlit: true, ..Material::default() }
}

pub fn matte(color: Vec3) -> Material {
    Material { base_color: color.extend(1.0), metallic: 0.0, roughness: 1.0, ..Material::default() }
}

fn empty() -> MeshPart {
    MeshPart {
        topology: Topology::Triangles,
        positions: vec![],
        triangles: vec![],
        normals: vec![],
        tangents: vec![],
        tex_coords: vec![],
        colors: vec![],
        influences: None,
        targets: vec![],
        material: None,
    }
}

/// A square of half size `half` in the plane z = 0 that faces +Z; v grows downwards.
pub fn square(half: f32) -> MeshPart {
    let corners = [Vec2::new(-1.0, 1.0), Vec2::new(-1.0, -1.0), Vec2::new(1.0, -1.0), Vec2::new(1.0, 1.0)];
    MeshPart {
        positions: corners.map(|c| (c * half).extend(0.0)).to_vec(),
        normals: vec![Vec3::Z; 4],
        tex_coords: vec![corners.map(|c| Vec2::new(c.x * 0.5 + 0.5, 0.5 - c.y * 0.5)).to_vec()],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..empty()
    }
}

/// A floor of half size `half` in the plane y = 0 that faces +Y.
pub fn floor(half: f32) -> MeshPart {
    let mut part = square(half);
    for p in &mut part.positions {
        *p = Vec3::new(p.x, 0.0, -p.y);
    }
    part.normals.fill(Vec3::Y);
    part
}

/// A ball with smooth normals and texture coordinates.
pub fn ball(radius: f32, columns: u32, rows: u32) -> MeshPart {
    let mut part = empty();
    let mut coords = vec![];
    for row in 0..=rows {
        for column in 0..=columns {
            let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
            let (theta, phi) = (v * std::f32::consts::PI, u * 2.0 * std::f32::consts::PI);
            let (sin, cos) = (libm::sinf(theta), libm::cosf(theta));
            let n = Vec3::new(sin * libm::sinf(phi), cos, sin * libm::cosf(phi));
            part.positions.push(n * radius);
            part.normals.push(n);
            coords.push(Vec2::new(u, v));
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let a = row * (columns + 1) + column;
            let b = a + columns + 1;
            part.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        }
    }
    part.tex_coords = vec![coords];
    part
}

/// A rotation about an axis.
pub fn turned(axis: DVec3, degrees: f64, place: Trs) -> Trs {
    let half = degrees.to_radians() * 0.5;
    let (sin, cos) = (libm::sin(half), libm::cos(half));
    let v = axis * sin;
    Trs { rotation: DQuat::from_xyzw(v.x, v.y, v.z, cos), ..place }
}
