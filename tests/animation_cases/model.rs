//! Small animated models as a test writes them down: source data for both the glTF file and the reference.

/// A model: one animation a list of channels.
#[derive(Clone, Debug, Default)]
pub(crate) struct Model {
    pub(crate) nodes: Vec<Node>,
    /// Roots of the default scene; other parentless nodes lie outside.
    pub(crate) roots: Vec<usize>,
    pub(crate) meshes: Vec<Mesh>,
    pub(crate) skins: Vec<Skin>,
    pub(crate) animations: Vec<Vec<Channel>>,
}

#[derive(Clone, Debug)]
pub(crate) enum Placement {
    Trs([f32; 3], [f32; 4], [f32; 3]),
    /// Column by column.
    Matrix([f32; 16]),
}

#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) children: Vec<usize>,
    pub(crate) placement: Placement,
    pub(crate) mesh: Option<usize>,
    pub(crate) skin: Option<usize>,
    pub(crate) weights: Option<Vec<f32>>,
    /// Translations, rotations, scales of `EXT_mesh_gpu_instancing` copies.
    pub(crate) copies: Vec<([f32; 3], [f32; 4], [f32; 3])>,
}

impl Default for Node {
    fn default() -> Self {
        let placement = Placement::Trs([0.0; 3], [0.0, 0.0, 0.0, 1.0], [1.0; 3]);
        Self { children: vec![], placement, mesh: None, skin: None, weights: None, copies: vec![] }
    }
}

impl Node {
    pub(crate) fn at(t: [f32; 3], r: [f32; 4], s: [f32; 3]) -> Self {
        Self { placement: Placement::Trs(t, r, s), ..Self::default() }
    }

    pub(crate) fn matrix(columns: [f32; 16]) -> Self {
        Self { placement: Placement::Matrix(columns), ..Self::default() }
    }

    pub(crate) fn with_mesh(self, mesh: usize) -> Self {
        Self { mesh: Some(mesh), ..self }
    }

    pub(crate) fn with_skin(self, skin: usize) -> Self {
        Self { skin: Some(skin), ..self }
    }

    pub(crate) fn over(self, children: &[usize]) -> Self {
        Self { children: children.to_vec(), ..self }
    }
}

/// One part: consecutive triples of vertices are triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mesh {
    pub(crate) positions: Vec<[f32; 3]>,
    pub(crate) targets: Vec<Vec<[f32; 3]>>,
    pub(crate) weights: Vec<f32>,
    /// `JOINTS_n` with `WEIGHTS_n`, one a vertex.
    pub(crate) joint_sets: Vec<Vec<([u16; 4], [f32; 4])>>,
}

#[derive(Clone, Debug)]
pub(crate) struct Skin {
    pub(crate) joints: Vec<usize>,
    pub(crate) inverse_bind: Vec<[f32; 16]>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Path {
    Translation,
    Rotation,
    Scale,
    Weights,
    /// `/meshes/M/weights` through `KHR_animation_pointer`; the target is a mesh.
    MeshWeights,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interpolation {
    Step,
    Linear,
    Cubic,
}

/// How key values are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Storage {
    Float,
    /// Floats, a key's time and value side by side.
    Interleaved,
    /// Normalised signed integers of one or two bytes.
    Int8,
    Int16,
}

impl Storage {
    /// The value that a stored number stands for.
    pub(crate) fn decoded(self, v: f32) -> f64 {
        let v = f64::from(v);
        match self {
            Self::Float | Self::Interleaved => v,
            Self::Int8 => ((v * 127.0).round() / 127.0).max(-1.0),
            Self::Int16 => ((v * 32767.0).round() / 32767.0).max(-1.0),
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Channel {
    /// A node, or a mesh for [`Path::MeshWeights`].
    pub(crate) target: usize,
    pub(crate) path: Path,
    pub(crate) interpolation: Interpolation,
    pub(crate) storage: Storage,
    pub(crate) times: Vec<f32>,
    /// As many numbers a value as the path asks for; in-tangent, value, out-tangent for cubics.
    pub(crate) values: Vec<f32>,
}

impl Channel {
    pub(crate) fn new(target: usize, path: Path, interpolation: Interpolation, times: &[f32], values: &[f32]) -> Self {
        let storage = Storage::Float;
        Self { target, path, interpolation, storage, times: times.to_vec(), values: values.to_vec() }
    }

    pub(crate) fn stored(self, storage: Storage) -> Self {
        Self { storage, ..self }
    }

    /// Numbers a value.
    pub(crate) fn width(&self) -> usize {
        let tangents = if self.interpolation == Interpolation::Cubic { 3 } else { 1 };
        self.values.len() / self.times.len() / tangents
    }
}
