//! The figure's mesh as it goes into the file: charts, weights, and textures baked from the solid.

use glam::DVec3;

use super::{
    body::Body,
    paint,
    rig::{ARM_DIR, JOINTS, mirror},
    weights::{self, Influence},
};
use crate::scenes::{
    atlas::{self, PartFrame},
    bake::{self, Place, Source},
    glb::Glb,
    nets::Surface,
    sdf,
};

const COLOR_TEXELS: usize = 1024;
const DETAIL_TEXELS: usize = 512;

/// Body part of each joint: torso, head, then arm, hand, leg and foot of both sides.
const PART_OF_JOINT: [usize; JOINTS.len()] = [0, 0, 0, 1, 1, 0, 2, 2, 4, 4, 6, 6, 8, 8, 0, 3, 3, 5, 5, 7, 7, 9, 9];

fn part_frames() -> Vec<PartFrame> {
    let straight = [DVec3::X, DVec3::Y, DVec3::Z];
    let left = [ARM_DIR, DVec3::Z.cross(ARM_DIR), DVec3::Z];
    let right = [-mirror(ARM_DIR), DVec3::Z.cross(-mirror(ARM_DIR)), DVec3::Z];
    let frame = |axes: [DVec3; 3], importance: f64| PartFrame { axes, importance };
    vec![
        frame(straight, 1.0),
        frame(straight, 1.75),
        frame(left, 1.0),
        frame(right, 1.0),
        frame(left, 1.2),
        frame(right, 1.2),
        frame(straight, 0.8),
        frame(straight, 0.8),
        frame(straight, 1.3),
        frame(straight, 1.3),
    ]
}

/// The part in which each triangle's weights are greatest.
fn parts(surface: &Surface, influences: &[Influence]) -> Vec<usize> {
    let part = |corners: &[u32; 3]| {
        let mut sums = [0.0; 10];
        for influence in corners.iter().map(|&c| &influences[c as usize]) {
            for (&joint, weight) in influence.joints.iter().zip(influence.weights) {
                sums[PART_OF_JOINT[joint as usize]] += weight;
            }
        }
        (0..10).max_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0)
    };
    surface.triangles.iter().map(part).collect()
}

/// Adds the skinned mesh with its material; returns its number.
pub fn add(glb: &mut Glb, body: &Body, surface: &Surface) -> usize {
    let field = |p: DVec3| body.distance(p);
    let influences = weights::bind(surface);
    let unwrapped = atlas::unwrap(surface, &parts(surface, &influences), &part_frames(), DETAIL_TEXELS as f64, 3.0);
    let place = |(&source, &u_dir): (&u32, &DVec3)| {
        let position = surface.positions[source as usize];
        let normal = sdf::normal(&field, position, 3e-3);
        Place { position, normal, tangent: (u_dir - normal * normal.dot(u_dir)).normalize_or(DVec3::X) }
    };
    let places: Vec<Place> = unwrapped.source.iter().zip(&unwrapped.u_dir).map(place).collect();
    let source = Source { places: &places, tex_coords: &unwrapped.tex_coords, triangles: &unwrapped.triangles };
    let material = material(glb, body, &source);
    let bound = unwrapped.source.iter().map(|&s| influences[s as usize]);
    let (joints, weights): (Vec<[u8; 4]>, Vec<[f64; 4]>) = bound.map(|i| (i.joints, i.weights)).unzip();
    let vectors = |f: fn(&Place) -> DVec3| places.iter().map(f).collect::<Vec<DVec3>>();
    let tangents: Vec<[f64; 4]> = places.iter().map(|p| p.tangent.extend(1.0).to_array()).collect();
    let attributes = [
        ("POSITION", glb.positions(&vectors(|p| p.position))),
        ("NORMAL", glb.vectors(&vectors(|p| p.normal))),
        ("TANGENT", glb.quads(&tangents)),
        ("TEXCOORD_0", glb.tex_coords(&unwrapped.tex_coords)),
        ("JOINTS_0", glb.bytes4(&joints, false)),
        ("WEIGHTS_0", glb.quads(&weights)),
    ];
    let indices = glb.triangles(&unwrapped.triangles);
    glb.mesh("figure", &attributes, indices, material)
}

fn material(glb: &mut Glb, body: &Body, source: &Source<'_>) -> usize {
    let field = |p: DVec3| body.distance(p);
    let color =
        bake::bake(source, COLOR_TEXELS, [128; 3], |place| bake::bytes(paint::finish(body, place.position).color));
    let surface = bake::bake(source, DETAIL_TEXELS, [255, 160, 0], |place| {
        let p = sdf::project(&field, place.position, 1);
        let roughness = paint::finish(body, p).roughness;
        bake::bytes(DVec3::new(openness(&field, p, place.normal), roughness, 0.0))
    });
    let normals = bake::bake(source, DETAIL_TEXELS, [128, 128, 255], |place| {
        let p = sdf::project(&field, place.position, 1);
        bake::normal_texel(place, detailed_normal(body, p))
    });
    let color = glb.texture("figure color", &color);
    let surface = glb.texture("figure occlusion roughness", &surface);
    let normals = glb.texture("figure normal", &normals);
    glb.material(&format!(
        "\"name\":\"figure\",\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":{color}}},\
         \"metallicRoughnessTexture\":{{\"index\":{surface}}},\"metallicFactor\":0}},\
         \"occlusionTexture\":{{\"index\":{surface}}},\"normalTexture\":{{\"index\":{normals}}}"
    ))
}

/// The normal of the solid with its relief.
fn detailed_normal(body: &Body, p: DVec3) -> DVec3 {
    let smooth = sdf::normal(&|q| body.distance(q), p, 1.2e-3);
    let h = 1.0e-3;
    let stuff = paint::stuff(body, p);
    let slope = |axis: DVec3| (paint::relief(stuff, p + axis * h) - paint::relief(stuff, p - axis * h)) / (2.0 * h);
    let gradient = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
    let gradient = gradient - smooth * smooth.dot(gradient);
    let limit = (0.8 / gradient.length().max(1e-9)).min(1.0);
    (smooth - gradient * limit).normalize()
}

/// How open the space in front of the surface is, 1 for nothing near: the deficit of the distance field along
/// the normal (A. Evans, "Fast approximations for global illumination on dynamic scenes", 2006).
fn openness(field: &impl Fn(DVec3) -> f64, p: DVec3, n: DVec3) -> f64 {
    let mut hidden = 0.0;
    let mut weight = 1.0;
    for step in 1..=5 {
        let reach = 0.014 * f64::from(step);
        hidden += weight * (reach - field(p + n * reach)).max(0.0) / reach;
        weight *= 0.75;
    }
    (1.0 - 0.40 * hidden).clamp(0.15, 1.0)
}
