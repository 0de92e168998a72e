//! `tumble`: a fountain of small solids. They shoot out of a pipe, fly, bounce and spin over a round table,
//! fall off its edge into a basin and come back up the pipe.
//!
//! Every solid lives the same life of one clip's length, each begun a little later than the last, so the
//! clip has neither beginning nor end. Flights are exact parabolas (cubic keys), and a solid meets the table
//! with the very corner that is lowest.

mod life;
mod solids;

use glam::{DVec2, DVec3};

use super::{
    glb::{Animation, Glb, Keys, Node},
    maths::{cos_turns, deg, fractal, hash, mix, sin_turns},
    png::Picture,
    shape::Shape,
};
use life::Life;

/// Number of solids, and the step in direction from one to the next in 144ths of a turn: neighbours in the
/// Fibonacci sequence, so that directions spread as evenly as a sunflower's seeds and close up after all.
const COUNT: usize = 144;
const DIRECTION_STEP: usize = 89;
/// Seconds from one solid to the same place of the next round.
pub const DURATION: f64 = 5.4;
/// Radius of the table, the basin's inner radius, the pipe's inner radius and its height.
pub const TABLE: f64 = 1.5;
const BASIN: f64 = 1.86;
const PIPE: f64 = 0.115;
pub const PIPE_HEIGHT: f64 = 0.34;
/// Depth at which solids travel back to the middle.
pub const DEPTH: f64 = 1.15;

/// The file.
pub fn tumble() -> Vec<u8> {
    let mut glb = Glb::default();
    let mut animation = Animation::default();
    let materials = PALETTE.map(|(name, color, metal, rough)| {
        glb.material(&format!(
            "\"name\":\"{name}\",\"pbrMetallicRoughness\":{{\"baseColorFactor\":[{color},1],\"metallicFactor\":{metal},\
             \"roughnessFactor\":{rough}}}"
        ))
    });
    let solids = solids::all();
    let meshes: Vec<Vec<usize>> =
        solids.iter().map(|(name, shape)| shape.write_each(&mut glb, name, &materials)).collect();
    let mut roots = vec![furniture(&mut glb)];
    for number in 0..COUNT {
        let seed = 100 * number as u64;
        let kind = (number * 5 + number / 6) % solids.len();
        let turn = (number * DIRECTION_STEP % COUNT) as f64 / COUNT as f64;
        let life = Life::new(&solids[kind].1, turn, seed);
        let tracks = life.tracks(number as f64 / COUNT as f64 * DURATION);
        let node = Node {
            name: format!("{} {number}", solids[kind].0),
            translation: tracks.places[1],
            rotation: Some(tracks.turns[0]),
            mesh: Some(meshes[kind][(hash(seed + 7) * PALETTE.len() as f64) as usize]),
            ..Node::default()
        };
        let node = glb.node(node);
        roots.push(node);
        let (input, output) = (glb.scalars(&tracks.place_times), glb.vectors(&tracks.places));
        let sampler = animation.sampler(Keys::Cubic, input, output);
        animation.channel(sampler, node, "translation");
        let (input, output) = (glb.scalars(&tracks.turn_times), glb.rotations(&tracks.turns));
        let sampler = animation.sampler(Keys::Linear, input, output);
        animation.channel(sampler, node, "rotation");
    }
    roots.push(glb.camera("above", DVec3::new(1.2, 2.25, 4.45), DVec3::new(0.0, 0.36, 0.0), deg(34.0)));
    glb.animation("fountain", &animation);
    glb.finish(&roots)
}

const PALETTE: [(&str, &str, &str, &str); 6] = [
    ("vermilion", "0.80,0.13,0.05", "0", "0.35"),
    ("saffron", "0.90,0.48,0.04", "0", "0.35"),
    ("teal", "0.02,0.28,0.30", "0", "0.30"),
    ("ivory", "0.80,0.74,0.60", "0", "0.40"),
    ("indigo", "0.06,0.09,0.33", "0", "0.30"),
    ("brass", "0.85,0.60,0.22", "1", "0.30"),
];

