use std::collections::BTreeMap;

use serde::{Deserialize, de::IgnoredAny};

use super::{Idx, List, Size};

/// `buffers[]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct Buffer {
    pub(in super::super) uri: Option<Box<str>>,
    pub(in super::super) byte_length: Size,
}

/// `bufferViews[]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct BufferView {
    pub(in super::super) buffer: Idx,
    #[serde(default)]
    pub(in super::super) byte_offset: Size,
    pub(in super::super) byte_length: Size,
    pub(in super::super) byte_stride: Option<Size>,
    extensions: Option<Box<ViewExtensions>>,
}

#[derive(Debug, Deserialize)]
struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    ext_meshopt: Option<MeshoptView>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr_meshopt: Option<MeshoptView>,
}

impl BufferView {
    /// Where the compressed data of this view is, if it is compressed.
    pub(in super::super) fn meshopt(&self) -> Option<&MeshoptView> {
        self.extensions.as_ref().and_then(|e| e.khr_meshopt.as_ref().or(e.ext_meshopt.as_ref()))
    }
}

/// `EXT_meshopt_compression` or `KHR_meshopt_compression` on a buffer view.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct MeshoptView {
    pub(in super::super) buffer: Idx,
    #[serde(default)]
    pub(in super::super) byte_offset: Size,
    pub(in super::super) byte_length: Size,
    pub(in super::super) byte_stride: Size,
    pub(in super::super) count: Size,
    pub(in super::super) mode: String,
    pub(in super::super) filter: Option<String>,
}

/// Shape of an accessor's elements.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "UPPERCASE")]
pub(in super::super) enum AccessorType {
    Scalar,
    Vec2,
    Vec3,
    Vec4,
    Mat2,
    Mat3,
    Mat4,
}

/// `accessors[]`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct Accessor {
    pub(in super::super) buffer_view: Option<Idx>,
    pub(in super::super) byte_offset: Option<Size>,
    pub(in super::super) component_type: Idx,
    #[serde(default)]
    pub(in super::super) normalized: bool,
    pub(in super::super) count: Size,
    #[serde(rename = "type")]
    pub(in super::super) kind: AccessorType,
    pub(in super::super) min: Option<Box<[f64]>>,
    pub(in super::super) max: Option<Box<[f64]>>,
    pub(in super::super) sparse: Option<Box<Sparse>>,
}

/// `accessors[].sparse`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Sparse {
    pub(in super::super) count: Size,
    pub(in super::super) indices: SparseIndices,
    pub(in super::super) values: SparseValues,
}

/// `accessors[].sparse.indices`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct SparseIndices {
    pub(in super::super) buffer_view: Idx,
    #[serde(default)]
    pub(in super::super) byte_offset: Size,
    pub(in super::super) component_type: Idx,
}

/// `accessors[].sparse.values`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(in super::super) struct SparseValues {
    pub(in super::super) buffer_view: Idx,
    #[serde(default)]
    pub(in super::super) byte_offset: Size,
}

/// `meshes[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Mesh {
    pub(in super::super) name: Option<Box<str>>,
    pub(in super::super) primitives: List<Primitive>,
    pub(in super::super) weights: Option<Box<[f64]>>,
}

/// `meshes[].primitives[]`.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Primitive {
    pub(in super::super) attributes: BTreeMap<String, Idx>,
    pub(in super::super) indices: Option<Idx>,
    pub(in super::super) material: Option<Idx>,
    pub(in super::super) mode: Option<Idx>,
    pub(in super::super) targets: Option<Box<[BTreeMap<String, Idx>]>>,
    extensions: Option<Box<PrimitiveExtensions>>,
}

#[derive(Debug, Deserialize)]
struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    draco: Option<IgnoredAny>,
}

impl Primitive {
    /// True when the primitive carries Draco data.
    pub(in super::super) fn has_draco(&self) -> bool {
        self.extensions.as_ref().is_some_and(|e| e.draco.is_some())
    }
}
