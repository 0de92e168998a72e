//! The single slab hierarchy's table 1: nodes, tests, build, picture and memory of both hierarchies over the same topology.

use super::{
    Options,
    cases::{Case, Source, given},
    published::{SLABS, SlabScene},
};
use crate::{
    accel::{AccelSpec, AccelStats, AnyAccel},
    geom::{Forms, Ray},
    report::{
        Bound, Cell, Check, Column, Monitor, ReportError, Role, Subject, Table,
        measure::{Answer, Ask, Caster, Counts, Samples},
        rays::{self, Sphere, View},
    },
    scene::spd::SpdKind,
};

/// Build settings that both hierarchies share.
struct Setup {
    name: &'static str,
    settings: &'static str,
    /// The paper's own.
    reproduces: bool,
}

const SETUPS: [Setup; 3] = [
    Setup { name: "median, 1 a leaf", settings: ":build=median,leaf=1", reproduces: true },
    Setup { name: "SAH, 1 a leaf", settings: ":build=sah,leaf=1", reproduces: false },
    Setup { name: "defaults", settings: "", reproduces: false },
];

const COLUMNS: &[Column] = &[
    Column::new("model", "model", Role::Note, 0),
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("standing", "model or stand-in", Role::Note, 0),
    Column::new("triangles", "triangles", Role::Note, 0),
    Column::new("paper_triangles", "(paper)", Role::Note, 0),
    Column::new("setup", "set-up", Role::Id, 0),
    Column::new("structure", "structure", Role::Id, 0),
    Column::new("nodes_per_ray", "N_T", Role::Less, 2),
    Column::new("paper_nodes_per_ray", "(paper)", Role::Note, 2),
    Column::new("tests_per_ray", "N_I", Role::Less, 2),
    Column::new("paper_tests_per_ray", "(paper)", Role::Note, 2),
    Column::new("build_s", "T_C [s]", Role::Sooner, 3),
    Column::new("paper_build_s", "(paper)", Role::Note, 2),
    Column::new("single_s", "T_R, single rays [s]", Role::Sooner, 3),
    Column::new("packet_s", "T_R, packets [s]", Role::Sooner, 3),
    Column::new("paper_render_s", "(paper)", Role::Note, 2),
    Column::new("single_speed_up", "speed-up, single", Role::Note, 2),
    Column::new("packet_speed_up", "speed-up, packets", Role::Note, 2),
    Column::new("paper_speed_up", "(paper)", Role::Note, 2),
    Column::new("node_mebibytes", "nodes [MiB]", Role::Less, 2),
    Column::new("paper_mebibytes", "(paper)", Role::Note, 2),
];

/// The paper's scanned models. Stand-ins for its other scenes are of another sort, so the bounds on nodes and triangles a ray do not apply
/// to them; their rows show what they do.
const SCANNED: [&str; 3] = ["HappyBuddha", "Dragon", "Bunny"];

/// One structure in one set-up.
struct Half {
    spec: AccelSpec,
    stats: AccelStats,
    counts: Counts,
    build: Samples,
    single: Samples,
    packet: Samples,
}

/// Both structures in one set-up over one scene.
struct Pair {
    scene: String,
    reproduces: bool,
    /// A scanned model or a surface like one, in the paper's table.
    scanned: bool,
    bvh2: Half,
    ssh: Half,
    differences: usize,
}

/// The scenes: the paper's, by model or stand-in, and larger ones.
fn cases<'a>(models: &'a [Subject], quick: bool) -> Vec<Case<'a>> {
    let scale = if quick { 20 } else { 1 };
    let stand_in = |row: &SlabScene| match row.scene {
        "PowerPlant" => Source::Spd(SpdKind::Lattice, if quick { 8 } else { 24 }, 10_000_000 / (5 * scale)),
        "FairyFrame1" => Source::Spd(SpdKind::Tree, if quick { 6 } else { 9 }, row.triangles / scale.min(4)),
        "Toys" => Source::Spd(SpdKind::Teapot, 12, row.triangles),
        _ => Source::Sphere(row.triangles / scale),
    };
    let mut used: Vec<&str> = Vec::new();
    let mut cases: Vec<Case<'a>> = Vec::new();
    for row in &SLABS {
        let model = given(models, row.scene, row.triangles);
        used.extend(model.map(|m| m.name.as_str()));
        let source = model.map_or_else(|| stand_in(row), Source::Given);
        cases.push(Case { model: Some(row.scene), triangles: row.triangles, source });
    }
    let ours = |source| Case { model: None, triangles: 0, source };
    cases.extend(models.iter().filter(|m| !used.contains(&m.name.as_str())).map(|m| ours(Source::Given(m))));
    let sizes: &[usize] = if quick { &[20_000] } else { &[1_000_000] };
    cases.extend(sizes.iter().map(|&n| ours(Source::Soup(n))));
    if !quick {
        cases.push(ours(Source::Sphere(10_000_000)));
    }
    cases
}

