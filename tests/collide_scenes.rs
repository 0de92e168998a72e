//! Queries on the built-in scenes and on the shared meshes in motion against every triangle: pairs of boxes by a plain grid, then exact predicates.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "small numbers; places on the grid saturate"
)]

mod common;
#[path = "common/integers.rs"]
mod integers;
#[path = "common/trace.rs"]
mod trace;

use std::{
    collections::{BTreeSet, HashMap},
    sync::Arc,
};

use kinora::{
    anim::ActiveClip,
    collide::{
        CollisionConfig, CollisionWorld, ContactOptions, Continuous, Features, Layers, PartId, Shape, Snapshot,
        TrianglePair, boxes_meet, closest_on_triangle, triangle_distance, triangle_meets_box, triangle_meets_capsule,
        triangle_meets_sphere, triangles_meet,
    },
    geom::Aabb,
    glam::{DAffine3, Vec3},
    scene::{ClipId, Scene, builtin, import},
};
use trace::Random;

type Triangle = (PartId, u32, [u32; 3], [Vec3; 3]);

fn triangles(snapshot: &Snapshot) -> Vec<Triangle> {
    let of_part = |part: kinora::collide::PartView<'_>| {
        let corners = |t: &[u32; 3]| t.map(|i| part.vertices()[i as usize]);
        (0..).zip(part.triangles()).map(|(i, t)| (part.id(), i, *t, corners(t))).collect::<Vec<_>>()
    };
    snapshot.parts().flat_map(of_part).collect()
}

/// Every pair of boxes that meet, found in the cells of a grid that both reach into.
fn box_pairs(boxes: &[Aabb]) -> Vec<[usize; 2]> {
    let mean = boxes.iter().map(|b| b.extent().max_element()).sum::<f32>() / boxes.len().max(1) as f32;
    let cell = |p: Vec3| (p / (mean * 2.0).max(1e-20)).floor().to_array().map(|x| x as i32);
    let mut cells: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    for (i, aabb) in boxes.iter().enumerate() {
        let ([x0, y0, z0], [x1, y1, z1]) = (cell(aabb.min), cell(aabb.max));
        for x in x0..=x1 {
            for y in y0..=y1 {
                for z in z0..=z1 {
                    cells.entry([x, y, z]).or_default().push(i);
                }
            }
        }
    }
    let mut pairs = Vec::new();
    for (&place, inside) in &cells {
        for (at, &i) in inside.iter().enumerate() {
            for &j in &inside[at + 1..] {
                let (a, b) = (&boxes[i], &boxes[j]);
                // In the lowest of the cells that both reach into.
                if boxes_meet(a, b) && cell(a.min.max(b.min)) == place {
                    pairs.push([i, j]);
                }
            }
        }
    }
    pairs
}

fn share_place(rest: &[Vec3], a: &[u32], b: &[u32]) -> bool {
    a.iter().any(|&i| b.iter().any(|&j| rest[i as usize] == rest[j as usize]))
}

fn rest(snapshot: &Snapshot, part: PartId) -> &[Vec3] {
    let view = snapshot.part(part).expect("a part");
    let instance = view.scene().instances[part.index() % view.scene().instances.len()];
    &view.scene().part(instance).positions
}

/// Contacts between parts, and within those that deform but for neighbours.
fn check_contacts(snapshot: &Snapshot, what: &str) -> usize {
    let all = triangles(snapshot);
    let boxes: Vec<_> = all.iter().map(|t| Aabb::from_points(t.3)).collect();
    let mut due = Vec::new();
    for (number, [i, j]) in box_pairs(&boxes).into_iter().enumerate() {
        let ((a, x, corners, s), (b, y, others, t)) = (&all[i.min(j)], &all[i.max(j)]);
        let deforms = || snapshot.part(*a).expect("a part").class() == kinora::anim::MotionClass::Deforming;
        if a == b && (!deforms() || share_place(rest(snapshot, *a), corners, others)) {
            continue;
        }
        let meet = triangles_meet(s, t);
        if number % 64 == 0 {
            assert_eq!(meet, integers::triangles_meet(s, t), "{s:?} {t:?}");
        }
        if meet {
            due.push(TrianglePair { parts: [*a, *b], triangles: [*x, *y] });
        }
    }
    due.sort_unstable();
    let options = ContactOptions { within: true, ..ContactOptions::default() };
    assert!(snapshot.contact_pairs(&options).expect("pairs") == due, "{what}: {} pairs are due", due.len());
    due.len()
}

fn at(world: &mut CollisionWorld, scene: &Scene, time_s: f64) -> Snapshot {
    let clips: Vec<_> = (0..).zip(&scene.clips).take(1).map(|(i, _)| ActiveClip { clip: ClipId(i), time_s }).collect();
    world.set_time(kinora::collide::ObjectId(0), &clips).expect("a clip of the scene");
    world.snapshot().expect("a snapshot")
}

