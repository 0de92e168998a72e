//! The stage under the figure: a round plinth and, let into it, a belt of slats that runs back under the feet.
//!
//! The belt's slats go round a flat loop whose length is what the feet cover in the whole clip, so each slat
//! ends where it began.

use glam::{DQuat, DVec2, DVec3};

use super::gait;
use crate::scenes::{
    glb::{Animation, Glb, Keys, Node},
    maths::{about, cos_turns, fractal, sin_turns},
    png::Picture,
    shape::{Shape, beveled_box},
};

const RADIUS: f64 = 0.92;
const THICKNESS: f64 = 0.13;
const BEVEL: f64 = 0.022;
const SLATS: usize = 20;
/// Half the width of the belt, half the thickness of a slat, and the gap between slats.
const BELT_HALF_WIDTH: f64 = 0.24;
const SLAT_HALF_HEIGHT: f64 = 0.008;
const SLAT_GAP: f64 = 0.006;
/// Length of the straight upper run.
const RUN: f64 = 0.89;
const KEYS: usize = 120;

/// Length of the belt for a clip of `duration` seconds.
fn belt_length(duration: f64) -> f64 {
    gait::STRIDE * duration / gait::CYCLE
}

/// Radius of the ends of the loop.
fn roller_radius(length: f64) -> f64 {
    (length - 2.0 * RUN) / std::f64::consts::TAU
}

/// Adds plinth, belt and the belt's channels; returns the root nodes.
pub fn add(glb: &mut Glb, animation: &mut Animation, duration: f64) -> Vec<usize> {
    let top = glb.texture("stage", &top_picture());
    let stone = glb.material(&format!(
        "\"name\":\"stage\",\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":{top}}},\
         \"metallicFactor\":0,\"roughnessFactor\":0.55}}"
    ));
    let shapes = plinth(roller_radius(belt_length(duration)));
    let mesh = shapes.write(glb, "stage", stone);
    let mut roots = vec![glb.node(Node { name: "stage".into(), mesh: Some(mesh), ..Node::default() })];
    roots.extend(belt(glb, animation, duration));
    roots
}

fn belt(glb: &mut Glb, animation: &mut Animation, duration: f64) -> Vec<usize> {
    let length = belt_length(duration);
    let pitch = length / SLATS as f64;
    let half = DVec3::new(BELT_HALF_WIDTH, SLAT_HALF_HEIGHT, 0.5 * (pitch - SLAT_GAP));
    let slat = beveled_box(half, 0.004);
    let meshes = [("slat dark", "0.030,0.032,0.036"), ("slat light", "0.062,0.066,0.073")].map(|(name, color)| {
        let material = glb.material(&format!(
            "\"name\":\"{name}\",\"pbrMetallicRoughness\":{{\"baseColorFactor\":[{color},1],\"metallicFactor\":0,\
             \"roughnessFactor\":0.7}}"
        ));
        slat.write(glb, name, material)
    });
    let times: Vec<f64> = (0..=KEYS).map(|k| duration * k as f64 / KEYS as f64).collect();
    let input = glb.scalars(&times);
    let mut nodes = Vec::new();
    for number in 0..SLATS {
        let start = (number as f64 + 0.5) * pitch;
        let place = |k: usize| on_loop(start + length * (k % KEYS) as f64 / KEYS as f64, length);
        let (places, turns): (Vec<DVec3>, Vec<DQuat>) = (0..=KEYS).map(place).unzip();
        let node = Node {
            name: format!("slat {number}"),
            translation: places[0],
            rotation: Some(turns[0]),
            mesh: Some(meshes[number % 2]),
            ..Node::default()
        };
        let node = glb.node(node);
        let output = glb.vectors(&places);
        let sampler = animation.sampler(Keys::Linear, input, output);
        animation.channel(sampler, node, "translation");
        let output = glb.rotations(&turns);
        let sampler = animation.sampler(Keys::Linear, input, output);
        animation.channel(sampler, node, "rotation");
        nodes.push(node);
    }
    nodes
}

/// Place and rotation of a slat `s` metres along the loop, which runs back along the top from its front end.
fn on_loop(s: f64, length: f64) -> (DVec3, DQuat) {
    let radius = roller_radius(length);
    let s = s - (s / length).floor() * length;
    let arc = std::f64::consts::PI * radius;
    let at = |y: f64, z: f64| DVec3::new(0.0, y - radius - SLAT_HALF_HEIGHT, z);
    let turned = |half_turns: f64| about(DVec3::X, -std::f64::consts::PI * half_turns);
    if s < RUN {
        (at(radius, 0.5 * RUN - s), turned(0.0))
    } else if s < RUN + arc {
        let h = (s - RUN) / arc;
        (at(radius * cos_turns(0.5 * h), -0.5 * RUN - radius * sin_turns(0.5 * h)), turned(h))
    } else if s < 2.0 * RUN + arc {
        (at(-radius, s - RUN - arc - 0.5 * RUN), turned(1.0))
    } else {
        let h = (s - 2.0 * RUN - arc) / arc;
        (at(-radius * cos_turns(0.5 * h), 0.5 * RUN + radius * sin_turns(0.5 * h)), turned(1.0 + h))
    }
}

