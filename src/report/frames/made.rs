//! Scenes made for measurements: sequences of meshes, a burst, a skinned reed.
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "what is made is small and not negative, what is given is checked"
)]

use crate::{
    glam::{DMat4, DQuat, DVec3, Vec3},
    report::{ReportError, random::Random},
    scene::{
        Channel, ChannelTarget, Clip, Influences, Interpolation, LocalTransform, Mesh, MeshId, MeshPart, MorphTarget,
        NodeId, PartInstance, Sampler, Scene, SceneNode, Skin, SkinId, Topology, Trs,
    },
};

/// Triangles whose vertices go in straight lines from each of `positions` to the next, a second each.
///
/// # Errors
/// When there are no positions, not equally many at all times, or an index out of range.
pub(super) fn sequence(name: &str, positions: &[Vec<Vec3>], indices: Vec<[u32; 3]>) -> Result<Scene, ReportError> {
    let wrong = |reason: &str| ReportError::Scene { scene: name.to_owned(), reason: reason.to_owned() };
    let [first, later @ ..] = positions else { return Err(wrong("a sequence without frames")) };
    if positions.iter().any(|p| p.len() != first.len()) {
        return Err(wrong("frames with unequal numbers of vertices"));
    }
    if indices.iter().flatten().any(|&i| i as usize >= first.len()) {
        return Err(wrong("a triangle that names a vertex that does not exist"));
    }
    let target = |p: &Vec<Vec3>| MorphTarget {
        positions: p.iter().zip(first).map(|(&to, &from)| to - from).collect(),
        ..MorphTarget::default()
    };
    let count = later.len();
    let part = MeshPart { targets: later.iter().map(target).collect(), ..part(first.clone(), indices) };
    let mut scene = single(name, part);
    scene.meshes[0].weights = vec![0.0; count];
    let weights = |key: usize| (1..=count).map(move |target| if target == key { 1.0 } else { 0.0 });
    let values = (0..=count).flat_map(weights).collect();
    let times: Vec<f32> = (0..=count).map(|t| t as f32).collect();
    if count > 0 {
        scene.clips.push(clip(ChannelTarget::Weights(NodeId(0)), times, values));
    }
    Ok(scene)
}

/// A ball of `count` loose triangles that flies apart in five seconds, each with its own speed: what no refit can follow.
pub(super) fn burst(count: u32) -> Scene {
    let (mut positions, mut shifts) = (Vec::new(), Vec::new());
    let size = 1.5 / f64::from(count.max(1)).sqrt();
    for i in 0..u64::from(count) {
        let mut random = Random::new(41, i);
        let direction = random_direction(&mut random);
        let center = direction * (1.0 - 0.2 * random.unit());
        let speed = random_direction(&mut random) * 1.5 + direction * (4.0 * random.unit());
        for _ in 0..3 {
            positions.push((center + random_direction(&mut random) * size).as_vec3());
            shifts.push((speed + random_direction(&mut random) * size).as_vec3());
        }
    }
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let target = MorphTarget { positions: shifts, ..MorphTarget::default() };
    let mut scene = single("burst", MeshPart { targets: vec![target], ..part(positions, triangles) });
    scene.meshes[0].weights = vec![0.0];
    scene.clips.push(clip(ChannelTarget::Weights(NodeId(0)), vec![0.0, 5.0], vec![0.0, 1.0]));
    scene
}

