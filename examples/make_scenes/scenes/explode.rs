//! `explode`: a sphere flake bursts into shards and balls and comes together again.
//!
//! The flake (E. Haines, "A proposal for standard graphics environments", 1987) is a ball with nine smaller
//! ones on it, each with nine smaller ones again. The two coarser levels are shells that break along the
//! faces of an icosahedron; the finer balls fly whole. All of it is one skinned mesh with a joint a fragment,
//! so boxes of a tree built at rest grow without bound while it flies: refitting is not enough.

use std::collections::HashMap;

use glam::{DQuat, DVec2, DVec3};

use super::{
    glb::{Accessor, Animation, Glb, Keys, Node},
    maths::{about, cos_turns, deg, fractal, from_axes, hash, mix, sin_turns, smoothstep},
    png::Picture,
    shape::Shape,
};

const RADIUS: f64 = 0.52;
const LEVELS: usize = 3;
const DURATION: f64 = 5.0;
const KEYS: usize = 60;
/// Metres of one unit of the quantised positions.
const UNIT: f64 = 1.0 / 24000.0;
/// Different flights; fragments of one flight share their keys, each in its own direction.
const FLIGHTS: usize = 40;

/// The file.
pub fn explode() -> Vec<u8> {
    let mut flake = Flake::default();
    let up = about(DVec3::X, deg(-12.0)) * DVec3::Y;
    flake.ball(DVec3::ZERO, up, RADIUS, 0);
    let mut glb = Glb::default();
    let mut animation = Animation::default();
    let flights = flights(&mut glb, &mut animation);
    let (root, joints) = joints(&mut glb, &mut animation, &flake.fragments, &flights);
    let mesh = flake.write(&mut glb);
    let binds: Vec<(DVec3, DQuat)> = flake.fragments.iter().map(|f| (f.center, f.frame())).collect();
    let binds = glb.inverse_binds(&binds, UNIT);
    let skin = Some(glb.skin("flake", &joints, binds));
    let node = glb.node(Node { name: "flake".into(), mesh: Some(mesh), skin, ..Node::default() });
    let core = core(&mut glb);
    let floor = floor(&mut glb);
    let camera = glb.camera("front", DVec3::new(0.0, 1.00, 5.3), DVec3::new(0.0, -0.02, 0.0), deg(34.0));
    glb.animation("burst", &animation);
    glb.finish(&[root, node, core, floor, camera])
}

/// A piece that moves as a whole.
struct Fragment {
    /// Where it turns about.
    center: DVec3,
    /// Unit direction of its flight.
    dir: DVec3,
    flight: usize,
}

impl Fragment {
    /// Rotation that takes +Z to the direction of flight.
    fn frame(&self) -> DQuat {
        let helper = if self.dir.y.abs() < 0.9 { DVec3::Y } else { DVec3::X };
        let x = helper.cross(self.dir).normalize();
        from_axes(x, self.dir.cross(x), self.dir)
    }
}

/// The mesh under construction.
#[derive(Default)]
struct Flake {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
    colors: Vec<[u8; 4]>,
    joints: Vec<u16>,
    triangles: Vec<[u32; 3]>,
    fragments: Vec<Fragment>,
}

/// Outer colour of each level, and the colour of broken faces; sRGB.
const LEVEL_COLORS: [DVec3; LEVELS + 1] = [
    DVec3::new(0.12, 0.22, 0.36),
    DVec3::new(0.15, 0.50, 0.54),
    DVec3::new(0.93, 0.63, 0.24),
    DVec3::new(0.95, 0.88, 0.74),
];
const BROKEN: DVec3 = DVec3::new(0.92, 0.42, 0.20);
/// The colour inside the shells.
const INSIDE: DVec3 = DVec3::new(0.50, 0.20, 0.14);

impl Flake {
    /// A ball of `level` and everything on it; `up` points away from the ball it sits on.
    fn ball(&mut self, center: DVec3, up: DVec3, radius: f64, level: usize) {
        match level {
            0 => self.shell(center, radius, level, &split(&icosahedron()), 4),
            1 => self.shell(center, radius, level, &icosahedron(), 3),
            2 => self.whole(center, radius, level, &split(&split(&octahedron()))),
            _ => self.whole(center, radius, level, &split(&octahedron())),
        }
        if level == LEVELS {
            return;
        }
        let helper = if up.y.abs() < 0.9 { DVec3::Y } else { DVec3::X };
        let x = helper.cross(up).normalize();
        let z = x.cross(up);
        for child in 0..9u32 {
            let (turn, rise) =
                if child < 6 { (f64::from(child) / 6.0, 0.0) } else { ((f64::from(child) + 0.25) / 3.0, 0.166) };
            let (side, lift) = (cos_turns(rise), sin_turns(rise));
            let dir = x * (side * cos_turns(turn)) + z * (side * sin_turns(turn)) + up * lift;
            let small = radius / 3.0;
            self.ball(center + dir * (radius + small), dir, small, level + 1);
        }
    }

