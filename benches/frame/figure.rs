//! A skinned figure as a `.glb`: six tubes for trunk, head, arms and legs over thirteen joints, four influences a vertex, in a walk of two seconds.

use serde_json::{Value, json};

/// A joint: its parent, and where it is in the rest pose.
const JOINTS: [(Option<usize>, [f32; 3]); 13] = [
    (None, [0.0, 1.0, 0.0]),        // hips
    (Some(0), [0.0, 1.25, 0.0]),    // chest
    (Some(1), [0.0, 1.5, 0.0]),     // head
    (Some(1), [0.22, 1.42, 0.0]),   // left arm
    (Some(3), [0.50, 1.42, 0.0]),   // left forearm
    (Some(1), [-0.22, 1.42, 0.0]),  // right arm
    (Some(5), [-0.50, 1.42, 0.0]),  // right forearm
    (Some(0), [0.11, 0.95, 0.0]),   // left thigh
    (Some(7), [0.11, 0.50, 0.0]),   // left shin
    (Some(8), [0.11, 0.08, 0.0]),   // left foot
    (Some(0), [-0.11, 0.95, 0.0]),  // right thigh
    (Some(10), [-0.11, 0.50, 0.0]), // right shin
    (Some(11), [-0.11, 0.08, 0.0]), // right foot
];

struct Tube {
    from: [f32; 3],
    to: [f32; 3],
    /// How thick it is at its ends.
    radii: [f32; 2],
    /// The joints along it.
    joints: &'static [u8],
}

impl Tube {
    const fn new(from: [f32; 3], to: [f32; 3], radii: [f32; 2], joints: &'static [u8]) -> Self {
        Self { from, to, radii, joints }
    }
}

const TUBES: [Tube; 6] = [
    Tube::new([0.0, 0.92, 0.0], [0.0, 1.48, 0.0], [0.17, 0.15], &[0, 1]),
    Tube::new([0.0, 1.46, 0.0], [0.0, 1.80, 0.0], [0.07, 0.10], &[1, 2]),
    Tube::new([0.16, 1.42, 0.0], [0.80, 1.42, 0.0], [0.06, 0.04], &[1, 3, 4]),
    Tube::new([-0.16, 1.42, 0.0], [-0.80, 1.42, 0.0], [0.06, 0.04], &[1, 5, 6]),
    Tube::new([0.11, 0.98, 0.0], [0.11, 0.02, 0.0], [0.09, 0.05], &[0, 7, 8, 9]),
    Tube::new([-0.11, 0.98, 0.0], [-0.11, 0.02, 0.0], [0.09, 0.05], &[0, 10, 11, 12]),
];

/// The binary chunk, and the views and accessors into it.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    /// Adds an accessor; returns its number.
    fn add(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize, range: Option<[Value; 2]>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() }));
        let mut accessor =
            json!({ "bufferView": self.views.len() - 1, "componentType": component, "type": kind, "count": count });
        if let Some([min, max]) = range {
            accessor["min"] = min;
            accessor["max"] = max;
        }
        self.bytes.extend_from_slice(bytes);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn add_floats(&mut self, values: &[f32], kind: &str, range: Option<[Value; 2]>) -> usize {
        let components = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.add(&bytes, 5126, kind, values.len() / components, range)
    }
}

/// Vertices of all tubes, ring after ring.
#[derive(Default)]
struct Skin {
    positions: Vec<f32>,
    joints: Vec<u8>,
    weights: Vec<f32>,
    indices: Vec<u32>,
}

impl Skin {
    fn tube(&mut self, tube: &Tube, rings: u32, sides: u32) {
        let &Tube { from, to, radii, joints } = tube;
        let first = u32::try_from(self.positions.len() / 3).expect("few vertices");
        let upright = (to[1] - from[1]).abs() > 0.0;
        for (ring, side) in (0..rings).flat_map(|ring| (0..sides).map(move |side| (ring, side))) {
            let along = ring as f32 / (rings - 1) as f32;
            let angle = side as f32 / sides as f32 * std::f32::consts::TAU;
            // Ends are closed by rings without width; skin is not smooth.
            let end = (along * 30.0).min((1.0 - along) * 30.0).min(1.0);
            let rough = 1.0 + 0.01 * (angle * 9.0).sin() * (along * 60.0).sin();
            let radius = (radii[0] + (radii[1] - radii[0]) * along) * end.sqrt() * rough;
            let (across, deep) = (radius * angle.cos(), radius * angle.sin());
            let at: [f32; 3] = std::array::from_fn(|i| from[i] + (to[i] - from[i]) * along);
            let around = if upright { [across, 0.0, deep] } else { [0.0, across, deep] };
            self.positions.extend((0..3).map(|i| at[i] + around[i]));
            let place = along * (joints.len() - 1) as f32;
            let near = |i: usize| (1.5 - (place - i as f32).abs()).max(0.0).powi(2);
            let total: f32 = (0..joints.len()).map(near).sum();
            self.joints.extend((0..4).map(|i| joints.get(i).copied().unwrap_or(0)));
            self.weights.extend((0..4).map(|i| if i < joints.len() { near(i) / total } else { 0.0 }));
            if ring + 1 < rings {
                let [a, b] = [side, (side + 1) % sides].map(|s| first + ring * sides + s);
                self.indices.extend([a, a + sides, b, b, a + sides, b + sides]);
            }
        }
    }
}

