//! `cloth`: a patterned cloth between two bars. Three morph targets run waves over it and fill it with wind;
//! a column of joints twists it to one side and the other.

use glam::{DQuat, DVec2, DVec3};

use super::{
    glb::{Animation, Glb, Keys, Node},
    maths::{about, cos_turns, deg, fractal, sin_turns, smoothstep},
    png::Picture,
    shape::{Shape, beveled_box},
};

const WIDTH: f64 = 1.30;
const HEIGHT: f64 = 1.62;
const TOP: f64 = 1.98;
const COLUMNS: usize = 66;
const ROWS: usize = 78;
const JOINTS: usize = 10;
const DURATION: f64 = 4.0;
const KEYS: usize = 96;
/// Turns of the lower bar at the height of the twist.
const TWIST: f64 = 0.62;

/// The file.
pub fn cloth() -> Vec<u8> {
    let mut glb = Glb::default();
    let mut animation = Animation::default();
    let times: Vec<f64> = (0..=KEYS).map(|k| DURATION * k as f64 / KEYS as f64).collect();
    let input = glb.scalars(&times);
    let joints = column(&mut glb, &mut animation, input);
    let mesh = cloth_mesh(&mut glb);
    let binds: Vec<DVec3> = (0..JOINTS).map(|j| DVec3::Y * -rest_height(j)).collect();
    let binds = glb.translation_matrices(&binds);
    let skin = Some(glb.skin("cloth", &joints, binds));
    let node = glb.node(Node { name: "cloth".into(), mesh: Some(mesh), skin, ..Node::default() });
    let weights: Vec<f64> = (0..=KEYS).flat_map(|k| morph_weights((k % KEYS) as f64 / KEYS as f64)).collect();
    let output = glb.scalars(&weights);
    let sampler = animation.sampler(Keys::Linear, input, output);
    animation.channel(sampler, node, "weights");
    let frame = frame(&mut glb);
    lower_bar(&mut glb, joints[JOINTS - 1]);
    let camera = glb.camera("three-quarter", DVec3::new(1.9, 1.45, 4.1), DVec3::new(0.0, 0.98, 0.0), deg(33.0));
    let column = glb.node(Node { name: "column".into(), children: joints, ..Node::default() });
    glb.animation("twist and waves", &animation);
    glb.finish(&[column, node, frame, camera])
}

/// Height of joint `j` before anything moves; the first is at the upper bar.
fn rest_height(j: usize) -> f64 {
    TOP - HEIGHT * j as f64 / (JOINTS - 1) as f64
}

/// The joints, side by side: each is placed by the twist alone.
fn column(glb: &mut Glb, animation: &mut Animation, input: usize) -> Vec<usize> {
    let mut nodes = Vec::new();
    for j in 0..JOINTS {
        let poses: Vec<(DVec3, DQuat, DVec3)> =
            (0..=KEYS).map(|k| joint_pose(j, (k % KEYS) as f64 / KEYS as f64)).collect();
        let (place, turn, scale) = poses[0];
        let node = glb.node(Node {
            name: format!("joint {j}"),
            translation: place,
            rotation: Some(turn),
            scale: Some(scale),
            ..Node::default()
        });
        let tracks = [
            ("translation", glb.vectors(&poses.iter().map(|p| p.0).collect::<Vec<_>>())),
            ("rotation", glb.rotations(&poses.iter().map(|p| p.1).collect::<Vec<_>>())),
            ("scale", glb.vectors(&poses.iter().map(|p| p.2).collect::<Vec<_>>())),
        ];
        for (path, output) in tracks {
            let sampler = animation.sampler(Keys::Linear, input, output);
            animation.channel(sampler, node, path);
        }
        nodes.push(node);
    }
    nodes
}

/// Place, rotation and scale of joint `j` at `phase` of the clip.
fn joint_pose(j: usize, phase: f64) -> (DVec3, DQuat, DVec3) {
    let down = j as f64 / (JOINTS - 1) as f64;
    let swing = sin_turns(phase);
    // The lower end follows a little late, so the twist runs down the cloth.
    let lagged = sin_turns(phase - 0.05 * down);
    let turn = TWIST * lagged * down;
    let tight = lagged * lagged;
    let narrow = 1.0 - 0.30 * tight * 4.0 * down * (1.0 - down);
    let shorter = 1.0 - 0.075 * swing * swing;
    let sway = DVec3::new(0.0, 0.0, 0.05 * down * down * sin_turns(2.0 * phase - 0.2));
    let place = DVec3::Y * (TOP - HEIGHT * down * shorter) + sway;
    (place, about(DVec3::Y, turn * std::f64::consts::TAU), DVec3::new(narrow, 1.0, 1.0))
}

