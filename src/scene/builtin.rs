//! The scenes compiled into the program: files that `examples/make_scenes` makes (`animations/SOURCES.md` tells of
//! them), and the databases of [`spd`](super::spd), which are made when they are asked for.

use super::{
    Scene,
    import::{self, ImportError},
    spd::SpdKind,
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

/// Names of the databases: `spd-NAME`, to which `:SIZE` may be added.
const DATABASES: [&str; SpdKind::ALL.len()] = [
    "spd-balls",
    "spd-gears",
    "spd-mount",
    "spd-rings",
    "spd-tetra",
    "spd-tree",
    "spd-teapot",
    "spd-lattice",
    "spd-jacks",
];

/// Names of the built-in scenes that are files; the first one is the default.
pub fn names() -> &'static [&'static str] {
    &NAMES
}

/// Names of the built-in scenes that are made on demand; `NAME:SIZE` gives one another size factor.
pub fn generated_names() -> &'static [&'static str] {
    &DATABASES
}

/// The `.glb` file of a built-in scene; `None` for an unknown name and for those without a file.
pub fn bytes(name: &str) -> Option<&'static [u8]> {
    SCENES.iter().find(|scene| scene.0 == name).map(|scene| scene.1)
}

/// Imports or makes a built-in scene. Its [`Scene::file`] is `builtin:NAME`.
///
/// # Errors
/// For an unknown name; the message lists the known ones. For a size factor that is out of range.
pub fn load(name: &str) -> Result<Scene, ImportError> {
    let file = format!("builtin:{name}");
    if let Some(bytes) = bytes(name) {
        return import::from_bytes(&file, bytes, &mut |uri| {
            Err(format!("{uri}: built-in scenes hold everything themselves"))
        });
    }
    match database(name) {
        Ok(scene) => Ok(Scene { file, ..scene }),
        Err(reason) => Err(ImportError::Read { file, reason }),
    }
}

/// The database of a name with or without a size factor.
fn database(name: &str) -> Result<Scene, String> {
    let (database, size) = name.split_once(':').map_or((name, None), |(name, size)| (name, Some(size)));
    let Some(kind) = database.strip_prefix("spd-").and_then(SpdKind::from_name) else {
        let known: Vec<_> = names().iter().chain(generated_names()).copied().collect();
        return Err(format!("there is no such built-in scene; there are {}", known.join(", ")));
    };
    let size = match size {
        None => kind.default_size(),
        Some(text) => {
            let max = kind.max_size();
            text.parse().map_err(|_| format!("`{text}` is not a size factor: a whole number in 1..={max}"))?
        }
    };
    Ok(kind.generate(size).map_err(|error| error.to_string())?.tessellate())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn databases_are_listed_under_their_own_names() {
        for (kind, name) in SpdKind::ALL.into_iter().zip(generated_names()) {
            assert_eq!(name.strip_prefix("spd-"), Some(kind.name()));
        }
    }

    #[test]
    fn size_factors_are_read_and_checked() {
        assert_eq!(load("spd-tetra:2").map(|s| s.triangles_drawn()).map_err(|e| e.to_string()), Ok(16));
        for (name, due) in [
            ("spd-tetra:11", "size 11 is not in 1..=10"),
            ("spd-tetra:0", "size 0 is not in 1..=10"),
            ("spd-tetra:", "`` is not a size factor"),
            ("spd-tetra:-1", "`-1` is not a size factor"),
            ("spd-tetra:99999999999", "`99999999999` is not a size factor"),
            ("spd-nope", "there is no such built-in scene"),
            ("walk:2", "there is no such built-in scene"),
        ] {
            let message = load(name).expect_err("not valid").to_string();
            assert!(message.contains(due) && message.contains(name), "{message}");
        }
    }
}
