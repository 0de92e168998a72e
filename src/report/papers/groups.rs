//! The grouped uniform grid's figure 5 (memory) and figure 8 (reads of a picture's primary rays).

use rayon::prelude::*;

use super::{
    Options,
    cases::{Case, Source, given},
    published::{GROUPS, GroupScene},
};
use crate::{
    accel::{
        Accel, AccelConfig, AnyHit, BuildError, Closest, ReadCounter, SpecError, TravRay,
        grug::{Grug, GrugBytes, GrugConfig},
        kdtree::{KdConfig, KdTree},
    },
    geom::{Ray, Triangles},
    report::{
        Bars, Bound, Cell, Chart, Check, Column, Line, Monitor, Plot, ReportError, Role, Subject, Table,
        rays::{self, Sphere, View},
    },
    scene::spd::SpdKind,
    simd::Scalar,
};

const MEMORY: &[Column] = &[
    Column::new("model", "model", Role::Note, 0),
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("standing", "model or stand-in", Role::Note, 0),
    Column::new("triangles", "triangles", Role::Note, 0),
    Column::new("paper_triangles", "(paper)", Role::Note, 0),
    Column::new("res", "cells an axis", Role::Id, 0),
    Column::new("groups", "groups", Role::Less, 0),
    Column::new("kdtree_mib", "`kdtree` [MiB]", Role::Less, 2),
    Column::new("full_tree_mib", "aligned tree [MiB]", Role::Less, 2),
    Column::new("paper_kd_mib", "(paper)", Role::Note, 2),
    Column::new("tree_mib", "tree kept [MiB]", Role::Less, 2),
    Column::new("paper_tree_mib", "(paper)", Role::Note, 2),
    Column::new("boundary_mib", "bounds [MiB]", Role::Less, 2),
    Column::new("paper_boundary_mib", "(paper)", Role::Note, 2),
    Column::new("hash_mib", "table [MiB]", Role::Less, 2),
    Column::new("paper_hash_mib", "(paper)", Role::Note, 2),
    Column::new("total_mib", "total [MiB]", Role::Less, 2),
    Column::new("paper_total_mib", "(paper)", Role::Note, 2),
];

const READS: &[Column] = &[
    Column::new("model", "model", Role::Note, 0),
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("triangles", "triangles", Role::Note, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("rays", "rays", Role::Note, 0),
    Column::new("transactions", "reads a ray", Role::Less, 2),
    Column::new("words", "words a ray", Role::Less, 2),
    Column::new("bytes", "bytes a ray", Role::Less, 1),
    Column::new("lines", "lines a ray", Role::Less, 2),
    Column::new("fewer_transactions", "fewer reads [%]", Role::Note, 1),
    Column::new("fewer_words", "fewer words [%]", Role::Note, 1),
    Column::new("fewer_bytes", "fewer bytes [%]", Role::Note, 1),
    Column::new("fewer_lines", "fewer lines [%]", Role::Note, 1),
    Column::new("blocks", "blocks a ray", Role::Less, 2),
    Column::new("steps", "cells a ray", Role::Less, 2),
];

/// Scenes above this many triangles are those of which the paper claims fewer reads.
const LARGE: usize = 100_000;

/// Settings of `grug` whose reads are counted.
const VARIANTS: [&str; 5] = ["res=64", "res=128", "res=256", "res=512", "res=128,mode=dda"];

/// Places of ways of counting in [`Reads::four`].
const TRANSACTIONS: usize = 0;
const WORDS: usize = 1;

/// What one structure's rays read, a ray, and the way from the kd-tree's.
struct Reads {
    structure: String,
    rays: u64,
    /// Transactions, words, bytes, lines.
    four: [f64; 4],
    blocks: f64,
    steps: f64,
}

/// The reads of all structures over a scene; the kd-tree's first.
struct SceneReads {
    triangles: usize,
    scene: String,
    reads: Vec<Reads>,
}

fn cases(models: &[Subject], quick: bool) -> Vec<Case<'_>> {
    let stand_in = |row: &GroupScene| match row.scene {
        "UlmBox" => Source::Boxes(row.polygons / 12),
        "FairyForest" => Source::Spd(SpdKind::Tree, 9, row.polygons),
        "Cabin" => Source::Spd(SpdKind::Gears, 6, row.polygons),
        "Atrium" => Source::Spd(SpdKind::Lattice, 12, row.polygons),
        _ => Source::Cave(row.polygons),
    };
    let rows = GROUPS.iter().filter(|row| !quick || row.polygons < 200_000 && row.scene != "StanfordBunny");
    let case = |row: &GroupScene| {
        // The dragon is the nearest in size that is at hand.
        let name = if row.scene == "Cabin" { "dragon" } else { row.scene.trim_start_matches("Stanford") };
        let source = given(models, name, row.polygons).map_or_else(|| stand_in(row), Source::Given);
        Case { model: Some(row.scene), triangles: row.polygons, source }
    };
    rows.map(case).collect()
}

/// What the grouped uniform grid adds to the report.
type Found = (Vec<Table>, Vec<Plot>, Vec<Check>);