    fn fragment(&mut self, center: DVec3, out: DVec3) -> u16 {
        let seed = 31 * self.fragments.len() as u64;
        let stray = DVec3::new(hash(seed + 1) - 0.5, hash(seed + 2) - 0.5, hash(seed + 3) - 0.5);
        let from_middle = center.normalize_or(out);
        let dir = (from_middle + 0.25 * out + 0.45 * stray).normalize();
        let flight = (hash(seed + 4) * FLIGHTS as f64) as usize;
        self.fragments.push(Fragment { center, dir, flight });
        self.fragments.len() as u16 - 1
    }

    fn vertex(&mut self, position: DVec3, normal: DVec3, color: DVec3, joint: u16) -> u32 {
        let decode = |c: f64| if c <= 0.040_45 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) };
        let linear = color.to_array().map(|c| (decode(c) * 255.0).round().clamp(0.0, 255.0) as u8);
        self.positions.push(position);
        self.normals.push(normal);
        self.colors.push([linear[0], linear[1], linear[2], 255]);
        self.joints.push(joint);
        self.positions.len() as u32 - 1
    }

    /// A ball in one piece.
    fn whole(&mut self, center: DVec3, radius: f64, level: usize, sphere: &Sphere) {
        let joint = self.fragment(center, center.normalize_or(DVec3::Y));
        let first = self.positions.len() as u32;
        for &n in &sphere.points {
            self.vertex(center + n * radius, n, tinted(level, center), joint);
        }
        self.triangles.extend(sphere.triangles.iter().map(|t| t.map(|i| i + first)));
    }

    /// A hollow ball that breaks into one shard a triangle of `pieces`, each drawn with `steps` triangles a
    /// side.
    fn shell(&mut self, center: DVec3, radius: f64, level: usize, pieces: &Sphere, steps: usize) {
        for piece in &pieces.triangles {
            let corners = piece.map(|i| pieces.points[i as usize]);
            let middle = (corners[0] + corners[1] + corners[2]).normalize();
            let joint = self.fragment(center + middle * (0.9 * radius), middle);
            let color = tinted(level, center + middle * radius);
            let inner = 0.86;
            let grid = |flake: &mut Self, scale: f64, sign: f64, color: DVec3| {
                let mut rows: Vec<Vec<u32>> = Vec::new();
                for row in 0..=steps {
                    let row = (0..=steps - row).map(|column| {
                        let n = patch(corners, row, column, steps);
                        flake.vertex(center + n * (radius * scale), n * sign, color, joint)
                    });
                    rows.push(row.collect());
                }
                rows
            };
            let outside = grid(self, 1.0, 1.0, color);
            let inside = grid(self, inner, -1.0, INSIDE);
            self.fill(&outside, false);
            self.fill(&inside, true);
            for side in 0..3 {
                self.wall(center, [radius, inner * radius], [corners[side], corners[(side + 1) % 3]], steps, joint);
            }
        }
    }

    /// Triangles over rows that shrink by one vertex each.
    fn fill(&mut self, rows: &[Vec<u32>], flipped: bool) {
        for (low, high) in rows.iter().zip(&rows[1..]) {
            for i in 0..high.len() {
                let mut both = vec![[low[i], low[i + 1], high[i]]];
                if i + 1 < high.len() {
                    both.push([low[i + 1], high[i + 1], high[i]]);
                }
                self.triangles.extend(both.into_iter().map(|[a, b, c]| if flipped { [a, c, b] } else { [a, b, c] }));
            }
        }
    }

    /// The broken face of a shard between two of its corners.
    fn wall(&mut self, center: DVec3, radii: [f64; 2], [a, b]: [DVec3; 2], steps: usize, joint: u16) {
        let normal = b.cross(a).normalize();
        let mut last: Option<[u32; 2]> = None;
        for step in 0..=steps {
            let n = a.lerp(b, step as f64 / steps as f64).normalize();
            let pair = radii.map(|r| self.vertex(center + n * r, normal, BROKEN * 0.9, joint));
            if let Some([outer, inner]) = last {
                self.triangles.extend([[outer, inner, pair[1]], [outer, pair[1], pair[0]]]);
            }
            last = Some(pair);
        }
    }

    fn write(&self, glb: &mut Glb) -> usize {
        let quantised: Vec<[i16; 3]> =
            self.positions.iter().map(|p| (*p / UNIT).to_array().map(|c| c.round() as i16)).collect();
        let joints: Vec<[u16; 4]> = self.joints.iter().map(|&j| [j, 0, 0, 0]).collect();
        let weights = vec![[255, 0, 0, 0]; joints.len()];
        let attributes = [
            ("POSITION", glb.positions_i16(&quantised)),
            ("NORMAL", glb.normals_i8(&self.normals)),
            ("COLOR_0", glb.bytes4(&self.colors, true)),
            ("JOINTS_0", glb.shorts4(&joints)),
            ("WEIGHTS_0", glb.bytes4(&weights, true)),
        ];
        let indices = glb.triangles(&self.triangles);
        let material =
            glb.material("\"name\":\"flake\",\"pbrMetallicRoughness\":{\"metallicFactor\":0,\"roughnessFactor\":0.38}");
        glb.mesh("flake", &attributes, indices, material)
    }
}

