//! Every structure on the same rays, against the reference.

use std::{fmt, time::Instant};

use kinora::{
    accel::{AccelKind, AccelSpec, AnyAccel, PACKET, Refit},
    geom::{Hit, InstanceId, Ray},
    report::reference::{Reference, Truth, Verdict, judge, wilson},
    simd::SimdLevel,
};
use rayon::prelude::*;

use crate::{
    meshes::displaced,
    trace::{Mesh, closest, occluded},
};

/// Rays held in memory at once.
const CHUNK: usize = 1 << 19;

/// Rays that a task of a pool takes.
const GRAIN: usize = 1 << 12;

/// True when the counts that prove something are asked for.
pub(crate) fn is_full() -> bool {
    std::env::var_os("KINORA_HARD_SCENES").is_some_and(|v| v == "full")
}

/// How many: in full, as a share in release builds, without optimisation.
pub(crate) fn count(full: usize, release: usize, debug: usize) -> usize {
    if is_full() {
        full
    } else if cfg!(debug_assertions) {
        debug
    } else {
        release
    }
}

/// Answers that are not the reference's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Mistakes {
    pub(crate) rays: u64,
    /// Rays that meet something.
    pub(crate) hits: u64,
    pub(crate) false_misses: u64,
    pub(crate) false_hits: u64,
    /// Another triangle than the ones met first.
    pub(crate) wrong: u64,
    /// The right triangle, but t, u or v not correctly rounded, or not the lowest number.
    pub(crate) inexact: u64,
    /// Occlusion answered otherwise.
    pub(crate) occlusions: u64,
}

impl Mistakes {
    pub(crate) fn none(&self) -> bool {
        [self.false_misses, self.false_hits, self.wrong, self.inexact, self.occlusions] == [0; 5]
    }

    fn add(&mut self, truth: Option<&Truth>, found: Option<&Hit>) {
        self.rays += 1;
        self.hits += u64::from(truth.is_some());
        if due(truth).as_ref() == found {
            return;
        }
        match judge(truth, found) {
            Verdict::FalseMiss => self.false_misses += 1,
            Verdict::FalseHit => self.false_hits += 1,
            Verdict::WrongPrimitive(_) => self.wrong += 1,
            Verdict::Miss | Verdict::Right(_) => self.inexact += 1,
        }
    }

    fn sum(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            hits: self.hits + other.hits,
            false_misses: self.false_misses + other.false_misses,
            false_hits: self.false_hits + other.false_hits,
            wrong: self.wrong + other.wrong,
            inexact: self.inexact + other.inexact,
            occlusions: self.occlusions + other.occlusions,
        }
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rays, hits, false_misses, false_hits, wrong, inexact, occlusions } = self;
        let worst = wilson(false_misses + false_hits + wrong, *rays).1 * 1e9;
        write!(f, "{rays} rays, {hits} meet something: {false_misses} missed, {false_hits} false, {wrong} wrong, ")?;
        write!(f, "{inexact} inexact, {occlusions} occlusions otherwise; below {worst:.0} in 10^9 at 95 %")
    }
}

/// The one right answer of exact arithmetic: rounded, the lowest triangle.
pub(crate) fn due(truth: Option<&Truth>) -> Option<Hit> {
    let (truth, first) = (truth?, truth?.accepted.first()?);
    let [u, v] = first.rounded;
    Some(Hit { t: truth.t_rounded, u, v, prim: first.prim, instance: InstanceId(0) })
}

/// A structure with how it came about.
pub(crate) struct Candidate {
    pub(crate) name: String,
    pub(crate) kind: AccelKind,
    pub(crate) accel: AnyAccel,
    /// One triangle after the other, so that rays x triangles must stay bounded.
    pub(crate) slow: bool,
}

/// All structures over `mesh`, fresh and, if asked for and they can, refitted from elsewhere; each valid.
pub(crate) fn candidates(mesh: &Mesh, refitted: bool) -> Vec<Candidate> {
    let mut all = Vec::new();
    let specs = AccelKind::ALL.iter().map(|&kind| AccelSpec::new(kind));
    let flat = "events:form=flat".parse().expect("a setting of events");
    let elsewhere = displaced(mesh);
    for spec in specs.chain([flat]) {
        let kind = spec.kind();
        let slow = kind == AccelKind::List || spec.to_string().contains("flat");
        let fresh = spec.build(&mesh.prims()).expect("the mesh builds");
        fresh.validate(&mesh.prims()).unwrap_or_else(|v| panic!("{spec}: {v:?}"));
        all.push(Candidate { name: spec.to_string(), kind, accel: fresh, slow });
        if !(refitted && all[all.len() - 1].accel.refits()) {
            continue;
        }
        let old = spec.build(&elsewhere.prims()).expect("the mesh builds");
        let mut accel = old.clone();
        if old.refit_into(&mut accel, &mesh.prims()) == Refit::Done {
            accel.validate(&mesh.prims()).unwrap_or_else(|v| panic!("refitted {spec}: {v:?}"));
            all.push(Candidate { name: format!("{spec}, refitted"), kind, accel, slow });
        }
    }
    all
}

