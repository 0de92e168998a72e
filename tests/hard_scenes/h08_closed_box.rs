//! H8: a closed box from within, at scales from 10^-3 to 10^5, with lights inside and outside: no surface shadows itself and no
//! light passes a wall.
//!
//! Hits are decided on world-space vertices, so an instance that is scaled or sheared is a box of other vertices, no more: the
//! start of a secondary ray is found from the vertices and does not know of the matrix. The placements here hold that.

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use kinora::{
    geom::{
        Forms, Hit, Ray,
        exact::{side, slope},
    },
    glam::Vec3,
    render::{CameraView, RenderSettings},
    scene::{LightKind, LocalTransform, Material, TexSampler},
    simd::SimdLevel,
    world::World,
};

use crate::{
    fast::{self, FAST},
    meshes::{cuboid, mapped, plane, together},
    scenes::part,
    stage::{Stage, at, matte, shoot},
    trace::{Mesh, Random},
    trial::{Mistakes, count},
};

const SCALES: [f64; 9] = [1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5];

/// Part of the way to a light that must be clear, as in the renderer.
const REACH: f32 = 0.9999;

/// Half the box's size before it is placed.
const HALF: Vec3 = Vec3::new(1.0, 0.75, 1.3);

/// How the box is placed: name and world from node, scale left out.
fn placements() -> [(&'static str, DMat4); 5] {
    let turn = DQuat::from_xyzw(0.3, -0.5, 0.2, 0.7).normalize();
    let shear =
        DMat4::from_cols_array(&[1.0, 0.2, 0.0, 0.0, 0.6, 0.9, 0.3, 0.0, -0.4, 0.5, 1.2, 0.0, 0.0, 0.0, 0.0, 1.0]);
    [
        ("upright", DMat4::IDENTITY),
        ("turned", DMat4::from_quat(turn)),
        ("stretched", DMat4::from_quat(turn) * DMat4::from_scale(DVec3::new(3.0, 0.5, 1.0))),
        ("sheared", DMat4::from_quat(turn) * shear),
        ("far off", DMat4::from_translation(DVec3::new(37.0, -53.0, 71.0)) * DMat4::from_quat(turn)),
    ]
}

/// The closed box: twelve triangles, or walls of n x n squares.
fn walls(n: u32) -> Mesh {
    if n == 1 {
        return cuboid(-HALF, HALF);
    }
    let wall = |axis: usize, end: f32| {
        mapped(&plane(n), move |p| {
            let mut out = Vec3::ZERO;
            out[axis] = end * HALF[axis];
            out[(axis + 1) % 3] = p.x * HALF[(axis + 1) % 3];
            out[(axis + 2) % 3] = p.y * HALF[(axis + 2) % 3];
            out
        })
    };
    together((0..6).map(|i| wall(i / 2, if i % 2 == 0 { -1.0 } else { 1.0 })))
}

/// A white material that nothing but lights can brighten.
fn unlit_by_surroundings(stage: &mut Stage) -> Material {
    let black = stage.texture(TexSampler::default(), 1, |_, _| [0; 4]);
    Material { occlusion_texture: Some(black), double_sided: true, ..matte(Vec3::ONE) }
}

/// The box placed in a world, with a point light if one is given (in the box's own coordinates).
fn world(n: u32, world_from_box: DMat4, light: Option<Vec3>, forms: Forms) -> Arc<World> {
    let mut stage = Stage::default();
    let material = unlit_by_surroundings(&mut stage);
    let mesh = walls(n);
    let mut walls = part(mesh.positions, mesh.indices);
    walls.tex_coords = vec![vec![glam::Vec2::ZERO; walls.positions.len()]];
    let node = stage.part(walls, material, at(0.0, 0.0, 0.0));
    stage.scene.nodes[node.index()].local = LocalTransform::Matrix(world_from_box);
    if let Some(light) = light {
        let p = world_from_box.transform_point3(light.as_dvec3());
        stage.light(LightKind::Point, Vec3::ONE, 100.0, at(p.x, p.y, p.z));
    }
    stage.world_as("bvh2", forms)
}

/// What secondary rays did.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    hits: u64,
    /// Camera rays that escaped.
    escaped: u64,
    /// Rays to lights inside, and those of them that something blocked.
    inside: u64,
    acne: u64,
    /// Rays to lights outside, and those of them that nothing blocked.
    outside: u64,
    leaks: u64,
    /// Rays in any direction that met the triangle they left.
    met_own: u64,
    /// Rays in any direction that left the box.
    lost: u64,
    /// Starts that are not on the side they leave to, exactly.
    wrong_side: u64,
}