fn world_of(scene: &Arc<Scene>) -> CollisionWorld {
    let mut world = CollisionWorld::new(&CollisionConfig::default()).expect("the default is valid");
    world.add_scene(scene.clone(), DAffine3::IDENTITY).expect("a valid scene");
    world
}

fn duration(scene: &Scene) -> f64 {
    scene.clips.first().map_or(0.0, |clip| clip.duration_s)
}

#[test]
fn contacts_of_built_in_scenes_are_those_of_a_plain_grid() {
    for name in builtin::names() {
        let scene = Arc::new(builtin::load(name).expect("built-in scenes are valid"));
        let mut world = world_of(&scene);
        for share in [0.0, 0.6] {
            check_contacts(&at(&mut world, &scene, share * duration(&scene)), name);
        }
    }
}

#[test]
fn queries_on_built_in_scenes_are_those_of_every_triangle() {
    let mut random = Random(21);
    for name in builtin::names() {
        let scene = Arc::new(builtin::load(name).expect("built-in scenes are valid"));
        let snapshot = at(&mut world_of(&scene), &scene, 0.4 * duration(&scene));
        let all = triangles(&snapshot);
        let (center, size) = (snapshot.bounds().center(), snapshot.bounds().extent());
        for _ in 0..4 {
            let (p, q) = (center + random.vec3() * size * 0.5, center + random.vec3() * size * 0.5);
            let radius = size.min_element() * 0.1;
            let aabb = Aabb { min: p.min(q), max: p.min(q) + size * 0.2 };
            let near = all.iter().filter_map(|t| closest_on_triangle(p, &t.3).map(|n| (n.distance, t.0, t.1)));
            let due = near.min_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            let found = snapshot.closest_point(p, f64::INFINITY, Layers::ALL).expect("a point");
            assert_eq!(found.map(|c| (c.distance, c.surface.part, c.surface.triangle)), due, "{name}: {p}");
            let check = |shape: &Shape<'_>, meets: &dyn Fn(&[Vec3; 3]) -> bool| {
                let due: Vec<_> = all.iter().filter(|t| meets(&t.3)).map(|t| (t.0, t.1)).collect();
                let found = snapshot.overlaps(shape, Layers::ALL).expect("a shape");
                let found: Vec<_> = found.iter().map(|o| (o.surface.part, o.surface.triangle)).collect();
                assert!(found == due, "{name}: {shape:?}: {} due, {} found", due.len(), found.len());
            };
            check(&Shape::Sphere { center: p, radius }, &|t| triangle_meets_sphere(t, p, radius));
            check(&Shape::Capsule { from: p, to: q, radius }, &|t| triangle_meets_capsule(t, p, q, radius));
            check(&Shape::Box(aabb), &|t| triangle_meets_box(t, &aabb));
            check(&Shape::Triangle([p, q, center]), &|t| triangles_meet(t, &[p, q, center]));
        }
    }
}

#[test]
fn distances_of_parts_of_a_figure_are_those_of_every_pair_of_triangles() {
    let scene = Arc::new(builtin::load("tumble").expect("built-in scenes are valid"));
    let snapshot = at(&mut world_of(&scene), &scene, 0.5 * duration(&scene));
    let mut by_size: Vec<_> = snapshot.parts().filter(|p| !p.triangles().is_empty()).collect();
    by_size.sort_by_key(|p| p.triangles().len());
    let parts: Vec<_> = by_size.iter().take(4).map(kinora::collide::PartView::id).collect();
    let all = triangles(&snapshot);
    for (i, &a) in parts.iter().enumerate() {
        for &b in &parts[i + 1..] {
            let of = |part: PartId| all.iter().filter(move |t| t.0 == part).take(400);
            if of(a).count() == 400 || of(b).count() == 400 {
                continue;
            }
            let pairs = of(a).flat_map(|s| of(b).map(move |t| (s, t)));
            let near = pairs.filter_map(|(s, t)| triangle_distance(&s.3, &t.3).map(|n| (n.distance, s.1, t.1)));
            let due = near.min_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
            let found = snapshot.distance_between(a, b, f64::INFINITY).expect("two parts");
            assert_eq!(found.map(|d| (d.distance, d.surfaces[0].triangle, d.surfaces[1].triangle)), due);
        }
    }
}

