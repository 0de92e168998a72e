//! The Standard Procedural Databases: published ray counts, and triangles that stand for the primitives.
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

#[path = "common/trace.rs"]
mod trace;

use kinora::{
    accel::{
        AccelKind, AccelSpec, AnyAccel,
        grid::{BoxGrid, GridConfig, Resolution},
    },
    geom::Ray,
    glam::Vec3,
    report::papers::{
        objects::{SolidRay, Solids},
        spd::{Naive, PIXELS, RaySet, RayTally, Rules, Tracer, WalkCounts, published, spd_rays},
    },
    scene::{
        Scene,
        spd::{SpdKind, SpdScene},
    },
    simd::SimdLevel,
};
use trace::{Mesh, closest, in_packets, occluded};

/// Pictures of more than a few million rays take minutes without optimisation.
fn is_quick(kind: SpdKind) -> bool {
    !cfg!(debug_assertions) || kind == SpdKind::Tetra
}

/// Fails unless `found` is within `part` of `due`.
fn assert_close(found: u64, due: u64, part: f64, what: &str) {
    let off = (found as f64 - due as f64).abs();
    assert!(off <= part * due as f64, "{what}: {found}, published are {due}: {:+.2} %", 100.0 * off / due as f64);
}

#[test]
fn ray_counts_are_those_of_the_packages_readme() {
    for (kind, [primary, shadow, secondary]) in published::README.into_iter().filter(|p| is_quick(p.0)) {
        let scene = kind.generate(kind.default_size()).expect("a valid size");
        let found = spd_rays(&scene, Rules::Readme);
        let name = kind.name();
        assert_eq!(found.primary.rays, 263_169, "{name}");
        assert_close(found.primary.hits, primary, 2e-4, &format!("{name}, primary hits"));
        assert_close(found.shadow.rays, shadow, 4e-3, &format!("{name}, shadow rays"));
        assert_close(found.secondary.rays, secondary, 0.02, &format!("{name}, secondary rays"));
    }
}

#[test]
fn ray_counts_agree_with_those_of_havran_and_sixta() {
    for (kind, due) in published::HAVRAN.into_iter().filter(|p| is_quick(p.0)) {
        let scene = kind.generate(kind.default_size()).expect("a valid size");
        let found = spd_rays(&scene, Rules::Havran);
        let name = kind.name();
        assert_close(found.primary.hits, due.primary.hits, 1e-4, &format!("{name}, primary hits"));
        let check = |found: RayTally, due: RayTally, rays: f64, hits: f64, what: &str| {
            assert_close(found.rays, due.rays, rays, &format!("{name}, {what} rays"));
            assert_close(found.hits, due.hits, hits, &format!("{name}, {what} hits"));
        };
        // How shadow rays from within flat glass were counted is not known: with one rule 21 % fewer hit something,
        // with the other 15 % more.
        let shadow_hits = if kind == SpdKind::Gears { 0.21 } else { 0.14 };
        check(found.shadow, due.shadow, 0.02, shadow_hits, "shadow");
        check(found.secondary, due.secondary, 0.03, 0.06, "secondary");
        if kind == SpdKind::Gears {
            let other = spd_rays(&scene, Rules::Readme).shadow.hits;
            assert!(found.shadow.hits < due.shadow.hits && due.shadow.hits < other, "{name}: {found:?}, {other}");
        }
    }
}

#[test]
fn a_uniform_grid_tests_and_steps_as_often_as_published() {
    // Flat gears meet fewer cells here than there; balls and tree take long.
    let quick = [SpdKind::Lattice, SpdKind::Mount, SpdKind::Teapot, SpdKind::Tetra];
    for (kind, cells, [tests, steps]) in published::GRID.into_iter().filter(|g| quick.contains(&g.0) && is_quick(g.0)) {
        let scene = kind.generate(kind.default_size()).expect("a valid size");
        let solids = Solids::new(&scene);
        let config = GridConfig { resolution: Resolution::Cells(cells), ..GridConfig::default() };
        let grid = BoxGrid::build(solids.boxes(), &config).expect("few objects");
        let (rays, walk) =
            Tracer::new(&scene, &solids, &grid, Rules::Havran, (PIXELS, RaySet::All)).trace::<WalkCounts>();
        let a_ray = |count: u64| count as f64 / rays.all().rays as f64;
        for (found, due, what) in [(a_ray(walk.tests), tests, "tests"), (a_ray(walk.steps), steps, "steps")] {
            assert!((found / due - 1.0).abs() < 0.06, "{}: {found:.2} {what} a ray, published are {due}", kind.name());
        }
    }
}

/// A small version of each database.
fn small() -> impl Iterator<Item = SpdScene> {
    let size = |kind| match kind {
        SpdKind::Mount => 4,
        SpdKind::Tetra | SpdKind::Lattice => 3,
        SpdKind::Tree | SpdKind::Teapot => 5,
        _ => 2,
    };
    SpdKind::ALL.into_iter().map(move |kind| kind.generate(size(kind)).expect("a valid size"))
}

/// Triangles that a small version is cut into.
const TRIANGLES: usize = 40_000;

/// All parts in one mesh.
fn mesh(scene: &Scene) -> Mesh {
    let mut mesh = Mesh::default();
    for &instance in &scene.instances {
        let (part, first) = (scene.part(instance), mesh.positions.len() as u32);
        mesh.positions.extend(&part.positions);
        mesh.indices.extend(part.triangles.iter().map(|t| t.map(|i| first + i)));
    }
    mesh
}