/// The disc with its slot; texture coordinates map the square around the disc.
fn plinth(roller: f64) -> Shape {
    let mut shape = Shape::default();
    let slot = DVec2::new(BELT_HALF_WIDTH + 0.006, 0.5 * RUN + roller + 2.0 * SLAT_HALF_HEIGHT + 0.004);
    let map = |p: DVec3| DVec2::new(0.5 + 0.5 * p.x / RADIUS, 0.5 + 0.5 * p.z / RADIUS);
    let rim = RADIUS - BEVEL;
    let outline: Vec<(DVec3, DVec3)> = directions(slot)
        .into_iter()
        .map(|d| {
            let inner = d * (slot.x / d.x.abs()).min(slot.y / d.y.abs());
            (DVec3::new(inner.x, 0.0, inner.y), DVec3::new(d.x, 0.0, d.y) * rim)
        })
        .collect();
    for (k, &(inner, outer)) in outline.iter().enumerate() {
        let (next_inner, next_outer) = outline[(k + 1) % outline.len()];
        shape.face([inner, outer, next_outer, next_inner], map);
        let down = DVec3::Y * THICKNESS;
        shape.face([inner, next_inner, next_inner - down, inner - down], map);
    }
    let floor = |x: f64, z: f64| DVec3::new(x * slot.x, -THICKNESS, z * slot.y);
    shape.face([floor(-1.0, 1.0), floor(1.0, 1.0), floor(1.0, -1.0), floor(-1.0, -1.0)], map);
    shape.append(&side(map));
    shape
}

/// Unit directions round the slot, counter-clockwise from above, with its corners among them.
fn directions(slot: DVec2) -> Vec<DVec2> {
    let mut all: Vec<DVec2> =
        (0..120).map(|k| DVec2::new(sin_turns(f64::from(k) / 120.0), cos_turns(f64::from(k) / 120.0))).collect();
    for (x, z) in [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)] {
        all.push(DVec2::new(x * slot.x, z * slot.y).normalize());
    }
    let angle = |d: &DVec2| libm::atan2(d.x, d.y);
    all.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    all
}

/// The rounded rim and the side of the disc.
fn side(map: impl Fn(DVec3) -> DVec2) -> Shape {
    let mut profile = vec![(RADIUS - 0.01, -THICKNESS, DVec2::X), (RADIUS, -THICKNESS + 0.01, DVec2::X)];
    for step in 0..=6 {
        let quarter = f64::from(step) / 24.0;
        let normal = DVec2::new(cos_turns(quarter), sin_turns(quarter));
        profile.push((RADIUS - BEVEL + BEVEL * normal.x, -BEVEL + BEVEL * normal.y, normal));
    }
    let mut shape = Shape::default();
    shape.turned(96, &profile);
    let tex_coords = shape.positions.iter().map(|&p| map(p)).collect();
    Shape { tex_coords, ..shape }
}

/// Pale terrazzo with a ring of inlaid marks.
fn top_picture() -> Picture {
    const SIZE: usize = 512;
    Picture::from_fn(SIZE, SIZE, |x, y| {
        let at = |i: usize| 2.0 * (i as f64 + 0.5) / SIZE as f64 - 1.0;
        let (x, y) = (at(x), at(y));
        let r = (x * x + y * y).sqrt();
        let grain = fractal(DVec3::new(x * 9.0, y * 9.0, 1.0));
        let mut color = DVec3::new(0.62, 0.63, 0.65) * (0.92 + 0.14 * grain);
        let turn = libm::atan2(x, y) / std::f64::consts::TAU;
        let tick = (turn * 60.0 - (turn * 60.0).round()).abs() / 60.0 * r * std::f64::consts::TAU;
        let major = ((turn * 12.0 - (turn * 12.0).round()).abs() * 60.0) < 1.0;
        let start = if major { 0.80 } else { 0.855 };
        if (r - 0.91).abs() < 0.006 || (r > start && r < 0.895 && tick < if major { 0.009 } else { 0.005 }) {
            color = DVec3::new(0.22, 0.42, 0.44);
        }
        color.to_array().map(|c| ((c * 64.0).round() * 4.0).clamp(0.0, 255.0) as u8)
    })
}
