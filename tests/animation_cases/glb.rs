//! A model as the bytes of a `.glb` file.

use serde_json::{Map, Value, json};

use super::model::{Channel, Interpolation, Mesh, Model, Path, Placement, Storage};

#[derive(Default)]
struct Writer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Writer {
    fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        self.bytes.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, view: usize, offset: usize, component: u32, count: usize, kind: &str) -> usize {
        self.accessors.push(json!({"bufferView": view, "byteOffset": offset, "componentType": component,
            "count": count, "type": kind}));
        self.accessors.len() - 1
    }

    fn floats(&mut self, numbers: &[f32], kind: &str, width: usize) -> usize {
        let view = self.view(bytemuck::cast_slice(numbers), None);
        let count = numbers.len() / width;
        let id = self.accessor(view, 0, 5126, count, kind);
        if width == 3 || kind == "SCALAR" {
            let component = |c: usize| numbers.iter().copied().skip(c).step_by(width);
            let fold = |f: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..width).map(|c| component(c).reduce(f).unwrap_or(0.0)).collect()
            };
            self.accessors[id]["min"] = json!(fold(f32::min));
            self.accessors[id]["max"] = json!(fold(f32::max));
        }
        id
    }

    fn joints(&mut self, joints: &[[u16; 4]]) -> usize {
        let view = self.view(bytemuck::cast_slice(joints), None);
        self.accessor(view, 0, 5123, joints.len(), "VEC4")
    }

    /// The accessors of a sampler's times and values.
    fn keys(&mut self, channel: &Channel) -> (usize, usize) {
        let width = channel.width();
        let kind = match channel.path {
            Path::Translation | Path::Scale => "VEC3",
            Path::Rotation => "VEC4",
            Path::Weights | Path::MeshWeights => "SCALAR",
        };
        let accessor_width = if kind == "SCALAR" { 1 } else { width };
        let values = channel.values.len() / accessor_width;
        match channel.storage {
            Storage::Float => {
                (self.floats(&channel.times, "SCALAR", 1), self.floats(&channel.values, kind, accessor_width))
            }
            Storage::Interleaved => self.interleaved(channel, kind),
            Storage::Int8 => {
                let view: Vec<i8> = channel.values.iter().map(|v| (v * 127.0).round() as i8).collect();
                let view = self.view(bytemuck::cast_slice(&view), None);
                let values = self.accessor(view, 0, 5120, values, kind);
                self.accessors[values]["normalized"] = json!(true);
                (self.floats(&channel.times, "SCALAR", 1), values)
            }
            Storage::Int16 => {
                let view: Vec<i16> = channel.values.iter().map(|v| (v * 32767.0).round() as i16).collect();
                let view = self.view(bytemuck::cast_slice(&view), None);
                let values = self.accessor(view, 0, 5122, values, kind);
                self.accessors[values]["normalized"] = json!(true);
                (self.floats(&channel.times, "SCALAR", 1), values)
            }
        }
    }

    /// Time and value of each key side by side, in one view with a stride.
    fn interleaved(&mut self, channel: &Channel, kind: &str) -> (usize, usize) {
        let width = channel.values.len() / channel.times.len();
        let rows = channel.times.iter().zip(channel.values.chunks(width));
        let numbers: Vec<f32> = rows.flat_map(|(&t, v)| std::iter::once(t).chain(v.iter().copied())).collect();
        let view = self.view(bytemuck::cast_slice(&numbers), Some(4 * (width + 1)));
        let times = self.accessor(view, 0, 5126, channel.times.len(), "SCALAR");
        let (first, last) = (channel.times.first().unwrap(), channel.times.last().unwrap());
        self.accessors[times]["min"] = json!([first]);
        self.accessors[times]["max"] = json!([last]);
        (times, self.accessor(view, 4, 5126, channel.times.len(), kind))
    }

    fn mesh(&mut self, mesh: &Mesh) -> Value {
        let mut attributes = Map::new();
        attributes.insert("POSITION".into(), json!(self.floats(mesh.positions.as_flattened(), "VEC3", 3)));
        for (set, influences) in mesh.joint_sets.iter().enumerate() {
            let joints: Vec<_> = influences.iter().map(|(j, _)| *j).collect();
            let weights: Vec<_> = influences.iter().flat_map(|(_, w)| *w).collect();
            attributes.insert(format!("JOINTS_{set}"), json!(self.joints(&joints)));
            attributes.insert(format!("WEIGHTS_{set}"), json!(self.floats(&weights, "VEC4", 4)));
        }
        let targets: Vec<Value> =
            mesh.targets.iter().map(|t| json!({"POSITION": self.floats(t.as_flattened(), "VEC3", 3)})).collect();
        let mut part = json!({"attributes": attributes});
        if !targets.is_empty() {
            part["targets"] = json!(targets);
        }
        let mut value = json!({"primitives": [part]});
        if !mesh.weights.is_empty() {
            value["weights"] = json!(mesh.weights);
        }
        value
    }

    fn copies(&mut self, copies: &[([f32; 3], [f32; 4], [f32; 3])]) -> Value {
        let t: Vec<f32> = copies.iter().flat_map(|c| c.0).collect();
        let r: Vec<f32> = copies.iter().flat_map(|c| c.1).collect();
        let s: Vec<f32> = copies.iter().flat_map(|c| c.2).collect();
        json!({"attributes": {"TRANSLATION": self.floats(&t, "VEC3", 3), "ROTATION": self.floats(&r, "VEC4", 4),
            "SCALE": self.floats(&s, "VEC3", 3)}})
    }

    fn animation(&mut self, channels: &[Channel]) -> Value {
        let mut samplers = Vec::new();
        let mut targets = Vec::new();
        for channel in channels {
            let (input, output) = self.keys(channel);
            let interpolation = match channel.interpolation {
                Interpolation::Step => "STEP",
                Interpolation::Linear => "LINEAR",
                Interpolation::Cubic => "CUBICSPLINE",
            };
            targets.push(json!({"sampler": samplers.len(), "target": target(channel)}));
            samplers.push(json!({"input": input, "output": output, "interpolation": interpolation}));
        }
        json!({"samplers": samplers, "channels": targets})
    }
}

