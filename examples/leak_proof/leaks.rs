//! Rays from inside closed meshes.

use std::time::Instant;

use kinora::{
    accel::{AccelSpec, AnyAccel, PACKET},
    geom::{Hit, Ray},
    rayon::prelude::*,
    report::{
        closed::{self, Aim, BATCH, Closed},
        reference::{Reference, Tally, wilson},
    },
    simd::SimdLevel,
};

/// Sizes asked for, with the share of all rays that each gets, in percent: small meshes are quick.
const SIZES: [(usize, u64); 4] = [(1_000, 40), (20_000, 30), (300_000, 20), (1_000_000, 10)];

/// What is asked for on the command line.
struct Options {
    rays: u64,
    judged: u64,
    aimed: u64,
    accel: AccelSpec,
    simd: SimdLevel,
}

impl Options {
    fn parse(words: &[String]) -> Result<Self, String> {
        let accel = "bvh8".parse().map_err(|e| format!("{e}"))?;
        let mut out = Self { rays: 10_000_000, judged: 100_000, aimed: 100_000, accel, simd: SimdLevel::best() };
        for pair in words.chunks(2) {
            let [key, value] = pair else { return Err(format!("{}: a value is missing", pair[0])) };
            let count = || value.parse().map_err(|e| format!("{key} {value}: {e}"));
            match key.as_str() {
                "--rays" => out.rays = count()?,
                "--judged" => out.judged = count()?,
                "--aimed" => out.aimed = count()?,
                "--accel" => out.accel = value.parse().map_err(|e| format!("{e}"))?,
                _ => return Err(format!("{key}: there are --rays, --judged, --aimed, --accel")),
            }
        }
        Ok(out)
    }
}

/// What rays are aimed at, how many go together, and whether they come from outside.
type Kind = (Aim, usize, bool);

/// Rays from inside; packets of rays anywhere point apart.
const INSIDE: [Kind; 3] = [(Aim::Anywhere, 1, false), (Aim::Anywhere, PACKET, false), (Aim::Packets, PACKET, false)];

/// A mesh with all that looks at it.
struct Subject {
    mesh: Closed,
    accel: AnyAccel,
    reference: Reference,
    simd: SimdLevel,
}

/// What came of some batches.
#[derive(Default)]
struct Outcome {
    cast: u64,
    leaks: u64,
    tally: Tally,
}

impl Outcome {
    fn plus(mut self, other: Self) -> Self {
        self.cast += other.cast;
        self.leaks += other.leaks;
        self.tally += other.tally;
        self
    }
}

impl Subject {
    fn hits(&self, rays: &[Ray], packet: usize) -> Vec<Option<Hit>> {
        let mut hits = vec![None; rays.len()];
        let prims = self.mesh.subject.prims();
        self.accel.closest_hits(&prims, rays, packet, self.simd, &mut hits).expect("floating point is as it was");
        hits
    }

    /// Casts one batch; judges its first `judged` rays.
    fn batch(&self, (aim, packet, outside): Kind, batch: u64, judged: usize) -> Outcome {
        let rays = self.mesh.rays(aim, outside, batch);
        let hits = self.hits(&rays, packet);
        let missed = hits.iter().filter(|h| h.is_none()).count() as u64;
        let mut tally = Tally::default();
        for (ray, hit) in rays.iter().zip(&hits).take(judged) {
            tally.add(self.reference.closest(ray).as_ref(), hit.as_ref());
        }
        Outcome { cast: rays.len() as u64, leaks: if outside { 0 } else { missed }, tally }
    }

    /// Casts at least `rays`, of which at least `judged` are judged.
    fn cast(&self, kind: Kind, rays: u64, judged: u64) -> Outcome {
        let size = BATCH as u64;
        let batches = rays.div_ceil(size);
        let each = usize::try_from(judged.div_ceil(batches.max(1)).min(size)).unwrap_or(BATCH);
        (0..batches).into_par_iter().map(|b| self.batch(kind, b, each)).reduce(Outcome::default, Outcome::plus)
    }
}

/// Prints a line for each mesh and kind of ray; true when nothing leaked and every judged answer is exact.
pub(crate) fn run(words: &[String]) -> Result<bool, String> {
    let options = Options::parse(words)?;
    println!("structure {}, kernels for {}", options.accel, options.simd);
    println!(
        "mesh | rays | as | cast | leaks | judged | missed | false | wrong | ties | inexact | zeros lost | u, v [2^-24] | s"
    );
    let (mut inside, mut aimed) = (Outcome::default(), Outcome::default());
    for (size, percent) in SIZES {
        for mesh in [closed::ball(size), closed::dented(size), closed::cube(size)] {
            let prims = mesh.subject.prims();
            let accel = options.accel.build(&prims).map_err(|e| e.to_string())?;
            let subject = Subject { reference: Reference::new(&prims), accel, simd: options.simd, mesh };
            for kind in INSIDE {
                let share = |total: u64| (total * percent).div_ceil(100 * 9);
                inside = inside.plus(shown(&subject, kind, [share(options.rays), share(options.judged)]));
            }
            for aim in Aim::AT_EDGES {
                for kind in [(aim, 1, false), (aim, PACKET, false), (aim, 1, true), (aim, PACKET, true)] {
                    let share = options.aimed.div_ceil(SIZES.len() as u64 * 3 * 12);
                    aimed = aimed.plus(shown(&subject, kind, [share; 2]));
                }
            }
        }
    }
    Ok([("from inside", &inside), ("aimed", &aimed)].map(|(name, outcome)| conclude(name, outcome)) == [true; 2])
}

fn shown(subject: &Subject, kind: Kind, [rays, judged]: [u64; 2]) -> Outcome {
    let start = Instant::now();
    let outcome = subject.cast(kind, rays, judged);
    let Outcome { cast, leaks, tally: t } = &outcome;
    let (aim, packet, outside) = kind;
    let (name, side) = (&subject.mesh.subject.name, if outside { ", from outside" } else { "" });
    let cast_as = if packet == 1 { "single" } else { "packets" };
    println!(
        "{name} | {}{side} | {cast_as} | {cast} | {leaks} | {} | {} | {} | {} | {} | {} | {} | {:.3} | {:.1}",
        aim.name(),
        t.rays,
        t.false_misses,
        t.false_hits,
        t.wrong,
        t.ties,
        t.inexact,
        t.lost_zeros,
        t.uv_max,
        start.elapsed().as_secs_f64()
    );
    outcome
}

/// Prints what the counts bound, with 95 % confidence; true when there is no error.
fn conclude(name: &str, Outcome { cast, leaks, tally: t }: &Outcome) -> bool {
    let below = |events: u64, trials: u64| wilson(events, trials).1 * 1e9;
    println!("{name}: {leaks} leaks of {cast} rays: fewer than {:.2} in 10^9", below(*leaks, *cast));
    println!(
        "{name}: {} judged ({} hits, {} ties): {} missed, {} false, {} wrong: fewer than {:.0} in 10^9; {} not correctly rounded or not \
         the lowest number, {} zeros lost, u and v within {:.4} * 2^-24",
        t.rays,
        t.hits,
        t.ties,
        t.false_misses,
        t.false_hits,
        t.wrong,
        below(t.mistakes(), t.rays),
        t.inexact,
        t.lost_zeros,
        t.uv_max
    );
    *leaks == 0 && t.mistakes() == 0 && t.inexact == 0 && t.lost_zeros == 0
}
