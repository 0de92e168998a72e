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

/// The file's own tangents against those made when they are taken away: same signs, nearly the same directions.
#[test]
fn made_tangents_agree_with_supplied_ones() {
    let Some(shared) = common::shared_dir() else { return };
    let file = shared.join("assets/khronos/NormalTangentMirrorTest/glTF-Binary/NormalTangentMirrorTest.glb");
    let bytes = fs::read(file).expect("readable");
    let mut without = bytes.clone();
    let name = b"\"TANGENT\"";
    let places: Vec<usize> = (0..bytes.len() - name.len()).filter(|&i| bytes[i..].starts_with(name)).collect();
    assert!(!places.is_empty());
    for &at in &places {
        without[at + 1] = b'_';
    }
    let import = |bytes: &[u8]| import::from_bytes("test", bytes, &mut |_| Err(String::new())).expect("valid");
    let (supplied, made) = (import(&bytes), import(&without));
    let (mut count, mut signs, mut near) = (0, 0, 0);
    for (a, b) in supplied.meshes.iter().zip(&made.meshes).flat_map(|(a, b)| a.parts.iter().zip(&b.parts)) {
        assert_eq!(a.tangents.len(), b.tangents.len());
        for (a, b) in a.tangents.iter().zip(&b.tangents) {
            count += 1;
            signs += usize::from(a.w * b.w > 0.0);
            near += usize::from(a.truncate().dot(b.truncate()) > 0.98);
        }
    }
    println!("{count} tangents, {signs} of equal sign, {near} within 11 degrees");
    assert!(count > 1000 && signs * 1000 >= count * 995 && near * 100 >= count * 97);
}