fn target(channel: &Channel) -> Value {
    let path = match channel.path {
        Path::Translation => "translation",
        Path::Rotation => "rotation",
        Path::Scale => "scale",
        Path::Weights => "weights",
        Path::MeshWeights => {
            let pointer = format!("/meshes/{}/weights", channel.target);
            return json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
        }
    };
    json!({"node": channel.target, "path": path})
}

/// The bytes of a `.glb` file that holds `model`.
pub(crate) fn bytes(model: &Model) -> Vec<u8> {
    let mut w = Writer::default();
    let meshes: Vec<_> = model.meshes.iter().map(|m| w.mesh(m)).collect();
    let skins: Vec<_> = model
        .skins
        .iter()
        .map(
            |s| json!({"joints": s.joints, "inverseBindMatrices": w.floats(s.inverse_bind.as_flattened(), "MAT4", 16)}),
        )
        .collect();
    let nodes: Vec<_> = model.nodes.iter().map(|n| node(&mut w, n)).collect();
    let animations: Vec<_> = model.animations.iter().map(|a| w.animation(a)).collect();
    let mut root = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": model.roots}], "nodes": nodes,
        "extensionsUsed": ["KHR_animation_pointer", "EXT_mesh_gpu_instancing", "KHR_mesh_quantization"],
        "accessors": w.accessors, "bufferViews": w.views, "buffers": [{"byteLength": w.bytes.len()}],
    });
    for (key, list) in [("meshes", meshes), ("skins", skins), ("animations", animations)] {
        if !list.is_empty() {
            root[key] = json!(list);
        }
    }
    container(root.to_string().into_bytes(), w.bytes)
}

fn node(w: &mut Writer, node: &super::model::Node) -> Value {
    let mut value = match node.placement {
        Placement::Trs(t, r, s) => json!({"translation": t, "rotation": r, "scale": s}),
        Placement::Matrix(m) => json!({"matrix": m}),
    };
    if !node.children.is_empty() {
        value["children"] = json!(node.children);
    }
    for (key, index) in [("mesh", node.mesh), ("skin", node.skin)] {
        if let Some(index) = index {
            value[key] = json!(index);
        }
    }
    if let Some(weights) = &node.weights {
        value["weights"] = json!(weights);
    }
    if !node.copies.is_empty() {
        value["extensions"] = json!({"EXT_mesh_gpu_instancing": w.copies(&node.copies)});
    }
    value
}

fn container(mut text: Vec<u8>, mut data: Vec<u8>) -> Vec<u8> {
    text.resize(text.len().next_multiple_of(4), b' ');
    data.resize(data.len().next_multiple_of(4), 0);
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((28 + text.len() as u32 + data.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text), (b"BIN\0", data)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    out
}
