//! The same scenes by kinora and by parry3d in one run: processor time of one thread, medians of frames, and the ratio.
//!
//! What both answer is compared in every frame. parry's own triangle test errs on near misses, so its pairs of boxes are decided by the same
//! exact test as ours.

mod scenes;

use std::hint::black_box;

use kinora::{
    collide::{
        BroadMethod, BroadPhase, CollisionConfig, CollisionWorld, ContactOptions, Continuous, Layers, PartId, Snapshot,
        triangles_meet,
    },
    geom::{Aabb, Ray},
    glam::{DAffine3, Vec3},
};
use parry3d::{
    math::Vector,
    partitioning::{Bvh, BvhBuildStrategy, BvhNode, BvhWorkspace},
    query::{PointQuery, RayCast},
    shape::{TriMesh, TriMeshFlags},
};

/// Processor time of this thread in seconds.
fn now() -> f64 {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
    }
    #[cfg(not(unix))]
    {
        static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
        START.get_or_init(std::time::Instant::now).elapsed().as_secs_f64()
    }
}

/// Milliseconds that `work` takes.
fn timed<T>(times: &mut Vec<f64>, work: impl FnOnce() -> T) -> T {
    let began = now();
    let out = black_box(work());
    times.push((now() - began) * 1e3);
    out
}

