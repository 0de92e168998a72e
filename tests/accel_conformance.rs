//! Every structure against brute force: the same hit bit for bit, fresh and refitted, singly and in packets, at every
//! SIMD level.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "common/trace.rs"]
mod trace;

use kinora::{
    accel::{AccelKind, AccelSpec, AnyAccel, Refit},
    geom::{Hit, Ray},
    glam::Vec3,
    simd::SimdLevel,
};
use trace::{Mesh, Random, closest, in_packets, occluded};

fn build(kind: AccelKind, mesh: &Mesh) -> AnyAccel {
    build_spec(&AccelSpec::new(kind), mesh)
}

fn build_spec(spec: &AccelSpec, mesh: &Mesh) -> AnyAccel {
    let accel = spec.build(&mesh.prims()).expect("the mesh builds");
    accel.validate(&mesh.prims()).unwrap_or_else(|v| panic!("{spec}: {v:?}"));
    accel
}

/// Forms of structures beside the default ones, with kernels or builders of their own.
const FORMS: [&str; 6] = [
    "ssh:planes=3",
    "ssh:planes=4",
    "bvh2:build=fast",
    "bvh8:build=fast",
    "bvh8:layout=compact",
    "bvh8:layout=compact,leaf=11",
];

/// Every structure but `list`, and the other forms.
fn specs() -> Vec<AccelSpec> {
    let kinds = AccelKind::ALL.iter().filter(|&&k| k != AccelKind::List).map(|&k| AccelSpec::new(k));
    kinds.chain(FORMS.map(|form| form.parse().expect("known settings"))).collect()
}

/// The mesh with every vertex elsewhere: what a refit starts from.
fn displaced(mesh: &Mesh) -> Mesh {
    let mut random = Random(7);
    let positions = mesh.positions.iter().map(|_| random.vec3() * 3.0).collect();
    Mesh { positions, indices: mesh.indices.clone() }
}

fn bits(hit: Option<Hit>) -> Option<[u32; 4]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim.0])
}

/// All kinds, levels, fresh and refitted, singly and in packets, against `list`.
fn conforms(name: &str, mesh: &Mesh, rays: &[Ray]) {
    let list = build(AccelKind::List, mesh);
    let due: Vec<_> = closest(&list, &mesh.prims(), rays, SimdLevel::Scalar).into_iter().map(bits).collect();
    for kind in &specs() {
        let fresh = build_spec(kind, mesh);
        let elsewhere = displaced(mesh);
        let old = build_spec(kind, &elsewhere);
        let mut refitted = old.clone();
        let refit = old.refit_into(&mut refitted, &mesh.prims());
        if refit == Refit::Done {
            refitted.validate(&mesh.prims()).unwrap_or_else(|v| panic!("{name}, refitted {kind}: {v:?}"));
        }
        let accels = [Some(&fresh), (refit == Refit::Done).then_some(&refitted)];
        for (what, accel) in ["fresh", "refitted"].iter().zip(accels) {
            let Some(accel) = accel else { continue };
            for level in SimdLevel::available() {
                let hits = closest(accel, &mesh.prims(), rays, level);
                let blocked = occluded(accel, &mesh.prims(), rays, level);
                let (together, blocked_together) = in_packets(accel, &mesh.prims(), rays, level);
                assert_eq!(together, hits, "{name}: {what} {kind} at {level}, in packets");
                assert_eq!(blocked_together, blocked, "{name}: {what} {kind} at {level}, in packets");
                for (i, due) in due.iter().enumerate() {
                    let context = || format!("{name}: {what} {kind} at {level}, ray {i} {:?}", rays[i]);
                    assert_eq!(&bits(hits[i]), due, "{}", context());
                    assert_eq!(blocked[i], due.is_some(), "{}", context());
                }
            }
        }
    }
}

