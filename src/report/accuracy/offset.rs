//! Where secondary rays start: shadows that a surface casts on itself, and light that comes through it.

use rayon::prelude::*;

use super::Options;
use crate::{
    accel::{AccelSpec, AnyAccel},
    geom::{Forms, Hit, Precision, Ray, Triangles},
    glam::{DMat3, DVec3, Vec3},
    render::{self, Leaving},
    report::{
        Bound, Check, Column, Monitor, ReportError, Role, Table,
        closed::{self, Aim, BATCH, Closed},
        measure::{Ask, Caster, Samples, Stopwatch},
        reference::wilson,
    },
};

const COLUMNS: &[Column] = &[
    Column::new("scene", "scene", Role::Id, 0),
    Column::new("placed", "placed", Role::Id, 0),
    Column::new("precision", "offset", Role::Id, 0),
    Column::new("ns", "ns a start", Role::Sooner, 1),
    Column::new("count", "rays of each kind", Role::Note, 0),
    Column::new("false_shadows", "false shadows", Role::Less, 0),
    Column::new("false_shadows_below", "fewer in 10^9 than", Role::Note, 0),
    Column::new("self_hits", "of them by the own triangle", Role::Less, 0),
    Column::new("light_leaks", "light leaks", Role::Less, 0),
    Column::new("light_leaks_below", "fewer in 10^9 than", Role::Note, 0),
];

/// How a mesh is placed in the world.
#[derive(Clone, Copy, Debug)]
struct Placement {
    name: &'static str,
    matrix: DMat3,
    shift: DVec3,
}

fn placements() -> [Placement; 6] {
    let scaled = |name, s: f64| Placement { name, matrix: DMat3::from_diagonal(DVec3::splat(s)), shift: DVec3::ZERO };
    let sheared = DMat3::from_cols(DVec3::new(1.0, 0.3, 0.0), DVec3::new(0.7, 2.0, 0.1), DVec3::new(0.0, -0.4, 0.05));
    [
        scaled("as it is", 1.0),
        scaled("scale 10^-3", 1e-3),
        scaled("scale 10^5", 1e5),
        Placement { shift: DVec3::new(100.0, 250.0, -300.0), ..scaled("far from the origin", 1.0) },
        Placement { shift: DVec3::new(1e4, 0.0, 7e4), ..scaled("scale 10^2, far from the origin", 1e2) },
        Placement { name: "sheared", matrix: sheared, shift: DVec3::ZERO },
    ]
}

/// Starts on one mesh in one form.
#[derive(Clone, Debug)]
pub(super) struct OffsetRow {
    scene: String,
    placed: &'static str,
    form: Precision,
    seconds: Samples,
    rays: u64,
    false_shadows: u64,
    self_hits: u64,
    light_leaks: u64,
}

/// The rows as they are written.
pub(super) fn table(rows: &[OffsetRow]) -> Table {
    let mut table = Table::new("offsets", "Where secondary rays start", COLUMNS).with_note(
        "From hits on the inner side of closed convex meshes, one ray goes to a light inside, which nothing hides, and one to a light outside, which the mesh \
         hides. A false shadow (acne) is the first being blocked, a light leak the second not. Starts are made by the renderer's own code, a vector of them at once. The \
         exact offset comes from a bound on the error of the hit point; the fast one is fixed (Wächter and Binder 2019).",
    );
    for r in rows {
        let below = |n: u64| wilson(n, r.rays).1 * 1e9;
        table.push(vec![
            r.scene.clone().into(),
            r.placed.into(),
            r.form.name().into(),
            r.seconds.median().map(|s| s * 1e9 / r.rays.max(1) as f64).into(),
            r.rays.into(),
            r.false_shadows.into(),
            below(r.false_shadows).into(),
            r.self_hits.into(),
            r.light_leaks.into(),
            below(r.light_leaks).into(),
        ]);
    }
    table
}

/// Bound on the share of wrong shadow rays with the fixed offset.
const FAST_SHARE: f64 = 0.01;

/// What starts must show.
pub(super) fn checks(rows: &[OffsetRow]) -> Vec<Check> {
    let of = |form: Precision| rows.iter().filter(move |r| r.form == form);
    let wrong = |r: &OffsetRow| r.false_shadows + r.light_leaks;
    let share = of(Precision::Fast).map(|r| wrong(r) as f64 / (2 * r.rays).max(1) as f64).reduce(f64::max);
    vec![
        Check::new(
            "exact offset: false shadows and light leaks",
            Bound::Exactly(0.0),
            of(Precision::Exact).map(|r| wrong(r) as f64).reduce(|a, b| a + b),
        ),
        Check::new("fast offset: share of wrong shadow rays", Bound::AtMost(FAST_SHARE), share),
    ]
}

