//! The single slab hierarchy: refits over many frames, sides chosen anew, and the counts of its paper.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "common/trace.rs"]
mod trace;

use kinora::{
    accel::{AccelKind, AccelSpec, AnyAccel, AnyHit, Closest, Counter, Refit, TravRay},
    geom::{Hit, Ray, Triangles},
    glam::Vec3,
    simd::{Simd, SimdLevel, Task, dispatch},
};
use trace::{Mesh, Random, closest, in_packets, occluded};

fn build(spec: &str, prims: &Triangles<'_>) -> AnyAccel {
    let spec: AccelSpec = spec.parse().expect("known settings");
    let accel = spec.build(prims).expect("the mesh builds");
    accel.validate(prims).unwrap_or_else(|v| panic!("{spec}: {v:?}"));
    accel
}

/// A bumpy sheet of `2 n n` triangles over [-1, 1]^2, and its height at a time.
fn sheet(n: u32, time: f32) -> Mesh {
    let place = |i: u32| 2.0 * i as f32 / n as f32 - 1.0;
    let wave = |x: f32| x * (1.0 - x * x / 6.0);
    let mut mesh = Mesh::default();
    for (y, x) in (0..=n).flat_map(|y| (0..=n).map(move |x| (y, x))) {
        let (x, y) = (place(x), place(y));
        mesh.positions.push(Vec3::new(x, y, 0.3 * wave(2.0 * (x + time)) * wave(2.0 * y) + 0.1 * time * x));
    }
    for (y, x) in (0..n).flat_map(|y| (0..n).map(move |x| (y, x))) {
        let a = y * (n + 1) + x;
        mesh.indices.extend([[a, a + 1, a + n + 1], [a + 1, a + n + 2, a + n + 1]]);
    }
    mesh
}

/// A ball of `2 n n` triangles with a rough surface.
fn ball(n: u32) -> Mesh {
    let mut mesh = sheet(n, 0.0);
    let mut random = Random(9);
    for p in &mut mesh.positions {
        // From the square to the sphere by its two halves, folded at the diagonals.
        let (x, y) = (p.x, p.y);
        let z = 1.0 - x.abs() - y.abs();
        let folded = if z >= 0.0 {
            Vec3::new(x, y, z)
        } else {
            Vec3::new((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y), z)
        };
        *p = folded.normalize() * (1.0 + 0.01 * random.unit());
    }
    mesh
}

fn rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    let zeros = [0.0, -0.0];
    let ray = |i: usize| {
        let target = random.vec3() * Vec3::new(1.0, 1.0, 0.3);
        let mut dir = random.vec3();
        if i.is_multiple_of(5) {
            dir[random.below(3)] = zeros[random.below(2)];
        }
        Ray::new(target - dir * 2.0, dir)
    };
    (0..count).map(ray).collect()
}

fn bits(hit: Option<Hit>) -> Option<[u32; 4]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim.0])
}

fn answers(accel: &AnyAccel, prims: &Triangles<'_>, rays: &[Ray]) -> Vec<Option<[u32; 4]>> {
    closest(accel, prims, rays, SimdLevel::best()).into_iter().map(bits).collect()
}

#[test]
fn three_hundred_refits_answer_as_brute_force() {
    let rays = rays(12, 1);
    let first = sheet(9, 0.0);
    let specs = [
        "ssh",
        "ssh:leaf=1,build=median",
        "ssh:refit=rechoose,leaf=2",
        "ssh:leaf_planes=off",
        "ssh:planes=3",
        "ssh:planes=4,refit=rechoose",
    ];
    let mut accels = specs.map(|spec| {
        let accel = build(spec, &first.prims());
        (accel.clone(), accel)
    });
    for frame in 1..=300 {
        let mesh = sheet(9, frame as f32 / 100.0);
        let list = build("list", &mesh.prims());
        let due = answers(&list, &mesh.prims(), &rays);
        for ((accel, spare), spec) in accels.iter_mut().zip(specs) {
            assert_eq!(accel.refit_into(spare, &mesh.prims()), Refit::Done);
            std::mem::swap(accel, spare);
            accel.validate(&mesh.prims()).unwrap_or_else(|v| panic!("{spec}, frame {frame}: {v:?}"));
            assert_eq!(answers(accel, &mesh.prims(), &rays), due, "{spec}, frame {frame}");
        }
    }
}