/// Rays from around a mesh to random points near its triangles, and some with zero components of both signs.
fn rays_at(mesh: &Mesh, count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    let zeros = [0.0, -0.0];
    (0..count)
        .map(|i| {
            let target = if mesh.positions.is_empty() {
                random.vec3()
            } else {
                let prim = random.below(mesh.indices.len().max(1));
                let corners = mesh.indices.get(prim).map_or([Vec3::ZERO; 3], |_| mesh.corners(prim));
                match i % 4 {
                    0 => corners[0],
                    1 => (corners[0] + corners[1]) * 0.5,
                    _ => (corners[0] + corners[1] + corners[2]) / 3.0,
                }
            };
            let mut dir = random.vec3();
            for axis in 0..3 {
                if random.below(4) == 0 {
                    dir[axis] = zeros[random.below(2)];
                }
            }
            let origin = target - dir * (1.0 + random.below(3) as f32);
            let mut ray = Ray::new(origin, dir);
            if random.below(4) == 0 {
                ray.t_near = random.unit().abs() * 2.0;
                ray.t_far = ray.t_near + random.unit().abs() * 2.0;
            }
            ray
        })
        .collect()
}

fn soup(count: usize, size: f32, seed: u64) -> Mesh {
    let mut random = Random(seed);
    let triangle = |_| {
        let center = random.vec3();
        [center, center + random.vec3() * size, center + random.vec3() * size]
    };
    Mesh::soup(&(0..count).map(triangle).collect::<Vec<_>>())
}

/// A grid of n x n squares in the plane z = height, two triangles each.
fn plane(n: u32, height: f32) -> Mesh {
    let positions = (0..=n).flat_map(|y| (0..=n).map(move |x| Vec3::new(x as f32, y as f32, height))).collect();
    let indices = (0..n).flat_map(|y| {
        (0..n).flat_map(move |x| {
            let a = y * (n + 1) + x;
            [[a, a + 1, a + n + 1], [a + 1, a + n + 2, a + n + 1]]
        })
    });
    Mesh { positions, indices: indices.collect() }
}

/// A closed sphere: an icosahedron subdivided `levels` times.
fn icosphere(levels: u32) -> Mesh {
    let g = 1.618_034;
    let corners = [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)];
    let mut positions: Vec<Vec3> = corners.iter().map(|&(a, b)| Vec3::new(a, b, 0.0)).collect();
    positions.extend(corners.iter().map(|&(a, b)| Vec3::new(0.0, a, b)));
    positions.extend(corners.iter().map(|&(a, b)| Vec3::new(b, 0.0, a)));
    let mut indices = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..levels {
        let mut middles = std::collections::HashMap::new();
        let mut next = Vec::with_capacity(indices.len() * 4);
        for [a, b, c] in indices {
            let mut middle = |i: u32, j: u32| {
                *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    let p = (positions[i as usize] + positions[j as usize]) * 0.5;
                    positions.push(p / p.length() * 1.9);
                    positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        indices = next;
    }
    Mesh { positions, indices }
}

#[test]
fn nothing_is_hit_in_an_empty_mesh() {
    let mesh = Mesh::default();
    conforms("empty", &mesh, &rays_at(&mesh, 20, 1));
    let unused = Mesh { positions: vec![Vec3::ONE; 3], indices: vec![] };
    conforms("vertices without triangles", &unused, &rays_at(&unused, 20, 1));
}

#[test]
fn few_triangles_conform() {
    for count in [1, 2, 3, 4, 5, 8, 9, 17, 33] {
        let mesh = soup(count, 1.0, count as u64);
        conforms("few", &mesh, &rays_at(&mesh, 200, 3));
    }
}

#[test]
fn soups_conform() {
    for (count, size) in [(400, 0.3), (1500, 0.05), (200, 2.0)] {
        let mesh = soup(count, size, 5);
        conforms("soup", &mesh, &rays_at(&mesh, 150, 6));
    }
}

#[test]
fn garbage_vertices_disturb_no_other_triangle() {
    let mut mesh = soup(400, 0.3, 9);
    let mut random = Random(4);
    let garbage = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, 1e-45, f32::MAX, f32::MIN, f32::MIN_POSITIVE];
    for _ in 0..200 {
        let vertex = random.below(mesh.positions.len());
        mesh.positions[vertex][random.below(3)] = garbage[random.below(garbage.len())];
    }
    let clean = soup(400, 0.3, 9);
    conforms("garbage", &mesh, &rays_at(&clean, 400, 8));
    let nothing =
        Mesh { positions: vec![Vec3::NAN; 30], indices: (0..10).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect() };
    conforms("nothing finite", &nothing, &rays_at(&clean, 50, 8));
}

