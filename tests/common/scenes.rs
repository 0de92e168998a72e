//! Small scenes built in code, for tests of the frame loop.

use glam::{DMat4, DQuat, DVec3, Vec3};
use kinora::scene::{
    Channel, ChannelTarget, Clip, Influences, Interpolation, LocalTransform, Mesh, MeshId, MeshPart, MorphTarget,
    NodeId, PartInstance, Sampler, Scene, SceneNode, Skin, SkinId, Topology, Trs,
};

/// A generator of numbers that is the same everywhere.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// Uniform in [-1, 1).
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
    }

    pub fn vec(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

/// A part without attributes.
pub fn part(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> MeshPart {
    MeshPart {
        topology: Topology::Triangles,
        positions,
        triangles,
        normals: vec![],
        tangents: vec![],
        tex_coords: vec![],
        colors: vec![],
        influences: None,
        targets: vec![],
        material: None,
    }
}

pub fn node(translation: DVec3) -> SceneNode {
    SceneNode {
        name: String::new(),
        parent: None,
        children: vec![],
        local: LocalTransform::Trs(Trs { translation, ..Trs::IDENTITY }),
        mesh: None,
        skin: None,
        camera: None,
        light: None,
        weights: None,
        copies: None,
    }
}

/// A closed box around the origin.
pub fn cuboid(half: Vec3) -> MeshPart {
    let corner = |i: u32| Vec3::new(sign(i, 0), sign(i, 1), sign(i, 2)) * half;
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    part((0..8).map(corner).collect(), quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

fn sign(i: u32, bit: u32) -> f32 {
    if i >> bit & 1 == 1 { 1.0 } else { -1.0 }
}

/// A scene under construction.
#[derive(Debug, Default)]
pub struct Maker {
    scene: Scene,
}

impl Maker {
    pub fn mesh(&mut self, part: MeshPart) -> MeshId {
        let weights = vec![0.0; part.targets.len()];
        self.scene.meshes.push(Mesh { parts: vec![part], weights, ..Mesh::default() });
        MeshId(self.scene.meshes.len() as u32 - 1)
    }

    pub fn node(&mut self, parent: Option<NodeId>, node: SceneNode) -> NodeId {
        let id = NodeId(self.scene.nodes.len() as u32);
        self.scene.nodes.push(SceneNode { parent, ..node });
        if let Some(parent) = parent {
            self.scene.nodes[parent.index()].children.push(id);
        }
        id
    }

    pub fn skin(&mut self, joints: Vec<NodeId>, inverse_bind: Vec<DMat4>) -> SkinId {
        self.scene.skins.push(Skin { name: String::new(), joints, inverse_bind });
        SkinId(self.scene.skins.len() as u32 - 1)
    }

    /// Adds a linear channel to the first clip.
    pub fn channel(&mut self, target: ChannelTarget, times: &[f32], values: Vec<f32>) {
        if self.scene.clips.is_empty() {
            self.scene.clips.push(Clip::default());
        }
        let clip = &mut self.scene.clips[0];
        clip.channels.push(Channel { sampler: clip.samplers.len() as u32, target });
        clip.samplers.push(Sampler {
            interpolation: Interpolation::Linear,
            times: times.to_vec(),
            width: values.len() / times.len(),
            values,
        });
        clip.channel_count += 1;
        clip.duration_s = clip.duration_s.max(f64::from(*times.last().unwrap()));
    }

    /// Every node was added after its parent, so the order of addition is one of evaluation and drawing.
    pub fn finish(mut self) -> Scene {
        let order: Vec<_> = (0..self.scene.nodes.len() as u32).map(NodeId).collect();
        for &node in &order {
            let Some(mesh) = self.scene.nodes[node.index()].mesh else { continue };
            let copies = match &self.scene.nodes[node.index()].copies {
                Some(copies) => (0..copies.len() as u32).map(Some).collect(),
                None => vec![None],
            };
            let parts = 0..self.scene.meshes[mesh.index()].parts.len() as u32;
            for (copy, part) in copies.into_iter().flat_map(|copy| parts.clone().map(move |part| (copy, part))) {
                self.scene.instances.push(PartInstance { node, mesh, part, copy });
            }
        }
        self.scene.eval_order.clone_from(&order);
        self.scene.draw_order = order;
        "made.gltf".clone_into(&mut self.scene.file);
        self.scene.scene_count = 1;
        self.scene
    }
}

fn quat(axis: DVec3, half_angle_tan: f64) -> Vec<f32> {
    let q = DQuat::from_xyzw(axis.x * half_angle_tan, axis.y * half_angle_tan, axis.z * half_angle_tan, 1.0);
    q.normalize().to_array().map(|v| v as f32).to_vec()
}

/// A skinned tube of `rings` rings over five joints that bends, with a box on its end and a still floor.
///
/// Instances: floor (static), tube (deforming), box (rigid).
pub fn figure(rings: u32) -> Scene {
    let mut maker = Maker::default();
    let floor = maker.mesh(cuboid(Vec3::new(4.0, 0.1, 4.0)));
    maker.node(None, SceneNode { mesh: Some(floor), ..node(DVec3::new(0.0, -0.2, 0.0)) });
    let joints: Vec<_> = (0..5).fold(Vec::new(), |mut joints, i| {
        let at = DVec3::new(0.0, if i == 0 { 0.0 } else { 0.5 }, 0.0);
        joints.push(maker.node(joints.last().copied(), node(at)));
        joints
    });
    let binds = (0..5).map(|i| DMat4::from_translation(DVec3::new(0.0, -0.5 * f64::from(i), 0.0))).collect();
    let skin = maker.skin(joints.clone(), binds);
    let tube = maker.mesh(tube(rings));
    maker.node(None, SceneNode { mesh: Some(tube), skin: Some(skin), ..node(DVec3::ZERO) });
    let held = maker.mesh(cuboid(Vec3::new(0.3, 0.05, 0.1)));
    maker.node(Some(joints[4]), SceneNode { mesh: Some(held), ..node(DVec3::new(0.2, 0.4, 0.0)) });
    for (i, &joint) in joints.iter().enumerate().skip(1) {
        let axis = if i % 2 == 0 { DVec3::X } else { DVec3::Z };
        let values = [0.0, 0.25, -0.25, 0.0].map(|bend| quat(axis, bend)).concat();
        maker.channel(ChannelTarget::Rotation(joint), &[0.0, 0.5, 1.5, 2.0], values);
    }
    maker.finish()
}

/// A tube of radius 0.2 and height 2.5 with 12 sides, weighted to five joints 0.5 apart.
fn tube(rings: u32) -> MeshPart {
    const SIDES: u32 = 12;
    let corner = |i: u32| {
        let (ring, side) = (i / SIDES, i % SIDES);
        // A circle without transcendental functions: the half-angle parametrisation, quadrant by quadrant.
        let t = (side % 3) as f32 / 3.0;
        let (x, z) = ((1.0 - t * t) / (1.0 + t * t), 2.0 * t / (1.0 + t * t));
        let (x, z) = [(x, z), (-z, x), (-x, -z), (z, -x)][(side / 3) as usize];
        Vec3::new(0.2 * x, 2.5 * ring as f32 / (rings - 1) as f32, 0.2 * z)
    };
    let quad = |i: u32| {
        let (ring, side) = (i / SIDES, i % SIDES);
        let next = ring * SIDES + (side + 1) % SIDES;
        [[i, i + SIDES, next], [next, i + SIDES, next + SIDES]]
    };
    let positions: Vec<_> = (0..rings * SIDES).map(corner).collect();
    let mut influences = Influences { per_vertex: 4, ..Influences::default() };
    for p in &positions {
        let along = (p.y / 0.5).clamp(0.0, 4.0);
        let joint = (along as u16).min(3);
        let share = along - f32::from(joint);
        influences.joints.extend([joint, joint + 1, 0, 0]);
        influences.weights.extend([1.0 - share, share, 0.0, 0.0]);
    }
    MeshPart { influences: Some(influences), ..part(positions, (0..(rings - 1) * SIDES).flat_map(quad).collect()) }
}

/// `count` boxes that tumble along straight lines, each with its own animated node.
pub fn bodies(count: u32) -> Scene {
    let mut maker = Maker::default();
    let mut random = Random::new(5);
    let mesh = maker.mesh(cuboid(Vec3::new(0.2, 0.1, 0.15)));
    for _ in 0..count {
        let id = maker.node(None, SceneNode { mesh: Some(mesh), ..node(DVec3::ZERO) });
        let (from, to) = (random.vec() * 3.0, random.vec() * 3.0);
        maker.channel(ChannelTarget::Translation(id), &[0.0, 2.0], [from.to_array(), to.to_array()].concat());
        let axis = random.vec().as_dvec3();
        let values = [quat(axis, 0.0), quat(axis, 1.0), quat(axis, -1.0)].concat();
        maker.channel(ChannelTarget::Rotation(id), &[0.0, 1.0, 2.0], values);
    }
    maker.finish()
}

/// A ball of `count` loose triangles that flies apart and mixes, by one morph target: what refitting cannot follow.
pub fn burst(count: u32) -> Scene {
    let mut maker = Maker::default();
    let mut random = Random::new(9);
    let (mut positions, mut shifts) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let (center, shift) = (random.vec(), random.vec() * 6.0);
        for _ in 0..3 {
            positions.push(center + random.vec() * 0.05);
            shifts.push(shift);
        }
    }
    let target = MorphTarget { positions: shifts, ..MorphTarget::default() };
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = maker.mesh(MeshPart { targets: vec![target], ..part(positions, triangles) });
    let id = maker.node(None, SceneNode { mesh: Some(mesh), weights: Some(vec![0.0]), ..node(DVec3::ZERO) });
    maker.channel(ChannelTarget::Weights(id), &[0.0, 2.0], vec![0.0, 1.0]);
    maker.finish()
}

/// Two boxes that nothing moves, with a clip that does nothing.
pub fn still() -> Scene {
    let mut maker = Maker::default();
    let mesh = maker.mesh(cuboid(Vec3::splat(0.5)));
    maker.node(None, SceneNode { mesh: Some(mesh), ..node(DVec3::ZERO) });
    maker.node(None, SceneNode { mesh: Some(mesh), ..node(DVec3::new(2.0, 0.0, 0.0)) });
    maker.scene.clips.push(Clip::default());
    maker.finish()
}
