//! `kinora pose`: the world-space vertices of every mesh part at one time.

use std::path::PathBuf;

use clap::Args;
use kinora::{
    anim::Pose,
    glam::DAffine3,
    output::{AtomicFile, PosClips, PosFile, Unfinished, atomic},
};

use super::{
    error::CliError,
    scene::{self, ANIMATION_HELP, SCENE_HELP},
    settings::Settings,
};

/// Arguments of `pose`.
#[derive(Debug, Args)]
pub(crate) struct PoseArgs {
    #[arg(value_name = "SCENE", help = SCENE_HELP)]
    scene: Option<String>,
    #[arg(long, value_name = "INDEX|NAME|all|none", help = ANIMATION_HELP)]
    animation: Option<String>,
    /// Time on the animation's clock in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, allow_negative_numbers = true)]
    time: f64,
    /// File to write
    #[arg(long, value_name = "FILE")]
    output: PathBuf,
}

/// Writes the file.
///
/// # Errors
/// When the scene cannot be loaded or the file cannot be written.
pub(crate) fn run(args: &PoseArgs, settings: &Settings) -> Result<(), CliError> {
    if !args.time.is_finite() {
        return Err(CliError::usage(format!("--time {}: expected a finite number of seconds", args.time)));
    }
    let scene = scene::load(args.scene.as_deref(), settings)?;
    let clips = scene::select_clips(&scene, args.animation.as_deref())?;
    let mut pose = Pose::rest(&scene);
    pose.evaluate(&scene, &scene::at_time(&clips, args.time), &DAffine3::IDENTITY);
    let clips = match (clips.as_slice(), args.animation.as_deref()) {
        (_, Some("all")) => PosClips::All,
        (&[clip], _) => PosClips::One(clip),
        _ => PosClips::None,
    };
    atomic::prepare(&args.output)?;
    let mut file = AtomicFile::create(&args.output, &Unfinished::default())?;
    let Settings { precision, simd, .. } = *settings;
    let content = PosFile { scene: &scene, pose: &pose, clips, time_s: args.time, precision, simd };
    settings
        .pool
        .install(|| content.write(&mut file))
        .map_err(|e| CliError::failed(format!("{}: cannot write: {e}", args.output.display())))?;
    Ok(file.finish()?)
}