/// Table with pipe, and basin.
fn furniture(glb: &mut Glb) -> usize {
    let table = lathe(
        96,
        &[
            (TABLE - 0.09, -0.98),
            (TABLE - 0.09, -0.12),
            (TABLE, -0.06),
            (TABLE, -0.02),
            (TABLE - 0.02, 0.0),
            (0.46, 0.0),
            (0.40, 0.03),
            (PIPE + 0.05, PIPE_HEIGHT - 0.02),
            (PIPE + 0.035, PIPE_HEIGHT),
            (PIPE + 0.01, PIPE_HEIGHT),
            (PIPE, PIPE_HEIGHT - 0.01),
            (PIPE, -0.55),
        ],
    );
    let basin = lathe(
        96,
        &[
            (BASIN + 0.02, -1.35),
            (BASIN + 0.08, -0.12),
            (BASIN + 0.08, -0.06),
            (BASIN + 0.06, -0.04),
            (BASIN + 0.02, -0.04),
            (BASIN, -0.06),
            (BASIN - 0.10, -1.30),
            (0.0, -1.30),
        ],
    );
    let picture = glb.texture("table", &top_picture());
    let pale = glb.material(&format!(
        "\"name\":\"table\",\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":{picture}}},\
         \"metallicFactor\":0,\"roughnessFactor\":0.45}}"
    ));
    let dark = glb.material(
        "\"name\":\"basin\",\"doubleSided\":true,\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.05,0.06,0.07,1],\
         \"metallicFactor\":0,\"roughnessFactor\":0.5}",
    );
    let mesh = basin.write(glb, "basin", dark);
    let basin = glb.node(Node { name: "basin".into(), mesh: Some(mesh), ..Node::default() });
    let mesh = table.write(glb, "table", pale);
    glb.node(Node { name: "table".into(), mesh: Some(mesh), children: vec![basin], ..Node::default() })
}

/// A surface of revolution over a polygon from its outer foot; flat between corners, textured from above.
fn lathe(sides: usize, outline: &[(f64, f64)]) -> Shape {
    let mut shape = Shape::default();
    for pair in outline.windows(2) {
        let along = DVec2::new(pair[1].0 - pair[0].0, pair[1].1 - pair[0].1).normalize();
        let normal = DVec2::new(along.y, -along.x);
        let mut band = Shape::default();
        band.turned(sides, &[(pair[0].0, pair[0].1, normal), (pair[1].0, pair[1].1, normal)]);
        shape.append(&band);
    }
    // Below the rim there is only plain stone.
    let scale = |p: &DVec3| if p.y < -0.03 { 0.487 / (p.x * p.x + p.z * p.z).sqrt().max(1e-3) } else { 0.5 / TABLE };
    let map = |p: &DVec3| DVec2::splat(0.5) + DVec2::new(p.x, p.z) * scale(p);
    shape.tex_coords = shape.positions.iter().map(map).collect();
    shape
}

/// Spirals in the direction of the Fibonacci numbers, on pale stone.
fn top_picture() -> Picture {
    const SIZE: usize = 512;
    Picture::from_fn(SIZE, SIZE, |x, y| {
        let at = |i: usize| 2.0 * (i as f64 + 0.5) / SIZE as f64 - 1.0;
        let (x, y) = (at(x), at(y));
        let r = (x * x + y * y).sqrt().max(1e-3);
        let turn = libm::atan2(x, y) / std::f64::consts::TAU;
        let spiral = |arms: f64, pull: f64| {
            let s = turn * arms + pull * r;
            (s - s.round()).abs() / arms * r
        };
        let line = spiral(21.0, 3.6).min(spiral(13.0, -3.4)) < 0.0013 && r > 0.33 && r < 0.93;
        let ring = (r - 0.945).abs() < 0.006 || (r - 0.32).abs() < 0.005;
        let stone = 0.94 + 0.10 * fractal(DVec3::new(x * 7.0, y * 7.0, 2.0));
        let base = DVec3::new(0.80, 0.78, 0.74) * stone;
        let color = if ring || line { DVec3::new(0.36, 0.44, 0.46) } else { base };
        color.to_array().map(|c| ((c * 64.0).round() * 4.0).clamp(0.0, 255.0) as u8)
    })
}

/// Unit vector in the table's plane at `turn` of a full turn.
pub fn direction(turn: f64) -> DVec3 {
    DVec3::new(sin_turns(turn), 0.0, cos_turns(turn))
}

/// A number between `lo` and `hi` that follows from `seed`.
pub fn between(lo: f64, hi: f64, seed: u64) -> f64 {
    mix(lo, hi, hash(seed))
}