/// The table and its bounds.
///
/// # Errors
/// When `monitor` ends it or a structure cannot be built.
pub(super) fn measure(
    models: &[Subject],
    options: Options,
    monitor: &mut dyn Monitor,
) -> Result<(Table, Vec<Check>), ReportError> {
    let mut table = Table::new("slabs", "Single slab hierarchy: table 1", COLUMNS).with_note(
        "First hits of 640 x 480 rays (quick: 160 x 120), one thread. N_T counts nodes tested a ray and N_I triangles tested a ray, of single rays; \
         packets hold 16 rays, the paper's 4. T_R is the casting alone, the paper's the whole picture on a processor of 2007: compare ratios. \
         Speed-up is T_R of `bvh2` over that of `ssh`. Stand-ins replace models that are not at hand; bounds \
         on N_T and N_I are of scanned surfaces, to which those for PowerPlant, FairyFrame1 and Toys do not belong.",
    );
    let mut pairs = Vec::new();
    for case in cases(models, options.quick) {
        let subject = case.source.subject()?;
        let rays = picture(&subject, options)?;
        for setup in &SETUPS {
            monitor.begin(&format!("slabs: {}: {}", subject.name, setup.name))?;
            let mut pair = Pair::measure(&subject, setup, &rays, options)?;
            pair.scanned = case.model.is_some_and(|m| SCANNED.contains(&m));
            pair.rows(&case, setup, subject.indices.len(), &mut table);
            pairs.push(pair);
        }
    }
    Ok((table, checks(&pairs)))
}

/// The rays of the paper's picture.
fn picture(subject: &Subject, options: Options) -> Result<Vec<Ray>, ReportError> {
    let list: AccelSpec = AccelSpec::new(crate::accel::AccelKind::List);
    let bounds = list.build(&subject.prims())?.bounds();
    let size = if options.quick { [160, 120] } else { [640, 480] };
    let view = subject.view.or_else(|| Sphere::around(bounds).map(View::whole));
    Ok(view.map_or_else(Vec::new, |view| rays::primary(view, size)))
}

impl Half {
    fn build(subject: &Subject, name: &str, setup: &Setup, quick: bool) -> Result<(Self, AnyAccel), ReportError> {
        let spec: AccelSpec = format!("{name}{}", setup.settings).parse().map_err(crate::accel::BuildError::Spec)?;
        let prims = subject.prims();
        let mut build = Samples::default();
        let mut accel = build.time(|| spec.build(&prims))?;
        for _ in 1..if quick { 1 } else { 3 } {
            if build.median().is_some_and(|s| s < 2.0) {
                drop(accel);
                accel = build.time(|| spec.build(&prims))?;
            }
        }
        let (single, packet) = (Samples::default(), Samples::default());
        let half = Self { spec, stats: accel.stats(), counts: Counts::default(), build, single, packet };
        Ok((half, accel))
    }

    fn cast(&mut self, caster: &Caster<'_>, rays: &[Ray], out: &mut [Answer]) {
        self.single.push(caster.cast(rays, Ask::Closest, false, out));
        self.packet.push(caster.cast(rays, Ask::Closest, true, out));
    }
}

impl Pair {
    fn measure(subject: &Subject, setup: &Setup, rays: &[Ray], options: Options) -> Result<Self, ReportError> {
        let (mut bvh2, box_tree) = Half::build(subject, "bvh2", setup, options.quick)?;
        let (mut ssh, slab_tree) = Half::build(subject, "ssh", setup, options.quick)?;
        let caster = |accel| Caster { accel, prims: subject.prims(), simd: options.simd, forms: Forms::EXACT };
        let (boxes, slabs) = (caster(&box_tree), caster(&slab_tree));
        bvh2.counts = boxes.count(rays, Ask::Closest, u64::MAX);
        ssh.counts = slabs.count(rays, Ask::Closest, u64::MAX);
        let due = boxes.answers(rays, Ask::Closest);
        let mut found = slabs.answers(rays, Ask::Closest);
        let mut differences = differing(&due, &found);
        for _ in 0..if options.quick { 3 } else { 7 } {
            bvh2.cast(&boxes, rays, &mut found);
            differences += differing(&due, &found);
            ssh.cast(&slabs, rays, &mut found);
            differences += differing(&due, &found);
        }
        let (scene, reproduces) = (subject.name.clone(), setup.reproduces);
        Ok(Self { scene, reproduces, scanned: false, bvh2, ssh, differences })
    }

