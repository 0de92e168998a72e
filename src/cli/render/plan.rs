//! Arguments and scene, checked: everything that is known before the first frame.

use std::sync::Arc;

use kinora::{
    dynamics::RebuildPolicy,
    output::{
        Chroma, ExrColor, FilmFormat, FilmSettings, Fps, FrameList, SettingsHash, SettingsHasher, Shard, Stamp, Target,
    },
    render::Shading,
    scene::{ClipId, Scene},
};

use super::RenderArgs;
use crate::cli::{
    error::CliError,
    scene::{self, Loaded},
    settings::Settings,
    shard,
    view::Viewpoint,
};

/// Longest side and largest area of a picture in pixels.
const MAX_SIDE: u32 = 65_535;
const MAX_AREA: u64 = 1 << 27;

/// Most samples a pixel.
pub(crate) const MAX_SAMPLES: u32 = 1 << 20;

/// What the arguments say by themselves.
#[derive(Debug)]
pub(super) struct Request {
    target: Target,
    frames: Option<FrameList>,
    size: (u32, u32),
    shading: Shading,
    shard: Option<Shard>,
    exr_color: ExrColor,
    chroma: Chroma,
    policy: RebuildPolicy,
}

impl Request {
    /// Checks every option that needs no scene.
    ///
    /// # Errors
    /// A usage error naming the option.
    pub(super) fn check(args: &RenderArgs) -> Result<Self, CliError> {
        let named = |option: &'static str| move |why: String| CliError::usage(format!("--{option} {why}"));
        let output = args.output.display().to_string();
        let target = Target::parse(&args.output).map_err(|why| CliError::usage(format!("--output {output}: {why}")))?;
        if !(1..=MAX_SAMPLES).contains(&args.samples) {
            return Err(named("samples")(format!("{}: expected 1 to {MAX_SAMPLES}", args.samples)));
        }
        if target == Target::Stdout {
            check_stdout(args)?;
        }
        if args.shard.is_some() && target.holds_all_frames() {
            return Err(named("shard")(format!(
                "{output}: parts of one film cannot be joined; use a numbered sequence"
            )));
        }
        Ok(Self {
            target,
            frames: args.frames.as_deref().map(str::parse).transpose().map_err(named("frames"))?,
            size: size(&args.size).map_err(named("size"))?,
            shading: shading(&args.shading).map_err(named("shading"))?,
            shard: args.shard.as_deref().map(|s| shard::shard(s, args.shard_count)).transpose()?,
            exr_color: pick(&args.exr_color, &[("half", ExrColor::Half), ("float", ExrColor::Float)])
                .map_err(named("exr-color"))?,
            chroma: pick(&args.chroma, &[("420", Chroma::C420), ("444", Chroma::C444)]).map_err(named("chroma"))?,
            policy: policy(&args.policy).map_err(named("policy"))?,
        })
    }
}

/// Everything about a run.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) scene: Arc<Scene>,
    pub(super) clips: Vec<ClipId>,
    pub(super) viewpoint: Viewpoint,
    pub(super) target: Target,
    /// The frames of this shard, each once unless the target is a film.
    pub(super) frames: Vec<u64>,
    pub(super) fps: Fps,
    pub(super) size: (u32, u32),
    pub(super) samples: u32,
    pub(super) seed: u64,
    pub(super) shading: Shading,
    pub(super) exr_color: ExrColor,
    pub(super) film: FilmSettings,
    pub(super) policy: RebuildPolicy,
    pub(super) settings: SettingsHash,
    pub(super) resume: bool,
    pub(super) overwrite: bool,
}

impl Plan {
    /// Joins the arguments with the scene.
    ///
    /// # Errors
    /// A usage error: no such animation or camera, several frames for one still, too many frames.
    pub(super) fn new(
        args: &RenderArgs,
        request: Request,
        loaded: Loaded,
        settings: &Settings,
    ) -> Result<Self, CliError> {
        let Request { target, frames, size, shading, shard, exr_color, chroma, policy } = request;
        let Loaded { scene, digest } = loaded;
        let clips = scene::select_clips(&scene, args.animation.as_deref())?;
        let list = match frames {
            Some(list) => list,
            None => FrameList::whole(scene::duration(&scene, &clips), args.fps).map_err(CliError::usage)?,
        };
        let list = if target.holds_all_frames() { list } else { list.distinct() };
        if matches!(target, Target::Still(..)) && list.frames().len() > 1 {
            return Err(CliError::usage(format!(
                "--output {}: {} frames need a run of # for their numbers, as frame_####.png, or a film (.apng, .gif, .y4m)",
                args.output.display(),
                list.frames().len()
            )));
        }
        let aspect = size.0 as f32 / size.1 as f32;
        let viewpoint = settings.pool.install(|| Viewpoint::select(&scene, &args.camera, &clips, aspect))?;

        let mut hasher = SettingsHasher::default();
        hasher.add("scene", &digest);
        for (name, value) in [
            ("clips", format!("{clips:?}")),
            ("camera", args.camera.clone()),
            ("fps", args.fps.to_string()),
            ("size", format!("{size:?}")),
            ("samples", args.samples.to_string()),
            ("seed", args.seed.to_string()),
            ("shading", args.shading.clone()),
            ("format", format!("{:?}", format_options(&target, exr_color, chroma))),
        ] {
            hasher.add(name, value.as_bytes());
        }
        if target.holds_all_frames() {
            hasher.add("frames", format!("{:?}", list.frames()).as_bytes());
        }
        let settings = hasher.finish();

        let rate = list.step().and_then(|step| args.fps.divided(step)).unwrap_or(args.fps);
        let count = list.frames().len() as u64;
        let stamp = Stamp::of_film(&settings, count);
        let film = FilmSettings { width: size.0, height: size.1, fps: rate, frames: count, chroma, stamp };
        Ok(Self {
            scene: Arc::new(scene),
            clips,
            viewpoint,
            frames: shard.map_or_else(|| list.frames().to_vec(), |s| s.of(list.frames())),
            target,
            fps: args.fps,
            size,
            samples: args.samples,
            seed: args.seed,
            shading,
            exr_color,
            film,
            policy,
            settings,
            resume: args.resume,
            overwrite: args.overwrite,
        })
    }
}

