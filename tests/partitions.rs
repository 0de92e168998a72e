//! Partitions of space (`grid`, `kdtree`, `grug`) where they are most likely to lose a hit, and what they count and refuse.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "common/trace.rs"]
mod trace;

use kinora::{
    accel::{
        Accel, AccelKind, AccelSpec, AnyAccel, AnyHit, BuildError, Closest, ReadCounter, TravRay, Visitor,
        grid::{BoxGrid, Grid, GridConfig, Resolution},
        grug::{CellOrder, Grug, GrugBytes, GrugConfig, StepMode},
        kdtree::{BoxKdTree, KdConfig, KdTree},
    },
    geom::{Aabb, Hit, Ray},
    glam::Vec3,
    simd::{Scalar, SimdLevel},
};
use trace::{Mesh, Random, closest, occluded};

const SPECS: &[&str] = &[
    "grid",
    "grid:res=8",
    "grid:res=8,leaf=ids",
    "grid:res=3x1x7",
    "kdtree",
    "kdtree:clip=off,bins=8,block_cost=1",
    "grug",
    "grug:res=8,mode=dda",
    "grug:res=8,mode=exit,order=morton",
    "grug:res=32,mode=exit,clip=off",
];

fn built(text: &str, mesh: &Mesh) -> AnyAccel {
    let spec: AccelSpec = text.parse().expect("known settings");
    let accel = spec.build(&mesh.prims()).expect("the mesh builds");
    accel.validate(&mesh.prims()).unwrap_or_else(|v| panic!("{text}: {v:?}"));
    accel
}

/// Every specification against `list`; the number of hits.
fn conforms(name: &str, mesh: &Mesh, rays: &[Ray]) -> usize {
    let list = built("list", mesh);
    let due = closest(&list, &mesh.prims(), rays, SimdLevel::best());
    for text in SPECS {
        let accel = built(text, mesh);
        let hits = closest(&accel, &mesh.prims(), rays, SimdLevel::best());
        let blocked = occluded(&accel, &mesh.prims(), rays, SimdLevel::best());
        for i in 0..rays.len() {
            assert_eq!(hits[i].map(bits), due[i].map(bits), "{name}: {text}, ray {i} {:?}", rays[i]);
            assert_eq!(blocked[i], due[i].is_some(), "{name}: {text}, ray {i} {:?}", rays[i]);
        }
    }
    due.iter().flatten().count()
}

fn bits(hit: Hit) -> [u32; 4] {
    [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.prim.0]
}

/// Two triangles over the square from `low` to `high` at `at` on `axis`.
fn square(axis: usize, at: f32, low: f32, high: f32) -> [[Vec3; 3]; 2] {
    let corner = |b: f32, c: f32| {
        let mut p = Vec3::splat(at);
        p[(axis + 1) % 3] = b;
        p[(axis + 2) % 3] = c;
        p
    };
    let [a, b, c, d] = [corner(low, low), corner(high, low), corner(high, high), corner(low, high)];
    [[a, b, c], [a, c, d]]
}

/// The walls of a cube of 8 x 8 x 8 unit cells, and squares of one cell in many of the planes between them: all on planes of `res=8`.
fn chambers() -> Mesh {
    let mut corners = Vec::new();
    for axis in 0..3 {
        for at in [0.0, 8.0] {
            corners.extend(square(axis, at, 0.0, 8.0));
        }
        for k in 1..8 {
            let low = ((k * 3 + axis as i32) % 7) as f32;
            corners.extend(square(axis, k as f32, low, low + 1.0));
        }
    }
    Mesh::soup(&corners)
}

fn signed_zero(random: &mut Random) -> f32 {
    [0.0, -0.0][random.below(2)]
}

#[test]
fn geometry_in_the_planes_between_cells_is_hit() {
    let mesh = chambers();
    let mut random = Random(1);
    let mut rays = Vec::new();
    for i in 0..300 {
        // Origins on faces, edges and corners of cells, directions along axes, through edges and through corners.
        let origin = Vec3::new(random.below(9) as f32, random.below(9) as f32, random.below(17) as f32 * 0.5);
        let step = |random: &mut Random| [-1.0, -0.5, 0.5, 1.0, signed_zero(random)][random.below(5)];
        let dir = Vec3::new(step(&mut random), step(&mut random), step(&mut random));
        let shift = if i % 3 == 0 { Vec3::new(0.25, 0.5, 0.125) } else { Vec3::ZERO };
        rays.push(Ray::new(origin + shift, dir));
        rays.push(Ray { t_near: 1.0, t_far: 2.0, ..Ray::new(origin + shift - dir, dir) });
    }
    assert!(conforms("chambers", &mesh, &rays) > 300);
}

