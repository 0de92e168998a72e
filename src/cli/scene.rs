//! The SCENE argument and the choice of clips, shared by the commands.

use std::path::Path;

use kinora::{
    anim::ActiveClip,
    output::SettingsHasher,
    scene::{ClipId, Scene, builtin, import},
};

use super::{error::CliError, settings::Settings};

/// Help text of every SCENE argument.
pub(crate) const SCENE_HELP: &str =
    "A .gltf or .glb file, or builtin:NAME (builtin:spd-NAME:SIZE) [default: the first built-in scene]";

/// Help text of every `--animation` option.
pub(crate) const ANIMATION_HELP: &str = "Index or name of an animation, `all` together, or `none` for the rest pose";

/// A scene with a digest of the files it was made of.
#[derive(Debug)]
pub(crate) struct Loaded {
    /// The scene.
    pub(crate) scene: Scene,
    /// Over the bytes of every file that was read, in the order of reading.
    pub(crate) digest: [u8; 32],
}

/// Loads SCENE and prints its warnings, one line each.
///
/// # Errors
/// A usage error that names the file, the place in it and the reason.
pub(crate) fn load(scene: Option<&str>, settings: &Settings) -> Result<Scene, CliError> {
    load_with_digest(scene, settings).map(|l| l.scene)
}

/// As [`load`], with the digest.
///
/// # Errors
/// As [`load`].
pub(crate) fn load_with_digest(scene: Option<&str>, settings: &Settings) -> Result<Loaded, CliError> {
    let loaded = settings.pool.install(|| read(scene))?;
    if settings.verbosity.shows_progress() {
        for warning in &loaded.scene.warnings {
            eprintln!("warning: {}: {warning}", loaded.scene.file);
        }
    }
    Ok(loaded)
}

fn read(scene: Option<&str>) -> Result<Loaded, CliError> {
    let mut hasher = SettingsHasher::default();
    let text = scene.map_or_else(|| format!("builtin:{}", builtin::names()[0]), str::to_owned);
    let scene = if let Some(name) = text.strip_prefix("builtin:") {
        hasher.add(name, builtin::bytes(name).unwrap_or_default());
        builtin::load(name)?
    } else {
        import::from_path_observed(Path::new(&text), &mut |name, bytes| hasher.add(name, bytes))?
    };
    Ok(Loaded { scene, digest: hasher.digest() })
}

/// The clips that `--animation` asks for, in playing order.
///
/// Without the option: the first clip that is not disabled, if there is one. `all` leaves disabled clips out.
/// A number is an index; any other text must be a clip's name.
///
/// # Errors
/// A usage error when no clip matches, or the one named is disabled.
pub(crate) fn select_clips(scene: &Scene, choice: Option<&str>) -> Result<Vec<ClipId>, CliError> {
    let ids = || (0u32..).zip(&scene.clips);
    let playable = || ids().filter(|(_, c)| c.disabled.is_none()).map(|(i, _)| ClipId(i));
    let Some(choice) = choice else {
        return Ok(playable().take(1).collect());
    };
    match choice {
        "none" => return Ok(Vec::new()),
        "all" => return Ok(playable().collect()),
        _ => {}
    }
    let by_index = choice.parse::<usize>().ok().and_then(|i| ids().nth(i));
    let Some((index, clip)) = by_index.or_else(|| ids().find(|(_, c)| c.name == choice)) else {
        return Err(CliError::usage(format!("{}: no animation `{choice}`; {}", scene.file, known_clips(scene))));
    };
    match &clip.disabled {
        None => Ok(vec![ClipId(index)]),
        Some(reason) => Err(CliError::usage(format!("{}: animation `{choice}` is disabled: {reason}", scene.file))),
    }
}

fn known_clips(scene: &Scene) -> String {
    const SHOWN: usize = 20;
    if scene.clips.is_empty() {
        return "the file has none".to_owned();
    }
    let name = |(i, name): (usize, &str)| if name.is_empty() { i.to_string() } else { format!("{i} `{name}`") };
    let names: Vec<_> = scene.clips.iter().map(|c| c.name.as_str()).enumerate().take(SHOWN).map(name).collect();
    let rest = if scene.clips.len() > SHOWN { ", ..." } else { "" };
    format!("it has {}{rest}", names.join(", "))
}

/// `clips` at a common time in seconds.
pub(crate) fn at_time(clips: &[ClipId], time_s: f64) -> Vec<ActiveClip> {
    clips.iter().map(|&clip| ActiveClip { clip, time_s }).collect()
}

/// The longest of `clips` in seconds; 0 without clips.
pub(crate) fn duration(scene: &Scene, clips: &[ClipId]) -> f64 {
    clips.iter().map(|c| scene.clips[c.index()].duration_s).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use kinora::scene::Clip;

    use super::*;

    fn scene() -> Scene {
        let clip = |name: &str, disabled: Option<&str>| Clip {
            name: name.to_owned(),
            disabled: disabled.map(str::to_owned),
            ..Clip::default()
        };
        Scene {
            file: "a.glb".to_owned(),
            clips: vec![clip("bad", Some("no keys")), clip("walk", None), clip("1", None)],
            ..Scene::default()
        }
    }

    #[test]
    fn clips_are_found_by_index_then_name_and_disabled_ones_are_left_out() {
        let scene = scene();
        let select = |choice| select_clips(&scene, choice).map_err(|e| e.to_string());
        assert_eq!(select(None), Ok(vec![ClipId(1)]));
        assert_eq!(select(Some("none")), Ok(vec![]));
        assert_eq!(select(Some("all")), Ok(vec![ClipId(1), ClipId(2)]));
        assert_eq!(select(Some("walk")), Ok(vec![ClipId(1)]));
        assert_eq!(select(Some("1")), Ok(vec![ClipId(1)]));
        assert_eq!(select(Some("bad")), Err("a.glb: animation `bad` is disabled: no keys".to_owned()));
        assert_eq!(select(Some("run")), Err("a.glb: no animation `run`; it has 0 `bad`, 1 `walk`, 2 `1`".to_owned()));
    }
}
