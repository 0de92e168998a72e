//! H11: an elbow from 0 to 170 degrees, an explosion with an exact return, a collapse to a point, ten thousand frames of
//! spin: no structure's bound is ever violated, and a frame that returns is the same, bit for bit.

use std::sync::Arc;

use glam::{DAffine3, DMat4, DVec3};
use kinora::{
    accel::{AccelKind, AccelSpec, Refit},
    anim::{ActiveClip, loop_time},
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy},
    geom::{Forms, Hit, InstanceId, Ray},
    glam::Vec3,
    render::{CameraView, Film, RenderSettings, Renderer},
    report::reference::Reference,
    scene::{ChannelTarget, ClipId, Influences, MeshPart, MorphTarget, Scene, SceneNode},
    simd::SimdLevel,
    world::World,
};

use crate::{
    fast::FAST,
    meshes::{icosphere, plane},
    scenes::{Maker, Random as Noise, burst, node, part},
    trace::{Mesh, Random},
    trial::{count, is_full},
};

/// Rotations about z by these degrees, as keys.
fn turns(degrees: &[f64]) -> Vec<f32> {
    let quat = |d: &f64| {
        let half = d.to_radians() / 2.0;
        [0.0, 0.0, libm::sin(half) as f32, libm::cos(half) as f32]
    };
    degrees.iter().flat_map(quat).collect()
}

/// An upper arm and a forearm, skinned smoothly around the elbow, which bends from 0 to 170 degrees and back.
fn elbow() -> Scene {
    let mut maker = Maker::default();
    let shoulder = maker.node(None, node(DVec3::ZERO));
    let elbow = maker.node(Some(shoulder), node(DVec3::new(0.0, 1.0, 0.0)));
    let binds = vec![DMat4::IDENTITY, DMat4::from_translation(DVec3::new(0.0, -1.0, 0.0))];
    let skin = maker.skin(vec![shoulder, elbow], binds);
    // A sphere stretched to an arm.
    let ball = icosphere(2);
    let positions: Vec<Vec3> = ball.positions.iter().map(|p| Vec3::new(p.x * 0.2, p.y + 1.0, p.z * 0.2)).collect();
    let mut influences = Influences { per_vertex: 4, ..Influences::default() };
    for p in &positions {
        let share = ((p.y - 0.8) / 0.4).clamp(0.0, 1.0);
        influences.joints.extend([0, 1, 0, 0]);
        influences.weights.extend([1.0 - share, share, 0.0, 0.0]);
    }
    let mesh = maker.mesh(MeshPart { influences: Some(influences), ..part(positions, ball.indices) });
    maker.node(None, SceneNode { mesh: Some(mesh), skin: Some(skin), ..node(DVec3::ZERO) });
    let degrees = [0.0, 45.0, 90.0, 130.0, 170.0, 130.0, 90.0, 45.0, 0.0];
    maker.channel(ChannelTarget::Rotation(elbow), &[0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0], turns(&degrees));
    maker.finish()
}

/// Loose triangles that fly apart and come back to where they were: weights 0, 1, 0.
fn explosion() -> Scene {
    let mut scene = burst(300);
    let sampler = &mut scene.clips[0].samplers[0];
    (sampler.times, sampler.values) = (vec![0.0, 2.0, 4.0], vec![0.0, 1.0, 0.0]);
    scene.clips[0].duration_s = 4.0;
    scene
}

/// A sphere that shrinks to a point, exactly, and grows again.
fn collapse() -> Scene {
    let mut maker = Maker::default();
    let ball = icosphere(2);
    let target = MorphTarget { positions: ball.positions.iter().map(|&p| -p).collect(), ..MorphTarget::default() };
    let mesh = maker.mesh(MeshPart { targets: vec![target], ..part(ball.positions, ball.indices) });
    let id = maker.node(None, SceneNode { mesh: Some(mesh), weights: Some(vec![0.0]), ..node(DVec3::ZERO) });
    maker.channel(ChannelTarget::Weights(id), &[0.0, 2.0, 4.0], vec![0.0, 1.0, 0.0]);
    maker.finish()
}