/// Numbers of a scene on all structures.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trial<'a> {
    /// For messages.
    pub(crate) name: &'a str,
    pub(crate) mesh: &'a Mesh,
    /// Rays in all.
    pub(crate) rays: usize,
    /// After refits as well.
    pub(crate) refitted: bool,
}

impl Trial<'_> {
    /// Every structure gives the reference's answer on every ray: the triangle, and t, u, v correctly rounded; on shares of the rays
    /// (all of the first 4096) also in packets, at every SIMD level, and for occlusion. `rays` makes so many of them from a number on.
    ///
    /// # Panics
    /// Where one does not; all counts are printed first.
    pub(crate) fn run(self, rays: impl Fn(usize, usize) -> Vec<Ray>) -> Vec<(String, Mistakes)> {
        let reference = Reference::new(&self.mesh.prims());
        let candidates = candidates(self.mesh, self.refitted);
        let mut found = vec![Mistakes::default(); candidates.len()];
        let mut seconds = vec![0.0; candidates.len()];
        for first in (0..self.rays).step_by(CHUNK) {
            let rays = rays(first, CHUNK.min(self.rays - first));
            let truths = reference.all_closest(&rays);
            for ((candidate, found), seconds) in candidates.iter().zip(&mut found).zip(&mut seconds) {
                let begun = Instant::now();
                *found = found.sum(self.answers(candidate, &rays, &truths));
                *seconds += begun.elapsed().as_secs_f64();
            }
        }
        let results: Vec<_> = candidates.into_iter().map(|c| c.name).zip(found).collect();
        for ((name, found), seconds) in results.iter().zip(seconds) {
            println!("{}: {name}: {found} ({:.0} ns a ray)", self.name, seconds * 1e9 / found.rays.max(1) as f64);
        }
        for (name, found) in &results {
            assert!(found.none(), "{}: {name}: {found}", self.name);
        }
        results
    }

    fn answers(&self, candidate: &Candidate, rays: &[Ray], truths: &[Option<Truth>]) -> Mistakes {
        // Slow structures take every so many rays.
        let budget = count(1_000_000_000, 5_000_000, 600_000);
        // The flat lists handle an event where `list` tests a triangle, which takes longer.
        let budget = if candidate.kind == AccelKind::List { budget } else { budget / 30 };
        let most = if candidate.slow { (budget / self.mesh.indices.len().max(1)).max(1) } else { self.rays };
        let step = self.rays.div_ceil(most);
        let picked: Vec<_> = (0..rays.len()).step_by(step).collect();
        let (rays, truths): (Vec<Ray>, Vec<&Option<Truth>>) = picked.iter().map(|&i| (rays[i], &truths[i])).unzip();
        rays.par_chunks(GRAIN)
            .zip(truths.par_chunks(GRAIN))
            .enumerate()
            .map(|(number, (rays, truths))| self.chunk(candidate, number, rays, truths))
            .reduce(Mistakes::default, Mistakes::sum)
    }

    fn chunk(&self, candidate: &Candidate, number: usize, rays: &[Ray], truths: &[&Option<Truth>]) -> Mistakes {
        let (accel, prims) = (&candidate.accel, self.mesh.prims());
        let mut mistakes = Mistakes::default();
        let best = closest(accel, &prims, rays, SimdLevel::best());
        for (truth, hit) in truths.iter().zip(&best) {
            mistakes.add(truth.as_ref(), hit.as_ref());
        }
        // Packets and occlusion on a quarter of the rays, lower levels on an eighth: they run the same tests in other orders and widths.
        if number.is_multiple_of(4) {
            let mut together = vec![None; rays.len()];
            accel.closest_hits(&prims, rays, PACKET, SimdLevel::best(), &mut together).expect("the default float mode");
            mistakes.inexact += differences(&best, &together);
            for (truth, blocked) in truths.iter().zip(occluded(accel, &prims, rays, SimdLevel::best())) {
                mistakes.occlusions += u64::from(truth.is_some() != blocked);
            }
        }
        if number.is_multiple_of(8) {
            for level in SimdLevel::available().filter(|&l| l != SimdLevel::best()) {
                mistakes.inexact += differences(&best, &closest(accel, &prims, rays, level));
            }
        }
        mistakes
    }
}

fn differences(a: &[Option<Hit>], b: &[Option<Hit>]) -> u64 {
    a.iter().zip(b).filter(|(a, b)| a != b).count() as u64
}
