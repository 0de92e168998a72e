//! `kinora report`: measurements with tables and plots.

mod monitor;
mod plays;

use std::{
    fmt::Write,
    path::{Path, PathBuf},
    sync::Arc,
};

use clap::Args;
use kinora::{
    accel::AccelSpec,
    dynamics::RebuildPolicy,
    output::{Unfinished, atomic},
    report::{
        Kind, Report, ReportError, Subject,
        accuracy::{self, Source},
        baseline::{Baseline, Changes},
        frames::{self, Play},
        papers, structures,
    },
};

use self::monitor::Watching;
use super::{error::CliError, geometry, scene, settings::Settings, signals::Signals, stdout, values};

/// Arguments of `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    /// What to measure
    #[arg(value_name = "KIND", value_parser = values::report())]
    kind: Kind,
    /// Scenes or meshes (.gltf, .glb, builtin:NAME, .tris, .ply, .obj, .stl). Without any, `structures` takes the built-in scenes, generated
    /// meshes and growth over the number of triangles; `accuracy` takes the built-in scenes and closed meshes; `frames` the built-in scenes, a burst
    /// and a crowd; a folder of frame_*.tris, or several .tris of one folder, is a sequence to it. For `papers` they take the places of the papers' models; without any, models are
    /// looked for in ../shared/assets/meshes, and generated scenes stand in for the rest
    #[arg(value_name = "SCENE")]
    scenes: Vec<String>,
    /// Folder for KIND.json, KIND.md and the plots
    #[arg(long, value_name = "DIR", default_value = "report")]
    output: PathBuf,
    /// Fewer rays, repeats and sizes: under a minute on two cores
    #[arg(long)]
    quick: bool,
    /// Policies that `frames` compares, by commas: refit, rebuild, async, auto, swap-every=K [default: rebuild,refit,async,auto]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = values::policy)]
    policy: Vec<RebuildPolicy>,
    /// End with exit code 1 when a stated bound or target is missed, naming which
    #[arg(long)]
    check: bool,
    /// Print what changed against the KIND.json of an earlier run; with --check, values that became worse are missed bounds
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
}

/// Measures and writes the files.
///
/// # Errors
/// A usage error for scenes or a baseline that cannot be read, a failure when files cannot be written or, with `--check`, a bound is
/// missed.
pub(crate) fn run(args: &ReportArgs, settings: &Settings) -> Result<(), CliError> {
    let baseline = args.baseline.as_deref().map(|file| Baseline::read(file, args.kind)).transpose()?;
    atomic::prepare(&args.output.join(format!("{}.json", args.kind.name())))?;
    let scenes = if args.scenes.is_empty() { models_at_hand(args) } else { args.scenes.clone() };
    let inputs = Inputs::read(args.kind, &scenes, settings)?;
    let unfinished = Unfinished::default();
    let signals = Signals::watch(&unfinished)?;
    let mut watching = Watching::new(&signals, settings.verbosity);
    let made = settings.pool.install(|| measure(args, &inputs, settings, &mut watching));
    watching.end();
    signals.check()?;
    let mut report = made?;
    let changes = baseline.as_ref().map(|b| b.compare(&report));
    if let Some(changes) = changes.as_ref().filter(|_| args.check) {
        report.checks.extend(changes.checks());
    }
    let files = report.write(&args.output, &unfinished)?;
    stdout::write(text(args, &report, &files, baseline.as_ref().zip(changes.as_ref())).as_bytes())?;
    verdict(args, &report)
}

/// What is measured.
enum Inputs {
    Subjects(Vec<Subject>),
    Sources(Vec<Source>),
    Plays(Vec<Play>),
}

impl Inputs {
    fn read(kind: Kind, scenes: &[String], settings: &Settings) -> Result<Self, CliError> {
        let subjects = || scenes.iter().map(|s| subject(s, scenes, settings)).collect::<Result<_, _>>();
        let sources = || scenes.iter().map(|s| source(s, scenes, settings)).collect::<Result<_, _>>();
        Ok(match kind {
            Kind::Papers | Kind::Structures => Self::Subjects(subjects()?),
            Kind::Accuracy => Self::Sources(sources()?),
            Kind::Frames => Self::Plays(plays::read(scenes, settings)?),
        })
    }
}

