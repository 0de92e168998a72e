//! The scenes compiled into the program. `examples/make_scenes` makes them; `animations/SOURCES.md` tells of them.

use super::{
    Scene,
    import::{self, ImportError},
};

/// Names in the order they are listed; the first is the default scene.
const NAMES: &[&str] = &["walk"];

/// Names of the built-in scenes; the first one is the default.
pub fn names() -> &'static [&'static str] {
    NAMES
}

/// The `.glb` file of a built-in scene; `None` for an unknown name.
pub fn bytes(name: &str) -> Option<&'static [u8]> {
    Some(match name {
        "walk" => include_bytes!("../../animations/walk.glb"),
        _ => return None,
    })
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