#[test]
fn settings_change_no_answer() {
    let mesh = ball(24);
    let rays = rays(400, 2);
    let reference = build("bvh2", &mesh.prims());
    let due = closest(&reference, &mesh.prims(), &rays, SimdLevel::best());
    let blocked = occluded(&reference, &mesh.prims(), &rays, SimdLevel::best());
    for spec in [
        "ssh",
        "ssh:leaf=1",
        "ssh:leaf=32",
        "ssh:build=median",
        "ssh:build=median,leaf=1",
        "ssh:build=median,leaf=7",
        "ssh:build=fast",
        "ssh:build=fast,leaf=1",
        "ssh:planes=3,build=fast",
        "ssh:leaf_planes=off",
        "ssh:leaf_planes=off,leaf=1",
        "ssh:bins=2,leaf=3",
        "ssh:planes=3",
        "ssh:planes=4",
        "ssh:planes=3,leaf=32,build=median",
        "ssh:planes=4,leaf=1,leaf_planes=off",
    ] {
        let accel = build(spec, &mesh.prims());
        for level in SimdLevel::available() {
            assert_eq!(closest(&accel, &mesh.prims(), &rays, level), due, "{spec} at {level}");
            assert_eq!(occluded(&accel, &mesh.prims(), &rays, level), blocked, "{spec} at {level}");
            let (hits, shadows) = in_packets(&accel, &mesh.prims(), &rays, level);
            assert_eq!((hits, shadows), (due.clone(), blocked.clone()), "{spec} at {level}, in packets");
        }
    }
}

#[test]
fn unknown_settings_are_refused() {
    let error = |spec: &str| spec.parse::<AccelSpec>().unwrap_err().to_string();
    assert_eq!(error("ssh:build=good"), "ssh: setting `build`: `good` is not one of sah, median, fast");
    assert_eq!(error("ssh:planes=6"), "ssh: setting `planes`: `6` is not one of 1, 3, 4");
    assert_eq!(error("ssh:leaf=0"), "ssh: setting `leaf`: `0` is not a number from 1 to 32");
    assert_eq!(error("ssh:leaf_planes=1"), "ssh: setting `leaf_planes`: `1` is not one of on, off");
    assert_eq!(error("ssh:refit=always"), "ssh: setting `refit`: `always` is not one of keep, rechoose");
}

#[test]
fn sides_chosen_anew_bound_tighter_after_motion() {
    let mesh = ball(40);
    // The ball is turned by a quarter and flattened: sides that were good are bad now.
    let turned: Vec<_> = mesh.positions.iter().map(|p| Vec3::new(p.y * 0.2 + p.x, p.z * 3.0, -p.x * 0.1)).collect();
    let moved = Mesh { positions: turned, indices: mesh.indices.clone() };
    let refitted = |spec: &str| {
        let accel = build(spec, &mesh.prims());
        let mut out = accel.clone();
        assert_eq!(accel.refit_into(&mut out, &moved.prims()), Refit::Done);
        out.validate(&moved.prims()).unwrap_or_else(|v| panic!("{spec}: {v:?}"));
        out
    };
    let (keep, rechosen) = (refitted("ssh"), refitted("ssh:refit=rechoose"));
    assert!(rechosen.stats().sah_cost < 0.95 * keep.stats().sah_cost, "{:?} {:?}", rechosen.stats(), keep.stats());
    assert!(rechosen.decay() < keep.decay());
    let rays = rays(300, 3);
    assert_eq!(answers(&keep, &moved.prims(), &rays), answers(&rechosen, &moved.prims(), &rays));
    // Sides kept through a refit to the same positions are those of the build.
    let same = build("ssh", &mesh.prims());
    let mut out = keep;
    same.refit_into(&mut out, &mesh.prims());
    assert!((out.decay() - 1.0).abs() < 1e-12, "{}", out.decay());
}