/// A skinned reed of `rings` rings of 12 over five joints that sways, in one of two ways.
pub(super) fn reed(rings: u32) -> Scene {
    const SIDES: u32 = 12;
    let rings = rings.max(2);
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
        let joint = libm::floorf(along).min(3.0);
        influences.joints.extend([joint as u16, joint as u16 + 1, 0, 0]);
        influences.weights.extend([1.0 - (along - joint), along - joint, 0.0, 0.0]);
    }
    let triangles = (0..(rings - 1) * SIDES).flat_map(quad).collect();
    let mut scene = single("reed", MeshPart { influences: Some(influences), ..part(positions, triangles) });
    let joints: Vec<NodeId> = (1..6).map(NodeId).collect();
    for (i, &joint) in joints.iter().enumerate() {
        let at = DVec3::new(0.0, if i == 0 { 0.0 } else { 0.5 }, 0.0);
        let parent = (i > 0).then(|| joints[i - 1]);
        scene.nodes.push(SceneNode { parent, ..node(at) });
        if let Some(parent) = parent {
            scene.nodes[parent.index()].children.push(joint);
        }
    }
    let binds = (0..5).map(|i| DMat4::from_translation(DVec3::new(0.0, -0.5 * f64::from(i), 0.0))).collect();
    scene.skins.push(Skin { name: String::new(), joints: joints.clone(), inverse_bind: binds });
    scene.nodes[0].skin = Some(SkinId(0));
    scene.eval_order = (0..6).map(NodeId).collect();
    scene.draw_order.clone_from(&scene.eval_order);
    for axes in [[DVec3::X, DVec3::Z], [DVec3::Z, DVec3::X]] {
        let mut sway = Clip { duration_s: 2.0, ..Clip::default() };
        for (i, &joint) in joints.iter().enumerate().skip(1) {
            let bend = |half: f64| DQuat::from_xyzw(axes[i % 2].x * half, 0.0, axes[i % 2].z * half, 1.0).normalize();
            let values = [0.0, 0.25, -0.25, 0.0].map(|half| bend(half).to_array().map(|v| v as f32)).concat();
            sway.channels.push(Channel { sampler: i as u32 - 1, target: ChannelTarget::Rotation(joint) });
            sway.samplers.push(sampler(vec![0.0, 0.5, 1.5, 2.0], values));
        }
        sway.channel_count = sway.channels.len();
        scene.clips.push(sway);
    }
    scene
}

/// Uniform on the unit sphere.
fn random_direction(random: &mut Random) -> DVec3 {
    loop {
        let point = DVec3::new(random.unit(), random.unit(), random.unit()) * 2.0 - DVec3::ONE;
        if (1e-3..=1.0).contains(&point.length()) {
            return point.normalize();
        }
    }
}

/// A scene of one part at the origin.
fn single(name: &str, part: MeshPart) -> Scene {
    let mesh = Mesh { parts: vec![part], ..Mesh::default() };
    Scene {
        file: name.to_owned(),
        scene_count: 1,
        nodes: vec![SceneNode { mesh: Some(MeshId(0)), ..node(DVec3::ZERO) }],
        eval_order: vec![NodeId(0)],
        draw_order: vec![NodeId(0)],
        instances: vec![PartInstance { node: NodeId(0), mesh: MeshId(0), part: 0, copy: None }],
        meshes: vec![mesh],
        ..Scene::default()
    }
}

fn part(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> MeshPart {
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

fn node(translation: DVec3) -> SceneNode {
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

fn sampler(times: Vec<f32>, values: Vec<f32>) -> Sampler {
    Sampler { interpolation: Interpolation::Linear, width: values.len() / times.len(), times, values }
}

fn clip(target: ChannelTarget, times: Vec<f32>, values: Vec<f32>) -> Clip {
    Clip {
        duration_s: times.last().copied().map_or(0.0, f64::from),
        channels: vec![Channel { sampler: 0, target }],
        samplers: vec![sampler(times, values)],
        channel_count: 1,
        ..Clip::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_together_is_refused() {
        let three = vec![Vec3::ZERO; 3];
        assert!(sequence("a", &[], vec![]).is_err());
        assert!(sequence("a", &[three.clone(), vec![Vec3::ZERO; 4]], vec![]).is_err());
        assert!(sequence("a", std::slice::from_ref(&three), vec![[0, 1, 3]]).is_err());
        assert!(sequence("a", &[three], vec![[0, 1, 2]]).unwrap().clips.is_empty());
    }
}