fn measure(
    args: &ReportArgs,
    inputs: &Inputs,
    settings: &Settings,
    watching: &mut Watching<'_>,
) -> Result<Report, ReportError> {
    let asked = settings.accel.parse::<AccelSpec>().ok();
    match inputs {
        Inputs::Plays(plays) => {
            let policies =
                if args.policy.is_empty() { frames::Options::POLICIES.to_vec() } else { args.policy.clone() };
            let options = frames::Options {
                quick: args.quick,
                simd: settings.simd,
                accel: settings.accel.clone(),
                top: settings.top.clone(),
                policies,
                pool: Arc::clone(&settings.pool),
            };
            frames::report(plays, &options, watching)
        }
        Inputs::Sources(sources) => {
            let mut options = accuracy::Options { simd: settings.simd, ..accuracy::Options::new(args.quick) };
            options.specs.extend(asked.filter(|spec| !options.specs.contains(spec)));
            accuracy::report(sources, &options, watching)
        }
        Inputs::Subjects(subjects) if args.kind == Kind::Papers => {
            let options = papers::Options { quick: args.quick, simd: settings.simd };
            papers::report(subjects, options, watching)
        }
        Inputs::Subjects(subjects) => {
            let mut options = structures::Options { simd: settings.simd, ..structures::Options::new(args.quick) };
            options.specs.extend(asked.filter(|spec| !options.specs.contains(spec)));
            structures::report(subjects, &options, watching)
        }
    }
}

/// The papers' models that the shared assets beside the checkout hold.
fn models_at_hand(args: &ReportArgs) -> Vec<String> {
    const MODELS: [&str; 2] = ["../shared/assets/meshes/bun_zipper.ply", "../shared/assets/meshes/dragon_res2.glb"];
    let wanted = if args.kind == Kind::Papers { &MODELS[..] } else { &[] };
    wanted.iter().filter(|m| Path::new(m).is_file()).map(|&m| m.to_owned()).collect()
}

fn subject(file: &str, all: &[String], settings: &Settings) -> Result<Subject, CliError> {
    let name = name(file, all);
    if !geometry::is_mesh(file) {
        return Ok(Subject::from_scene(name, &scene::load(Some(file), settings)?));
    }
    let mut frames = geometry::read(&[file.to_owned()], settings)?;
    Ok(Subject::still(name, frames.positions.swap_remove(0), frames.indices))
}

fn source(file: &str, all: &[String], settings: &Settings) -> Result<Source, CliError> {
    if geometry::is_mesh(file) {
        return subject(file, all, settings).map(Source::mesh);
    }
    Ok(Source::scene(name(file, all), Arc::new(scene::load(Some(file), settings)?)))
}

/// The file's name without folders, unless another of `all` has the same.
fn name<'a>(file: &'a str, all: &[String]) -> &'a str {
    let short = |file: &'a str| Path::new(file).file_name().and_then(|n| n.to_str()).unwrap_or(file);
    let same = all.iter().filter(|other| Path::new(other).file_name() == Path::new(file).file_name());
    if same.count() > 1 { file } else { short(file) }
}

/// What goes to stdout: the files, the bounds, and what changed.
fn text(args: &ReportArgs, report: &Report, files: &[String], changes: Option<(&Baseline, &Changes)>) -> String {
    let mut out = String::new();
    for file in files {
        let _ = writeln!(out, "{}", args.output.join(file).display());
    }
    for check in &report.checks {
        let _ = writeln!(out, "{check}");
    }
    if let Some((baseline, changes)) = changes {
        let _ = write!(out, "against {}:\n{changes}", baseline.origin());
    }
    out
}

fn verdict(args: &ReportArgs, report: &Report) -> Result<(), CliError> {
    let missed: Vec<&str> = report.missed().map(|c| c.claim.as_str()).collect();
    if missed.is_empty() || !args.check {
        return Ok(());
    }
    Err(CliError::failed(format!("{} of {} bounds missed: {}", missed.len(), report.checks.len(), missed.join("; "))))
}

impl From<ReportError> for CliError {
    fn from(error: ReportError) -> Self {
        match error {
            ReportError::Baseline { .. } | ReportError::Import(_) => Self::usage(error.to_string()),
            ReportError::Build(error) => error.into(),
            _ => Self::failed(error.to_string()),
        }
    }
}
