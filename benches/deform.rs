//! Time to pose a scene and to deform its vertices: `pose/<scene>`, `deform/<scene>/<simd>`.
//!
//! Files from the shared assets are left out, with a line saying so, where those are absent.

use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use kinora::{
    anim::{ActiveClip, Pose, deform_parallel, deform_range_at},
    glam::{DAffine3, DMat4, DVec3, Vec3},
    scene::{
        Channel, ChannelTarget, Clip, ClipId, Influences, Interpolation, LocalTransform, Mesh, MeshId, MeshPart,
        NodeId, PartInstance, Sampler, Scene, SceneNode, Skin, SkinId, Topology, Trs, import,
    },
    simd::SimdLevel,
};

/// A chain of 64 joints, each turning, and a mesh of `count` vertices with four influences each.
fn chain(count: usize) -> Scene {
    const JOINTS: u16 = 64;
    let mut nodes: Vec<SceneNode> = (0..JOINTS).map(|j| joint(u32::from(j), u32::from(JOINTS))).collect();
    nodes.push(SceneNode { mesh: Some(MeshId(0)), skin: Some(SkinId(0)), ..node() });
    // The first of a vertex' four joints.
    let first = |v: usize| u16::try_from(v * usize::from(JOINTS - 4) / count).expect("below the joint count");
    let height = |v: usize| v as f32 / count as f32 * f32::from(JOINTS - 4) * 0.1;
    let positions = (0..count).map(|v| Vec3::new((v % 7) as f32 * 0.1, height(v), (v % 11) as f32 * 0.1)).collect();
    let influences = Influences {
        per_vertex: 4,
        joints: (0..count).flat_map(|v| (0..4).map(move |k| first(v) + k)).collect(),
        weights: (0..count).flat_map(|v| [0.4, 0.3, 0.2, 0.1 + (v % 3) as f32 * 0.01]).collect(),
    };
    let turn = Sampler {
        interpolation: Interpolation::Linear,
        times: vec![0.0, 1.0],
        width: 4,
        values: vec![0.0, 0.0, 0.0, 1.0, 0.05, 0.0, 0.0, 1.0],
    };
    let channel = |j| Channel { sampler: 0, target: ChannelTarget::Rotation(NodeId(j)) };
    let mesh_node = NodeId(u32::from(JOINTS));
    Scene {
        eval_order: (0..=u32::from(JOINTS)).map(NodeId).collect(),
        draw_order: vec![mesh_node],
        instances: vec![PartInstance { node: mesh_node, mesh: MeshId(0), part: 0, copy: None }],
        meshes: vec![Mesh { parts: vec![part(positions, influences)], ..Mesh::default() }],
        skins: vec![Skin {
            name: String::new(),
            joints: (0..u32::from(JOINTS)).map(NodeId).collect(),
            inverse_bind: (0..JOINTS)
                .map(|j| DMat4::from_translation(DVec3::new(0.0, -0.1 * f64::from(j), 0.0)))
                .collect(),
        }],
        clips: vec![Clip {
            channels: (0..u32::from(JOINTS)).map(channel).collect(),
            samplers: vec![turn],
            duration_s: 1.0,
            ..Clip::default()
        }],
        nodes,
        ..Scene::default()
    }
}

fn joint(j: u32, count: u32) -> SceneNode {
    let translation = DVec3::new(0.0, 0.1, 0.0);
    SceneNode {
        parent: j.checked_sub(1).map(NodeId),
        children: if j + 1 < count { vec![NodeId(j + 1)] } else { Vec::new() },
        local: LocalTransform::Trs(Trs { translation, ..Trs::IDENTITY }),
        ..node()
    }
}

fn node() -> SceneNode {
    SceneNode {
        name: String::new(),
        parent: None,
        children: Vec::new(),
        local: LocalTransform::Trs(Trs::IDENTITY),
        mesh: None,
        skin: None,
        camera: None,
        light: None,
        weights: None,
        copies: None,
    }
}

fn part(positions: Vec<Vec3>, influences: Influences) -> MeshPart {
    MeshPart {
        topology: Topology::Points,
        positions,
        triangles: Vec::new(),
        normals: Vec::new(),
        tangents: Vec::new(),
        tex_coords: Vec::new(),
        colors: Vec::new(),
        influences: Some(influences),
        targets: Vec::new(),
        material: None,
    }
}

fn scenes() -> Vec<(&'static str, Scene, usize)> {
    let mut scenes = vec![("chain50k", chain(50_000), 0)];
    let assets = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/assets"));
    for (name, file, clip) in
        [("cesium_man", "khronos/CesiumMan/glTF-Binary/CesiumMan.glb", 0), ("knight", "kaykit/Knight.glb", 36)]
    {
        match import::from_path(&assets.join(file)) {
            Ok(scene) => scenes.push((name, scene, clip)),
            Err(error) => eprintln!("left out: {error}"),
        }
    }
    scenes
}

fn bench(c: &mut Criterion) {
    for (name, scene, clip) in scenes() {
        let clip = ClipId(u32::try_from(clip).expect("small"));
        let mut pose = Pose::rest(&scene);
        let mut time_s = 0.0;
        c.bench_function(&format!("pose/{name}"), |b| {
            b.iter(|| {
                time_s = (time_s + 0.01) % 1.0;
                pose.evaluate(&scene, &[ActiveClip { clip, time_s }], &DAffine3::IDENTITY);
            });
        });
        let counts: Vec<_> = scene.instances.iter().map(|&i| scene.part(i).positions.len()).collect();
        let mut out: Vec<_> = counts.iter().map(|&n| vec![Vec3::ZERO; n]).collect();
        let mut group = c.benchmark_group("deform");
        group.throughput(Throughput::Elements(counts.iter().sum::<usize>() as u64));
        for level in SimdLevel::ALL.into_iter().filter(|l| l.is_available()) {
            group.bench_function(BenchmarkId::new(name, level), |b| {
                b.iter(|| {
                    for (&instance, out) in scene.instances.iter().zip(&mut out) {
                        deform_range_at(level, &scene, &pose, instance, 0, out);
                    }
                });
            });
        }
        group.bench_function(BenchmarkId::new(name, "parallel"), |b| {
            b.iter(|| {
                for (&instance, out) in scene.instances.iter().zip(&mut out) {
                    deform_parallel(SimdLevel::best(), &scene, &pose, instance, out);
                }
            });
        });
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