/// The level's colour, a little different from place to place.
fn tinted(level: usize, p: DVec3) -> DVec3 {
    LEVEL_COLORS[level] * mix(0.90, 1.10, fractal(p * 6.0 + DVec3::splat(4.0)))
}

/// A point of the spherical triangle over `corners`, `row` and `column` of `steps` from the first corner.
fn patch(corners: [DVec3; 3], row: usize, column: usize, steps: usize) -> DVec3 {
    let (v, u) = (row as f64 / steps as f64, column as f64 / steps as f64);
    (corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v).normalize()
}

/// Unit vectors and triangles over them.
pub struct Sphere {
    /// Points of the unit sphere.
    pub points: Vec<DVec3>,
    /// Corners, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

fn octahedron() -> Sphere {
    let points = vec![DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let triangles = vec![[4, 0, 2], [0, 5, 2], [5, 1, 2], [1, 4, 2], [0, 4, 3], [5, 0, 3], [1, 5, 3], [4, 1, 3]];
    Sphere { points, triangles }
}

/// The regular solid of twenty triangles.
pub fn icosahedron() -> Sphere {
    let g = 0.5 * (1.0 + 5.0f64.sqrt());
    let mut points = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        points.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
    }
    let points: Vec<DVec3> = points.into_iter().map(DVec3::normalize).collect();
    let near = |a: usize, b: usize| points[a].dot(points[b]) > 0.4;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let outside = (points[b] - points[a]).cross(points[c] - points[a]).dot(points[a]) > 0.0;
                    triangles.push([a, if outside { b } else { c }, if outside { c } else { b }].map(|i| i as u32));
                }
            }
        }
    }
    Sphere { points, triangles }
}

/// Each triangle cut into four.
fn split(sphere: &Sphere) -> Sphere {
    let mut out = Sphere { points: sphere.points.clone(), triangles: Vec::new() };
    let mut middles = HashMap::new();
    for &[a, b, c] in &sphere.triangles {
        let mut middle = |i: u32, j: u32| {
            *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                out.points.push((sphere.points[i as usize] + sphere.points[j as usize]).normalize());
                out.points.len() as u32 - 1
            })
        };
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        out.triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    out
}

/// How far out the burst is, in [0, 1], at `phase` of the clip, for a flight that sets out after `delay`.
fn spread(phase: f64, delay: f64) -> f64 {
    let since = (phase - 0.10 - delay).max(0.0);
    let out = 1.0 - libm::exp(-11.0 * since);
    let drift = 0.80 + 0.34 * since;
    let back = 1.0 - smoothstep(0.58 + 0.5 * delay, 0.93 + 0.5 * delay, phase);
    out * drift * back * back
}

/// Samplers of translation along +Z and of rotation for every flight.
fn flights(glb: &mut Glb, animation: &mut Animation) -> Vec<[usize; 2]> {
    let times: Vec<f64> = (0..=KEYS).map(|k| DURATION * k as f64 / KEYS as f64).collect();
    let input = glb.scalars(&times);
    (0..FLIGHTS)
        .map(|flight| {
            let random = |salt: u64| hash(9000 + 17 * flight as u64 + salt);
            let (reach, delay) = (mix(0.28, 0.88, random(1) * random(1)), 0.05 * random(2));
            let axis = DVec3::new(random(3) - 0.5, random(4) - 0.5, random(5) - 0.5).normalize_or(DVec3::X);
            let angle = deg(mix(120.0, 420.0, random(6)));
            let amount = |k: usize| spread((k % KEYS) as f64 / KEYS as f64, delay);
            let places: Vec<DVec3> = (0..=KEYS).map(|k| DVec3::Z * (reach * amount(k))).collect();
            let turns: Vec<DQuat> = (0..=KEYS).map(|k| about(axis, angle * amount(k))).collect();
            let places: Accessor = glb.vectors(&places);
            let turns: Accessor = glb.rotations(&turns);
            [animation.sampler(Keys::Linear, input, places), animation.sampler(Keys::Linear, input, turns)]
        })
        .collect()
}

