//! From glTF bytes to a [`Scene`].
//!
//! The JSON text is read into plain structs (`json`), buffers are loaded, and each kind of object is
//! converted by a module of its own. References, ranges and sizes are checked before anything is read or
//! allocated; what a file may make the importer allocate is bounded by its size (`context::Budget`).
//! What would change the picture silently is an error; what can be worked around is a warning; an
//! animation that is not valid disables itself.

use std::path::Path;

use super::Scene;

mod accessor;
mod buffers;
mod cameras;
mod clips;
mod context;
mod decompose;
mod error;
mod extensions;
mod files;
mod glb;
mod graph;
mod images;
mod influences;
mod instancing;
mod json;
mod lint;
mod materials;
mod meshes;
mod meshopt;
mod nodes;
mod pointer;
mod skins;
mod tangents;
mod textures;
mod topology;
mod uri;

pub use error::ImportError;

use buffers::{Buffers, Files};
use context::{Budget, Context, Warnings};
use error::{Problem, Step};

/// Imports a `.gltf` or `.glb` file with everything it refers to.
///
/// Only files in the folder of `path` or below are read.
///
/// # Errors
/// When the file or a file it names cannot be read, or its content is not valid.
pub fn from_path(path: &Path) -> Result<Scene, ImportError> {
    from_path_observed(path, &mut |_, _| {})
}

/// As [`from_path`]; `observe` is shown the bytes of every file as it is read, the scene's own first under an
/// empty name, the others under their URIs.
///
/// # Errors
/// As [`from_path`].
pub fn from_path_observed(path: &Path, observe: &mut dyn FnMut(&str, &[u8])) -> Result<Scene, ImportError> {
    let name = path.display().to_string();
    let bytes = files::read_scene(path).map_err(|reason| ImportError::Read { file: name.clone(), reason })?;
    observe("", &bytes);
    let folder = path.parent().unwrap_or(Path::new(""));
    from_bytes(&name, &bytes, &mut |uri| {
        let bytes = files::read_beside(folder, uri)?;
        observe(uri, &bytes);
        Ok(bytes)
    })
}

/// Imports from memory; `resolve` is asked for the bytes behind each relative URI, percent-decoded, with `/`
/// between its parts and never leading out of the scene's folder.
///
/// # Errors
/// As [`from_path`].
pub fn from_bytes(
    name: &str,
    bytes: &[u8],
    resolve: &mut dyn FnMut(&str) -> Result<Vec<u8>, String>,
) -> Result<Scene, ImportError> {
    let span = tracing::info_span!("import", file = name);
    let _entered = span.enter();
    import(name, bytes, resolve).map_err(|problem| problem.in_file(name))
}

fn import(name: &str, bytes: &[u8], resolve: buffers::Resolver<'_>) -> Step<Scene> {
    let (budget, warnings) = (Budget::new(bytes.len()), Warnings::default());
    let container = glb::split(bytes, &warnings)?;
    let text = json_text(container.json, &warnings)?;
    let json::Object(doc) = json::read::<json::Object<json::Document<'_>>>(text, "")?;
    extensions::check_required(&doc)?;
    let mut files = Files::new(resolve);
    let buffers = Buffers::load(&doc, container.bin, &mut files, &budget, &warnings)?;
    let cx = Context { doc: &doc, buffers, budget: &budget, warnings: &warnings };

    let (images, readable) = images::import(&cx, &mut files)?;
    let textures = textures::import(&cx, &readable)?;
    let materials = materials::import(&cx)?;
    let meshes = meshes::import(&cx)?;
    let skins = skins::import(&cx)?;
    let mut nodes = nodes::import(&cx, &meshes, &skins)?;
    let eval_order = graph::eval_order(&nodes)?;
    let draw_order = graph::draw_order(&cx, &nodes)?;
    let instances = nodes::instances(&cx, &nodes, &draw_order, &meshes)?;
    let mut meshes: Vec<_> = meshes.into_iter().map(|m| m.mesh).collect();
    tangents::fill(&cx, &mut meshes, &materials)?;
    let clips = clips::import(&cx, &mut nodes, &meshes)?;
    let (cameras, lights) = (cameras::import_cameras(&cx)?, cameras::import_lights(&cx)?);
    lint::run(&cx);
    let extensions_ignored = extensions::ignored(&cx, &lint::undeclared(&cx, text));

    Ok(Scene {
        file: Path::new(name).file_name().map_or_else(|| name.to_owned(), |f| f.to_string_lossy().into_owned()),
        scene_count: doc.scenes.len(),
        nodes,
        eval_order,
        draw_order,
        instances,
        meshes,
        skins,
        clips,
        materials,
        textures,
        images,
        cameras,
        lights,
        extensions_used: doc.extensions_used.clone(),
        extensions_ignored,
        warnings: warnings.finish(),
    })
}

/// The JSON chunk as text; a byte order mark is dropped.
fn json_text<'a>(bytes: &'a [u8], warnings: &Warnings) -> Step<&'a str> {
    let text =
        std::str::from_utf8(bytes).map_err(|error| Problem::at("the JSON text", format!("is not UTF-8: {error}")))?;
    let rest = text.strip_prefix('\u{feff}').unwrap_or(text);
    if rest.len() < text.len() {
        warnings.add("the JSON text", "starts with a byte order mark");
    }
    match rest.trim_start().bytes().next() {
        None => Err(Problem::at("the JSON text", "is empty")),
        Some(b'{') => Ok(rest),
        Some(_) => Err(Problem::at("the start", "is neither a GLB header nor the brace of a glTF JSON object")),
    }
}