/// A plate and a heap of triangles that spin about a slanted axis.
fn spin() -> Scene {
    let mut maker = Maker::default();
    let mut noise = Noise::new(3);
    let hub = maker.node(None, node(DVec3::new(0.3, -0.2, 0.1)));
    let plate = plane(6);
    let flat = maker.mesh(part(plate.positions, plate.indices));
    maker.node(Some(hub), SceneNode { mesh: Some(flat), ..node(DVec3::ZERO) });
    let heap: Vec<Vec3> = (0..300).map(|_| noise.vec()).collect();
    let heap = maker.mesh(part(heap, (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect()));
    maker.node(Some(hub), SceneNode { mesh: Some(heap), ..node(DVec3::new(0.0, 0.5, 0.0)) });
    maker.channel(ChannelTarget::Rotation(hub), &[0.0, 1.0, 2.0, 3.0, 4.0], turns(&[0.0, 90.0, 180.0, 270.0, 360.0]));
    maker.finish()
}

fn motions() -> [(&'static str, Scene); 4] {
    [("elbow", elbow()), ("explosion", explosion()), ("collapse", collapse()), ("spin", spin())]
}

/// Length of every clip.
const DURATION_S: f64 = 4.0;

fn frame_loop(scene: &Arc<Scene>, accel: &str, policy: RebuildPolicy, forms: Forms) -> FrameLoop {
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool"));
    let config = FrameConfig { accel: accel.into(), top: "bvh2".into(), policy, forms, pool };
    let mut frames = FrameLoop::new(config).expect("a known structure");
    frames.add(scene.clone(), DAffine3::IDENTITY);
    frames
}

fn advance(frames: &mut FrameLoop, time_s: f64) -> Arc<World> {
    frames.advance(&[&[ActiveClip { clip: ClipId(0), time_s }]]).expect("a frame").0
}

/// Bits of every vertex.
fn vertices(world: &World) -> Vec<[u32; 3]> {
    let instances = (0..world.instances().len() as u32).map(InstanceId);
    instances.flat_map(|i| world.positions(i).iter().map(|p| p.to_array().map(f32::to_bits))).collect()
}

/// What a fixed set of rays finds.
fn answers(world: &World) -> Vec<Option<Hit>> {
    let mut random = Random(1);
    let rays: Vec<Ray> = (0..300)
        .map(|_| {
            let origin = random.vec3() * 4.0;
            Ray::new(origin, random.vec3() * 1.2 - origin)
        })
        .collect();
    let mut hits = vec![None; rays.len()];
    world.hit_all(&rays, SimdLevel::best(), &mut hits).expect("the default float mode");
    hits
}

fn picture(world: &World) -> Vec<u8> {
    let mut film = Film::new(32, 32);
    let camera = CameraView::look_at(Vec3::new(1.0, 2.0, 6.0), Vec3::ZERO, Vec3::Y, 0.8);
    Renderer::default().render(world, &camera, &RenderSettings::default(), &mut film).expect("a picture");
    let mut rgba = Vec::new();
    film.to_srgb8(&mut rgba);
    rgba
}

const POLICIES: [RebuildPolicy; 4] =
    [RebuildPolicy::Refit, RebuildPolicy::Rebuild, RebuildPolicy::Async, RebuildPolicy::SwapEvery(3)];

/// Positions as bits, hits and pixels of a frame.
type Seen = (Vec<[u32; 3]>, Vec<Option<Hit>>, Vec<u8>);

#[test]
fn h11_no_bound_is_violated_and_what_returns_is_the_same() {
    let precisions = [Forms::EXACT, FAST];
    for ((name, scene), forms) in motions().into_iter().flat_map(|m| precisions.map(|forms| (m.clone(), forms))) {
        let scene = Arc::new(scene);
        let mut due: Option<Seen> = None;
        for &kind in AccelKind::ALL {
            // In fast the answers depend on the tree: all policies but the plainest change it.
            let policies = if forms == FAST { &POLICIES[..1] } else { &POLICIES[..] };
            if forms == FAST {
                due = None;
            }
            for &policy in policies {
                let mut frames = frame_loop(&scene, kind.name(), policy, forms);
                let rounds = count(10, 1, 1);
                let steps = count(40, 40, 8);
                for frame in 0..=rounds * steps {
                    let time_s = loop_time(0.0, frame as f64 * DURATION_S / steps as f64, 1.0, DURATION_S);
                    let world = advance(&mut frames, time_s);
                    let context = || format!("{name}: {kind}, {policy:?}, {forms:?}, frame {frame}");
                    world.validate().unwrap_or_else(|v| panic!("{}: {v:?}", context()));
                    if frame % steps == 0 {
                        let now = (vertices(&world), answers(&world), picture(&world));
                        assert!(now.1.iter().flatten().count() > 10, "{}", context());
                        assert!(*due.get_or_insert_with(|| now.clone()) == now, "{}: it did not return", context());
                    }
                }
            }
        }
    }
}

/// At the end of the clip itself, without the clock's wrap, the weights are 0 again and so is every vertex.
#[test]
fn h11_the_last_key_returns_to_the_first() {
    for (name, scene) in [("explosion", explosion()), ("collapse", collapse()), ("elbow", elbow())] {
        let scene = Arc::new(scene);
        for policy in POLICIES {
            let mut frames = frame_loop(&scene, "bvh2", policy, Forms::EXACT);
            let first = advance(&mut frames, 0.0);
            let (vertices_then, answers_then, picture_then) = (vertices(&first), answers(&first), picture(&first));
            for step in 1..=16 {
                advance(&mut frames, DURATION_S * f64::from(step) / 16.0).validate().expect("no bound is violated");
            }
            let last = advance(&mut frames, DURATION_S);
            assert!(vertices(&last) == vertices_then, "{name}, {policy:?}");
            assert!(answers(&last) == answers_then, "{name}, {policy:?}");
            assert!(picture(&last) == picture_then, "{name}, {policy:?}");
        }
    }
}

#[test]
fn h11_a_collapsed_sphere_is_never_hit() {
    let scene = Arc::new(collapse());
    for &kind in AccelKind::ALL {
        let world = advance(&mut frame_loop(&scene, kind.name(), RebuildPolicy::Refit, Forms::EXACT), 2.0);
        assert!(world.positions(InstanceId(0)).iter().all(|p| *p == Vec3::ZERO));
        assert!(answers(&world).iter().all(Option::is_none), "{kind}");
    }
}

/// The mesh of a world's frame, in (instance, prim) order.
fn mesh_of(world: &World) -> Mesh {
    let mut mesh = Mesh::default();
    for i in (0..world.instances().len() as u32).map(InstanceId) {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend_from_slice(world.positions(i));
        let part = world.scene(i).part(world.instances()[i.0 as usize].part);
        mesh.indices.extend(part.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    mesh
}

/// Ten thousand frames: the structure is refitted, or swapped, from frame to frame, and never leaves a triangle out.
#[test]
fn h11_ten_thousand_frames_of_spin_violate_no_bound_and_do_not_drift() {
    let total = count(10_000, 10_000, 100) as u64;
    let scene = Arc::new(spin());
    let kinds = AccelKind::ALL.iter().filter(|&&k| {
        let fresh = AccelSpec::new(k).build(&icosphere(0).prims()).expect("it builds");
        // Those that are built anew each frame are covered by shorter runs.
        is_full() || fresh.refits()
    });
    for &kind in kinds {
        let mut frames = frame_loop(&scene, kind.name(), RebuildPolicy::SwapEvery(64), Forms::EXACT);
        let first = advance(&mut frames, 0.0);
        let (vertices_then, answers_then) = (vertices(&first), answers(&first));
        for frame in 1..=total {
            // 97 frames a round: no frame but those of whole rounds repeats.
            let time_s = loop_time(0.0, (frame % 97) as f64 * DURATION_S / 97.0, 1.0, DURATION_S);
            let world = advance(&mut frames, time_s);
            world.validate().unwrap_or_else(|v| panic!("{kind}, frame {frame}: {v:?}"));
            if frame % 97 == 0 {
                assert!(vertices(&world) == vertices_then, "{kind}, frame {frame}");
                assert!(answers(&world) == answers_then, "{kind}, frame {frame}");
            } else if frame % 1009 == 0 {
                let mesh = mesh_of(&world);
                let reference = Reference::new(&mesh.prims());
                let mut random = Random(frame);
                for _ in 0..50 {
                    let origin = random.vec3() * 4.0;
                    let ray = Ray::new(origin, random.vec3() - origin);
                    let mut hit = [None];
                    world.hit_all(&[ray], SimdLevel::best(), &mut hit).expect("the default float mode");
                    let due = reference.closest(&ray);
                    assert_eq!(hit[0].map(|h| h.t), due.map(|d| d.t_rounded), "{kind}, frame {frame}: {ray:?}");
                }
            }
        }
        println!("H11: {kind}: {total} frames of spin, 0 bound violations, every return bit-identical");
    }
}

/// Refit by refit on the structure itself, out of and into the same buffers, through every motion.
#[test]
fn h11_chains_of_refits_keep_every_bound() {
    for (name, scene) in motions() {
        let scene = Arc::new(scene);
        let mut frames = frame_loop(&scene, "list", RebuildPolicy::Rebuild, Forms::EXACT);
        let meshes: Vec<Mesh> =
            (0..=40).map(|i| mesh_of(&advance(&mut frames, DURATION_S * f64::from(i) / 40.0))).collect();
        for &kind in AccelKind::ALL {
            let mut now = AccelSpec::new(kind).build(&meshes[0].prims()).expect("it builds");
            let mut spare = now.clone();
            for (step, mesh) in meshes.iter().cycle().take(count(2000, 120, 20)).enumerate() {
                if now.refit_into(&mut spare, &mesh.prims()) == Refit::NeedsRebuild {
                    break;
                }
                spare.validate(&mesh.prims()).unwrap_or_else(|v| panic!("{name}: {kind}, step {step}: {v:?}"));
                std::mem::swap(&mut now, &mut spare);
            }
        }
    }
}
