//! The glTF document as its JSON text has it, before any reference is followed.
//!
//! Own serde types instead of the `gltf` crate's: those refuse legal files (animation channels without a
//! target node) and keep unknown content as trees, many times the size of the text. Here what is
//! not used is skipped, rare members are boxed, and an array element takes at most about 40 times its
//! shortest text. Animations stay text until each is read on its own, so that a broken one harms no other.

mod animation;
mod geometry;
mod material;
mod node;
mod value;

pub(super) use animation::{Animation, AnimationSampler, AnimationTarget};
pub(super) use geometry::{Accessor, AccessorType, Buffer, BufferView, Mesh, Primitive, SparseIndices};
pub(super) use material::{Image, Material, Texture, TextureInfo, TextureSampler};
pub(super) use node::{Camera, Instancing, Light, Node, Orthographic, Perspective, Scene, Skin, Spot};
use serde::Deserialize;
use serde_json::value::RawValue;
pub(super) use value::{Idx, List, Object, Size};

use super::error::{Problem, Step};

/// `asset`.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Asset {
    pub(super) version: String,
    pub(super) min_version: Option<String>,
}

/// The root object.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document<'a> {
    pub(super) asset: Object<Asset>,
    pub(super) scene: Option<Idx>,
    #[serde(default)]
    pub(super) scenes: List<Scene>,
    #[serde(default)]
    pub(super) nodes: List<Node>,
    #[serde(default)]
    pub(super) meshes: List<Mesh>,
    #[serde(default)]
    pub(super) accessors: List<Accessor>,
    #[serde(default)]
    pub(super) buffer_views: List<BufferView>,
    #[serde(default)]
    pub(super) buffers: List<Buffer>,
    #[serde(default)]
    pub(super) skins: List<Skin>,
    #[serde(borrow, default)]
    pub(super) animations: Option<Vec<&'a RawValue>>,
    #[serde(default)]
    pub(super) cameras: List<Camera>,
    #[serde(default)]
    pub(super) materials: List<Material>,
    #[serde(default)]
    pub(super) textures: List<Texture>,
    #[serde(default)]
    pub(super) images: List<Image>,
    #[serde(default)]
    pub(super) samplers: List<TextureSampler>,
    #[serde(default)]
    pub(super) extensions_used: Vec<String>,
    #[serde(default)]
    pub(super) extensions_required: Vec<String>,
    #[serde(default)]
    extensions: Option<RootExtensions>,
}

#[derive(Debug, Default, Deserialize)]
struct RootExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    lights: Option<RootLights>,
}

#[derive(Debug, Deserialize)]
struct RootLights {
    #[serde(default)]
    lights: List<Light>,
}

impl Document<'_> {
    /// The lights of `KHR_lights_punctual`.
    pub(super) fn lights(&self) -> &[Light] {
        self.extensions.as_ref().and_then(|e| e.lights.as_ref()).map_or(&[], |l| &l.lights)
    }

    /// True when the file says that it cannot do without the extension.
    pub(super) fn requires(&self, extension: &str) -> bool {
        self.extensions_required.iter().any(|e| e == extension)
    }

    /// True when the file says that it uses the extension.
    pub(super) fn uses(&self, extension: &str) -> bool {
        self.extensions_used.iter().any(|e| e == extension)
    }
}

/// The message without the line where `text` is only a part of the file.
fn without_line(message: &str, is_part: bool) -> &str {
    message.rsplit_once(" at line ").filter(|_| is_part).map_or(message, |(text, _)| text)
}

/// Reads JSON text into `T`; the error names the member and the line.
pub(super) fn read<'a, T: Deserialize<'a>>(text: &'a str, place: &str) -> Step<T> {
    let is_part = !place.is_empty();
    let mut json = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let path = error.path().to_string();
        let place = match (place, path.as_str()) {
            ("", "." | "?") => "the JSON text".to_owned(),
            ("", path) => path.to_owned(),
            (place, "." | "?") => place.to_owned(),
            (place, path) => format!("{place}.{path}"),
        };
        Problem::at(place, without_line(&error.into_inner().to_string(), is_part))
    })?;
    json.end().map_err(|error| Problem::at("the JSON text", error))?;
    Ok(value)
}
