//! What it costs to sort event lists again after a motion, by insertion, by radix, by comparison, and by whatever the last time recommends.

use crate::{
    accel::events::{FlatLists, How},
    geom::Aabb,
    glam::DVec3,
    report::{
        Bound, Chart, Check, Column, Line, Lines, Monitor, Plot, ReportError, Role, Table,
        measure::{Samples, Stopwatch},
        random::Random,
    },
};

/// Ways of sorting, in the order of the columns.
const WAYS: [(How, &str); 4] = [
    (How::Adaptive, "adaptive"),
    (How::Insertion, "insertion"),
    (How::Radix, "radix"),
    (How::Comparison, "comparison"),
];

/// Motions a step, in units of the distance between neighbouring events.
const MOTIONS: [f64; 13] = [0.005, 0.01, 0.03, 0.1, 0.3, 1.0, 2.0, 4.0, 6.0, 10.0, 30.0, 100.0, 300.0];

const SORTS: &[Column] = &[
    Column::new("boxes", "boxes", Role::Id, 0),
    Column::new("motion", "motion a step [spacings]", Role::Id, 3),
    Column::new("inversions", "inversions an event", Role::Note, 4),
    Column::new("adaptive_ms", "adaptive [ms]", Role::Sooner, 3),
    Column::new("insertion_ms", "insertion [ms]", Role::Sooner, 3),
    Column::new("radix_ms", "radix [ms]", Role::Sooner, 3),
    Column::new("comparison_ms", "comparison [ms]", Role::Sooner, 3),
    Column::new("over_better", "adaptive / better of insertion and radix", Role::Note, 3),
    Column::new("comparisons", "comparison / adaptive", Role::Note, 2),
];

/// One size of motion.
#[derive(Clone, Debug)]
pub(super) struct SortRow {
    boxes: u32,
    motion: f64,
    inversions: f64,
    /// By [`WAYS`].
    times: [Samples; 4],
}

impl SortRow {
    fn median(&self, way: usize) -> Option<f64> {
        self.times[way].median()
    }

    fn over_better(&self) -> Option<f64> {
        Some(self.median(0)? / self.median(1)?.min(self.median(2)?))
    }

    fn comparisons(&self) -> Option<f64> {
        Some(self.median(3)? / self.median(0)?)
    }
}

/// Boxes that go straight on, each its own way.
struct Drift {
    places: Vec<DVec3>,
    ways: Vec<DVec3>,
    size: f64,
}

impl Drift {
    fn new(boxes: u32) -> Self {
        let unit = |seed| {
            move |i: u32| {
                let mut random = Random::new(seed, u64::from(i));
                DVec3::new(random.unit(), random.unit(), random.unit()) * 2.0 - DVec3::ONE
            }
        };
        let (places, ways) = ((0..boxes).map(unit(91)).collect(), (0..boxes).map(unit(92)).collect());
        Self { places, ways, size: libm::cbrt(1.0 / f64::from(boxes.max(1))) }
    }

    fn step(&mut self, by: f64) {
        for (place, way) in self.places.iter_mut().zip(&self.ways) {
            *place += *way * by;
        }
    }

    fn aabb(&self, i: u32) -> Aabb {
        let place = self.places[i as usize];
        Aabb { min: place.as_vec3(), max: (place + DVec3::splat(self.size)).as_vec3() }
    }
}

/// Measures every way at every motion, on one thread.
///
/// # Errors
/// When `monitor` ends it or no thread can be started.
pub(super) fn measure(quick: bool, monitor: &mut dyn Monitor) -> Result<Vec<SortRow>, ReportError> {
    let boxes: u32 = if quick { 10_000 } else { 50_000 };
    let steps = if quick { 5 } else { 15 };
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let one = one.map_err(|e| ReportError::Threads(e.to_string()))?;
    let mut rows = Vec::new();
    for motion in MOTIONS {
        monitor.begin(&format!("event lists: {motion} spacings a step"))?;
        rows.push(one.install(|| row(boxes, motion, steps)));
    }
    Ok(rows)
}

fn row(boxes: u32, motion: f64, steps: usize) -> SortRow {
    let mut drift = Drift::new(boxes);
    let spacing = 1.0 / f64::from(boxes);
    let fresh = FlatLists::build(boxes, |i| drift.aabb(i));
    let mut lists = WAYS.map(|_| fresh.clone());
    let mut row = SortRow { boxes, motion, inversions: 0.0, times: Default::default() };
    for step in 0..steps + 2 {
        drift.step(motion * spacing);
        for (way, lists) in lists.iter_mut().enumerate() {
            lists.place(|i| drift.aabb(i));
            let watch = Stopwatch::thread();
            let done = lists.settle(false, WAYS[way].0);
            let seconds = watch.seconds();
            // The first steps bring the choice and the caches to what they stay at.
            if step >= 2 {
                row.times[way].push(seconds);
                if WAYS[way].0 == How::Insertion {
                    row.inversions += done.swaps as f64 / (6.0 * f64::from(boxes) * steps as f64);
                }
            }
        }
    }
    row
}

/// The rows.
pub(super) fn table(rows: &[SortRow]) -> Table {
    let mut table = Table::new("sorts", "Event lists sorted again", SORTS).with_note(
        "Three lists of the ends of boxes that drift through a cube, and the ranks of the ends; processor time of one thread, medians. Insertion and radix say what \
         either takes by itself, comparison is the standard library's unstable sort, adaptive is what the frame loop does: the inversions of the step before choose.",
    );
    for row in rows {
        let ms = |way| row.median(way).map(|s| s * 1e3).into();
        table.push(vec![
            u64::from(row.boxes).into(),
            row.motion.into(),
            row.inversions.into(),
            ms(0),
            ms(1),
            ms(2),
            ms(3),
            row.over_better().into(),
            row.comparisons().into(),
        ]);
    }
    table
}

/// Where insertion and radix cross.
pub(super) fn plot(rows: &[SortRow]) -> Plot {
    let line = |(way, &(_, name)): (usize, &(How, &str))| {
        let points = rows.iter().filter_map(|row| Some((row.inversions, row.median(way)? * 1e3)));
        Line::new(way, name, points.collect())
    };
    let lines = WAYS.iter().enumerate().map(line).collect();
    let chart = Lines { x: "inversions an event".into(), y: "sort [ms]".into(), lines };
    Plot::new("sorts", "Event lists sorted again after a motion", Chart::Lines(chart))
}

/// Never far from the better way; far from a comparison sort where little moved.
pub(super) fn checks(rows: &[SortRow]) -> Vec<Check> {
    let worst = rows.iter().filter_map(SortRow::over_better).reduce(f64::max);
    let still = rows.iter().filter(|row| row.inversions <= 0.01).filter_map(SortRow::comparisons).reduce(f64::min);
    vec![
        Check::new(
            "sorting event lists again / the better of insertion and radix, at the worst motion",
            Bound::AtMost(1.1),
            worst,
        ),
        Check::new(
            "comparison sort / sorting again, at 0.01 inversions an event or fewer",
            Bound::AtLeast(10.0),
            still,
        ),
    ]
}