fn median(times: &[f64]) -> f64 {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn mean(times: &[f64]) -> f64 {
    times.iter().sum::<f64>() / times.len() as f64
}

fn row(what: &str, ours: f64, theirs: f64, unit: &str, target: &str) {
    let ratio = if unit == "ms" { theirs / ours } else { ours / theirs };
    println!("{what:<44} kinora {ours:10.3}  parry3d {theirs:10.3} {unit:<8} {ratio:6.2} x   target {target}");
}

fn vector(v: Vec3) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

fn parry_box(b: &Aabb) -> parry3d::bounding_volume::Aabb {
    parry3d::bounding_volume::Aabb::new(vector(b.min), vector(b.max))
}

/// The scenes, by name.
const SCENES: [(&str, fn()); 6] =
    [("boxes", boxes), ("tubes", tubes), ("cloth", cloth), ("rays", rays), ("closest", closest), ("steps", steps)];

/// The scenes that the command line names, or all, on one thread.
pub(crate) fn run() {
    let wanted: Vec<String> =
        std::env::args().filter(|argument| SCENES.iter().any(|(name, _)| name == argument)).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for (name, scene) in SCENES {
        if wanted.is_empty() || wanted.iter().any(|w| w == name) {
            pool.install(scene);
        }
    }
}

fn boxes() {
    for count in [1000, 10_000, 50_000] {
        broad(count, true);
        broad(count, false);
    }
}

fn broad(count: usize, calm: bool) {
    let frames = if count == 50_000 && !calm { 24 } else { scenes::FRAMES };
    let mut scene = scenes::Boxes::new(count, calm);
    let first = scene.boxes();
    let mut ours = BroadPhase::default();
    ours.update(&first);
    let leaves = |boxes: &[Aabb]| boxes.iter().map(parry_box).enumerate().collect::<Vec<_>>();
    let mut refitted = Bvh::from_iter(BvhBuildStrategy::Binned, leaves(&first));
    let mut space = BvhWorkspace::default();
    let (mut t_ours, mut t_refit, mut t_build) = (vec![], vec![], vec![]);
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    for frame in 0..frames {
        scene.step();
        let boxes = scene.boxes();
        timed(&mut t_ours, || ours.update(&boxes).len());
        let due = scenes::hash(ours.pairs().iter().copied());
        timed(&mut t_refit, || {
            for (i, b) in boxes.iter().enumerate() {
                refitted.insert_or_update_partially(parry_box(b), i as u32, 0.0);
            }
            refitted.refit_without_opt();
            pairs.clear();
            refitted.traverse_bvtt_single_tree::<false>(&mut space, &mut |a, b| pairs.push([a.min(b), a.max(b)]));
        });
        assert_eq!(scenes::hash(pairs.iter().copied()), due, "frame {frame}");
        timed(&mut t_build, || {
            let bvh = Bvh::from_iter(BvhBuildStrategy::Binned, boxes.iter().map(parry_box).enumerate());
            pairs.clear();
            bvh.traverse_bvtt_single_tree::<false>(&mut space, &mut |a, b| pairs.push([a.min(b), a.max(b)]));
        });
        assert_eq!(scenes::hash(pairs.iter().copied()), due, "frame {frame}");
    }
    let what = format!("boxes {count} {}", if calm { "high coherence" } else { "low coherence" });
    let target = match (count, calm) {
        (10_000, true) => "1.3",
        (50_000, true) => "7.6",
        (10_000, false) => "3.9",
        (50_000, false) => "23.5",
        _ => "-",
    };
    let best = median(&t_refit).min(median(&t_build));
    row(&what, median(&t_ours), best, "ms", target);
    let by = BroadMethod::ALL.map(|m| format!("{} {}", m.name(), ours.frames_by(m))).join(", ");
    println!(
        "    mean {:.3}, worst {:.3} ms; frames by {by}",
        mean(&t_ours),
        t_ours.iter().copied().fold(0.0, f64::max)
    );
    println!("    parry3d refit {:.3}, rebuild {:.3} ms", median(&t_refit), median(&t_build));
}

fn mesh_world(meshes: &[(&[Vec3], &[[u32; 3]])], config: &CollisionConfig) -> CollisionWorld {
    let mut world = CollisionWorld::new(config).expect("valid settings");
    for (vertices, triangles) in meshes {
        world.add_mesh("mesh", vertices.to_vec(), triangles.to_vec(), DAffine3::IDENTITY).expect("a valid mesh");
    }
    world
}

fn set(world: &mut CollisionWorld, object: u32, vertices: &[Vec3]) {
    world.set_vertices(kinora::collide::ObjectId(object), vertices).expect("as many vertices");
}

fn snapshot(world: &mut CollisionWorld) -> Snapshot {
    world.snapshot().expect("a snapshot")
}

fn corners(vertices: &[Vec3], triangle: &[u32; 3]) -> [Vec3; 3] {
    triangle.map(|i| vertices[i as usize])
}

fn parry_mesh(vertices: &[Vec3], triangles: &[[u32; 3]]) -> TriMesh {
    let vertices = vertices.iter().copied().map(vector).collect();
    TriMesh::with_flags(vertices, triangles.to_vec(), TriMeshFlags::DEFORMABLE).expect("a valid mesh")
}

fn tubes() {
    let triangles = scenes::tube_triangles();
    let frames: Vec<_> = (0..scenes::FRAMES).map(|f| [scenes::tube(0, f), scenes::tube(1, f)]).collect();
    let config = CollisionConfig { contacts: true, ..CollisionConfig::default() };
    let mut world = mesh_world(&[(&frames[0][0], &triangles), (&frames[0][1], &triangles)], &config);
    let mut theirs = [parry_mesh(&frames[0][0], &triangles), parry_mesh(&frames[0][1], &triangles)];
    let (mut update, mut query, mut with_points, mut t_update, mut t_query) = (vec![], vec![], vec![], vec![], vec![]);
    let mut total = 0;
    for tubes in &frames {
        let shot = timed(&mut update, || {
            (0..).zip(tubes).for_each(|(i, tube)| set(&mut world, i, tube));
            snapshot(&mut world)
        });
        let found = timed(&mut query, || shot.contact_pairs(&ContactOptions::default()).expect("contacts"));
        timed(&mut with_points, || shot.contacts(&ContactOptions::default()).expect("contacts").len());
        let moved = tubes.each_ref().map(|t| t.iter().copied().map(vector).collect::<Vec<_>>());
        timed(&mut t_update, || theirs.iter_mut().zip(&moved).for_each(|(mesh, v)| mesh.set_vertices(v)));
        let mut pairs = timed(&mut t_query, || {
            let boxes = theirs[0].bvh().leaf_pairs(theirs[1].bvh(), |a: &BvhNode, b: &BvhNode| a.intersects(b));
            let meet = |&(i, j): &(u32, u32)| {
                triangles_meet(&corners(&tubes[0], &triangles[i as usize]), &corners(&tubes[1], &triangles[j as usize]))
            };
            boxes.filter(meet).map(|(i, j)| [i, j]).collect::<Vec<_>>()
        });
        pairs.sort_unstable();
        assert!(pairs.iter().copied().eq(found.iter().map(|p| p.triangles)));
        total += pairs.len();
    }
    assert_eq!(total, 43_938, "the pairs of the scene");
    let sum = |a: &[f64], b: &[f64]| median(&a.iter().zip(b).map(|(a, b)| a + b).collect::<Vec<_>>());
    row("two tubes, update and pairs", sum(&update, &query), sum(&t_update, &t_query), "ms", "0.95");
    println!(
        "    update {:.3}, pairs {:.3}; with points and depths {:.3} ms",
        median(&update),
        median(&query),
        median(&with_points)
    );
    println!("    parry3d update {:.3}, pairs {:.3} ms", median(&t_update), median(&t_query));
}

fn cloth() {
    let triangles = scenes::cloth_triangles();
    let frames: Vec<_> = (0..30).map(|f| scenes::cloth(2 * f)).collect();
    let config = CollisionConfig { contacts: true, ..CollisionConfig::default() };
    let mut world = mesh_world(&[(&frames[0], &triangles)], &config);
    let leaf = |v: &[Vec3], t: &[u32; 3]| parry_box(&Aabb::from_points(corners(v, t)));
    let mut bvh = Bvh::from_iter(BvhBuildStrategy::Binned, triangles.iter().map(|t| leaf(&frames[0], t)).enumerate());
    let mut space = BvhWorkspace::default();
    let (mut update, mut query, mut t_all) = (vec![], vec![], vec![]);
    let mut total = 0;
    for vertices in &frames {
        let shot = timed(&mut update, || {
            set(&mut world, 0, vertices);
            snapshot(&mut world)
        });
        let found = timed(&mut query, || shot.pairs_between(PartId(0), PartId(0)).expect("contacts"));
        let mut pairs = Vec::new();
        timed(&mut t_all, || {
            for (i, t) in (0..).zip(&triangles) {
                bvh.insert_or_update_partially(leaf(vertices, t), i, 0.0);
            }
            bvh.refit_without_opt();
            bvh.traverse_bvtt_single_tree::<false>(&mut space, &mut |i, j| {
                let (a, b) = (&triangles[i as usize], &triangles[j as usize]);
                let apart = !a.iter().any(|x| b.contains(x));
                if apart && triangles_meet(&corners(vertices, a), &corners(vertices, b)) {
                    pairs.push([i.min(j), i.max(j)]);
                }
            });
        });
        pairs.sort_unstable();
        assert!(pairs.iter().copied().eq(found.iter().map(|p| p.triangles)));
        total += pairs.len();
    }
    assert_eq!(total, 116_495, "the pairs of the scene");
    let sum: Vec<_> = update.iter().zip(&query).map(|(a, b)| a + b).collect();
    row("cloth of 100k against itself", median(&sum), median(&t_all), "ms", "36");
    println!("    update {:.3}, pairs {:.3} ms", median(&update), median(&query));
}

fn rays() {
    let triangles = scenes::torus_triangles();
    let frames: Vec<_> = (0..20).map(scenes::torus).collect();
    let kinds = scenes::rays();
    for accel in ["bvh8", "bvh2"] {
        let config = CollisionConfig { accel: accel.to_owned(), rays: true, ..CollisionConfig::default() };
        let mut world = mesh_world(&[(&frames[0], &triangles)], &config);
        let mut theirs = parry_mesh(&frames[0], &triangles);
        let (mut update, mut t_update) = (vec![], vec![]);
        let mut times = [[vec![], vec![]], [vec![], vec![]]];
        for vertices in &frames {
            let shot = timed(&mut update, || {
                set(&mut world, 0, vertices);
                snapshot(&mut world)
            });
            let moved: Vec<_> = vertices.iter().copied().map(vector).collect();
            timed(&mut t_update, || theirs.set_vertices(&moved));
            for (rays, [ours, parry]) in kinds.iter().zip(&mut times) {
                let ours_in: Vec<_> = rays.iter().map(|&(o, d)| Ray::new(o, d)).collect();
                let mut hits = vec![None; rays.len()];
                timed(ours, || shot.closest_hits(&ours_in, Layers::ALL, &mut hits).expect("rays"));
                if accel == "bvh8" {
                    let count = timed(parry, || {
                        let one = |&(o, d): &(Vec3, Vec3)| {
                            theirs
                                .cast_local_ray(&parry3d::query::Ray::new(vector(o), vector(d)), f32::MAX, true)
                                .is_some()
                        };
                        rays.iter().filter(|r| one(r)).count()
                    });
                    let due = hits.iter().flatten().count();
                    // Without exact arithmetic a few rays along edges differ.
                    assert!(count.abs_diff(due) <= due / 1000, "{count} against {due}");
                } else {
                    parry.push(f64::NAN);
                }
            }
        }
        row(&format!("torus of 100k, update ({accel})"), median(&update), median(&t_update), "ms", "3");
        for (name, [ours, parry], target) in [("camera", &times[0], "7.7"), ("random", &times[1], "1.9")] {
            let rate = |times: &[f64]| 65_536.0 / median(times) * 1e-3;
            row(&format!("torus of 100k, {name} rays ({accel})"), rate(ours), rate(parry), "M/s", target);
        }
    }
}

fn closest() {
    let (triangles, vertices) = (scenes::torus_triangles(), scenes::torus(0));
    let config = CollisionConfig { contacts: true, ..CollisionConfig::default() };
    let mut world = mesh_world(&[(&vertices, &triangles)], &config);
    let shot = snapshot(&mut world);
    let theirs = parry_mesh(&vertices, &triangles);
    let mut random = scenes::Random(99);
    let mut place = |size: f32| (random.unit() * 2.0 - 1.0) * size;
    let points: Vec<_> = (0..20_000).map(|_| Vec3::new(place(3.5), place(3.5), place(1.5))).collect();
    let (mut ours, mut parry) = (vec![], vec![]);
    for _ in 0..5 {
        let near =
            |p: &Vec3| shot.closest_point(*p, f64::INFINITY, Layers::ALL).expect("a point").map_or(0.0, |c| c.distance);
        let a = timed(&mut ours, || points.iter().map(near).sum::<f64>());
        let b = timed(&mut parry, || {
            points.iter().map(|p| f64::from(theirs.distance_to_local_point(vector(*p), false))).sum::<f64>()
        });
        assert!((a - b).abs() < 1e-3 * a, "{a} against {b}");
    }
    let rate = |times: &[f64]| points.len() as f64 / median(times);
    row("closest point on 100k triangles", rate(&ours), rate(&parry), "k/s", "96");
}

/// Continuous detection on ordinary motion: the tubes from frame to frame. parry3d has none.
fn steps() {
    let triangles = scenes::tube_triangles();
    let frames: Vec<_> = (0..8).map(|f| [scenes::tube(0, f), scenes::tube(1, f)]).collect();
    let config = CollisionConfig { contacts: true, ..CollisionConfig::default() };
    let mut world = mesh_world(&[(&frames[0][0], &triangles), (&frames[0][1], &triangles)], &config);
    let mut last = snapshot(&mut world);
    let mut times = vec![];
    let mut contacts = 0;
    for tubes in &frames[1..] {
        (0..).zip(tubes).for_each(|(i, tube)| set(&mut world, i, tube));
        let next = snapshot(&mut world);
        let found = timed(&mut times, || {
            last.moving_contacts(&next, &ContactOptions::default(), &Continuous::default()).expect("contacts")
        });
        contacts += found.len();
        last = next;
    }
    println!(
        "two tubes, continuous from frame to frame: {:.3} ms, {} contacts a step",
        median(&times),
        contacts / times.len()
    );
}
