//! Arguments and scene, checked: everything that is known before the first frame.

use std::sync::Arc;

use kinora::{
    accel::Precision,
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

/// What the arguments say together, without the scene.
#[derive(Debug)]
pub(super) struct Request {
    target: Target,
    shard: Option<Shard>,
}

impl Request {
    /// Checks the options against each other.
    ///
    /// # Errors
    /// A usage error naming the option.
    pub(super) fn check(args: &RenderArgs) -> Result<Self, CliError> {
        let output = args.output.display();
        let target = Target::parse(&args.output).map_err(|why| CliError::usage(format!("--output {output}: {why}")))?;
        if target == Target::Stdout {
            check_stdout(args)?;
        }
        if args.shard.is_some() && target.holds_all_frames() {
            return Err(CliError::usage(format!(
                "--shard with --output {output}: parts of one film cannot be joined; use a numbered sequence"
            )));
        }
        Ok(Self { target, shard: args.shard.as_deref().map(|s| shard::shard(s, args.shard_count)).transpose()? })
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
        let Request { target, shard } = request;
        let &RenderArgs { size, shading, exr_color, chroma, policy, .. } = args;
        let Loaded { scene, digest } = loaded;
        let clips = scene::select_clips(&scene, args.animation.as_deref())?;
        let list = match &args.frames {
            Some(list) => list.clone(),
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
            ("camera", viewpoint.key()),
            ("fps", args.fps.to_string()),
            ("size", format!("{size:?}")),
            ("samples", args.samples.to_string()),
            ("seed", args.seed.to_string()),
            ("shading", shading.name().to_owned()),
            ("precision", precision_key(settings)),
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

/// What the precision makes pictures depend on.
fn precision_key(settings: &Settings) -> String {
    match settings.precision {
        Precision::Exact => "exact".to_owned(),
        Precision::Fast => format!("fast {} {} {}", settings.accel, settings.top, settings.simd),
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
