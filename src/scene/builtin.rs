//! The scenes compiled into the program. `examples/make_scenes` makes them; `animations/SOURCES.md` tells of them.

use super::{
    Scene,
    import::{self, ImportError},
};

/// Names and files in the order they are listed; the first is the default scene.
const SCENES: [(&str, &[u8]); 4] = [
    ("walk", include_bytes!("../../animations/walk.glb")),
    ("cloth", include_bytes!("../../animations/cloth.glb")),
    ("explode", include_bytes!("../../animations/explode.glb")),
    ("tumble", include_bytes!("../../animations/tumble.glb")),
];

const NAMES: [&str; SCENES.len()] = {
    let mut names = [""; SCENES.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = SCENES[i].0;
        i += 1;
    }
    names
};

/// Names of the built-in scenes; the first one is the default.
pub fn names() -> &'static [&'static str] {
    &NAMES
}

/// The `.glb` file of a built-in scene; `None` for an unknown name.
pub fn bytes(name: &str) -> Option<&'static [u8]> {
    SCENES.iter().find(|scene| scene.0 == name).map(|scene| scene.1)
}

/// Imports a built-in scene. Its [`Scene::file`] is `builtin:NAME`.
///
/// # Errors
/// For an unknown name; the message lists the known ones.
pub fn load(name: &str) -> Result<Scene, ImportError> {
    let file = format!("builtin:{name}");
    let Some(bytes) = bytes(name) else {
        let reason = format!("there is no such built-in scene; there are {}", names().join(", "));
        return Err(ImportError::Read { file, reason });
    };
    import::from_bytes(&file, bytes, &mut |uri| Err(format!("{uri}: built-in scenes hold everything themselves")))
}