/// Rows of convex meshes in all placements.
///
/// # Errors
/// When `monitor` ends it, or a mesh cannot be built.
pub(super) fn measure(options: &Options, monitor: &mut dyn Monitor) -> Result<Vec<OffsetRow>, ReportError> {
    let mut rows = Vec::new();
    for mesh in [closed::ball(1000), closed::cube(1000)] {
        for placed in placements() {
            monitor.begin(&format!("{}, {}: offsets", mesh.subject.name, placed.name))?;
            let room = Room::new(&mesh, placed, options)?;
            rows.extend(Precision::ALL.map(|form| room.row(form, options)));
        }
    }
    Ok(rows)
}

/// A convex closed mesh, with hits on its inner side.
struct Room {
    name: String,
    placed: Placement,
    positions: Vec<Vec3>,
    indices: Vec<[u32; 3]>,
    accel: AnyAccel,
    hits: Vec<(Ray, Hit)>,
}

impl Room {
    fn new(mesh: &Closed, placed: Placement, options: &Options) -> Result<Self, ReportError> {
        let place = |p: Vec3| (placed.matrix * p.as_dvec3() + placed.shift).as_vec3();
        let positions: Vec<Vec3> = mesh.subject.positions.iter().map(|&p| place(p)).collect();
        let indices = mesh.subject.indices.clone();
        let prims = Triangles { positions: &positions, indices: &indices, topology_epoch: 1 };
        let accel = "bvh2".parse::<AccelSpec>().map_err(crate::accel::BuildError::from)?.build(&prims)?;
        let batches = options.rays().div_ceil(BATCH) as u64;
        let rays: Vec<Ray> = (0..batches).flat_map(|b| mesh.rays(Aim::Anywhere, false, b)).collect();
        let rays: Vec<Ray> =
            rays.into_iter().map(|r| Ray::new(place(r.origin), (placed.matrix * r.dir.as_dvec3()).as_vec3())).collect();
        let caster = Caster { accel: &accel, prims, simd: options.simd, forms: Forms::EXACT };
        let found = caster.answers(&rays, Ask::Closest);
        let hits = rays.into_iter().zip(found).filter_map(|(ray, found)| Some((ray, found.found()?))).collect();
        Ok(Self { name: mesh.subject.name.clone(), placed, positions, indices, accel, hits })
    }

    fn prims(&self) -> Triangles<'_> {
        Triangles { positions: &self.positions, indices: &self.indices, topology_epoch: 1 }
    }

    /// Rays about to leave to where the hits were seen from.
    fn leaving(&self) -> Vec<Leaving> {
        let of = |(ray, hit): &(Ray, Hit)| Leaving {
            corners: self.prims().corners(hit.prim),
            weights: [hit.u, hit.v],
            dir: -ray.dir,
        };
        self.hits.iter().map(of).collect()
    }

    fn row(&self, form: Precision, options: &Options) -> OffsetRow {
        let mut seconds = Samples::default();
        let leaving = self.leaving();
        let mut starts = vec![Vec3::ZERO; leaving.len()];
        for _ in 0..options.repeats() {
            let watch = Stopwatch::thread();
            render::starts(&leaving, form, options.simd, &mut starts);
            seconds.push(watch.seconds());
        }
        let placed = |p: DVec3| self.placed.matrix * p + self.placed.shift;
        // From the surface inwards, past the origin of the ray that found it: inside a convex mesh nothing is in the way.
        let (within, beyond) = (placed(DVec3::ZERO), placed(DVec3::new(3.0, 5.0, 4.0)));
        let toward = |light: DVec3| -> Vec<Ray> {
            let ray = |s: &Vec3| Ray { t_far: 1.0, ..Ray::new(*s, (light - s.as_dvec3()).as_vec3()) };
            starts.iter().map(ray).collect()
        };
        let caster = Caster { accel: &self.accel, prims: self.prims(), simd: options.simd, forms: Forms::EXACT };
        let (inside, outside) = (toward(within), toward(beyond));
        let shadows = caster.answers(&inside, Ask::Closest);
        let hidden = caster.answers(&outside, Ask::Blocked);
        let own = |(answer, (_, hit)): (&crate::report::measure::Answer, &(Ray, Hit))| {
            answer.hit().is_some_and(|(prim, _)| prim == hit.prim)
        };
        OffsetRow {
            scene: self.name.clone(),
            placed: self.placed.name,
            form,
            seconds,
            rays: self.hits.len() as u64,
            false_shadows: shadows.par_iter().filter(|a| a.hit().is_some()).count() as u64,
            self_hits: shadows.iter().zip(&self.hits).filter(|&pair| own(pair)).count() as u64,
            light_leaks: hidden.iter().filter(|a| a.hit().is_none()).count() as u64,
        }
    }
}