/// Weights of the two halves of a running wave, and of the wind.
fn morph_weights(phase: f64) -> [f64; 3] {
    let calm = 1.0 - 0.45 * sin_turns(phase) * sin_turns(phase);
    [calm * cos_turns(3.0 * phase), calm * sin_turns(3.0 * phase), 0.55 + 0.45 * cos_turns(2.0 * phase - 0.1)]
}

/// Displacement out of the cloth for each target; `u` and `v` in [0, 1] from the upper left corner.
fn displacement(target: usize, u: f64, v: f64) -> f64 {
    let free = smoothstep(0.0, 0.25, v) * (1.0 - smoothstep(0.80, 1.0, v));
    let wave = 1.5 * v + 0.55 * sin_turns(0.5 * u + 0.1) + 0.8 * u;
    match target {
        0 => 0.062 * free * cos_turns(wave),
        1 => 0.062 * free * sin_turns(wave),
        _ => 0.30 * sin_turns(0.5 * v) * sin_turns(0.5 * u),
    }
}

fn cloth_mesh(glb: &mut Glb) -> usize {
    let mut sheet = Shape::default();
    // v runs down, so the sheet is laid out from right to left to face +Z.
    sheet.sheet(COLUMNS, ROWS, |u, v| (DVec3::new(WIDTH * (0.5 - u), TOP - HEIGHT * v, 0.0), DVec3::Z));
    let place = |t: &DVec2| DVec2::new(1.0 - t.x, t.y);
    sheet.tex_coords = sheet.tex_coords.iter().map(place).collect();
    let (mut joints, mut weights) = (Vec::new(), Vec::new());
    for t in &sheet.tex_coords {
        let along = t.y * (JOINTS - 1) as f64;
        let upper = along.floor().min((JOINTS - 2) as f64);
        let share = ((along - upper) * 255.0).round() as u8;
        joints.push([upper as u8, upper as u8 + 1, 0, 0]);
        weights.push([255 - share, share, 0, 0]);
    }
    for (j, w) in joints.iter_mut().zip(&weights) {
        for i in 0..4 {
            j[i] = if w[i] == 0 { 0 } else { j[i] };
        }
    }
    let targets: Vec<Vec<(&str, usize)>> = (0..3).map(|target| morph_target(glb, &sheet, target)).collect();
    let attributes = [
        ("POSITION", glb.positions(&sheet.positions)),
        ("NORMAL", glb.vectors(&sheet.normals)),
        ("TEXCOORD_0", glb.tex_coords(&sheet.tex_coords)),
        ("JOINTS_0", glb.bytes4(&joints, false)),
        ("WEIGHTS_0", glb.bytes4(&weights, true)),
    ];
    let indices = glb.triangles(&sheet.triangles);
    let pattern = glb.texture("pattern", &pattern());
    let material = glb.material(&format!(
        "\"name\":\"cloth\",\"doubleSided\":true,\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":{pattern}}},\
         \"metallicFactor\":0,\"roughnessFactor\":0.72}}"
    ));
    glb.morph_mesh("cloth", &attributes, indices, material, &targets)
}

/// Positions and normals of one target. The sheet is a height field, so displaced normals, before they are
/// scaled to length one, are sums of the targets' slopes.
fn morph_target(glb: &mut Glb, sheet: &Shape, target: usize) -> Vec<(&'static str, usize)> {
    let h = 1e-4;
    let slope = |t: &DVec2| {
        let across = displacement(target, t.x + h, t.y) - displacement(target, t.x - h, t.y);
        let down = displacement(target, t.x, t.y + h) - displacement(target, t.x, t.y - h);
        DVec3::new(-across / (2.0 * h * WIDTH), down / (2.0 * h * HEIGHT), 0.0)
    };
    let positions: Vec<DVec3> = sheet.tex_coords.iter().map(|t| DVec3::Z * displacement(target, t.x, t.y)).collect();
    let normals: Vec<DVec3> = sheet.tex_coords.iter().map(slope).collect();
    vec![("POSITION", glb.positions(&positions)), ("NORMAL", glb.vectors(&normals))]
}

const RED: DVec3 = DVec3::new(0.62, 0.13, 0.14);
const CREAM: DVec3 = DVec3::new(0.93, 0.87, 0.74);
const BLUE: DVec3 = DVec3::new(0.10, 0.24, 0.38);
const GOLD: DVec3 = DVec3::new(0.86, 0.60, 0.20);