#[test]
fn axis_parallel_rays_in_a_plane_between_cells_lose_no_hit() {
    let mesh = chambers();
    let mut rays = Vec::new();
    for axis in 0..3 {
        for k in 0..=8 {
            for j in 0..=16 {
                let mut origin = Vec3::splat(j as f32 * 0.5);
                origin[(axis + 1) % 3] = k as f32;
                origin[axis] = -1.0;
                for zero in [0.0, -0.0] {
                    let mut dir = Vec3::splat(zero);
                    dir[axis] = 1.0;
                    rays.push(Ray::new(origin, dir));
                    rays.push(Ray::new(origin + dir * 10.0, -dir));
                }
            }
        }
    }
    assert!(conforms("in planes", &mesh, &rays) > 600);
}

#[test]
fn diagonals_through_corners_of_cells_lose_no_hit() {
    let mesh = chambers();
    let mut rays = Vec::new();
    for signs in 0..8_u32 {
        let dir = Vec3::from_array(std::array::from_fn(|i| if signs >> i & 1 == 1 { -1.0 } else { 1.0 }));
        for far in [0.5, 3.0, 4.0, 1e3, 1e6] {
            for shift in [Vec3::ZERO, Vec3::X, Vec3::new(0.0, 1.0, -2.0), Vec3::new(1e-6, 0.0, 0.0)] {
                rays.push(Ray::new(Vec3::splat(4.0) + shift - dir * far, dir));
                rays.push(Ray::new(Vec3::splat(4.0) + shift - dir * far, dir.with_z(dir.z * 0.999_999_9)));
            }
        }
    }
    assert!(conforms("diagonals", &mesh, &rays) > 200);
}

#[test]
fn rays_from_very_far_away_lose_no_hit() {
    let mesh = chambers();
    let mut random = Random(9);
    let mut rays = Vec::new();
    for exponent in [10, 20, 38, 45, 60, 100, 120] {
        let far = (f64::from(exponent)).exp2() as f32;
        for _ in 0..20 {
            let target = (random.vec3() + 1.0) * 4.0;
            let axis = random.below(3);
            // Far along one axis the others can still be met exactly.
            let mut dir = Vec3::ZERO;
            dir[axis] = if random.below(2) == 0 { 1.0 } else { -1.0 };
            rays.push(Ray::new(target - dir * far, dir));
            let tilted = (random.vec3() * 2.0 - target) / far;
            rays.push(Ray::new(target - dir * far, dir + tilted));
            rays.push(Ray::new(target - random.vec3() * far, random.vec3()));
        }
    }
    assert!(conforms("far", &mesh, &rays) > 100);
}

#[test]
fn scenes_without_extent_conform() {
    let point = Mesh::soup(&[[Vec3::splat(3.5); 3]; 5]);
    let line = Mesh::soup(&[[Vec3::ZERO, Vec3::X, Vec3::X * 2.0], [Vec3::X, Vec3::X * 3.0, Vec3::ZERO]]);
    let towards: Vec<_> =
        (0..20).map(|i| Ray::new(Vec3::new(i as f32 * 0.2, 1.0, 2.0), Vec3::new(0.0, -0.5, -1.0))).collect();
    assert_eq!(conforms("point", &point, &towards), 0);
    assert_eq!(conforms("line", &line, &towards), 0);
    for (axis, at) in [(0, 0.0), (1, 1.0e6), (2, -1.0e-40)] {
        let sheet = Mesh::soup(&square(axis, at, -1.0, 1.0));
        let mut random = Random(4);
        let rays: Vec<_> = (0..60)
            .map(|_| {
                let mut target = random.vec3();
                target[axis] = at;
                let dir = random.vec3();
                Ray::new(target - dir, dir)
            })
            .collect();
        assert!(conforms("sheet", &sheet, &rays) > 20);
    }
}

#[test]
fn one_triangle_conforms() {
    let mut random = Random(5);
    for scale in [1.0, 1e-30, 1e30] {
        let corners = [random.vec3() * scale, random.vec3() * scale, random.vec3() * scale];
        let mesh = Mesh::soup(&[corners]);
        let rays: Vec<_> = (0..60)
            .map(|i| {
                let target = (corners[0] + corners[1] + corners[i % 3]) / 3.0;
                let dir = random.vec3() * scale;
                Ray::new(target - dir, dir)
            })
            .collect();
        assert!(conforms("one", &mesh, &rays) > 10);
    }
}