    fn rows(&self, case: &Case<'_>, setup: &Setup, triangles: usize, table: &mut Table) {
        let published = SLABS.iter().find(|row| case.model == Some(row.scene));
        for (i, half) in [&self.bvh2, &self.ssh].into_iter().enumerate() {
            // The paper has one set-up.
            let paper = |value: fn(&SlabScene, usize) -> f64| {
                Cell::from(published.filter(|_| setup.reproduces).map(|row| value(row, i)))
            };
            let c = &half.counts;
            table.push(vec![
                case.model.into(),
                self.scene.clone().into(),
                case.standing(triangles).into(),
                triangles.into(),
                published.map(|row| row.triangles).into(),
                setup.name.into(),
                half.spec.kind().name().into(),
                c.per_ray(c.nodes).into(),
                paper(|row, i| row.nodes[i]),
                c.per_ray(c.prims).into(),
                paper(|row, i| row.tests[i]),
                half.build.median().into(),
                paper(|row, i| row.build_s[i]),
                half.single.median().into(),
                half.packet.median().into(),
                paper(|row, i| row.render_s[i]),
                speed_up(&self.bvh2.single, &half.single).into(),
                speed_up(&self.bvh2.packet, &half.packet).into(),
                paper(|row, i| if i == 0 { 1.0 } else { row.speed_up }),
                (half.stats.node_bytes as f64 / f64::from(1 << 20)).into(),
                paper(|row, i| row.mebibytes[i]),
            ]);
        }
    }
}

fn differing(due: &[Answer], found: &[Answer]) -> usize {
    due.iter().zip(found).filter(|(a, b)| a != b).count()
}

/// Median time of one over that of the other.
fn speed_up(of: &Samples, over: &Samples) -> Option<f64> {
    Some(of.median()? / over.median().filter(|&s| s > 0.0)?)
}

fn checks(pairs: &[Pair]) -> Vec<Check> {
    let mut checks = Vec::new();
    let differences: usize = pairs.iter().map(|p| p.differences).sum();
    checks.push(Check::new("slabs: answers of `ssh` that differ from `bvh2`", Bound::Exactly(0.0), differences as f64));
    let memory = |p: &Pair| p.ssh.stats.node_bytes as f64 / p.bvh2.stats.node_bytes.max(1) as f64;
    let paper = || pairs.iter().filter(|p| p.reproduces);
    for pair in paper() {
        let (a, b) = (&pair.bvh2.counts, &pair.ssh.counts);
        let scene = &pair.scene;
        checks.push(Check::new(
            format!("slabs: {scene}: node memory, ssh over bvh2"),
            Bound::Exactly(0.25),
            memory(pair),
        ));
        if !pair.scanned {
            continue;
        }
        checks.push(Check::new(
            format!("slabs: {scene}: nodes a ray in the paper's set-up, ssh over bvh2"),
            Bound::Between(1.5, 2.3),
            b.per_ray(b.nodes) / a.per_ray(a.nodes),
        ));
        checks.push(Check::new(
            format!("slabs: {scene}: triangles a ray in the paper's set-up, ssh less bvh2"),
            Bound::Between(0.7, 2.0),
            b.per_ray(b.prims) - a.per_ray(a.prims),
        ));
    }
    for (kind, samples) in [("single rays", (|h| &h.single) as fn(&Half) -> &Samples), ("packets", |h| &h.packet)] {
        let mut ratios = Samples::default();
        paper().filter_map(|p| speed_up(samples(&p.bvh2), samples(&p.ssh))).for_each(|r| ratios.push(r));
        checks.push(Check::new(
            format!("slabs: speed in the paper's set-up, {kind}, ssh over bvh2, median over scenes"),
            Bound::AtLeast(0.9),
            ratios.median(),
        ));
    }
    checks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::AccelKind;

    fn half(kind: AccelKind, nodes: u64, prims: u64, node_bytes: usize, seconds: f64) -> Half {
        let mut time = Samples::default();
        time.push(seconds);
        Half {
            spec: AccelSpec::new(kind),
            stats: AccelStats { node_bytes, ..AccelStats::default() },
            counts: Counts { rays: 10, nodes, prims, ..Counts::default() },
            build: time.clone(),
            single: time.clone(),
            packet: time,
        }
    }

    /// The paper's bunny.
    fn pair() -> Pair {
        Pair {
            scene: "s".into(),
            reproduces: true,
            scanned: true,
            bvh2: half(AccelKind::Bvh2, 88, 6, 3200, 0.66),
            ssh: half(AccelKind::Ssh, 180, 13, 800, 0.65),
            differences: 0,
        }
    }

    fn missed(pair: Pair) -> Vec<String> {
        checks(&[pair]).into_iter().filter(Check::is_missed).map(|c| c.claim).collect()
    }

    type Fault = fn(&mut Pair);

    #[test]
    fn the_papers_own_row_keeps_the_bounds_and_each_fault_is_named() {
        assert!(missed(pair()).is_empty(), "{:?}", missed(pair()));
        let faults: [(&str, Fault); 5] = [
            ("answers", |p| p.differences = 1),
            ("node memory", |p| p.ssh.stats.node_bytes = 801),
            ("nodes a ray", |p| p.ssh.counts.nodes = 300),
            ("triangles a ray", |p| p.ssh.counts.prims = 30),
            ("single rays", |p| p.ssh.single.push(1e9)),
        ];
        for (word, fault) in faults {
            let mut pair = pair();
            fault(&mut pair);
            let missed = missed(pair);
            assert!(missed.len() == 1 && missed[0].contains(word), "{word}: {missed:?}");
        }
    }
}