/// Some of the features within a part that touch on the way, every pair of triangles with boxes that meet asked.
fn touching(
    before: &Snapshot,
    after: &Snapshot,
    settings: &Continuous,
    asked: impl Fn(u32) -> bool,
) -> BTreeSet<Features> {
    let (old, new) = (before.part(PartId(0)).expect("a part"), after.part(PartId(0)).expect("a part"));
    let (old, new, triangles) = (old.vertices(), new.vertices(), new.triangles());
    let around =
        |vertices: &[u32]| Aabb::from_points(vertices.iter().flat_map(|&v| [old[v as usize], new[v as usize]]));
    let boxes: Vec<_> = triangles.iter().map(|t| around(t)).collect();
    let rest = rest(before, PartId(0));
    let wide = |from: &[Vec3], v: [u32; 4]| v.map(|v| from[v as usize].as_dvec3());
    let mut found = BTreeSet::new();
    let mut known = BTreeSet::new();
    for [i, j] in box_pairs(&boxes) {
        for (x, y) in [(i, j), (j, i)] {
            for vertex in triangles[x] {
                let face = triangles[y];
                let features = Features::VertexFace { vertex, triangle: y as u32 };
                let near =
                    !asked(vertex) || share_place(rest, &[vertex], &face) || !boxes_meet(&around(&[vertex]), &boxes[y]);
                if near || !known.insert(features) {
                    continue;
                }
                let v = [vertex, face[0], face[1], face[2]];
                if settings.vertex_face(&wide(old, v), &wide(new, v)).is_some() {
                    found.insert(features);
                }
            }
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                for (c, d) in [(0, 1), (1, 2), (2, 0)] {
                    let mut edges = [[triangles[x][a], triangles[x][b]], [triangles[y][c], triangles[y][d]]];
                    for edge in &mut edges {
                        edge.sort_unstable();
                    }
                    edges.sort_unstable();
                    let [first, second] = edges;
                    let features = Features::EdgeEdge { first, second };
                    let near = !asked(first[0])
                        || share_place(rest, &first, &second)
                        || !boxes_meet(&around(&first), &around(&second));
                    if near || !known.insert(features) {
                        continue;
                    }
                    let v = [first[0], first[1], second[0], second[1]];
                    if settings.edge_edge(&wide(old, v), &wide(new, v)).is_some() {
                        found.insert(features);
                    }
                }
            }
        }
    }
    found
}

/// Without the order in which features were asked.
fn named(features: Features) -> Features {
    match features {
        Features::FaceVertex { triangle, vertex } => Features::VertexFace { vertex, triangle },
        Features::EdgeEdge { mut first, mut second } => {
            first.sort_unstable();
            second.sort_unstable();
            Features::EdgeEdge { first: first.min(second), second: first.max(second) }
        }
        other @ Features::VertexFace { .. } => other,
    }
}

fn is_asked(features: Features, asked: impl Fn(u32) -> bool) -> bool {
    match features {
        Features::VertexFace { vertex, .. } | Features::FaceVertex { vertex, .. } => asked(vertex),
        Features::EdgeEdge { first, .. } => asked(first[0]),
    }
}

#[test]
fn shared_meshes_in_motion_are_answered_as_every_pair_says() {
    let Some(shared) = common::shared_dir() else { return };
    // A debug build takes minutes for the larger ones.
    let count = if cfg!(debug_assertions) { 1 } else { 3 };
    let meshes = [("cloth-funnel", 16, true), ("cloth-ball", 256, true), ("n-body-simulation", 512, false)];
    for (name, every, contacts) in meshes.into_iter().take(count) {
        let file = shared.join(format!("assets/dynamic/{name}/{name}.glb"));
        let scene = Arc::new(import::from_path(&file).expect("a valid file"));
        let mut world = world_of(&scene);
        let before = at(&mut world, &scene, 0.0);
        let after = at(&mut world, &scene, duration(&scene));
        if contacts {
            check_contacts(&after, name);
        }
        let settings = Continuous::default();
        let options = ContactOptions { within: true, ..ContactOptions::default() };
        let found = before.moving_contacts(&after, &options, &settings).expect("contacts");
        let asked = |vertex: u32| vertex.is_multiple_of(every);
        let of_first = found.iter().filter(|c| c.parts == [PartId(0); 2]).map(|c| named(c.features));
        let told: BTreeSet<_> = of_first.filter(|f| is_asked(*f, asked)).collect();
        let due = touching(&before, &after, &settings, asked);
        assert!(told == due, "{name}: {} touch, {} are told", due.len(), told.len());
        // Nothing meets after the step that did not touch on the way.
        let met: BTreeSet<_> = before.contact_pairs(&options).expect("pairs").into_iter().collect();
        let later = after.contact_pairs(&options).expect("pairs");
        for pair in later.iter().filter(|pair| !met.contains(pair)).step_by(every as usize) {
            let first = before.first_impact(&after, *pair, &settings).expect("parts of both");
            assert!(first.is_some_and(|impact| impact.time <= 1.0), "{name}: {pair:?}");
        }
        println!("{name}: {} triangles, {} contacts, {} pairs meet", after.triangle_count(), found.len(), later.len());
    }
}