/// Triangles whose boxes all have the same centre.
fn concentric(count: usize) -> Mesh {
    let mut random = Random(3);
    let triangle = |_| {
        let v = random.vec3();
        [v, -v, Vec3::new(v.y, v.x, v.z)]
    };
    Mesh::soup(&(0..count).map(triangle).collect::<Vec<_>>())
}

#[test]
fn a_hundred_thousand_equal_centroids_stay_within_bounded_memory() {
    let mesh = concentric(100_000);
    let mut random = Random(8);
    let rays: Vec<_> = (0..3).map(|_| Ray::new(random.vec3() * 2.0, random.vec3())).collect();
    let list = built("list", &mesh);
    let due = closest(&list, &mesh.prims(), &rays, SimdLevel::best());
    for text in ["grid", "kdtree", "grug"] {
        let spec: AccelSpec = text.parse().expect("a name");
        let accel = spec.build(&mesh.prims()).expect("the mesh builds");
        let bytes = accel.stats().total_bytes;
        assert!(bytes < 100_000 * 3000, "{text}: {bytes} bytes");
        assert_eq!(closest(&accel, &mesh.prims(), &rays, SimdLevel::best()), due, "{text}");
    }
}

#[test]
fn settings_out_of_range_are_typed_errors() {
    let error = |text: &str| text.parse::<AccelSpec>().expect_err(text).to_string();
    assert_eq!(
        error("grid:res=5000"),
        "grid: setting `res`: `5000` is neither N nor NxMxK with numbers from 1 to 4096"
    );
    assert_eq!(error("grid:res=1000"), "grid: setting `res`: 1000000000 cells, at most 268435456 fit");
    assert_eq!(error("grid:density=0"), "grid: setting `density`: `0` is not a number from 0.001 to 1000");
    assert_eq!(error("grug:res=100"), "grug: setting `res`: `100` is neither `auto` nor a power of two from 4 to 512");
    assert_eq!(error("grug:mode=walk"), "grug: setting `mode`: `walk` is neither `dda` nor `exit`");
    assert_eq!(error("kdtree:bins=257"), "kdtree: setting `bins`: `257` is not a number from 2 to 256");
    assert_eq!(error("kdtree:clip=1"), "kdtree: setting `clip`: `1` is neither `on` nor `off`");
    assert_eq!(
        error("kdtree:block_cost=NaN"),
        "kdtree: setting `block_cost`: `NaN` is not a number from 0.001 to 1000"
    );
    // Every triangle fills a good part of the cells: more references than a number can hold.
    let spec: AccelSpec = "grid:res=512".parse().expect("known settings");
    let error = spec.build(&concentric(2000).prims()).expect_err("too many references");
    assert!(matches!(error, BuildError::TooLarge { structure: "grid", .. }), "{error}");
}

#[test]
fn a_given_resolution_is_kept_and_thin_axes_get_one_cell() {
    let sheet = Mesh::soup(&square(2, 1.0, 0.0, 1.0));
    let given = GridConfig { resolution: Resolution::Cells([4, 5, 6]), ..GridConfig::default() };
    let grid = Grid::build(&sheet.prims(), &given).expect("a sheet builds");
    assert_eq!(grid.resolution(), [4, 5, 1]);
}

fn soup(count: usize, size: f32, seed: u64) -> Mesh {
    let mut random = Random(seed);
    let triangle = |_| {
        let center = random.vec3();
        [center, center + random.vec3() * size, center + random.vec3() * size]
    };
    Mesh::soup(&(0..count).map(triangle).collect::<Vec<_>>())
}

fn random_rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    (0..count).map(|_| Ray::new(random.vec3() * 2.0, random.vec3())).collect()
}

/// Hits and counts of every ray, one after the other.
fn counted<A: Accel>(accel: &A, mesh: &Mesh, rays: &[Ray]) -> (Vec<Option<Hit>>, ReadCounter) {
    let mut count = ReadCounter::default();
    let mut answer = |ray: &Ray| {
        let ray = TravRay::new(ray)?;
        let mut best = Closest::new(&ray);
        accel.closest::<Scalar, _, _>(&mesh.prims(), &ray, &mut best, &AnyHit, &mut count);
        count.next_ray();
        best.hit(&ray)
    };
    (rays.iter().map(&mut answer).collect(), count)
}

