//! Arguments as typed; [`Settings`](super::settings::Settings) checks the common ones.

use clap::{ArgAction, Args, Parser, Subcommand};
use kinora::{
    accel::{AccelKind, AccelSpec, Precision},
    world::TopKind,
};

#[cfg(feature = "player")]
use super::play::PlayArgs;
use super::{
    cast::CastArgs,
    collide::CollideArgs,
    completions::CompletionsArgs,
    info::InfoArgs,
    logs::Verbosity,
    man::ManArgs,
    pose::PoseArgs,
    render::RenderArgs,
    report::ReportArgs,
    values::{self, SimdChoice},
};

/// Plays, renders and queries animated glTF scenes by ray tracing on the CPU.
#[derive(Debug, Parser)]
#[command(name = "kinora", version, propagate_version = true, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(flatten)]
    pub(crate) common: CommonArgs,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    #[cfg(feature = "player")]
    /// Play a scene in a window
    Play(PlayArgs),
    /// Render a frame sequence or a still to files
    Render(RenderArgs),
    /// Say what a file holds and what it needs
    Info(InfoArgs),
    /// Write the world-space vertices of every mesh part at one time
    Pose(PoseArgs),
    /// Answer rays from a file, timed
    Cast(CastArgs),
    /// Step an animation and print what touches what, one JSON object a line
    Collide(CollideArgs),
    /// Measure structures, with tables, plots and bounds
    Report(ReportArgs),
    /// Print a shell's completion script
    Completions(CompletionsArgs),
    /// Print a manual page (roff)
    Man(ManArgs),
}

/// Options of every command.
#[derive(Debug, Args)]
#[command(next_help_heading = "Common options")]
pub(crate) struct CommonArgs {
    #[arg(long, global = true, value_name = "N", help = THREADS_HELP)]
    pub(crate) threads: Option<usize>,
    #[arg(long, global = true, value_name = "NAME", default_value = "bvh8", value_parser = values::accel, help = accel_help())]
    pub(crate) accel: AccelSpec,
    /// Structure over groups of triangles
    #[arg(long, global = true, value_name = "NAME", default_value = "bvh2", value_parser = values::top())]
    pub(crate) top: TopKind,
    /// exact: hits proven right, the same bytes on every machine; fast: the cheapest form of each step, with errors
    #[arg(long, global = true, value_name = "PRECISION", default_value = "exact", value_parser = values::precision())]
    pub(crate) precision: Precision,
    /// Instruction set of the kernels; changes no result
    #[arg(long, global = true, value_name = "LEVEL", default_value = "auto", value_parser = values::simd())]
    pub(crate) simd: SimdChoice,
    /// Print errors only
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print more: -v what was chosen and why, -vv stages, -vvv everything
    #[arg(short, long, global = true, action = ArgAction::Count)]
    verbose: u8,
}

impl CommonArgs {
    /// How much to print.
    pub(crate) fn verbosity(&self) -> Verbosity {
        if self.quiet { Verbosity::QUIET } else { Verbosity::new(self.verbose) }
    }
}

const THREADS_HELP: &str = "Worker threads [default: KINORA_THREADS, else what the scheduler granted, else all cores]";

fn accel_help() -> String {
    format!(
        "Structure over triangles, with its settings: NAME[:key=value,...]; there are {}. bvh2, bvh8 and ssh take build=sah, \
         build=fast (built about three times as fast, rays 5 to 20 % slower) and build=median",
        AccelKind::names()
    )
}
