//! Broken files end in an error or in warnings that name what is wrong; valid ones load.

mod common;

use std::{fs, path::Path};

use kinora::scene::import::{ImportError, from_path};

/// `(file, codes of the errors that a validator finds)` of EXPECTED.json.
fn expected(folder: &Path) -> Vec<(String, Vec<String>)> {
    let text = fs::read_to_string(folder.join("EXPECTED.json")).expect("readable");
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let files = json.as_object().expect("an object").iter().map(|(file, entry)| {
        let has_errors = entry["errors"].as_u64().expect("a count") > 0;
        let codes = entry["codes"].as_array().expect("a list").iter();
        let codes = codes.map(|c| c.as_str().expect("a code").to_owned()).filter(|_| has_errors).collect();
        (file.clone(), codes)
    });
    files.collect()
}

/// Findings after which a picture or a motion would be garbage, so that the file must not load.
const FATAL: [&str; 25] = [
    "ACCESSOR_INDEX_OOB",
    "ACCESSOR_JOINTS_INDEX_OOB",
    "ASSET_MIN_VERSION_GREATER_THAN_VERSION",
    "GLB_CHUNK_TOO_BIG",
    "GLB_DUPLICATE_CHUNK",
    "GLB_EMPTY_CHUNK",
    "GLB_INVALID_MAGIC",
    "GLB_INVALID_VERSION",
    "GLB_LENGTH_MISMATCH",
    "GLB_LENGTH_TOO_SMALL",
    "GLB_UNEXPECTED_BIN_CHUNK",
    "GLB_UNEXPECTED_END_OF_CHUNK_HEADER",
    "GLB_UNEXPECTED_FIRST_CHUNK",
    "INVALID_IBM_ACCESSOR_COUNT",
    "MESH_PRIMITIVE_MORPH_TARGET_INVALID_ATTRIBUTE_COUNT",
    "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT",
    "NODE_LOOP",
    "NODE_PARENT_OVERRIDE",
    "TYPE_MISMATCH",
    "UNKNOWN_ASSET_MAJOR_VERSION",
    "UNUSED_EXTENSION_REQUIRED",
    "BUFFER_VIEW_TOO_LONG",
    "MESH_PRIMITIVE_INDICES_ACCESSOR_WITH_BYTESTRIDE",
    "SKIN_IBM_ACCESSOR_WITH_BYTESTRIDE",
    "ARRAY_TYPE_MISMATCH",
];

/// True when a message starts with a place in a file: `accessors[3].count: ...`, `GLB header: ...`.
fn names_a_place(message: &str) -> bool {
    message.split_once(": ").is_some_and(|(place, reason)| !place.is_empty() && reason.len() >= 4)
}

#[test]
fn every_broken_file_is_refused_or_warned_about_and_valid_ones_load() {
    let Some(shared) = common::shared_dir() else { return };
    let folder = shared.join("assets/invalid");
    let expected = expected(&folder);
    assert_eq!(expected.len(), 149);
    let mut faults = Vec::new();
    for (file, codes) in &expected {
        let path = folder.join(file);
        let mut fault = |what: &str| faults.push(format!("{file} ({}): {what}", codes.join(", ")));
        match from_path(&path) {
            Ok(scene) => {
                if let Some(code) = codes.iter().find(|c| FATAL.contains(&c.as_str())) {
                    fault(&format!("loads in spite of {code}"));
                }
                if !codes.is_empty() && scene.warnings.is_empty() {
                    fault("loads without a warning");
                }
                for warning in scene.warnings.iter().filter(|w| !names_a_place(w)) {
                    fault(&format!("warning without a place: {warning}"));
                }
            }
            Err(error) => {
                let message = error.to_string();
                let start = format!("{}: ", path.display());
                if codes.is_empty() {
                    fault(&format!("is valid but refused: {message}"));
                }
                if !message.strip_prefix(&start).is_some_and(names_a_place) || message.contains('\n') {
                    fault(&format!("message without file and place: {message}"));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn draco_is_named_with_advice() {
    let Some(shared) = common::shared_dir() else { return };
    let error = from_path(&shared.join("assets/khronos/Duck/glTF-Draco/Duck.gltf")).expect_err("needs Draco");
    let ImportError::Unsupported { extension, advice, .. } = error else { panic!("{error}") };
    assert_eq!(extension, "KHR_draco_mesh_compression");
    assert!(advice.contains("export"), "{advice}");
}