#[test]
fn rays_beside_a_flat_sheet_test_none_of_it() {
    let cells = (0..32).flat_map(|i| (0..32).map(move |j| (i as f32, j as f32)));
    let mut corners: Vec<_> =
        cells.map(|(x, y)| [Vec3::new(x, y, 0.0), Vec3::new(x + 1.0, y, 0.0), Vec3::new(x, y + 1.0, 0.0)]).collect();
    corners.push([Vec3::new(0.0, 0.0, -20.0), Vec3::new(1.0, 0.0, -20.0), Vec3::new(0.0, 1.0, -20.0)]);
    let mesh = Mesh::soup(&corners);
    let mut random = Random(3);
    let mut level = |size: f32| Vec3::new(16.0 + random.unit() * size, 16.0 + random.unit() * size, -0.05);
    let rays: Vec<_> = (0..200)
        .map(|_| {
            let (from, to) = (level(8.0), level(8.0));
            Ray { t_far: 1.0, ..Ray::new(from, to - from) }
        })
        .collect();
    let tree = KdTree::build(&mesh.prims(), &KdConfig::default()).expect("the mesh builds");
    let (hits, count) = counted(&tree, &mesh, &rays);
    assert!(hits.iter().all(Option::is_none));
    assert_eq!(count.blocks, 0);
}

#[test]
fn both_ways_of_stepping_read_and_hit_the_same() {
    for (mesh, rays) in [
        (soup(3000, 0.1, 2), random_rays(400, 3)),
        (chambers(), {
            let mut random = Random(6);
            (0..300).map(|_| Ray::new(Vec3::splat(4.0) - random.vec3().round() * 5.0, random.vec3().round())).collect()
        }),
    ] {
        for res in [8, 32, 64] {
            for order in [CellOrder::Concatenated, CellOrder::Interleaved] {
                let walk = |mode| {
                    let config = GrugConfig { res: Some(res), mode, order, ..GrugConfig::default() };
                    let grug = Grug::build(&mesh.prims(), &config).expect("the mesh builds");
                    counted(&grug, &mesh, &rays)
                };
                let ((hits, dda), (same, exit)) = (walk(StepMode::Dda), walk(StepMode::Exit));
                assert_eq!(hits, same);
                assert!(hits.iter().flatten().count() > 50);
                let reads = |c: &ReadCounter| (c.transactions, c.words, c.bytes, c.lines, c.nodes, c.blocks);
                assert_eq!(reads(&dda), reads(&exit));
                assert!(dda.steps >= exit.steps, "{} steps against {}", dda.steps, exit.steps);
                if order == CellOrder::Concatenated {
                    // A table entry, bounds and tree nodes: 1, 6 and 2 words.
                    let groups = dda.transactions - dda.nodes;
                    assert_eq!(dda.words, groups / 2 * 7 + dda.nodes * 2);
                    assert_eq!(dda.bytes, dda.words * 4);
                    assert_eq!(exit.steps + rays_entered(&mesh, &rays), groups / 2, "one step a group after the first");
                }
            }
        }
    }
}

/// Rays that meet the box of all triangles.
fn rays_entered(mesh: &Mesh, rays: &[Ray]) -> u64 {
    let grug = Grug::build(&mesh.prims(), &GrugConfig { res: Some(4), ..GrugConfig::default() }).expect("builds");
    rays.iter().filter(|&&ray| counted(&grug, mesh, &[ray]).1.transactions > 0).count() as u64
}

#[test]
fn bounds_cost_three_times_what_removing_the_upper_tree_saves() {
    let mesh = soup(5000, 0.05, 12);
    for res in [4, 16, 64] {
        let config = GrugConfig { res: Some(res), ..GrugConfig::default() };
        let grug = Grug::build(&mesh.prims(), &config).expect("the mesh builds");
        let GrugBytes { full_tree, tree, boundary, hash } = grug.bytes();
        assert_eq!(hash, 4 * (res as usize).pow(3));
        assert_eq!(boundary, 24 * grug.groups());
        assert_eq!(boundary, 3 * (full_tree - tree) + 24);
        assert!(grug.groups() > 1);
        assert_eq!(grug.resolution(), res);
    }
}

#[test]
fn automatic_resolution_gives_eight_cells_a_group_on_average() {
    for count in [1, 100, 20_000] {
        let mesh = soup(count, 0.02, 13);
        let grug = Grug::build(&mesh.prims(), &GrugConfig::default()).expect("the mesh builds");
        assert!((grug.resolution() as usize).pow(3) >= 8 * grug.groups());
        assert!(grug.resolution() <= 64);
    }
}