#[test]
fn rays_that_are_none_miss_without_harm() {
    let mesh = soup(100, 1.0, 2);
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    let mut rays = Vec::new();
    for value in odd {
        for axis in 0..3 {
            let mut ray = Ray::new(Vec3::splat(-3.0), Vec3::ONE);
            ray.origin[axis] = value;
            rays.push(ray);
            let mut ray = Ray::new(Vec3::splat(-3.0), Vec3::ONE);
            ray.dir[axis] = value;
            rays.push(ray);
        }
        rays.push(Ray { t_near: value.abs(), ..Ray::new(Vec3::splat(-3.0), Vec3::ONE) });
    }
    rays.push(Ray { t_far: f32::NAN, ..Ray::new(Vec3::splat(-3.0), Vec3::ONE) });
    rays.push(Ray { t_far: -1.0, ..Ray::new(Vec3::splat(-3.0), Vec3::ONE) });
    rays.push(Ray { t_near: 5.0, t_far: 4.0, ..Ray::new(Vec3::splat(-3.0), Vec3::ONE) });
    rays.push(Ray::new(Vec3::ZERO, Vec3::ZERO));
    rays.push(Ray::new(Vec3::ZERO, -Vec3::ZERO));
    for &kind in AccelKind::ALL {
        let accel = build(kind, &mesh);
        for level in SimdLevel::available() {
            assert!(closest(&accel, &mesh.prims(), &rays, level).iter().all(Option::is_none), "{kind} at {level}");
            assert!(!occluded(&accel, &mesh.prims(), &rays, level).contains(&true), "{kind} at {level}");
        }
    }
}

#[test]
fn duplicates_are_reported_as_the_lowest() {
    let mut random = Random(12);
    let once: Vec<[Vec3; 3]> = (0..40).map(|_| [random.vec3(), random.vec3(), random.vec3()]).collect();
    let many: Vec<_> = once.iter().cycle().take(once.len() * 20).copied().collect();
    let mesh = Mesh::soup(&many);
    conforms("duplicates", &mesh, &rays_at(&mesh, 300, 2));
    let bvh = build(AccelKind::Bvh2, &mesh);
    let hits = closest(&bvh, &mesh.prims(), &rays_at(&mesh, 300, 2), SimdLevel::best());
    assert!(hits.iter().flatten().all(|h| (h.prim.0 as usize) < once.len()));
    assert!(hits.iter().flatten().count() > 50);
}

#[test]
fn nearly_coplanar_layers_keep_their_order() {
    let mut corners = Vec::new();
    for ulps in [0, 8, 1, 2, 0] {
        let z = f32::from_bits(1.0_f32.to_bits() + ulps);
        corners.push([Vec3::new(-1.0, -1.0, z), Vec3::new(2.0, -1.0, z), Vec3::new(-1.0, 2.0, z)]);
    }
    let mesh = Mesh::soup(&corners);
    let rays: Vec<_> =
        (0..100).map(|i| Ray::new(Vec3::new(0.01 * i as f32 - 0.5, 0.1, 3.0), Vec3::new(0.0, 0.0, -1.0))).collect();
    conforms("layers", &mesh, &rays);
    let bvh = build(AccelKind::Bvh2, &mesh);
    let hits = closest(&bvh, &mesh.prims(), &rays, SimdLevel::best());
    assert!(hits.iter().all(|h| h.is_some_and(|h| h.prim.0 == 1)), "the layer 8 ulp nearer comes first");
}

/// Triangles whose boxes are symmetric about the origin: every box has the same centre.
fn concentric(count: usize) -> Mesh {
    let mut random = Random(3);
    let triangle = |_| {
        let v = random.vec3();
        [v, -v, Vec3::new(v.y, v.x, v.z)]
    };
    Mesh::soup(&(0..count).map(triangle).collect::<Vec<_>>())
}

#[test]
fn a_hundred_thousand_equal_centroids_build_within_the_depth_bound() {
    let mesh = concentric(100_000);
    assert!(build(AccelKind::Bvh2, &mesh).stats().depth <= 65);
}