/// Tables, plot and bounds.
///
/// # Errors
/// When `monitor` ends it or a structure cannot be built.
pub(super) fn measure(models: &[Subject], options: Options, monitor: &mut dyn Monitor) -> Result<Found, ReportError> {
    let mut memory = Table::new("groups-memory", "Grouped uniform grid: figure 5, memory", MEMORY).with_note(
        "The aligned tree is the kd-tree before its upper nodes are removed. Its g groups save 8 (g - 1) bytes of nodes and cost 24 g bytes of bounds: \
         always three times the saving and 24 bytes, also in the paper's own rows.",
    );
    let mut reads = Table::new("groups-reads", "Grouped uniform grid: figure 8, reads", READS).with_note(
        "Primary rays of 1920 x 1080 pixels (quick: 480 x 270); triangles are left out. A read of the table is one transaction of 4 bytes, of a group's \
         bounds one of 24, of a node one of 8; lines are distinct 64-byte lines of a ray. Figure 8 is a chart without numbers; the text says up to \
         70 % fewer above 100,000 polygons, more on the smallest scene alone. Words, bytes and lines agree with its order: a small room takes more of \
         them, large scenes fewer; transactions, which make six bounds as cheap as a node, come nearest to its 70 %.",
    );
    let resolutions = if options.quick { &VARIANTS[..2] } else { &VARIANTS[..] };
    let (mut broken, mut scenes) = (0, Vec::new());
    for case in cases(models, options.quick) {
        let subject = case.source.subject()?;
        monitor.begin(&format!("groups: {}", subject.name))?;
        let kd = KdTree::build(&subject.prims(), &KdConfig::default())?;
        let rays = picture(&subject, &kd, options);
        let mut scene = SceneReads { triangles: subject.indices.len(), scene: subject.name.clone(), reads: Vec::new() };
        scene.reads.push(count("kdtree", &kd, &subject.prims(), &rays));
        for settings in resolutions {
            monitor.begin(&format!("groups: {}: {settings}", subject.name))?;
            let grug = Grug::build(&subject.prims(), &config(settings)?)?;
            let bytes = grug.bytes();
            broken += usize::from(bytes.boundary != 3 * (bytes.full_tree - bytes.tree) + 24);
            if !settings.contains("mode") {
                memory.push(memory_row(&case, &subject, &kd, &grug));
            }
            scene.reads.push(count(&format!("grug:{settings}"), &grug, &subject.prims(), &rays));
        }
        scene.rows(&case, &mut reads);
        scenes.push(scene);
    }
    Ok((vec![memory, reads], plot(&scenes), checks(broken, &scenes)))
}

fn config(settings: &str) -> Result<GrugConfig, ReportError> {
    let mut config = GrugConfig::default();
    for pair in settings.split(',') {
        let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
        let error = |reason| SpecError::Setting { structure: Grug::NAME, key: key.to_owned(), reason };
        config.set(key, value).map_err(|reason| BuildError::Spec(error(reason)))?;
    }
    Ok(config)
}

fn picture(subject: &Subject, kd: &KdTree, options: Options) -> Vec<Ray> {
    let size = if options.quick { [480, 270] } else { [1920, 1080] };
    let view = subject.view.or_else(|| Sphere::around(kd.bounds()).map(View::whole));
    view.map_or_else(Vec::new, |view| rays::primary(view, size))
}

/// Counts every ray's reads, in the current rayon pool.
fn count<A: Accel>(name: &str, accel: &A, prims: &Triangles<'_>, rays: &[Ray]) -> Reads {
    let part = |rays: &[Ray]| {
        let mut count = ReadCounter::default();
        for ray in rays.iter().filter_map(TravRay::new) {
            let mut best = Closest::new(&ray);
            accel.closest::<Scalar, _, _>(prims, &ray, &mut best, &AnyHit, &mut count);
            count.next_ray();
        }
        [count.transactions, count.words, count.bytes, count.lines, count.blocks, count.steps]
    };
    let add = |a: [u64; 6], b: [u64; 6]| std::array::from_fn(|i| a[i] + b[i]);
    let sums: [u64; 6] = rays.par_chunks(4096).map(part).reduce(|| [0; 6], add);
    let [transactions, words, bytes, lines, blocks, steps] = sums.map(|n| n as f64 / rays.len().max(1) as f64);
    Reads {
        structure: name.to_owned(),
        rays: rays.len() as u64,
        four: [transactions, words, bytes, lines],
        blocks,
        steps,
    }
}

