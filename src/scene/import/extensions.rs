//! Which extensions are honoured, and what to say about the others.

use super::{
    context::Context,
    error::{Problem, Step},
    json::Document,
};

/// Extensions that the importer honours.
const HONOURED: [&str; 10] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
];

fn is_honoured(extension: &str) -> bool {
    HONOURED.contains(&extension)
}

fn advice(extension: &str) -> &'static str {
    match extension {
        "KHR_draco_mesh_compression" => "export the file again without Draco compression, or with meshopt",
        "KHR_texture_basisu" | "MSFT_texture_dds" | "EXT_texture_avif" => {
            "export the file again with PNG, JPEG or WebP textures"
        }
        "KHR_materials_pbrSpecularGlossiness" => "convert the materials to metallic-roughness",
        _ => "export the file again without it",
    }
}

/// Most names that the lists of extensions may hold.
const MAX_NAMES: usize = 1000;

/// Checks the version and that every required extension is honoured.
pub(super) fn check_required(doc: &Document<'_>) -> Step<()> {
    let asset = &doc.asset.0;
    let major = asset.version.split('.').next().unwrap_or_default();
    if major != "2" {
        let reason = format!("`{}`; only glTF 2 can be read", asset.version.escape_debug());
        return Err(Problem::at("asset.version", reason));
    }
    if let Some(least) = asset.min_version.as_deref().filter(|&v| v != "2.0") {
        let reason = format!("`{}`; this reads glTF 2.0", least.escape_debug());
        return Err(Problem::at("asset.minVersion", reason));
    }
    for (place, list) in [("extensionsUsed", &doc.extensions_used), ("extensionsRequired", &doc.extensions_required)] {
        if list.len() > MAX_NAMES {
            return Err(Problem::at(place, format!("names {} extensions; at most {MAX_NAMES} are read", list.len())));
        }
    }
    match doc.extensions_required.iter().find(|e| !is_honoured(e)) {
        Some(extension) => Err(Problem::Unsupported {
            extension: extension.escape_debug().to_string(),
            advice: advice(extension).to_owned(),
        }),
        None => Ok(()),
    }
}

/// Used extensions that are not honoured, each with a warning. `undeclared` are those that the file uses
/// without saying so.
pub(super) fn ignored(cx: &Context<'_>, undeclared: &[String]) -> Vec<String> {
    let mut ignored: Vec<String> = Vec::new();
    for extension in cx.doc.extensions_used.iter().chain(undeclared).filter(|e| !is_honoured(e)) {
        if !ignored.contains(extension) {
            cx.warnings.add("extensionsUsed", format_args!("{} is ignored", extension.escape_debug()));
            ignored.push(extension.clone());
        }
    }
    ignored
}
