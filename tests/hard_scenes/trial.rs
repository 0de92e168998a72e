//! Every structure on the same rays, against the reference.

use std::{
    fmt,
    time::{Duration, Instant},
};

use kinora::{
    accel::{AccelKind, AccelSpec, AnyAccel, PACKET, Refit},
    geom::{Hit, InstanceId, Ray},
    report::reference::{Reference, Truth, Verdict, judge, wilson},
    simd::SimdLevel,
};
use rayon::prelude::*;

use crate::{
    fast::{FAST, check, worst},
    meshes::displaced,
    trace::{Mesh, closest, occluded},
};

/// Rays held in memory at once, and between looks at the clock.
const CHUNK: usize = 8 * GRAIN;

/// Rays that a task of a pool takes.
const GRAIN: usize = 1 << 10;

/// Of a batch that fails.
const MODE: &str = "the default float mode";

/// What `KINORA_HARD_SCENES` asks for: `full`, or full counts as far as they go in so many seconds a trial.
fn asked() -> Option<String> {
    std::env::var("KINORA_HARD_SCENES").ok().filter(|v| v == "full" || v.parse::<u64>().is_ok())
}

/// True when the counts that prove something are asked for.
pub(crate) fn is_full() -> bool {
    asked().is_some()
}

/// How long the structures of a trial may take together.
pub(crate) fn limit() -> Option<Duration> {
    asked()?.parse().ok().map(Duration::from_secs)
}