/// Rays from within at corners, edges and walls alike.
fn camera_rays(world: &World, place: &dyn Fn(Vec3) -> Vec3, random: &mut Random, len: usize) -> Vec<Ray> {
    let corners: Vec<[Vec3; 3]> = {
        let instance = kinora::geom::InstanceId(0);
        let count = world.triangle_count() as u32;
        (0..count).map(|i| world.corners(instance, kinora::geom::PrimId(i))).collect()
    };
    let ray = |i: usize| {
        let origin = place(random.vec3() * HALF * 0.8);
        let [a, b, c] = corners[random.below(corners.len())];
        let along = random.unit() * 0.5 + 0.5;
        let target = match i % 4 {
            0 => a,
            1 => a + (b - a) * along,
            2 => c + (a - c) * along,
            _ => place(random.vec3() * 10.0),
        };
        Ray::new(origin, target - origin)
    };
    (0..len).map(ray).collect()
}

/// Shoots from within, and from every hit at each light and in a random direction.
fn count_secondary(world: &World, placed: &DMat4, seed: u64, len: usize) -> Counts {
    let mut random = Random(seed);
    let place = |p: Vec3| placed.transform_point3(p.as_dvec3()).as_vec3();
    let camera = camera_rays(world, &place, &mut random, len);
    let lights =
        [Vec3::new(0.1, 0.2, -0.3), Vec3::new(-0.9, 0.6, 1.1), Vec3::new(2.5, 0.4, 0.7), Vec3::new(-0.3, -1.0, 0.2)];
    let mut counts = Counts::default();
    let mut hits: Vec<Option<Hit>> = vec![None; camera.len()];
    world.hit_all(&camera, SimdLevel::best(), &mut hits).expect("the default float mode");
    counts.escaped = hits.iter().filter(|h| h.is_none()).count() as u64;
    let found: Vec<(&Ray, Hit)> = camera.iter().zip(hits).filter_map(|(r, h)| Some((r, h?))).collect();
    counts.hits = found.len() as u64;

    for (number, light) in lights.map(place).into_iter().enumerate() {
        let is_inside = number < 2;
        let mut rays = Vec::new();
        for (camera, hit) in &found {
            let corners = world.corners(hit.instance, hit.prim);
            let towards = light - camera.at(hit.t);
            // Only what faces the light is lit, on the side that the camera sees.
            let seen = side(&corners, camera.origin);
            if slope(&corners, towards) != seen {
                continue;
            }
            let start = world.leave(hit, towards);
            counts.wrong_side += u64::from(side(&corners, start) != seen);
            rays.push(Ray { t_far: REACH, ..Ray::new(start, light - start) });
        }
        let mut blocked = vec![false; rays.len()];
        world.block_all(&rays, SimdLevel::best(), &mut blocked).expect("the default float mode");
        let stopped = blocked.iter().filter(|b| **b).count() as u64;
        if is_inside {
            counts.inside += rays.len() as u64;
            counts.acne += stopped;
        } else {
            counts.outside += rays.len() as u64;
            counts.leaks += rays.len() as u64 - stopped;
        }
    }

    let mut rays = Vec::new();
    for (camera, hit) in &found {
        let corners = world.corners(hit.instance, hit.prim);
        let seen = side(&corners, camera.origin);
        let dir = random.vec3();
        let dir = if slope(&corners, dir) == seen { dir } else { -dir };
        if slope(&corners, dir) == seen {
            rays.push((hit, Ray::new(world.leave(hit, dir), dir)));
        }
    }
    let plain: Vec<Ray> = rays.iter().map(|r| r.1).collect();
    let mut next = vec![None; plain.len()];
    world.hit_all(&plain, SimdLevel::best(), &mut next).expect("the default float mode");
    for ((from, _), next) in rays.iter().zip(next) {
        counts.lost += u64::from(next.is_none());
        counts.met_own += u64::from(next.is_some_and(|n| n.prim == from.prim));
    }
    counts
}