/// For each fragment a node that looks along its flight and, in it, the joint that flies along +Z. All hang
/// under one root that turns once round.
fn joints(
    glb: &mut Glb,
    animation: &mut Animation,
    fragments: &[Fragment],
    flights: &[[usize; 2]],
) -> (usize, Vec<usize>) {
    let root = glb.node(Node { name: "turntable".into(), ..Node::default() });
    let mut joints = Vec::new();
    for fragment in fragments {
        let joint = glb.node(Node::default());
        let rotation = Some(fragment.frame());
        let holder = Node { translation: fragment.center, rotation, children: vec![joint], ..Node::default() };
        let holder = glb.node(holder);
        glb.adopt(root, holder);
        for (sampler, path) in flights[fragment.flight].into_iter().zip(["translation", "rotation"]) {
            animation.channel(sampler, joint, path);
        }
        joints.push(joint);
    }
    let turns = 16;
    let times: Vec<f64> = (0..=turns).map(|k| DURATION * k as f64 / turns as f64).collect();
    let input = glb.scalars(&times);
    let turn = |k: usize| about(DVec3::Y, (k % turns) as f64 / turns as f64 * std::f64::consts::TAU);
    let output = glb.rotations(&(0..=turns).map(turn).collect::<Vec<_>>());
    let sampler = animation.sampler(Keys::Linear, input, output);
    animation.channel(sampler, root, "rotation");
    (root, joints)
}

/// The glowing ball inside.
fn core(glb: &mut Glb) -> usize {
    let mut shape = Shape::default();
    let profile: Vec<(f64, f64, DVec2)> = (0..=16)
        .map(|k| {
            let n = DVec2::new(sin_turns(f64::from(k) / 32.0), -cos_turns(f64::from(k) / 32.0));
            (0.16 * n.x, 0.16 * n.y, n)
        })
        .collect();
    shape.turned(32, &profile);
    let material = glb.material(
        "\"name\":\"core\",\"emissiveFactor\":[1,0.62,0.22],\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.9,0.5,0.2,1],\
         \"metallicFactor\":0,\"roughnessFactor\":0.9}",
    );
    let mesh = shape.write(glb, "core", material);
    glb.node(Node { name: "core".into(), mesh: Some(mesh), ..Node::default() })
}

/// A round floor with rings.
fn floor(glb: &mut Glb) -> usize {
    const SIZE: usize = 256;
    let picture = Picture::from_fn(SIZE, SIZE, |x, y| {
        let at = |i: usize| 2.0 * (i as f64 + 0.5) / SIZE as f64 - 1.0;
        let r = (at(x) * at(x) + at(y) * at(y)).sqrt();
        let ring = smoothstep(0.006, 0.014, ((r * 8.0).round() / 8.0 - r).abs());
        let color = DVec3::new(0.40, 0.42, 0.45) * mix(0.82, 1.0, ring) * mix(0.95, 1.05, hash((y * SIZE + x) as u64));
        color.to_array().map(|c| ((c * 64.0).round() * 4.0) as u8)
    });
    let texture = glb.texture("floor", &picture);
    let radius = 1.9;
    let mut shape = Shape::default();
    let mut profile = vec![(radius, -0.10, DVec2::X), (radius, -0.02, DVec2::X)];
    profile.extend([(radius - 0.02, 0.0, DVec2::Y), (0.0, 0.0, DVec2::Y)]);
    shape.turned(96, &profile);
    shape.tex_coords =
        shape.positions.iter().map(|p| DVec2::new(0.5 + 0.5 * p.x / radius, 0.5 + 0.5 * p.z / radius)).collect();
    let material = glb.material(&format!(
        "\"name\":\"floor\",\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":{texture}}},\
         \"metallicFactor\":0,\"roughnessFactor\":0.5}}"
    ));
    let mesh = shape.write(glb, "floor", material);
    glb.node(Node {
        name: "floor".into(),
        translation: DVec3::new(0.0, -1.30, 0.0),
        mesh: Some(mesh),
        ..Node::default()
    })
}
