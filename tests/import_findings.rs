//! Inputs that fuzzing found wanting once, and every public asset, against what `Scene` promises.

mod common;
#[path = "common/invariants.rs"]
mod invariants;

use std::{fs, path::Path};

use kinora::scene::import;

#[test]
fn findings_of_fuzzing_stay_fixed() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/import"));
    let mut count = 0;
    for entry in fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        let bytes = fs::read(&path).expect("readable");
        count += 1;
        match import::from_bytes("finding", &bytes, &mut |_| Ok(bytes.clone())) {
            Ok(scene) => invariants::check(&scene),
            Err(error) => assert!(!error.to_string().contains('\n'), "{}: {error}", path.display()),
        }
    }
    assert!(count > 0);
}

#[test]
fn public_assets_keep_the_promises_of_scene() {
    let Some(shared) = common::shared_dir() else { return };
    let files = [
        "blender-io/24_animation_pointer/24_animation_pointer.gltf",
        "derived/CesiumMan.meshopt.glb",
        "kaykit/Knight.glb",
        "khronos/MorphStressTest/glTF-Binary/MorphStressTest.glb",
        "khronos/SimpleInstancing/glTF-Binary/SimpleInstancing.glb",
        "tinygltf/singleBlendshapeCube_sparse.glb",
    ];
    for file in files {
        let scene = import::from_path(&shared.join("assets").join(file)).expect("valid");
        invariants::check(&scene);
        assert!(!scene.instances.is_empty());
    }
}
