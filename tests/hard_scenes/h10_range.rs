//! H10: coordinates near 10^-38 and 10^37, the end of f32, and floating point modes that foreign code has changed.

use std::{
    process::Command,
    sync::{Arc, atomic::AtomicBool},
};

use base64::{Engine, engine::general_purpose::STANDARD};
use kinora::{
    accel::{AccelKind, AccelSpec, BuildError},
    dynamics::{FrameConfig, FrameError, FrameLoop, RebuildPolicy},
    geom::{Aabb, Forms, Ray},
    glam::{DAffine3, DVec3, Vec3},
    render::{Film, RenderError, RenderSettings, Renderer},
    scene::import,
    simd::{FloatModeError, SimdLevel, check_float_mode},
};

use crate::{
    meshes::{cuboid, icosphere, mapped, together},
    scenes::{Maker, node, part},
    stage::front,
    trace::{Mesh, Random},
    trial::{Trial, candidates, count},
};

/// Factors on shapes of size 1 to 2: denormals, the least normal numbers, and up to where sizes overflow.
const FACTORS: [f32; 8] = [3e-44, 1e-40, 1e-38, 2e-38, 1e18, 1e37, 1e38, 1.6e38];

/// A sphere and boxes around it.
fn shapes() -> Mesh {
    let boxes = (0..8).map(|i| {
        let at = Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0;
        cuboid(at - 0.25, at + 0.25)
    });
    together(std::iter::once(mapped(&icosphere(2), |p| p * 0.9)).chain(boxes))
}

fn rays(factor: f32, first: usize, len: usize) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut random = Random(i as u64);
        let origin = random.vec3() * if i.is_multiple_of(3) { 0.5 } else { 1.9 };
        let dir = if i.is_multiple_of(2) { random.vec3() - origin * 0.5 } else { random.vec3() };
        // As long as the shapes are large, or of length 1.
        let along = if i % 4 < 2 { factor } else { 1.0 };
        Ray::new(origin * factor, dir * along)
    };
    (first..first + len).map(ray).collect()
}

fn is_sound(aabb: Aabb) -> bool {
    aabb.min.is_finite() && aabb.max.is_finite() && aabb.min.cmple(aabb.max).all()
}

#[test]
fn h10_tiny_and_huge_coordinates_are_answered_exactly_in_sound_bounds() {
    for factor in FACTORS {
        let mesh = mapped(&shapes(), |p| p * factor);
        assert!(mesh.positions.iter().all(|p| p.is_finite()));
        let name = format!("H10 {}, {factor:e}", if factor < 1.0 { "small" } else { "large" });
        let trial = Trial { name: &name, mesh: &mesh, rays: count(100_000, 1_000, 30), refitted: true };
        trial.run(|first, len| rays(factor, first, len));
        sound(&mesh);
    }
}

#[test]
fn h10_tiny_and_huge_shapes_in_one_scene_are_answered_exactly() {
    let mesh = together([mapped(&shapes(), |p| p * 1e-38), shapes(), mapped(&icosphere(2), |p| p * 1.6e38)]);
    let trial = Trial { name: "H10 all", mesh: &mesh, rays: count(100_000, 1_000, 30), refitted: true };
    trial.run(|first, len| {
        let ray = |i: usize| rays([1e-38, 1.0, 1.6e38][i % 3], i, 1)[0];
        (first..first + len).map(ray).collect()
    });
    sound(&mesh);
}

fn sound(mesh: &Mesh) {
    for candidate in candidates(mesh, true) {
        let stats = candidate.accel.stats();
        assert!(is_sound(candidate.accel.bounds()), "{}: {:?}", candidate.name, candidate.accel.bounds());
        assert!(!stats.sah_cost.is_nan() && !candidate.accel.decay().is_nan(), "{}: {stats:?}", candidate.name);
    }
}

fn frames() -> FrameLoop {
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool"));
    let (accel, top) = ("bvh2".to_owned(), "bvh2".to_owned());
    FrameLoop::new(FrameConfig { accel, top, policy: RebuildPolicy::Refit, forms: Forms::default(), pool })
        .expect("known structures")
}

/// A cube that a node moves.
fn cube_at(place: DVec3) -> kinora::scene::Scene {
    let mut maker = Maker::default();
    let cube = cuboid(Vec3::splat(-1.0), Vec3::splat(1.0));
    let mesh = maker.mesh(part(cube.positions, cube.indices));
    maker.node(None, kinora::scene::SceneNode { mesh: Some(mesh), ..node(place) });
    maker.finish()
}

#[test]
fn h10_a_vertex_beyond_f32_is_a_typed_error() {
    for (place, ends) in [(1e30, false), (3.4e38, false), (3.5e38, true), (-1e60, true), (1e300, true)] {
        let mut frames = frames();
        frames.add(Arc::new(cube_at(DVec3::new(0.0, place, 0.0))), DAffine3::IDENTITY);
        match frames.advance(&[&[]]) {
            Ok((world, _)) => assert!(!ends && is_sound(world.bounds()), "{place}"),
            Err(FrameError::OutOfRange { node, .. }) => assert!(ends && node == 0, "{place}"),
            Err(other) => panic!("{place}: {other}"),
        }
    }
}