#[test]
fn h08_no_secondary_ray_meets_its_own_surface_or_passes_a_wall() {
    let len = count(100_000, 2_000, 60);
    let mut sum = Counts::default();
    for (number, scale) in SCALES.into_iter().enumerate() {
        for (name, placement) in placements() {
            for n in [1, 7] {
                let placed = DMat4::from_scale(DVec3::splat(scale)) * placement;
                let world = world(n, placed, None, Forms::EXACT);
                let counts = count_secondary(&world, &placed, number as u64, len);
                let Counts { escaped, acne, leaks, met_own, lost, wrong_side, .. } = counts;
                assert_eq!(
                    [escaped, acne, leaks, met_own, lost, wrong_side],
                    [0; 6],
                    "{name}, walls of {n} x {n}, scale {scale:e}: {counts:?}"
                );
                assert!(counts.inside > counts.hits && counts.outside > counts.hits / 4, "{counts:?}");
                sum.hits += counts.hits;
                sum.inside += counts.inside;
                sum.outside += counts.outside;
            }
        }
    }
    println!(
        "H8: {} hits, {} rays to lights inside, 0 blocked; {} to lights outside, 0 pass; {} any way, 0 meet their own \
         triangle or leave the box",
        sum.hits, sum.inside, sum.outside, sum.hits
    );
}

/// Pictures from within: pixels that are dark with the light inside, and lit with it outside, of how many each.
fn wrong_pixels(forms: Forms) -> [[u64; 2]; 2] {
    let side = count(256, 64, 12) as u32;
    let mut pixels = [[0_u64; 2]; 2];
    for scale in SCALES {
        for (name, placement) in placements() {
            let placed = DMat4::from_scale(DVec3::splat(scale)) * placement;
            let point = |p: Vec3| placed.transform_point3(p.as_dvec3()).as_vec3();
            let towards = [Vec3::new(1.0, 0.75, 1.3), Vec3::new(-1.0, -0.7, 0.2), Vec3::new(0.1, -0.2, -1.0)];
            for (light, lit) in [(Vec3::new(0.2, 0.3, -0.2), true), (Vec3::new(1.9, 0.5, 0.4), false)] {
                let world = world(1, placed, Some(light), forms);
                for target in towards {
                    let camera = CameraView::look_at(point(Vec3::new(-0.3, 0.1, 0.2)), point(target), Vec3::Y, 1.6);
                    let film = shoot(&world, &camera, &RenderSettings::default(), side, side);
                    let wrong = film.color.iter().filter(|c| (c[0] > 0.0) != lit).count();
                    if forms == Forms::EXACT {
                        assert_eq!(wrong, 0, "{name}, scale {scale:e}, light {light}, towards {target}");
                        assert!(film.color.iter().all(|c| c[3] == 1.0));
                    }
                    assert!(film.color.iter().flatten().all(|x| x.is_finite()));
                    let [dark, all] = &mut pixels[usize::from(!lit)];
                    (*dark, *all) = (*dark + wrong as u64, *all + u64::from(side * side));
                }
            }
        }
    }
    pixels
}

#[test]
fn h08_no_pixel_is_speckled_or_leaks() {
    let [[dark, inside], [lit, outside]] = wrong_pixels(Forms::EXACT);
    println!("H8: {inside} pixels lit from inside, {dark} dark; {outside} with the light outside, {lit} lit");
    assert_eq!([dark, lit], [0; 2]);
    let [[dark, inside], [lit, outside]] = wrong_pixels(FAST);
    println!("H8, fast: {inside} pixels lit from inside, {dark} dark; {outside} with the light outside, {lit} lit");
    let found = Mistakes { rays: inside, false_hits: dark, false_misses: lit, ..Mistakes::default() };
    fast::check("H8 pixels", "bvh2", &found);
}
