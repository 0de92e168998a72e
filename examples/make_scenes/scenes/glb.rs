//! A small glTF 2.0 writer: typed accessors into one buffer, JSON built as text, one `.glb` at the end.

use std::fmt::Write as _;

use glam::{DQuat, DVec2, DVec3};

use super::png::Picture;

/// Number of an accessor.
pub type Accessor = usize;

/// A node to be written; fields left at their default are left out of the file.
#[derive(Clone, Default)]
pub struct Node {
    /// Name.
    pub name: String,
    /// Translation in metres.
    pub translation: DVec3,
    /// Rotation; identity when `None`.
    pub rotation: Option<DQuat>,
    /// Scale; one when `None`.
    pub scale: Option<DVec3>,
    /// Child nodes.
    pub children: Vec<usize>,
    /// Mesh drawn here.
    pub mesh: Option<usize>,
    /// Skin of the mesh.
    pub skin: Option<usize>,
    /// Camera here.
    pub camera: Option<usize>,
}

/// The interpolation of an animation sampler.
#[derive(Clone, Copy)]
pub enum Keys {
    /// Straight lines, slerp for rotations.
    Linear,
    /// Hermite cubics.
    Cubic,
}

/// One animation under construction.
#[derive(Default)]
pub struct Animation {
    samplers: Vec<String>,
    channels: Vec<String>,
}

impl Animation {
    /// Adds key times and values; returns the sampler's number, which many channels may use.
    pub fn sampler(&mut self, keys: Keys, input: Accessor, output: Accessor) -> usize {
        let mode = match keys {
            Keys::Linear => "",
            Keys::Cubic => ",\"interpolation\":\"CUBICSPLINE\"",
        };
        self.samplers.push(format!("{{\"input\":{input},\"output\":{output}{mode}}}"));
        self.samplers.len() - 1
    }

    /// Drives `path` of `node` by a sampler.
    pub fn channel(&mut self, sampler: usize, node: usize, path: &str) {
        self.channels.push(format!("{{\"sampler\":{sampler},\"target\":{{\"node\":{node},\"path\":\"{path}\"}}}}"));
    }
}

/// A glTF file under construction. The `Vec`s hold JSON objects in index order.
#[derive(Default)]
pub struct Glb {
    bin: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
    nodes: Vec<Node>,
    meshes: Vec<String>,
    skins: Vec<String>,
    animations: Vec<String>,
    materials: Vec<String>,
    textures: Vec<String>,
    images: Vec<String>,
    cameras: Vec<String>,
    quantized: bool,
}

/// How the numbers of an accessor are stored.
struct Layout {
    component: u32,
    kind: &'static str,
    normalized: bool,
    stride: Option<usize>,
}