/// Rays from the eye over the whole picture, in the database's axes.
fn eye_rays(scene: &SpdScene, solids: &Solids, side: u32) -> Vec<Ray> {
    let walker = Naive::new(solids.boxes());
    let tracer = Tracer::new(scene, solids, &walker, Rules::Readme, (side, RaySet::Primary));
    (0..=side).flat_map(|y| (0..=side).map(move |x| (x, y))).map(|(x, y)| tracer.eye_ray(x, y)).collect()
}

fn to_y_up(scene: &SpdScene, ray: &Ray) -> Ray {
    let turn = |v: Vec3| scene.to_y_up(v.as_dvec3()).as_vec3();
    Ray { origin: turn(ray.origin), dir: turn(ray.dir), ..*ray }
}

fn build(kind: AccelKind, mesh: &Mesh) -> AnyAccel {
    AccelSpec::new(kind).build(&mesh.prims()).expect("the mesh builds")
}

#[test]
fn triangles_lie_where_the_primitives_do() {
    for scene in small() {
        let name = scene.kind.name();
        let solids = Solids::new(&scene);
        let mesh = mesh(&scene.tessellate_within(TRIANGLES));
        assert!(mesh.indices.len() <= TRIANGLES, "{name}: {} triangles", mesh.indices.len());
        let error = scene.chord_error(TRIANGLES) + 1e-5;
        let rays = eye_rays(&scene, &solids, if cfg!(debug_assertions) { 16 } else { 40 });
        let turned: Vec<_> = rays.iter().map(|r| to_y_up(&scene, r)).collect();
        let found = closest(&build(AccelKind::Bvh2, &mesh), &mesh.prims(), &turned, SimdLevel::Scalar);
        let (mut compared, mut differ) = (0, 0);
        for (ray, found) in rays.iter().zip(&found) {
            let due = solids.closest(&SolidRay::from(ray)).map(|(_, hit)| hit);
            compared += usize::from(due.is_some() || found.is_some());
            differ += usize::from(match (due, found) {
                (None, None) => false,
                (Some(due), Some(found)) => {
                    let slope = due.n_geom.dot(ray.dir.as_dvec3()).abs().max(0.05);
                    (f64::from(found.t) - due.t).abs() > error / slope
                }
                _ => true,
            });
        }
        assert!(compared > 20, "{name}: {compared} rays hit");
        // Outlines of round objects, and what shows between them.
        assert!(differ * 25 <= compared, "{name}: {differ} of {compared} rays differ by more than {error}");
    }
}

#[test]
fn triangles_face_as_the_primitives_do() {
    for scene in small() {
        let tessellated = scene.tessellate_within(TRIANGLES);
        for &instance in &tessellated.instances {
            let part = tessellated.part(instance);
            assert_eq!(part.normals.len(), part.positions.len());
            for triangle in &part.triangles {
                let [a, b, c] = triangle.map(|i| part.positions[i as usize]);
                let face = (b - a).cross(c - a);
                for i in *triangle {
                    let normal = part.normals[i as usize];
                    assert!((normal.length() - 1.0).abs() < 1e-5, "{}: {normal}", scene.kind.name());
                    // Patches of the teapot turn sharply at its rim and lid.
                    let least = if scene.kind == SpdKind::Teapot { -0.5 } else { 0.0 };
                    assert!(normal.dot(face) > least * face.length(), "{}: {normal} {face}", scene.kind.name());
                }
            }
        }
    }
}

#[test]
fn every_structure_answers_like_list_on_every_database() {
    for scene in small() {
        let name = scene.kind.name();
        let solids = Solids::new(&scene);
        let mesh = mesh(&scene.tessellate_within(if cfg!(debug_assertions) { 4000 } else { 20_000 }));
        let prims = mesh.prims();
        let eye = eye_rays(&scene, &solids, if cfg!(debug_assertions) { 6 } else { 20 });
        let mut rays: Vec<_> = eye.iter().map(|r| to_y_up(&scene, r)).collect();
        let level = SimdLevel::best();
        let list = build(AccelKind::List, &mesh);
        let first = closest(&list, &prims, &rays, level);
        // Rays from where the first ones ended towards the first light.
        let light = scene.to_y_up(scene.lights[0]).as_vec3();
        let onward = rays.iter().zip(&first).filter_map(|(ray, hit)| Some((ray, hit.as_ref()?)));
        let onward: Vec<_> = onward.map(|(ray, hit)| Ray::new(ray.at(hit.t), light - ray.at(hit.t))).collect();
        rays.extend(onward);
        let (hits, blocked) = (closest(&list, &prims, &rays, level), occluded(&list, &prims, &rays, level));
        for &kind in AccelKind::ALL.iter().filter(|&&k| k != AccelKind::List) {
            let accel = build(kind, &mesh);
            assert_eq!(closest(&accel, &prims, &rays, level), hits, "{name}: {kind}");
            assert_eq!(occluded(&accel, &prims, &rays, level), blocked, "{name}: {kind}");
            assert_eq!(in_packets(&accel, &prims, &rays, level), (hits.clone(), blocked.clone()), "{name}: {kind}");
        }
    }
}

#[test]
fn scenes_for_the_renderer_have_materials_a_camera_and_lights() {
    for scene in small() {
        let made = scene.tessellate_within(TRIANGLES);
        let name = scene.kind.name();
        assert_eq!((made.cameras.len(), made.lights.len()), (1, scene.lights.len()), "{name}");
        assert_eq!(made.materials.len(), scene.surfaces.len(), "{name}");
        assert_eq!(made.instances.len(), scene.surfaces.len(), "{name}");
        assert!(made.instances.iter().all(|&i| !made.part(i).triangles.is_empty()), "{name}");
        let mesh = mesh(&made);
        assert!(mesh.positions.iter().all(|p| p.is_finite()), "{name}");
        assert!(mesh.indices.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()), "{name}");
    }
}