/// True for kinds that `KINORA_HARD_SCENES_KINDS` names, as `bvh8,bvh2`; all without it.
///
/// # Panics
/// When it names one that there is not.
fn is_wanted(kind: AccelKind) -> bool {
    let Ok(names) = std::env::var("KINORA_HARD_SCENES_KINDS") else { return true };
    let known = |name: &str| AccelKind::ALL.iter().any(|k| k.name() == name);
    names.split(',').for_each(|name| assert!(known(name), "KINORA_HARD_SCENES_KINDS: there is no {name}"));
    names.split(',').any(|name| name == kind.name())
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

    /// Only missed and false blockers are told apart.
    fn add_blocked(&mut self, due: bool, found: bool) {
        self.rays += 1;
        self.hits += u64::from(due);
        self.false_misses += u64::from(due && !found);
        self.false_hits += u64::from(!due && found);
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

/// How fast is asked.
const FAST_ASKED: [&str; 3] = ["alone", "in packets", "for occlusion"];

/// What a structure came to in both precisions.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    exact: Mistakes,
    /// As [`FAST_ASKED`].
    fast: [Mistakes; 3],
}

impl Found {
    fn sum(self, other: Self) -> Self {
        Self { exact: self.exact.sum(other.exact), fast: std::array::from_fn(|i| self.fast[i].sum(other.fast[i])) }
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

/// All structures over `mesh` that are wanted, fresh and, if asked for and they can, refitted from elsewhere; each valid.
pub(crate) fn candidates(mesh: &Mesh, refitted: bool) -> Vec<Candidate> {
    let mut all = Vec::new();
    let specs = AccelKind::ALL.iter().map(|&kind| AccelSpec::new(kind));
    let others = ["events:form=flat", "bvh8:layout=compact"].map(|spec| spec.parse().expect("known settings"));
    let elsewhere = displaced(mesh);
    for spec in specs.chain(others).filter(|spec| is_wanted(spec.kind())) {
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
    /// (all of the first 1024) also in packets, at every SIMD level, and for occlusion. In fast, what is listed may be missed. `rays` makes so
    /// many of them from a number on. Returns what exact answers came to. Where the time is limited, structures end when
    /// theirs is over: the counts say how many rays they took.
    ///
    /// # Panics
    /// Where one does not; all counts are printed first.
    pub(crate) fn run(self, rays: impl Fn(usize, usize) -> Vec<Ray>) -> Vec<(String, Mistakes)> {
        let reference = Reference::new(&self.mesh.prims());
        let candidates = candidates(self.mesh, self.refitted);
        let mut found = vec![Found::default(); candidates.len()];
        let mut seconds = vec![0.0; candidates.len()];
        // Each structure has its share of the time.
        let most = limit().map_or(f64::INFINITY, |l| l.as_secs_f64() / candidates.len() as f64);
        for first in (0..self.rays).step_by(CHUNK) {
            if seconds.iter().all(|&s| s > most) {
                break;
            }
            let rays = rays(first, CHUNK.min(self.rays - first));
            let truths = reference.all_closest(&rays);
            for ((candidate, found), seconds) in candidates.iter().zip(&mut found).zip(&mut seconds) {
                if *seconds <= most {
                    let begun = Instant::now();
                    *found = found.sum(self.answers(candidate, first, &rays, &truths));
                    *seconds += begun.elapsed().as_secs_f64();
                }
            }
        }
        let all = || candidates.iter().map(|c| c.name.as_str()).zip(&found);
        for ((name, found), seconds) in all().zip(seconds) {
            let Found { exact, fast } = found;
            println!(
                "{}: {name}: {exact} ({:.0} ns a ray, all asked)",
                self.name,
                seconds * 1e9 / exact.rays.max(1) as f64
            );
            for (how, fast) in FAST_ASKED.iter().zip(fast) {
                println!("{}: {name}, fast, {how}: {fast}", self.name);
            }
        }
        let fast = all().flat_map(|(name, found)| found.fast.iter().map(move |fast| (name, fast)));
        println!("{}: fast, the worst of all: {}", self.name, worst(&fast));
        for (name, Found { exact, .. }) in all() {
            assert!(exact.none(), "{}: {name}: {exact}", self.name);
        }
        fast.for_each(|(name, fast)| check(self.name, name, fast));
        candidates.iter().map(|c| c.name.clone()).zip(found.iter().map(|f| f.exact)).collect()
    }

    /// On rays from number `first` on.
    fn answers(&self, candidate: &Candidate, first: usize, rays: &[Ray], truths: &[Option<Truth>]) -> Found {
        // Slow structures take every so many rays.
        let budget = count(1_000_000_000, 2_000_000, 600_000);
        // The flat lists handle an event where `list` tests a triangle, which takes longer.
        let budget = if candidate.kind == AccelKind::List { budget } else { budget / 30 };
        let most = if candidate.slow { (budget / self.mesh.indices.len().max(1)).max(1) } else { self.rays };
        // Scenes take turns among two or three kinds of rays: a share has some of each.
        let mut step = self.rays.div_ceil(most);
        while step > 1 && (step.is_multiple_of(2) || step.is_multiple_of(3)) {
            step += 1;
        }
        let picked: Vec<_> = (0..rays.len()).filter(|i| (first + i).is_multiple_of(step)).collect();
        let (rays, truths): (Vec<Ray>, Vec<&Option<Truth>>) = picked.iter().map(|&i| (rays[i], &truths[i])).unzip();
        rays.par_chunks(GRAIN)
            .zip(truths.par_chunks(GRAIN))
            .enumerate()
            .map(|(number, (rays, truths))| (first / GRAIN + number, (rays, truths)))
            .map(|(number, (rays, truths))| Found {
                exact: self.exact(candidate, number, rays, truths),
                fast: self.fast(candidate, number, rays, truths),
            })
            .reduce(Found::default, Found::sum)
    }

    fn exact(&self, candidate: &Candidate, number: usize, rays: &[Ray], truths: &[&Option<Truth>]) -> Mistakes {
        let (accel, prims) = (&candidate.accel, self.mesh.prims());
        let mut mistakes = Mistakes::default();
        let best = closest(accel, &prims, rays, SimdLevel::best());
        for (truth, hit) in truths.iter().zip(&best) {
            mistakes.add(truth.as_ref(), hit.as_ref());
        }
        // Packets and occlusion on a quarter of the rays, lower levels on an eighth: they run the same tests in other orders and widths.
        if number.is_multiple_of(4) {
            let mut together = vec![None; rays.len()];
            accel.closest_hits(&prims, rays, PACKET, SimdLevel::best(), &mut together).expect(MODE);
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

    /// All rays alone; a quarter of them in packets and for occlusion. What is found must be numbers within the ray's range.
    fn fast(&self, candidate: &Candidate, number: usize, rays: &[Ray], truths: &[&Option<Truth>]) -> [Mistakes; 3] {
        let (accel, prims, level) = (&candidate.accel, self.mesh.prims(), SimdLevel::best());
        let closest = |packet: usize| {
            let (mut mistakes, mut hits) = (Mistakes::default(), vec![None; rays.len()]);
            accel.closest_hits_as(&prims, rays, packet, level, FAST, &mut hits).expect(MODE);
            for ((ray, truth), hit) in rays.iter().zip(truths).zip(&hits) {
                mistakes.add(truth.as_ref(), hit.as_ref());
                if let Some(hit) = hit {
                    let is_sound = hit.t >= ray.t_near && hit.t <= ray.t_far && hit.u.is_finite() && hit.v.is_finite();
                    assert!(is_sound, "{}: {}, fast: {hit:?}", self.name, candidate.name);
                }
            }
            mistakes
        };
        let alone = closest(1);
        if !number.is_multiple_of(4) {
            return [alone, Mistakes::default(), Mistakes::default()];
        }
        let (mut occlusion, mut blocked) = (Mistakes::default(), vec![false; rays.len()]);
        accel.blocked_as(&prims, rays, 1, level, FAST, &mut blocked).expect(MODE);
        for (truth, blocked) in truths.iter().zip(blocked) {
            occlusion.add_blocked(truth.is_some(), blocked);
        }
        [alone, closest(PACKET), occlusion]
    }
}

fn differences(a: &[Option<Hit>], b: &[Option<Hit>]) -> u64 {
    a.iter().zip(b).filter(|(a, b)| a != b).count() as u64
}