impl Glb {
    fn view(&mut self, bytes: &[u8], stride: Option<usize>) -> usize {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let stride = stride.map_or(String::new(), |s| format!(",\"byteStride\":{s}"));
        self.views.push(format!(
            "{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{}{stride}}}",
            self.bin.len(),
            bytes.len()
        ));
        self.bin.extend(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], count: usize, layout: &Layout, bounds: &str) -> Accessor {
        let view = self.view(bytes, layout.stride);
        let normalized = if layout.normalized { ",\"normalized\":true" } else { "" };
        self.accessors.push(format!(
            "{{\"bufferView\":{view},\"componentType\":{},\"count\":{count},\"type\":\"{}\"{normalized}{bounds}}}",
            layout.component, layout.kind
        ));
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]], bounded: bool) -> Accessor {
        assert!(values.iter().flatten().all(|v| v.is_finite()), "a number of the scene is not finite");
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N.min(4)];
        let kind = if N == 16 { "MAT4" } else { kind };
        let bounds = if bounded { bounds(values) } else { String::new() };
        self.accessor(&bytes, values.len(), &Layout { component: 5126, kind, normalized: false, stride: None }, &bounds)
    }

    /// Positions, with the bounds that the format asks for.
    pub fn positions(&mut self, values: &[DVec3]) -> Accessor {
        let values: Vec<_> = values.iter().map(|v| v.as_vec3().to_array()).collect();
        self.floats(&values, true)
    }

    /// Vectors or translations in `f32`.
    pub fn vectors(&mut self, values: &[DVec3]) -> Accessor {
        let values: Vec<_> = values.iter().map(|v| v.as_vec3().to_array()).collect();
        self.floats(&values, false)
    }

    /// Any four-component numbers in `f32`.
    pub fn quads(&mut self, values: &[[f64; 4]]) -> Accessor {
        let values: Vec<_> = values.iter().map(|v| v.map(|c| c as f32)).collect();
        self.floats(&values, false)
    }

    /// Rotations in `f32`; neighbours are given the sign that makes them agree.
    pub fn rotations(&mut self, values: &[DQuat]) -> Accessor {
        let mut last = DQuat::IDENTITY;
        let mut signed = Vec::with_capacity(values.len());
        for &q in values {
            last = if q.dot(last) < 0.0 { -q } else { q };
            signed.push([last.x, last.y, last.z, last.w]);
        }
        self.quads(&signed)
    }

    /// Texture coordinates in `f32`.
    pub fn tex_coords(&mut self, values: &[DVec2]) -> Accessor {
        let values: Vec<_> = values.iter().map(|v| v.as_vec2().to_array()).collect();
        self.floats(&values, false)
    }

    /// Key times in seconds, or morph weights key by key.
    pub fn scalars(&mut self, values: &[f64]) -> Accessor {
        let values: Vec<_> = values.iter().map(|&v| [v as f32]).collect();
        self.floats(&values, true)
    }

    /// Column-major matrices that only translate.
    pub fn translation_matrices(&mut self, values: &[DVec3]) -> Accessor {
        let matrix = |t: &DVec3| {
            let t = t.as_vec3();
            [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, t.x, t.y, t.z, 1.0]
        };
        let values: Vec<[f32; 16]> = values.iter().map(matrix).collect();
        self.floats(&values, false)
    }

    /// Inverse bind matrices of joints at the given places and rotations, for positions in units of `unit`
    /// metres.
    pub fn inverse_binds(&mut self, binds: &[(DVec3, DQuat)], unit: f64) -> Accessor {
        let matrix = |&(place, turn): &(DVec3, DQuat)| {
            let back = turn.conjugate();
            let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| (back * axis * unit).as_vec3());
            let t = (back * -place).as_vec3();
            let [x, y, z] = columns;
            [x.x, x.y, x.z, 0.0, y.x, y.y, y.z, 0.0, z.x, z.y, z.z, 0.0, t.x, t.y, t.z, 1.0]
        };
        let values: Vec<[f32; 16]> = binds.iter().map(matrix).collect();
        self.floats(&values, false)
    }

    /// Unit vectors in three signed bytes each (`KHR_mesh_quantization`).
    pub fn normals_i8(&mut self, values: &[DVec3]) -> Accessor {
        self.quantized = true;
        let byte = |c: f64| ((c * 127.0).round() as i8).cast_unsigned();
        let bytes: Vec<u8> = values.iter().flat_map(|v| [byte(v.x), byte(v.y), byte(v.z), 0]).collect();
        let layout = Layout { component: 5120, kind: "VEC3", normalized: true, stride: Some(4) };
        self.accessor(&bytes, values.len(), &layout, "")
    }

    /// Whole numbers in three signed shorts each (`KHR_mesh_quantization`), to be scaled by a node.
    pub fn positions_i16(&mut self, values: &[[i16; 3]]) -> Accessor {
        self.quantized = true;
        let bytes: Vec<u8> = values.iter().flat_map(|v| [v[0], v[1], v[2], 0]).flat_map(i16::to_le_bytes).collect();
        let layout = Layout { component: 5122, kind: "VEC3", normalized: false, stride: Some(8) };
        let bounds = bounds(values);
        self.accessor(&bytes, values.len(), &layout, &bounds)
    }

    /// Four unsigned bytes each: joints, or colours and weights when `normalized`.
    pub fn bytes4(&mut self, values: &[[u8; 4]], normalized: bool) -> Accessor {
        let bytes: Vec<u8> = values.iter().flatten().copied().collect();
        let layout = Layout { component: 5121, kind: "VEC4", normalized, stride: None };
        self.accessor(&bytes, values.len(), &layout, "")
    }

    /// Four unsigned shorts each: joints.
    pub fn shorts4(&mut self, values: &[[u16; 4]]) -> Accessor {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let layout = Layout { component: 5123, kind: "VEC4", normalized: false, stride: None };
        self.accessor(&bytes, values.len(), &layout, "")
    }

    /// Corners of triangles, in shorts when they fit.
    pub fn triangles(&mut self, values: &[[u32; 3]]) -> Accessor {
        let wide = values.iter().flatten().any(|&i| i >= 0xffff);
        let flat = values.iter().flatten();
        let bytes: Vec<u8> = if wide {
            flat.flat_map(|i| i.to_le_bytes()).collect()
        } else {
            flat.flat_map(|&i| (i as u16).to_le_bytes()).collect()
        };
        let component = if wide { 5125 } else { 5123 };
        let layout = Layout { component, kind: "SCALAR", normalized: false, stride: None };
        self.accessor(&bytes, 3 * values.len(), &layout, "")
    }

    /// A texture that repeats, with mipmaps.
    pub fn texture(&mut self, name: &str, picture: &Picture) -> usize {
        let view = self.view(&picture.encode(), None);
        self.images.push(format!("{{\"name\":\"{name}\",\"bufferView\":{view},\"mimeType\":\"image/png\"}}"));
        self.textures.push(format!("{{\"sampler\":0,\"source\":{}}}", self.images.len() - 1));
        self.textures.len() - 1
    }

    /// A material from the text inside its JSON object.
    pub fn material(&mut self, body: &str) -> usize {
        self.materials.push(format!("{{{body}}}"));
        self.materials.len() - 1
    }

    /// A mesh of one part; `attributes` are pairs of semantic and accessor.
    pub fn mesh(&mut self, name: &str, attributes: &[(&str, Accessor)], indices: Accessor, material: usize) -> usize {
        self.morph_mesh(name, attributes, indices, material, &[])
    }

    /// A mesh of one part with morph targets, each a list like `attributes`.
    pub fn morph_mesh(
        &mut self,
        name: &str,
        attributes: &[(&str, Accessor)],
        indices: Accessor,
        material: usize,
        targets: &[Vec<(&str, Accessor)>],
    ) -> usize {
        let object = |list: &[(&str, Accessor)]| {
            let pairs: Vec<String> = list.iter().map(|(key, accessor)| format!("\"{key}\":{accessor}")).collect();
            format!("{{{}}}", pairs.join(","))
        };
        let morphs = if targets.is_empty() {
            String::new()
        } else {
            let list: Vec<String> = targets.iter().map(|t| object(t)).collect();
            format!(",\"targets\":[{}]", list.join(","))
        };
        self.meshes.push(format!(
            "{{\"name\":\"{name}\",\"primitives\":[{{\"attributes\":{},\"indices\":{indices},\"material\":{material}{morphs}}}]}}",
            object(attributes)
        ));
        self.meshes.len() - 1
    }

    /// A skin over `joints`.
    pub fn skin(&mut self, name: &str, joints: &[usize], inverse_binds: Accessor) -> usize {
        self.skins.push(format!(
            "{{\"name\":\"{name}\",\"joints\":{},\"inverseBindMatrices\":{inverse_binds}}}",
            list(joints)
        ));
        self.skins.len() - 1
    }

    /// Adds a node; returns its number.
    pub fn node(&mut self, node: Node) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// Puts `child` under `parent`.
    pub fn adopt(&mut self, parent: usize, child: usize) {
        self.nodes[parent].children.push(child);
    }

    /// Adds an animation.
    pub fn animation(&mut self, name: &str, animation: &Animation) {
        self.animations.push(format!(
            "{{\"name\":\"{name}\",\"samplers\":[{}],\"channels\":[{}]}}",
            animation.samplers.join(","),
            animation.channels.join(",")
        ));
    }

    /// A node with a perspective camera at `eye` that looks at `target`; `y_fov` in radians.
    pub fn camera(&mut self, name: &str, eye: DVec3, target: DVec3, y_fov: f64) -> usize {
        self.cameras.push(format!(
            "{{\"name\":\"{name}\",\"type\":\"perspective\",\"perspective\":{{\"yfov\":{},\"znear\":0.05}}}}",
            number(y_fov)
        ));
        let camera = Some(self.cameras.len() - 1);
        let rotation = Some(super::maths::look_at(eye, target));
        self.node(Node { name: name.to_owned(), translation: eye, rotation, camera, ..Node::default() })
    }

    /// The finished file with `roots` as its scene.
    pub fn finish(mut self, roots: &[usize]) -> Vec<u8> {
        while !self.bin.len().is_multiple_of(4) {
            self.bin.push(0);
        }
        let mut json = self.json(roots);
        while !json.len().is_multiple_of(4) {
            json.push(' ');
        }
        let total = 12 + 8 + json.len() + 8 + self.bin.len();
        let mut out = Vec::with_capacity(total);
        out.extend(b"glTF");
        for word in [2, total as u32, json.len() as u32] {
            out.extend(word.to_le_bytes());
        }
        out.extend(b"JSON");
        out.extend(json.as_bytes());
        out.extend((self.bin.len() as u32).to_le_bytes());
        out.extend(b"BIN\0");
        out.extend(&self.bin);
        out
    }

    fn json(&self, roots: &[usize]) -> String {
        let mut json = String::from("{\"asset\":{\"version\":\"2.0\",\"generator\":\"kinora make_scenes\"}");
        if self.quantized {
            let names = "[\"KHR_mesh_quantization\"]";
            let _ = write!(json, ",\"extensionsUsed\":{names},\"extensionsRequired\":{names}");
        }
        let _ = write!(json, ",\"scene\":0,\"scenes\":[{{\"nodes\":{}}}]", list(roots));
        let nodes: Vec<String> = self.nodes.iter().map(node_json).collect();
        let samplers = if self.textures.is_empty() { vec![] } else { vec![SAMPLER.to_owned()] };
        let arrays: [(&str, &[String]); 12] = [
            ("nodes", &nodes),
            ("meshes", &self.meshes),
            ("skins", &self.skins),
            ("animations", &self.animations),
            ("materials", &self.materials),
            ("textures", &self.textures),
            ("samplers", &samplers),
            ("images", &self.images),
            ("cameras", &self.cameras),
            ("accessors", &self.accessors),
            ("bufferViews", &self.views),
            ("buffers", &[format!("{{\"byteLength\":{}}}", self.bin.len())]),
        ];
        for (key, items) in arrays.into_iter().filter(|(_, items)| !items.is_empty()) {
            let _ = write!(json, ",\"{key}\":[{}]", items.join(","));
        }
        json.push('}');
        json
    }
}