#[test]
fn h10_positions_that_are_no_numbers_are_a_typed_error_of_the_import() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut bytes = Vec::new();
        for value in [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, bad, 0.0] {
            bytes.extend(f32::to_le_bytes(value));
        }
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],
            "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{}"}}]}}"#,
            STANDARD.encode(bytes)
        );
        let result = import::from_bytes("bad.gltf", json.as_bytes(), &mut |_| Err("no other files".to_owned()));
        let Ok(scene) = result else { continue };
        assert!(scene.meshes[0].parts[0].positions.iter().all(|p| p.is_finite()), "{bad} came through");
    }
}

/// Names the mode that the child process sets.
const MODE: &str = "KINORA_TEST_FLOAT_MODE";

/// What foreign code does: writes the control register of this thread.
#[cfg(target_arch = "x86_64")]
fn set_mode(bits: u32) {
    let value = 0x1f80_u32 ^ bits;
    // SAFETY: the instruction loads four bytes from where `value` lies, all of whose bits exist. This is what a C shim does; the
    // process only asks for errors afterwards, and ends.
    unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const value, options(nostack, preserves_flags)) };
}

#[cfg(target_arch = "aarch64")]
fn set_mode(bits: u32) {
    // Flush-to-zero is bit 24 of FPCR and concerns inputs as well; rounding is bits 22 and 23.
    let value: u64 = match bits {
        0x8000 | 0x40 => 1 << 24,
        _ => u64::from(bits >> 13) << 22,
    };
    // SAFETY: as above.
    unsafe { std::arch::asm!("msr fpcr, {}", in(reg) value, options(nomem, nostack)) };
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn set_mode(_bits: u32) {}

/// In the child: everything is prepared in the default mode, then the mode changes, then every entry is asked.
#[test]
fn h10_child_of_the_float_mode_test() {
    let Some(mode) = std::env::var_os(MODE) else { return };
    let bits: u32 = mode.to_str().and_then(|m| m.parse().ok()).expect("a number");
    let mesh = icosphere(1);
    let accel = AccelSpec::new(AccelKind::Bvh2).build(&mesh.prims()).expect("it builds");
    let mut frames = frames();
    frames.add(Arc::new(cube_at(DVec3::ZERO)), DAffine3::IDENTITY);
    let (world, _) = frames.advance(&[&[]]).expect("a frame");
    let rays = [Ray::new(Vec3::new(0.1, 0.2, 5.0), Vec3::NEG_Z); 3];
    let (mut hits, mut blocked) = ([None; 3], [false; 3]);
    let (mut renderer, mut film, view) = (Renderer::default(), Film::new(8, 8), front(5.0));
    let (settings, level, stop) = (RenderSettings::default(), SimdLevel::best(), AtomicBool::new(false));

    set_mode(bits);
    let asked = [
        check_float_mode().err(),
        accel.closest_hits(&mesh.prims(), &rays, 1, level, &mut hits).err(),
        accel.blocked(&mesh.prims(), &rays, 16, level, &mut blocked).err(),
        world.hit_all(&rays, level, &mut hits).err(),
        world.block_all(&rays, level, &mut blocked).err(),
        match renderer.render_until(&world, &view, &settings, &mut film, &stop) {
            Err(RenderError::FloatMode(error)) => Some(error),
            _ => None,
        },
        match frames.advance(&[&[]]) {
            Err(FrameError::FloatMode(error)) => Some(error),
            _ => None,
        },
        match AccelSpec::new(AccelKind::Ssh).build(&mesh.prims()) {
            Err(BuildError::FloatMode(error)) => Some(error),
            _ => None,
        },
        // A pool's threads take over the mode of the thread that makes it.
        rayon::ThreadPoolBuilder::new().num_threads(1).build().ok().and_then(|p| p.install(check_float_mode).err()),
    ];
    set_mode(0);
    let due = match bits {
        0 => None,
        0x40 if cfg!(target_arch = "x86_64") => Some(FloatModeError::DenormalsAreZero),
        0x8000 | 0x40 => Some(FloatModeError::FlushToZero),
        _ => Some(FloatModeError::Rounding),
    };
    assert_eq!(asked, [due; 9], "mode {bits:#x}");
    assert!(hits == [None; 3] || due.is_none(), "nothing is answered");
}

#[test]
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
fn h10_every_entry_reports_a_changed_float_mode() {
    // The default, flush-to-zero, denormals-are-zero, and the three other roundings.
    for mode in [0, 0x8000, 0x40, 0x2000, 0x4000, 0x6000] {
        let child = Command::new(std::env::current_exe().expect("this test"))
            .args(["--exact", "h10_range::h10_child_of_the_float_mode_test", "--nocapture", "--test-threads", "1"])
            .env(MODE, mode.to_string())
            .output()
            .expect("the child runs");
        let text = String::from_utf8_lossy(&child.stdout);
        assert!(child.status.success() && text.contains("1 passed"), "mode {mode:#x}: {text}");
    }
}