/// The options that decide a file's bytes besides the picture.
fn format_options(target: &Target, exr_color: ExrColor, chroma: Chroma) -> (Option<ExrColor>, Option<Chroma>) {
    match target {
        Target::Sequence(_, format) | Target::Still(_, format) => {
            ((*format == kinora::output::StillFormat::Exr).then_some(exr_color), None)
        }
        Target::Film(_, format) => (None, (*format == FilmFormat::Y4m).then_some(chroma)),
        Target::Stdout => (None, Some(chroma)),
    }
}

fn check_stdout(args: &RenderArgs) -> Result<(), CliError> {
    use std::io::IsTerminal;
    if args.json {
        return Err(CliError::usage("--json and --output -: stdout can hold only one of them"));
    }
    if args.resume {
        return Err(CliError::usage("--resume and --output -: nothing is kept of a stream"));
    }
    if std::io::stdout().is_terminal() {
        return Err(CliError::usage("--output -: stdout is a terminal; send the video to a file or program"));
    }
    Ok(())
}

/// Width and height in pixels from `1280x720`.
///
/// # Errors
/// Words on what is wrong with the text.
pub(crate) fn size(text: &str) -> Result<(u32, u32), String> {
    let side = |t: &str| t.parse::<u32>().ok().filter(|_| t.bytes().all(|b| b.is_ascii_digit()));
    let parsed = text.split_once(['x', 'X']).and_then(|(w, h)| Some((side(w)?, side(h)?)));
    let (w, h) = parsed.ok_or_else(|| format!("`{text}`: expected WIDTHxHEIGHT in pixels, as 1280x720"))?;
    let sides = 1..=MAX_SIDE;
    if !sides.contains(&w) || !sides.contains(&h) || u64::from(w) * u64::from(h) > MAX_AREA {
        return Err(format!("`{text}`: sides must be 1 to {MAX_SIDE} and the area at most {MAX_AREA} pixels"));
    }
    Ok((w, h))
}

/// The value named `text`.
fn pick<T: Copy>(text: &str, values: &[(&str, T)]) -> Result<T, String> {
    let names = || values.iter().map(|v| v.0).collect::<Vec<_>>().join(", ");
    let found = values.iter().find(|v| v.0 == text).map(|v| v.1);
    found.ok_or_else(|| format!("`{text}`: there are {}", names()))
}

/// The shading of a name.
///
/// # Errors
/// Words naming those that exist.
pub(crate) fn shading(text: &str) -> Result<Shading, String> {
    pick(text, &Shading::ALL.map(|s| (s.name(), s)))
}

fn policy(text: &str) -> Result<RebuildPolicy, String> {
    if let Some(k) = text.strip_prefix("swap-every=") {
        let k = k.parse().ok().filter(|&k| k > 0);
        return k
            .map(RebuildPolicy::SwapEvery)
            .ok_or_else(|| format!("`{text}`: expected swap-every=K with K of 1 or more"));
    }
    pick(text, &[("async", RebuildPolicy::Async), ("refit", RebuildPolicy::Refit), ("rebuild", RebuildPolicy::Rebuild)])
        .map_err(|why| format!("{why}, swap-every=K"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_positive_numbers_within_bounds() {
        assert_eq!(size("1280x720"), Ok((1280, 720)));
        assert_eq!(size("1X1"), Ok((1, 1)));
        for wrong in ["", "x", "1280", "0x1", "1x0", "-1x5", "1x5x6", "65536x1", "60000x60000", "1.5x2", "+1x2"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn policies_are_named() {
        assert_eq!(policy("async"), Ok(RebuildPolicy::Async));
        assert_eq!(policy("swap-every=3"), Ok(RebuildPolicy::SwapEvery(3)));
        for wrong in ["", "swap-every=0", "swap-every=", "swap-every=x", "never"] {
            assert!(policy(wrong).is_err(), "{wrong}");
        }
    }
}