#[test]
fn equal_centroids_conform() {
    let mesh = concentric(1000);
    conforms("equal centroids", &mesh, &rays_at(&mesh, 60, 2));
}

#[test]
fn flat_scenes_conform_on_edges_and_vertices() {
    let mesh = plane(5, 1.5);
    let mut rays = Vec::new();
    for x in 0..=10 {
        for y in 0..=10 {
            let origin = Vec3::new(x as f32 * 0.5, y as f32 * 0.5, 4.0);
            for zero in [0.0, -0.0] {
                rays.push(Ray::new(origin, Vec3::new(zero, zero, -1.0)));
                rays.push(Ray::new(origin, Vec3::new(-zero, zero, -1e-7)));
            }
            // In the plane itself: parallel, so a miss.
            rays.push(Ray::new(Vec3::new(-1.0, y as f32 * 0.5, 1.5), Vec3::new(1.0, 0.0, -0.0)));
        }
    }
    conforms("plane", &mesh, &rays);
    let bvh = build(AccelKind::Bvh2, &mesh);
    let hits = closest(&bvh, &mesh.prims(), &rays, SimdLevel::best());
    assert_eq!(hits.iter().flatten().count(), 11 * 11 * 4, "every ray onto the plane hits, none along it");
}

#[test]
fn both_ends_of_the_range_are_closed() {
    let mesh = plane(4, 2.0);
    let down = |t_near, t_far| Ray { origin: Vec3::new(1.3, 1.4, 5.0), dir: -Vec3::Z, t_near, t_far };
    let rays = [
        down(3.0, 3.0),
        down(3.0, f32::INFINITY),
        down(0.0, 3.0),
        down(0.0, 3.0_f32.next_down()),
        down(3.0_f32.next_up(), f32::MAX),
    ];
    conforms("ends", &mesh, &rays);
    for &kind in AccelKind::ALL {
        let hits = closest(&build(kind, &mesh), &mesh.prims(), &rays, SimdLevel::best());
        assert_eq!(hits.map_to_some(), [true, true, true, false, false], "{kind}");
    }
}

trait MapToSome {
    fn map_to_some(&self) -> Vec<bool>;
}

impl MapToSome for Vec<Option<Hit>> {
    fn map_to_some(&self) -> Vec<bool> {
        self.iter().map(Option::is_some).collect()
    }
}

#[test]
fn extreme_scales_conform() {
    let base = soup(100, 0.5, 21);
    let rays = rays_at(&base, 80, 22);
    for exponent in [-148, -126, -100, -60, 0, 59, 60, 62, 100, 125] {
        let scale = (2.0_f64.powi(exponent)) as f32;
        let mesh =
            Mesh { positions: base.positions.iter().map(|&p| p * scale).collect(), indices: base.indices.clone() };
        let scaled = |r: &Ray| Ray { origin: r.origin * scale, dir: r.dir * scale, ..*r };
        conforms("scaled", &mesh, &rays.iter().map(scaled).collect::<Vec<_>>());
        let unscaled_dir = |r: &Ray| Ray { origin: r.origin * scale, t_far: f32::INFINITY, ..*r };
        conforms("scaled, unit directions", &mesh, &rays.iter().map(unscaled_dir).collect::<Vec<_>>());
    }
}

#[test]
fn tiny_direction_components_lose_no_hit() {
    let mesh = soup(500, 0.4, 31);
    let mut random = Random(5);
    let tiny = [1e-45, 1e-40, 1e-38, 1e-30, 1e-20, 1e-7, 0.0, -0.0];
    let rays: Vec<_> = (0..400)
        .map(|_| {
            let mut dir = random.vec3();
            for axis in 0..3 {
                if random.below(2) == 0 {
                    dir[axis] = tiny[random.below(tiny.len())] * if random.below(2) == 0 { 1.0 } else { -1.0 };
                }
            }
            let target = mesh.positions[random.below(mesh.positions.len())];
            Ray::new(target - dir, dir)
        })
        .collect();
    conforms("tiny components", &mesh, &rays);
}

