//! `kinora cast`: batch ray queries from files, timed.

mod queries;

use std::{path::PathBuf, time::Instant};

use clap::Args;
use kinora::{
    accel::{AccelSpec, AnyAccel, Refit, SpecError},
    geom::Triangles,
    output::{AtomicFile, Unfinished, atomic},
};
use serde::Serialize;

use super::{
    error::CliError,
    geometry::{self, Frames},
    settings::Settings,
    stdout,
};
use queries::{Queries, RAY_BYTES};

/// Arguments of `cast`.
#[derive(Debug, Args)]
pub(crate) struct CastArgs {
    /// Geometry: .tris, .ply, .obj, .stl or a scene in its rest pose; each file after the first is the next frame of the
    /// same triangles, and the structure built over the first is refitted to it
    #[arg(value_name = "GEOMETRY", required = true)]
    geometry: Vec<String>,
    /// Rays to cast (.rays)
    #[arg(long, value_name = "FILE")]
    rays: PathBuf,
    /// File for the hits (.hits)
    #[arg(long, value_name = "FILE")]
    hits: Option<PathBuf>,
    /// Ask only whether a ray is blocked; such a ray's hit is written as triangle 0 with t, u, v = 0
    #[arg(long)]
    any_hit: bool,
    /// How to build
    #[arg(long, value_name = "NAME", default_value = "sah", value_parser = ["sah"])]
    build: String,
    /// How to store nodes
    #[arg(long, value_name = "NAME", default_value = "full", value_parser = ["full"])]
    layout: String,
    /// Times to cast; the rate is the median's
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    repeat: u32,
    /// Cast 16 consecutive rays at a time
    #[arg(long)]
    packet: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Summary<'a> {
    accel: String,
    build: &'a str,
    layout: &'a str,
    precision: &'static str,
    triangles: usize,
    build_ms: f64,
    refit_ms: Option<f64>,
    node_bytes: usize,
    total_bytes: usize,
    rays: usize,
    hits: usize,
    mrays_per_s: f64,
    threads: usize,
    simd: &'static str,
}

/// Casts the rays.
///
/// # Errors
/// A usage error for input that cannot be read, a failure when the hits cannot be written.
pub(crate) fn run(args: &CastArgs, settings: &Settings) -> Result<(), CliError> {
    let spec: AccelSpec = settings.accel.parse().map_err(|e: SpecError| CliError::usage(e.to_string()))?;
    if let Some(path) = &args.hits {
        atomic::prepare(path)?;
    }
    let rays = queries::read_rays(&args.rays)?;
    let frames = geometry::read(&args.geometry, settings)?;
    let (accel, build_ms, refit_ms) = settings.pool.install(|| structure(&spec, &frames))?;
    let queries = Queries {
        accel: &accel,
        prims: frames.last(),
        simd: settings.simd,
        precision: settings.precision,
        any_hit: args.any_hit,
        packet: args.packet,
    };
    let cast = settings.pool.install(|| queries.run(&rays, args.repeat));
    let (records, mut seconds) = cast.map_err(|e| CliError::failed(e.to_string()))?;
    if let Some(path) = &args.hits {
        let mut file = AtomicFile::create(path, &Unfinished::default())?;
        file.write(b"HIT1")?;
        file.write(&u32::try_from(rays.len() / RAY_BYTES).unwrap_or(u32::MAX).to_le_bytes())?;
        file.write(&records)?;
        file.finish()?;
    }
    let stats = accel.stats();
    let count = rays.len() / RAY_BYTES;
    let summary = Summary {
        accel: spec.to_string(),
        build: &args.build,
        layout: &args.layout,
        precision: settings.precision.name(),
        triangles: frames.indices.len(),
        build_ms,
        refit_ms,
        node_bytes: stats.node_bytes,
        total_bytes: stats.total_bytes,
        rays: count,
        hits: queries::count_hits(&records),
        mrays_per_s: count as f64 / 1e6 / median(&mut seconds).max(1e-9),
        threads: settings.threads(),
        simd: settings.simd.name(),
    };
    if args.json { stdout::write_json(&summary) } else { stdout::write(summary.text().as_bytes()) }
}

impl Summary<'_> {
    fn text(&self) -> String {
        let refit = self.refit_ms.map_or(String::new(), |ms| format!(", refit {ms:.3} ms"));
        format!(
            "{} triangles in {}: build {:.3} ms{refit}, {} bytes\n{} rays, {} hits: {:.3} million rays a second ({} threads, {}, {})\n",
            self.triangles,
            self.accel,
            self.build_ms,
            self.total_bytes,
            self.rays,
            self.hits,
            self.mrays_per_s,
            self.threads,
            self.simd,
            self.precision
        )
    }
}

/// Builds over the first frame and refits to each next one: the structure, the build's milliseconds and the median
/// refit's.
fn structure(spec: &AccelSpec, frames: &Frames) -> Result<(AnyAccel, f64, Option<f64>), CliError> {
    let start = Instant::now();
    let mut accel = spec.build(&frames.at(0))?;
    let build_ms = start.elapsed().as_secs_f64() * 1e3;
    let mut times = Vec::new();
    // Two structures in turn, as in a frame loop: the steady state allocates nothing.
    let mut spare = accel.clone();
    for frame in 1..frames.positions.len() {
        let prims = frames.at(frame);
        let start = Instant::now();
        if accel.refit_into(&mut spare, &prims) == Refit::NeedsRebuild {
            spare = spec.build(&prims)?;
        }
        times.push(start.elapsed().as_secs_f64() * 1e3);
        std::mem::swap(&mut accel, &mut spare);
    }
    let refit_ms = (!times.is_empty()).then(|| median(&mut times));
    Ok((accel, build_ms, refit_ms))
}

/// The middle value, or the mean of the two.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { 0.0 } else { f64::midpoint(values[(n - 1) / 2], values[n / 2]) }
}

impl Frames {
    fn at(&self, frame: usize) -> Triangles<'_> {
        Triangles { positions: &self.positions[frame], indices: &self.indices, topology_epoch: 0 }
    }

    fn last(&self) -> Triangles<'_> {
        self.at(self.positions.len() - 1)
    }
}