/// Linear filters, mipmaps, repeat.
const SAMPLER: &str = "{\"magFilter\":9729,\"minFilter\":9987}";

fn node_json(node: &Node) -> String {
    let mut fields = Vec::new();
    if !node.name.is_empty() {
        fields.push(format!("\"name\":\"{}\"", node.name));
    }
    if node.translation != DVec3::ZERO {
        fields.push(format!("\"translation\":[{}]", numbers(&node.translation.to_array())));
    }
    if let Some(q) = node.rotation {
        fields.push(format!("\"rotation\":[{}]", numbers(&q.to_array())));
    }
    if let Some(s) = node.scale {
        fields.push(format!("\"scale\":[{}]", numbers(&s.to_array())));
    }
    if !node.children.is_empty() {
        fields.push(format!("\"children\":{}", list(&node.children)));
    }
    for (key, value) in [("mesh", node.mesh), ("skin", node.skin), ("camera", node.camera)] {
        if let Some(value) = value {
            fields.push(format!("\"{key}\":{value}"));
        }
    }
    format!("{{{}}}", fields.join(","))
}

/// Least and greatest of each component as JSON fields.
fn bounds<T: Copy + PartialOrd + std::fmt::Display, const N: usize>(values: &[[T; N]]) -> String {
    let Some((&first, rest)) = values.split_first() else { return String::new() };
    let (mut min, mut max) = (first, first);
    for v in rest {
        for i in 0..N {
            min[i] = if v[i] < min[i] { v[i] } else { min[i] };
            max[i] = if v[i] > max[i] { v[i] } else { max[i] };
        }
    }
    let text = |v: [T; N]| v.map(|c| format!("{c}")).join(",");
    format!(",\"min\":[{}],\"max\":[{}]", text(min), text(max))
}

fn list(items: &[usize]) -> String {
    let items: Vec<String> = items.iter().map(ToString::to_string).collect();
    format!("[{}]", items.join(","))
}

/// A number as the shortest decimal that reads back to the same `f32`.
pub fn number(value: f64) -> String {
    assert!(value.is_finite(), "a number of the scene is not finite");
    format!("{}", value as f32)
}

/// Numbers joined by commas.
pub fn numbers(values: &[f64]) -> String {
    values.iter().map(|&v| number(v)).collect::<Vec<_>>().join(",")
}