#[test]
fn refits_do_not_depend_on_the_number_of_threads() {
    let (mesh, moved) = (sheet(110, 0.0), sheet(110, 0.5));
    for spec in [
        "ssh:leaf=2",
        "ssh:leaf=1,build=median",
        "ssh:leaf=2,refit=rechoose",
        "ssh:planes=3,leaf=2",
        "ssh:planes=4,leaf=1,refit=rechoose",
    ] {
        let accel = build(spec, &mesh.prims());
        let in_pool = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| {
                let mut out = accel.clone();
                assert_eq!(accel.refit_into(&mut out, &moved.prims()), Refit::Done);
                out.validate(&moved.prims()).unwrap_or_else(|v| panic!("{spec}: {v:?}"));
                format!("{out:?}")
            })
        };
        assert!(in_pool(1) == in_pool(2), "{spec}");
    }
}

#[derive(Default)]
struct Counts {
    nodes: u64,
    prims: u64,
}

impl Counter for Counts {
    fn node(&mut self) {
        self.nodes += 1;
    }
    fn prim(&mut self) {
        self.prims += 1;
    }
}

struct Count<'a> {
    accel: &'a AnyAccel,
    prims: Triangles<'a>,
    rays: &'a [Ray],
}

impl Task for Count<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<S: Simd>(self) -> [f64; 2] {
        let mut count = Counts::default();
        for ray in self.rays {
            let ray = TravRay::new(ray).expect("a ray");
            let mut best = Closest::new(&ray);
            self.accel.closest::<S, _, _>(&self.prims, &ray, &mut best, &AnyHit, &mut count);
        }
        [count.nodes, count.prims].map(|n| n as f64 / self.rays.len() as f64)
    }
}

/// Nodes tested and triangles tested a ray, of `ssh` and `bvh2` with the same settings.
fn counted(settings: &str, mesh: &Mesh, rays: &[Ray]) -> [[f64; 2]; 2] {
    ["ssh", "bvh2"].map(|name| {
        let accel = build(&format!("{name}:{settings}"), &mesh.prims());
        dispatch(SimdLevel::Scalar, Count { accel: &accel, prims: mesh.prims(), rays })
    })
}

/// Rays through the pixels of a square camera that sees the ball with a margin around it, as in the paper's pictures.
fn camera(side: u16) -> Vec<Ray> {
    let place = |i: u16| 2.0 * (f32::from(i) + 0.5) / f32::from(side) - 1.0;
    let eye = Vec3::new(2.6, 1.9, 3.1);
    let (forward, right) = (-eye.normalize(), eye.cross(Vec3::Y).normalize());
    let up = right.cross(forward);
    let pixel = |x: u16, y: u16| Ray::new(eye, forward + 0.36 * (place(x) * right + place(y) * up));
    (0..side).flat_map(|y| (0..side).map(move |x| pixel(x, y))).collect()
}

#[test]
fn the_papers_setup_visits_about_twice_the_nodes_of_a_box_hierarchy() {
    let mesh = ball(90);
    let [ssh, bvh2] = counted("build=median,leaf=1", &mesh, &camera(48));
    let (nodes, tests) = (ssh[0] / bvh2[0], ssh[1] - bvh2[1]);
    assert!((1.5..2.3).contains(&nodes), "{ssh:?} {bvh2:?}");
    assert!((0.7..3.0).contains(&tests), "{ssh:?} {bvh2:?}");
}

#[test]
fn rays_beside_the_root_box_visit_nothing() {
    let mesh = ball(10);
    let beside = [Ray::new(Vec3::new(3.0, 3.0, 3.0), Vec3::X), Ray::new(Vec3::new(0.0, 0.0, 2.0), Vec3::Z)];
    let accel = build("ssh", &mesh.prims());
    let counts = dispatch(SimdLevel::best(), Count { accel: &accel, prims: mesh.prims(), rays: &beside });
    assert!(counts.iter().all(|&n| n < 1e-9), "{counts:?}");
    assert_eq!(accel.kind(), AccelKind::Ssh);
}