/// A woven rug: a border of triangles round a field of stepped diamonds.
fn pattern() -> Picture {
    let (columns, rows) = (80i64, 100i64);
    let knot = |texel: usize| i64::try_from(texel / 6).unwrap_or(0);
    Picture::from_fn(480, 600, |x, y| {
        // Six texels make one knot; everything is drawn in whole knots.
        let (i, j) = (knot(x), knot(y));
        let edge = i.min(j).min(columns - 1 - i).min(rows - 1 - j);
        let color = match edge {
            0 | 1 | 10 => BLUE,
            2 | 9 => GOLD,
            3..=8 => border(if i.min(columns - 1 - i) == edge { j } else { i }, edge - 3),
            _ => field(2 * i - columns + 1, 2 * j - rows + 1),
        };
        let thread = if (x + y) % 2 == 0 { 1.0 } else { 0.955 };
        let faded = 0.93 + 0.12 * (fractal(DVec3::new(i as f64 * 0.11, j as f64 * 0.11, 5.0)) * 8.0).round() / 8.0;
        (color * thread * faded).to_array().map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8)
    })
}

/// Triangles along the edge, six knots wide.
fn border(along: i64, depth: i64) -> DVec3 {
    let tooth = (along.rem_euclid(12) - 6).abs();
    if tooth > depth { CREAM } else { RED }
}

/// Diamonds in stepped rings, by twice the distance in knots from the middle.
fn field(i: i64, j: i64) -> DVec3 {
    let cell = |v: i64, size: i64| (v + size).rem_euclid(2 * size) - size;
    let (a, b) = (cell(i, 28), cell(j, 40));
    let ring = a.abs() * 10 + b.abs() * 7;
    match ring {
        0..45 => GOLD,
        45..90 | 235..262 => RED,
        90..125 | 205..235 => CREAM,
        125..205 => BLUE,
        _ if (i.rem_euclid(8) < 4) == (j.rem_euclid(8) < 4) => RED * 0.82,
        _ => RED,
    }
}

/// A bar along x with knobs at its ends.
fn bar(half_length: f64, radius: f64) -> Shape {
    let mut profile = Vec::new();
    let knob = 1.9 * radius;
    let ball = |turn: f64| DVec2::new(cos_turns(turn), sin_turns(turn));
    for (side, from) in [(-1.0, -0.25), (1.0, -0.13)] {
        for step in 0..=10 {
            let n = ball(from + 0.38 * f64::from(step) / 10.0);
            profile.push((knob * n.x, side * (half_length + knob) + knob * n.y, n));
        }
        if side < 0.0 {
            profile.extend([(radius, -half_length, DVec2::X), (radius, half_length, DVec2::X)]);
        }
    }
    let mut shape = Shape::default();
    shape.turned(20, &profile);
    // Lay it down: y becomes x.
    let lay = |v: &DVec3| DVec3::new(v.y, -v.x, v.z);
    shape.positions = shape.positions.iter().map(lay).collect();
    shape.normals = shape.normals.iter().map(lay).collect();
    shape
}

fn wood(glb: &mut Glb, name: &str, color: &str) -> usize {
    glb.material(&format!(
        "\"name\":\"{name}\",\"pbrMetallicRoughness\":{{\"baseColorFactor\":[{color},1],\"metallicFactor\":0,\
         \"roughnessFactor\":0.45}}"
    ))
}

/// The stand: two posts, the upper bar, a round foot.
fn frame(glb: &mut Glb) -> usize {
    let mut shape = bar(0.80, 0.020);
    shape.positions.iter_mut().for_each(|p| p.y += TOP);
    for side in [-1.0, 1.0] {
        let mut post = beveled_box(DVec3::new(0.022, 0.5 * TOP + 0.01, 0.022), 0.006);
        post.positions.iter_mut().for_each(|p| *p += DVec3::new(side * 0.76, 0.5 * TOP, 0.0));
        shape.append(&post);
    }
    let mut foot = Shape::default();
    let mut profile = vec![(1.02, -0.08, DVec2::X), (1.04, -0.07, DVec2::X)];
    for step in 0..=6 {
        let quarter = f64::from(step) / 24.0;
        let n = DVec2::new(cos_turns(quarter), sin_turns(quarter));
        profile.push((1.02 + 0.02 * n.x, -0.02 + 0.02 * n.y, n));
    }
    profile.push((0.0, 0.0, DVec2::Y));
    foot.turned(96, &profile);
    let light = wood(glb, "foot", "0.36,0.34,0.31");
    let dark = wood(glb, "frame", "0.16,0.08,0.04");
    let foot = foot.write(glb, "foot", light);
    let foot = glb.node(Node { name: "foot".into(), mesh: Some(foot), ..Node::default() });
    let mesh = shape.write(glb, "frame", dark);
    glb.node(Node { name: "frame".into(), mesh: Some(mesh), children: vec![foot], ..Node::default() })
}

/// The bar in the cloth's lower edge turns with the last joint.
fn lower_bar(glb: &mut Glb, joint: usize) {
    let dark = wood(glb, "bar", "0.16,0.08,0.04");
    let mesh = bar(0.5 * WIDTH, 0.014).write(glb, "lower bar", dark);
    let node = glb.node(Node { name: "lower bar".into(), mesh: Some(mesh), ..Node::default() });
    glb.adopt(joint, node);
}
