//! `kinora info` on the built-in scene, on files built here and on broken ones.

mod common;

use std::{fs, path::Path};

use assert_cmd::Command;
use serde_json::Value;

fn info(args: &[&str]) -> (i32, String, String) {
    let output = Command::cargo_bin("kinora").expect("built").arg("info").args(args).output().expect("runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code().expect("no signal"), text(output.stdout), text(output.stderr))
}

fn json(path: &Path) -> Value {
    let (code, out, err) = info(&[path.to_str().expect("UTF-8"), "--json", "--threads", "1"]);
    assert_eq!(code, 0, "{err}");
    assert_eq!(out.trim_end().lines().count(), 1, "one object on one line");
    serde_json::from_str(&out).expect("JSON")
}

const FIELDS: [&str; 20] = [
    "animations",
    "cameras",
    "classes",
    "extensions_ignored",
    "extensions_used",
    "file",
    "joints",
    "left_out",
    "lights",
    "materials",
    "meshes",
    "morph_targets",
    "nodes",
    "parts",
    "scenes",
    "textures",
    "triangles",
    "triangles_drawn",
    "vertices",
    "warnings",
];

#[test]
fn the_object_has_the_fields_of_the_contract_and_no_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("small.gltf");
    fs::write(
        &path,
        r#"{"asset":{"version":"2.0"},"nodes":[{}],"extensionsUsed":["XYZ_new"],"animations":[
        {"name":"broken","channels":[{"sampler":0,"target":{"node":0,"path":"scale"}}],"samplers":[]}]}"#,
    )
    .expect("written");
    let object = json(&path);
    let mut keys: Vec<_> = object.as_object().expect("an object").keys().map(String::as_str).collect();
    keys.sort_unstable();
    assert_eq!(keys, FIELDS);
    assert_eq!(object["file"], "small.gltf");
    assert_eq!(object["extensions_ignored"], serde_json::json!(["XYZ_new"]));
    let animation = &object["animations"][0];
    assert_eq!((&animation["name"], &animation["channels"]), (&"broken".into(), &1.into()));
    assert!(animation["disabled"].as_str().is_some_and(|why| why.contains("animations[0]")), "{animation}");
    assert_eq!(object["classes"], serde_json::json!({ "static": 0, "rigid": 0, "deforming": 0 }));
    assert!(
        object["left_out"].as_array().expect("a list").iter().all(|l| l["feature"].is_string() && l["why"].is_string())
    );
}

#[test]
fn the_built_in_scenes_are_listed_and_the_first_is_the_default() {
    let (code, out, _) = info(&["--list-builtin"]);
    assert_eq!(code, 0);
    let first = out.lines().next().expect("a name");
    let (code, out, _) = info(&[]);
    assert_eq!(code, 0);
    assert!(out.starts_with(&format!("builtin:{first}\n")), "{out}");
    assert!(out.contains("triangles") && out.contains("drawn parts"), "{out}");
    let (code, out, _) = info(&["--list-builtin", "--json"]);
    assert_eq!((code, out.lines().count()), (0, 1));
}

#[test]
fn missing_and_broken_files_end_in_2_with_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let broken = folder.path().join("broken.gltf");
    fs::write(&broken, r#"{"asset":{"version":"2.0"},"nodes":[{"children":[7]}]}"#).expect("written");
    let missing = folder.path().join("missing.glb");
    let this = folder.path();
    for (path, reason) in [(broken.as_path(), "nodes[0].children[0]"), (&missing, "cannot read"), (this, "folder")] {
        for extra in ["--json", "-q"] {
            let (code, out, err) = info(&[path.to_str().expect("UTF-8"), extra]);
            assert_eq!((code, out.as_str()), (2, ""), "{err}");
            assert!(err.trim_end().lines().count() == 1 && err.contains(reason), "{err}");
            assert!(err.contains(path.file_name().expect("a name").to_str().expect("UTF-8")), "{err}");
        }
    }
}

#[test]
fn classes_and_counts_of_public_assets_are_told() {
    let Some(shared) = common::shared_dir() else { return };
    let assets = shared.join("assets/khronos");
    let man = json(&assets.join("CesiumMan/glTF-Binary/CesiumMan.glb"));
    let numbers = ["triangles", "triangles_drawn", "vertices", "joints", "morph_targets"].map(|k| man[k].as_u64());
    assert_eq!(numbers, [Some(4672), Some(4672), Some(3273), Some(19), Some(0)]);
    assert_eq!(man["classes"], serde_json::json!({ "static": 0, "rigid": 0, "deforming": 1 }));
    assert_eq!(man["animations"][0]["duration_s"], 2.0);
    let truck = json(&assets.join("CesiumMilkTruck/glTF-Binary/CesiumMilkTruck.glb"));
    assert_eq!(truck["triangles_drawn"], 3624);
    assert_eq!(truck["classes"]["rigid"], 2);
    assert_eq!(truck["classes"]["deforming"], 0);
}