fn memory_row(case: &Case<'_>, subject: &Subject, kd: &KdTree, grug: &Grug) -> Vec<Cell> {
    let mib = |bytes: usize| Cell::from(bytes as f64 / f64::from(1 << 20));
    let row = GROUPS.iter().find(|row| case.model == Some(row.scene));
    // The paper's grid has 512 cells an axis.
    let paper = |value: fn(&GroupScene) -> f64| Cell::from(row.filter(|_| grug.resolution() == 512).map(value));
    let GrugBytes { full_tree, tree, boundary, hash } = grug.bytes();
    let triangles = subject.indices.len();
    vec![
        case.model.into(),
        subject.name.clone().into(),
        case.standing(triangles).into(),
        triangles.into(),
        row.map(|row| row.polygons).into(),
        u64::from(grug.resolution()).into(),
        grug.groups().into(),
        mib(kd.stats().node_bytes),
        mib(full_tree),
        paper(|row| row.kd),
        mib(tree),
        paper(|row| row.tree),
        mib(boundary),
        paper(|row| row.boundary),
        mib(hash),
        paper(|row| row.hash),
        mib(tree + boundary + hash),
        paper(|row| row.total),
    ]
}

impl SceneReads {
    /// Share of the kd-tree's reads that a structure does without.
    fn fewer(&self, reads: &Reads) -> [f64; 4] {
        std::array::from_fn(|way| 1.0 - reads.four[way] / self.reads[0].four[way])
    }

    fn rows(&self, case: &Case<'_>, table: &mut Table) {
        for (i, reads) in self.reads.iter().enumerate() {
            let fewer = (i > 0).then(|| self.fewer(reads));
            let mut row = vec![
                case.model.into(),
                self.scene.clone().into(),
                self.triangles.into(),
                reads.structure.clone().into(),
                reads.rays.into(),
            ];
            row.extend(reads.four.map(Cell::from));
            row.extend((0..4).map(|way| Cell::from(fewer.map(|f| 100.0 * f[way]))));
            row.push(reads.blocks.into());
            row.push(Cell::from((reads.steps > 0.0).then_some(reads.steps)));
            table.push(row);
        }
    }

    /// The largest share that any resolution saves, in a way of counting.
    fn best(&self, way: usize) -> f64 {
        self.reads[1..].iter().map(|r| self.fewer(r)[way]).fold(f64::NEG_INFINITY, f64::max)
    }
}

fn plot(scenes: &[SceneReads]) -> Vec<Plot> {
    let groups = scenes.iter().map(|s| s.scene.clone()).collect();
    let names: Vec<&String> = scenes.first().map_or_else(Vec::new, |s| s.reads.iter().map(|r| &r.structure).collect());
    let line = |(i, name): (usize, &&String)| {
        let points = scenes.iter().enumerate().map(|(x, scene)| (x as f64, scene.reads[i].four[0]));
        Line::new(i, name.as_str(), points.collect())
    };
    let lines = names.iter().enumerate().map(line).collect();
    let chart = Chart::Bars(Bars { groups, y: "reads a primary ray".into(), lines });
    vec![Plot::new("groups-reads", "Figure 8 of ours: reads of kd-tree and grouped uniform grid", chart)]
}

fn checks(broken: usize, scenes: &[SceneReads]) -> Vec<Check> {
    let tiny = scenes.iter().filter(|s| s.triangles < 1000).map(|s| s.best(WORDS)).reduce(f64::min);
    let large = |way| scenes.iter().filter(|s| s.triangles > LARGE).map(move |s| s.best(way));
    vec![
        Check::new(
            "groups: structures whose bounds are not 3 x removed nodes + 24 bytes",
            Bound::Exactly(0.0),
            broken as f64,
        ),
        Check::new("groups: share of words saved on the smallest scene", Bound::AtMost(0.0), tiny),
        Check::new(
            "groups: least share of words saved above 100,000 triangles",
            Bound::AtLeast(0.0),
            large(WORDS).reduce(f64::min),
        ),
        Check::new(
            "groups: greatest share of transactions saved above 100,000 triangles",
            Bound::Between(0.5, 1.0),
            large(TRANSACTIONS).reduce(f64::max),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(triangles: usize, kd: f64, grug: f64) -> SceneReads {
        let reads = |structure: &str, n: f64| Reads {
            structure: structure.into(),
            rays: 1,
            four: [n, 2.0 * n, 8.0 * n, n],
            blocks: 1.0,
            steps: 0.0,
        };
        SceneReads { triangles, scene: "s".into(), reads: vec![reads("kdtree", kd), reads("grug", grug)] }
    }

    fn missed(broken: usize, scenes: &[SceneReads]) -> usize {
        checks(broken, scenes).iter().filter(|c| c.is_missed()).count()
    }

    #[test]
    fn reads_must_fall_on_large_scenes_and_rise_on_tiny_ones() {
        let large = scene(200_000, 100.0, 30.0);
        assert!((large.best(WORDS) - 0.7).abs() < 1e-12);
        assert_eq!(missed(0, &[scene(500, 10.0, 12.0), large]), 0);
        assert_eq!(missed(1, &[]), 1);
        assert_eq!(missed(0, &[scene(500, 10.0, 9.0)]), 1);
        assert_eq!(missed(0, &[scene(200_000, 10.0, 12.0)]), 2);
    }

    #[test]
    fn variants_are_settings_that_exist() {
        for settings in VARIANTS {
            assert!(config(settings).is_ok(), "{settings}");
        }
        assert!(config("res=7").is_err());
    }
}