/// The file, of about so many triangles.
pub(crate) fn glb(triangles: u32) -> Vec<u8> {
    let sides = 72;
    let rings = (triangles / (6 * sides * 2)).max(2) + 1;
    let mut skin = Skin::default();
    for tube in &TUBES {
        skin.tube(tube, rings, sides);
    }
    let mut buffer = Buffer::default();
    let count = skin.positions.len() / 3;
    let bound = |pick: fn(f32, f32) -> f32| {
        Value::from((0..3).map(|i| skin.positions[i..].iter().step_by(3).copied().reduce(pick)).collect::<Vec<_>>())
    };
    let range = Some([bound(f32::min), bound(f32::max)]);
    let positions = buffer.add_floats(&skin.positions, "VEC3", range);
    let joints = buffer.add(&skin.joints, 5121, "VEC4", count, None);
    let weights = buffer.add_floats(&skin.weights, "VEC4", None);
    let bytes: Vec<u8> = skin.indices.iter().flat_map(|i| i.to_le_bytes()).collect();
    let indices = buffer.add(&bytes, 5125, "SCALAR", skin.indices.len(), None);
    let bind = JOINTS
        .iter()
        .flat_map(|(_, [x, y, z])| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -x, -y, -z, 1.0]);
    let bind = buffer.add_floats(&bind.collect::<Vec<_>>(), "MAT4", None);
    let animation = walk(&mut buffer);
    let document = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, JOINTS.len()] }],
        "nodes": nodes(),
        "skins": [{ "joints": (0..JOINTS.len()).collect::<Vec<_>>(), "inverseBindMatrices": bind }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights },
            "indices": indices,
        }] }],
        "animations": [animation],
        "buffers": [{ "byteLength": buffer.bytes.len() }],
        "bufferViews": buffer.views,
        "accessors": buffer.accessors,
    });
    container(&document.to_string(), &buffer.bytes)
}

/// The joints, in the order of [`JOINTS`], and the node that is drawn.
fn nodes() -> Vec<Value> {
    let mut nodes: Vec<Value> = (0..JOINTS.len())
        .map(|i| {
            let (parent, at) = JOINTS[i];
            let from = parent.map_or([0.0; 3], |p| JOINTS[p].1);
            let children: Vec<usize> = (0..JOINTS.len()).filter(|&c| JOINTS[c].0 == Some(i)).collect();
            let mut node = json!({ "translation": [at[0] - from[0], at[1] - from[1], at[2] - from[2]] });
            if !children.is_empty() {
                node["children"] = children.into();
            }
            node
        })
        .collect();
    nodes.push(json!({ "mesh": 0, "skin": 0 }));
    nodes
}

/// Arms and legs swing against each other, by angles about an axis.
fn walk(buffer: &mut Buffer) -> Value {
    let keys = 9;
    let times: Vec<f32> = (0..keys).map(|k| k as f32 * 2.0 / (keys - 1) as f32).collect();
    let range = Some([json!([0.0]), json!([2.0])]);
    let input = buffer.add_floats(&times, "SCALAR", range);
    // Joint, axis, how far, how it lags, and the angle about which it swings.
    let swings: [(usize, usize, f32, f32, f32); 9] = [
        (1, 1, 0.15, 0.0, 0.0),
        (3, 1, 0.5, 0.0, -0.2),
        (4, 1, 0.3, 0.2, -0.5),
        (5, 1, 0.5, 0.0, 0.2),
        (6, 1, 0.3, 0.2, 0.5),
        (7, 0, 0.6, 0.0, 0.0),
        (8, 0, 0.5, 0.25, 0.5),
        (10, 0, 0.6, 0.5, 0.0),
        (11, 0, 0.5, 0.75, 0.5),
    ];
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    for (joint, axis, far, lag, rest) in swings {
        let turns = times.iter().flat_map(|t| {
            let half = 0.5 * (rest + far * ((t / 2.0 + lag) * std::f32::consts::TAU).sin());
            let mut turn = [0.0, 0.0, 0.0, half.cos()];
            turn[axis] = half.sin();
            turn
        });
        let output = buffer.add_floats(&turns.collect::<Vec<_>>(), "VEC4", None);
        channels.push(json!({ "sampler": samplers.len(), "target": { "node": joint, "path": "rotation" } }));
        samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
    }
    json!({ "name": "walk", "channels": channels, "samplers": samplers })
}

/// Header, JSON chunk and binary chunk.
fn container(document: &str, binary: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let chunks = [(b"JSON", padded(document.as_bytes(), b' ')), (b"BIN\0", padded(binary, 0))];
    let length = |n: usize| u32::try_from(n).expect("a small file").to_le_bytes();
    let total = 12 + chunks.iter().map(|(_, bytes)| 8 + bytes.len()).sum::<usize>();
    let mut file = [b"glTF".as_slice(), &2_u32.to_le_bytes(), &length(total)].concat();
    for (kind, bytes) in chunks {
        file.extend_from_slice(&length(bytes.len()));
        file.extend_from_slice(kind);
        file.extend_from_slice(&bytes);
    }
    file
}