/// A fan of rays from one point through a window, in rows: what a camera shoots.
fn camera(origin: Vec3, target: Vec3, side: usize) -> Vec<Ray> {
    let forward = target - origin;
    let right = forward.cross(Vec3::new(0.1, 1.0, 0.2));
    let up = right.cross(forward) / forward.length();
    let step = |i: usize| (i as f32 + 0.5) / side as f32 - 0.5;
    let pixel = |i: usize| Ray::new(origin, forward + right * step(i % side) + up * step(i / side));
    (0..side * side).map(pixel).collect()
}

#[test]
fn coherent_packets_conform() {
    let mesh = icosphere(2);
    for origin in [Vec3::new(5.0, 3.0, 4.0), Vec3::new(-4.0, 0.2, -0.1), Vec3::new(0.3, 0.1, 0.0)] {
        let rays = camera(origin, Vec3::new(0.01, 0.02, -0.03), 14);
        conforms("camera", &mesh, &rays);
        // One direction from many points, as to a distant light.
        let parallel: Vec<_> = rays.iter().map(|r| Ray::new(r.origin + r.dir, -r.origin)).collect();
        conforms("parallel", &mesh, &parallel);
        // Many points to one, as to a near light.
        let to_light =
            |r: &Ray| Ray { t_far: 1.0, ..Ray::new(r.origin + r.dir, Vec3::new(2.0, 2.5, 0.5) - r.origin - r.dir) };
        conforms("to a light", &mesh, &rays.iter().map(to_light).collect::<Vec<_>>());
    }
}

#[test]
fn far_from_the_origin_nothing_is_lost() {
    let base = icosphere(2);
    for k in [0, 8, 16, 23] {
        let shift = Vec3::splat((1 << k) as f32);
        let mesh =
            Mesh { positions: base.positions.iter().map(|&p| p + shift).collect(), indices: base.indices.clone() };
        let mut random = Random(k as u64);
        let rays: Vec<_> = (0..200).map(|_| Ray::new(shift, random.vec3())).collect();
        conforms("shifted", &mesh, &rays);
    }
}

#[test]
fn a_closed_mesh_leaks_at_no_vertex_edge_or_face() {
    let mesh = icosphere(3);
    let inside = Vec3::new(0.011, -0.023, 0.037);
    let mut rays = Vec::new();
    for prim in 0..mesh.indices.len() {
        let [a, b, c] = mesh.corners(prim);
        for target in [a, (a + b) * 0.5, (b + c) * 0.5, (a + b + c) / 3.0] {
            rays.push(Ray::new(inside, target - inside));
            rays.push(Ray::new(Vec3::ZERO, target));
        }
    }
    for &kind in AccelKind::ALL.iter().filter(|&&k| k != AccelKind::List) {
        let accel = build(kind, &mesh);
        for level in SimdLevel::available() {
            let leaks = closest(&accel, &mesh.prims(), &rays, level).iter().filter(|h| h.is_none()).count();
            assert_eq!(leaks, 0, "{kind} at {level}: of {} rays", rays.len());
            assert!(!occluded(&accel, &mesh.prims(), &rays, level).contains(&false), "{kind} at {level}");
        }
    }
}

#[test]
fn builds_do_not_depend_on_the_number_of_threads() {
    let mesh = soup(60_000, 0.02, 17);
    let rays = rays_at(&mesh, 500, 18);
    let in_pool = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let accel = build(AccelKind::Bvh2, &mesh);
            let hits: Vec<_> = closest(&accel, &mesh.prims(), &rays, SimdLevel::best()).into_iter().map(bits).collect();
            (format!("{:?}", accel.stats()), hits)
        })
    };
    assert_eq!(in_pool(1), in_pool(2));
}

#[test]
fn decay_is_one_when_fresh_and_grows_when_a_mesh_explodes() {
    let mesh = icosphere(4);
    let bvh = build(AccelKind::Bvh2, &mesh);
    assert!((bvh.decay() - 1.0).abs() < 1e-12);
    let mut random = Random(1);
    // Every triangle flies off by itself.
    let apart = Mesh::soup(&(0..mesh.indices.len()).map(|p| mesh.corners(p)).collect::<Vec<_>>());
    let built = build(AccelKind::Bvh2, &apart);
    let mut exploded = apart.clone();
    for corners in exploded.positions.chunks_exact_mut(3) {
        let flight = random.vec3() * 20.0;
        for corner in corners {
            *corner += flight;
        }
    }
    let mut refitted = built.clone();
    assert_eq!(built.refit_into(&mut refitted, &exploded.prims()), Refit::Done);
    assert!(refitted.decay() > 3.0, "{}", refitted.decay());
    // Growing as a whole is no decay.
    let grown = Mesh { positions: apart.positions.iter().map(|&p| p * 8.0).collect(), indices: apart.indices.clone() };
    assert_eq!(built.refit_into(&mut refitted, &grown.prims()), Refit::Done);
    assert!((refitted.decay() - 1.0).abs() < 1e-3, "{}", refitted.decay());
}

