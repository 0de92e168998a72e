//! What a refit costs: against the fastest build of the same triangles, and against the memory it touches.

use std::{hint::black_box, sync::Arc};

use super::{Options, play::Play};
use crate::{
    accel::{AccelSpec, AnyAccel},
    anim::ActiveClip,
    dynamics::RebuildPolicy,
    geom::Triangles,
    glam::Vec3,
    report::{
        Monitor, ReportError,
        measure::{Samples, Stopwatch},
    },
};

/// Structures that are refitted.
const REFITTED: [&str; 4] = ["bvh2", "bvh8", "ssh", "events"];

/// Structures and settings among which the fastest build is looked for.
const BUILT: [&str; 6] = ["bvh2", "bvh2:build=median", "bvh8", "bvh8:build=median", "ssh", "ssh:build=median"];

/// Fewer triangles say nothing about bandwidth.
const LEAST: usize = 4096;

/// A structure over the largest group of a play that deforms; times of one thread.
#[derive(Clone, Debug)]
pub(super) struct RefitRow {
    pub(super) scene: String,
    pub(super) structure: String,
    pub(super) triangles: usize,
    pub(super) refit: Samples,
    /// The fastest build and its seconds.
    pub(super) build: (String, f64),
    /// Bytes that a refit reads and writes at least.
    pub(super) bytes: usize,
    /// Seconds that the memory takes for as many bytes.
    pub(super) memory_s: f64,
}

/// Bytes a second that one thread reads and writes, by a pass over more than the caches hold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bandwidth(f64);

impl Bandwidth {
    /// Measures it: the best of several passes that read and write each byte once.
    pub(super) fn measure(quick: bool) -> Self {
        let mut words = vec![1_u64; if quick { 1 << 22 } else { 1 << 25 }];
        let mut best = f64::INFINITY;
        for _ in 0..5 {
            let watch = Stopwatch::thread();
            for word in &mut words {
                *word = word.wrapping_add(3);
            }
            best = best.min(watch.seconds());
            black_box(&mut words);
        }
        Self(2.0 * size_of_val(&words[..]) as f64 / best)
    }

    /// In 10^9 bytes a second.
    pub(super) fn gigabytes(self) -> f64 {
        self.0 / 1e9
    }
}

/// Two frames of the largest group that deforms.
struct Pair {
    indices: Vec<[u32; 3]>,
    positions: [Arc<Vec<Vec3>>; 2],
}

impl Pair {
    fn new(play: &Play, options: &Options) -> Result<Option<Self>, ReportError> {
        let mut frames = play.begin(options.config(RebuildPolicy::Refit))?;
        let mut worlds = Vec::new();
        for frame in [play.frames / 2, play.frames / 2 + 1] {
            let clips = play.clips(frame);
            let clips: Vec<&[ActiveClip]> = clips.iter().map(Option::as_slice).collect();
            worlds.push(frames.advance(&clips)?.0);
        }
        let pairs = worlds[0].groups.iter().zip(&worlds[1].groups);
        let moved = pairs.filter(|(a, b)| !Arc::ptr_eq(&a.positions, &b.positions));
        let largest =
            moved.max_by_key(|(a, _)| a.layout.indices.len()).filter(|(a, _)| a.layout.indices.len() >= LEAST);
        Ok(largest.map(|(a, b)| Self {
            indices: a.layout.indices.clone(),
            positions: [a.positions.clone(), b.positions.clone()],
        }))
    }

    fn prims(&self, frame: usize) -> Triangles<'_> {
        Triangles { positions: &self.positions[frame % 2], indices: &self.indices, topology_epoch: 1 }
    }
}

/// Measures all structures on one play; nothing when too little deforms.
///
/// # Errors
/// When `monitor` ends it, a frame cannot be made or no thread be started.
pub(super) fn measure(
    play: &Play,
    bandwidth: Bandwidth,
    options: &Options,
    monitor: &mut dyn Monitor,
) -> Result<Vec<RefitRow>, ReportError> {
    monitor.begin(&format!("{}: refits", play.name))?;
    let Some(pair) = Pair::new(play, options)? else { return Ok(Vec::new()) };
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let one = one.map_err(|e| ReportError::Threads(e.to_string()))?;
    let repeats = if options.quick { 3 } else { 9 };
    let mut build = (String::new(), f64::INFINITY);
    for spec in BUILT {
        let parsed: AccelSpec = spec.parse().map_err(crate::accel::BuildError::from)?;
        for _ in 0..repeats.min(3) {
            let seconds = one.install(|| timed(|| parsed.build(&pair.prims(0)).map(drop)))?;
            if seconds < build.1 {
                build = (spec.to_owned(), seconds);
            }
        }
    }
    let mut rows = Vec::new();
    for name in REFITTED {
        monitor.begin(&format!("{}: refit {name}", play.name))?;
        let spec: AccelSpec = name.parse().map_err(crate::accel::BuildError::from)?;
        let accel = one.install(|| spec.build(&pair.prims(0)))?;
        let mut out = accel.clone();
        let mut refit = Samples::default();
        for repeat in 0..=repeats {
            let seconds = one.install(|| {
                let watch = Stopwatch::thread();
                accel.refit_into(&mut out, &pair.prims(repeat + 1));
                watch.seconds()
            });
            if repeat > 0 {
                refit.push(seconds);
            }
        }
        let bytes = touched(&accel, &pair);
        rows.push(RefitRow {
            scene: play.name.clone(),
            structure: name.to_owned(),
            triangles: pair.indices.len(),
            refit,
            build: build.clone(),
            bytes,
            memory_s: bytes as f64 / bandwidth.0,
        });
    }
    Ok(rows)
}

fn timed<E>(work: impl FnOnce() -> Result<(), E>) -> Result<f64, E> {
    let watch = Stopwatch::thread();
    work()?;
    Ok(watch.seconds())
}

/// What a refit reads and writes: the structure in place, the corners' numbers and the vertices.
fn touched(accel: &AnyAccel, pair: &Pair) -> usize {
    2 * accel.stats().total_bytes + size_of_val(&pair.indices[..]) + size_of_val(&pair.positions[0][..])
}