/// Finds the first sphere along a ray, and notes what it is asked about.
struct Spheres<'a> {
    boxes: &'a [Aabb],
    ray: Ray,
    best: f64,
    asked: Vec<u32>,
}

impl Visitor for Spheres<'_> {
    fn t_limit(&self) -> f64 {
        self.best
    }

    fn visit(&mut self, object: u32) -> bool {
        self.asked.push(object);
        let aabb = self.boxes[object as usize];
        let (center, radius) = (aabb.center().as_dvec3(), f64::from(aabb.extent().x) / 2.0);
        let (d, m) = (self.ray.dir.as_dvec3(), self.ray.origin.as_dvec3() - center);
        let (a, b, c) = (d.dot(d), m.dot(d), m.dot(m) - radius * radius);
        let root = (b * b - a * c).sqrt();
        let t = if (-b - root) / a >= 0.0 { (-b - root) / a } else { (-b + root) / a };
        // NaN where the sphere is missed.
        if t >= 0.0 && t < self.best {
            self.best = t;
        }
        false
    }
}

#[test]
fn structures_over_boxes_visit_what_can_be_hit() {
    let mut random = Random(21);
    let mut boxes: Vec<_> = (0..500)
        .map(|_| {
            let (center, radius) = (random.vec3(), random.unit().abs() * 0.1 + 0.01);
            Aabb { min: center - radius, max: center + radius }
        })
        .collect();
    boxes.push(Aabb::EMPTY);
    boxes.push(Aabb { min: Vec3::NAN, max: Vec3::ONE });
    let grids =
        [GridConfig::default(), GridConfig { resolution: Resolution::Cells([7, 3, 9]), ..GridConfig::default() }]
            .map(|c| BoxGrid::build(&boxes, &c).expect("boxes build"));
    let kd = BoxKdTree::build(&boxes, &KdConfig::default()).expect("boxes build");
    let (mut hits, mut asked) = (0, 0);
    for _ in 0..400 {
        let origin = random.vec3() * 2.0;
        let ray = Ray::new(origin, random.vec3() * 0.7 - origin);
        let trav = TravRay::new(&ray).expect("a ray");
        let fresh = || Spheres { boxes: &boxes, ray, best: f64::from(f32::MAX), asked: Vec::new() };
        let mut due = fresh();
        for object in 0..500 {
            due.visit(object);
        }
        for grid in grids.iter().map(Some).chain([None]) {
            let mut visitor = fresh();
            let mut count = ReadCounter::default();
            match grid {
                None => kd.walk(&trav, &mut visitor, &mut count),
                Some(grid) => grid.walk(&trav, &mut visitor, &mut count),
            };
            assert_eq!(visitor.best, due.best);
            assert_eq!(visitor.asked.len() as u64, count.prims);
            assert!(visitor.asked.iter().all(|&o| o < 500), "empty boxes are never visited");
            asked += visitor.asked.len();
        }
        hits += usize::from(due.best < 1e30);
    }
    assert!(hits > 100);
    assert!(asked < 3 * 400 * 50, "{asked} visits");
}

#[test]
fn a_visit_can_end_the_walk() {
    struct First(u32);
    impl Visitor for First {
        fn t_limit(&self) -> f64 {
            1e30
        }
        fn visit(&mut self, _object: u32) -> bool {
            self.0 += 1;
            true
        }
    }
    let boxes = [Aabb { min: Vec3::ZERO, max: Vec3::ONE }; 40];
    let ray = TravRay::new(&Ray::new(Vec3::splat(-1.0), Vec3::ONE)).expect("a ray");
    let grid = BoxGrid::build(&boxes, &GridConfig::default()).expect("boxes build");
    let kd = BoxKdTree::build(&boxes, &KdConfig::default()).expect("boxes build");
    let mut first = First(0);
    assert!(grid.walk(&ray, &mut first, &mut ()) && kd.walk(&ray, &mut first, &mut ()));
    assert_eq!(first.0, 2);
}

#[test]
fn all_three_ask_for_a_rebuild_when_positions_change() {
    let mesh = soup(50, 0.2, 4);
    for kind in [AccelKind::Grid, AccelKind::Kdtree, AccelKind::Grug] {
        let accel = built(kind.name(), &mesh);
        let mut out = accel.clone();
        assert_eq!(accel.refit_into(&mut out, &mesh.prims()), kinora::accel::Refit::NeedsRebuild);
    }
}