#[test]
fn a_refit_asks_for_a_rebuild_when_the_topology_changed() {
    let mesh = soup(100, 0.3, 1);
    for &kind in AccelKind::ALL {
        let accel = build(kind, &mesh);
        let mut out = accel.clone();
        let changed = kinora::geom::Triangles { topology_epoch: 2, ..mesh.prims() };
        assert_eq!(accel.refit_into(&mut out, &changed), Refit::NeedsRebuild, "{kind}");
        let fewer = Mesh { positions: mesh.positions.clone(), indices: mesh.indices[1..].to_vec() };
        assert_eq!(accel.refit_into(&mut out, &fewer.prims()), Refit::NeedsRebuild, "{kind}");
    }
}

#[test]
fn an_index_out_of_range_is_an_error() {
    let mesh = Mesh { positions: vec![Vec3::ZERO; 3], indices: vec![[0, 1, 2], [0, 1, 3]] };
    for &kind in AccelKind::ALL {
        let error = AccelSpec::new(kind).build(&mesh.prims()).expect_err("vertex 3 of 3");
        assert_eq!(error.to_string(), "triangle 1: vertex 3 of 3");
    }
}

#[test]
fn specifications_name_what_exists() {
    let parse = |text: &str| text.parse::<AccelSpec>().map(|s| s.to_string()).map_err(|e| e.to_string());
    assert_eq!(parse("bvh2"), Ok("bvh2".into()));
    assert_eq!(parse("bvh2:bins=32,leaf=1"), Ok("bvh2:bins=32,leaf=1".into()));
    let names = AccelKind::names();
    assert!(names.starts_with("list, bvh2"), "{names}");
    assert_eq!(parse("octree"), Err(format!("unknown structure `octree`; there are: {names}")));
    let unknown = parse("bvh2:depth=3").unwrap_err();
    assert!(unknown.starts_with("bvh2: setting `depth`: unknown; there are: build, bins, leaf"), "{unknown}");
    assert_eq!(parse("bvh2:bins=1"), Err("bvh2: setting `bins`: `1` is not a number from 2 to 64".into()));
    assert_eq!(parse("bvh2:bins"), Err("bvh2: `bins` is not of the form key=value".into()));
    assert_eq!(parse("list:a=b"), Err("list: setting `a`: unknown; there are no settings".into()));
}

#[test]
fn settings_change_the_tree_but_no_answer() {
    let mesh = soup(2000, 0.2, 77);
    let rays = rays_at(&mesh, 300, 78);
    let reference = build(AccelKind::Bvh2, &mesh);
    let due: Vec<_> = closest(&reference, &mesh.prims(), &rays, SimdLevel::best()).into_iter().map(bits).collect();
    for text in [
        "bvh2:bins=2",
        "bvh2:bins=64,leaf=1",
        "bvh2:leaf=8",
        "bvh2:build=median,leaf=1",
        "bvh2:build=median",
        "bvh2:build=fast",
        "bvh2:build=fast,leaf=1",
        "bvh2:build=fast,leaf=3",
        "bvh8:build=fast,leaf=32",
    ] {
        let spec: AccelSpec = text.parse().expect("known settings");
        let accel = spec.build(&mesh.prims()).expect("the mesh builds");
        accel.validate(&mesh.prims()).expect("valid");
        if text != "bvh2:leaf=8" {
            assert_ne!(accel.stats(), reference.stats(), "{text}");
        }
        let hits: Vec<_> = closest(&accel, &mesh.prims(), &rays, SimdLevel::best()).into_iter().map(bits).collect();
        assert_eq!(hits, due, "{text}");
    }
}
