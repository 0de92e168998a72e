//! The frame loop: the same answers whatever the structure, policy, threads and SIMD level; snapshots that stay.
#![allow(missing_docs, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a test file")]

use std::{
    sync::{Arc, LazyLock},
    time::{Duration, Instant},
};

use kinora::{
    accel::AccelKind,
    anim::{ActiveClip, Fade},
    dynamics::{FrameConfig, FrameError, FrameLoop, Playing, RebuildPolicy},
    geom::{Forms, Hit, InstanceId, Ray},
    glam::{DAffine3, DVec3, Vec3},
    scene::{ClipId, Scene, Trs},
    simd::{Simd, SimdLevel, Task, dispatch},
    world::{TopKind, World},
};
use scenes::{Maker, Random, bodies, burst, cuboid, figure, node, still};

#[path = "common/scenes.rs"]
#[allow(dead_code, unreachable_pub, clippy::pedantic, reason = "shared with tests inside the crate")]
mod scenes;

/// Pools by number of threads, shared over tests.
static POOLS: LazyLock<[Arc<rayon::ThreadPool>; 2]> = LazyLock::new(|| {
    [1, 2].map(|threads| Arc::new(rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()))
});

fn config(accel: &str, top: &str, policy: RebuildPolicy, threads: usize) -> FrameConfig {
    FrameConfig { accel: accel.into(), top: top.into(), policy, forms: Forms::EXACT, pool: POOLS[threads - 1].clone() }
}

fn looped(accel: &str, policy: RebuildPolicy, scene: Scene) -> FrameLoop {
    let mut frames = FrameLoop::new(config(accel, "bvh2", policy, 2)).unwrap();
    frames.add(Arc::new(scene), DAffine3::IDENTITY);
    frames
}

fn at(time_s: f64) -> [ActiveClip; 1] {
    [ActiveClip { clip: ClipId(0), time_s }]
}

/// Every third ray ends early, so that ranges matter.
fn rays(count: usize) -> Vec<Ray> {
    let mut random = Random::new(3);
    let ray = |i| {
        let target = random.vec() * Vec3::new(2.0, 1.5, 2.0) + Vec3::Y;
        let origin = random.vec() * 6.0;
        let t_far = if i % 3 == 0 { 1.0 } else { f32::INFINITY };
        Ray { t_far, ..Ray::new(origin, target - origin) }
    };
    (0..count).map(ray).collect()
}

struct Cast<'a> {
    world: &'a World,
    rays: &'a [Ray],
}

/// All that queries say of each ray.
type Answer = (Option<Hit>, Option<Hit>, bool, bool);

impl Task for Cast<'_> {
    type Output = Vec<Answer>;

    #[inline(always)]
    fn run<S: Simd>(self) -> Vec<Answer> {
        // Odd triangles let rays pass.
        let odd = |hit: &Hit| hit.prim.0.is_multiple_of(2);
        let answer = |ray: &Ray| {
            let (nearest, filtered) = (self.world.nearest_hit::<S>(ray), self.world.closest_hit::<S, _>(ray, &odd));
            (nearest, filtered, self.world.is_blocked::<S>(ray), self.world.is_occluded::<S, _>(ray, &odd))
        };
        self.rays.iter().map(answer).collect()
    }
}

fn cast(level: SimdLevel, world: &World, rays: &[Ray]) -> Vec<Answer> {
    dispatch(level, Cast { world, rays })
}

fn levels() -> impl Iterator<Item = SimdLevel> {
    SimdLevel::ALL.into_iter().filter(|level| level.is_available())
}

/// Scenes of every class, several actors, more groups than a flat top level takes.
fn cast_of_actors(frames: &mut FrameLoop) {
    let tube = Arc::new(figure(24));
    for i in 0..6_i16 {
        let placed = DAffine3::from_translation(DVec3::new(f64::from(i) * 0.8 - 2.0, 0.0, 0.0));
        frames.add(tube.clone(), placed);
    }
    frames.add(Arc::new(bodies(12)), DAffine3::IDENTITY);
    frames.add(Arc::new(still()), DAffine3::from_translation(DVec3::new(0.0, 1.0, 2.0)));
    frames.add(Arc::new(burst(150)), DAffine3::IDENTITY);
}

const TIMES: [f64; 7] = [0.0, 0.3, 0.9, 1.4, 2.0, 0.9, 0.0];

/// One clip a frame for each of `cast_of_actors`, out of step with one another.
fn clips_at(time_s: f64) -> Vec<[ActiveClip; 1]> {
    (0..9_u8).map(|i| at((time_s + 0.3 * f64::from(i)) % 2.0)).collect()
}

fn advance(frames: &mut FrameLoop, time_s: f64) -> Arc<World> {
    let clips = clips_at(time_s);
    let clips: Vec<&[ActiveClip]> = clips.iter().map(|clip| &clip[..]).collect();
    frames.advance(&clips).unwrap().0
}

const POLICIES: [RebuildPolicy; 7] = [
    RebuildPolicy::Refit,
    RebuildPolicy::Rebuild,
    RebuildPolicy::Async,
    RebuildPolicy::Auto,
    RebuildPolicy::SwapEvery(1),
    RebuildPolicy::SwapEvery(2),
    RebuildPolicy::SwapEvery(3),
];

#[test]
fn answers_do_not_depend_on_structure_policy_threads_or_simd_level() {
    let rays = rays(60);
    let mut oracle = FrameLoop::new(config("list", "list", RebuildPolicy::Rebuild, 1)).unwrap();
    cast_of_actors(&mut oracle);
    let expected: Vec<_> = TIMES
        .map(|time_s| {
            let world = advance(&mut oracle, time_s);
            assert!(world.group_count() > 8, "the top level must not be flat");
            (cast(SimdLevel::Scalar, &world, &rays), world.bounds())
        })
        .into();
    let hits = expected[0].0.iter().filter(|answer| answer.0.is_some()).count();
    assert!(hits > 12 && hits < 56, "{hits} of 60 rays hit");
    for accel in AccelKind::ALL.iter().map(|kind| kind.name()).filter(|&name| name != "list") {
        for (policy, top) in POLICIES.into_iter().flat_map(|policy| TopKind::ALL.map(|top| (policy, top.name()))) {
            let threads = if top == "list" { 1 } else { 2 };
            let mut frames = FrameLoop::new(config(accel, top, policy, threads)).unwrap();
            cast_of_actors(&mut frames);
            for (time_s, (answers, bounds)) in TIMES.into_iter().zip(&expected) {
                let world = advance(&mut frames, time_s);
                assert_eq!(world.bounds(), *bounds);
                for level in levels() {
                    let same = cast(level, &world, &rays) == *answers;
                    assert!(same, "{accel} {top} {policy:?} {threads} threads {level} at {time_s}");
                }
            }
        }
    }
}

#[test]
fn a_flat_top_level_answers_as_a_list() {
    let rays = rays(400);
    let worlds = TopKind::ALL.map(|top| {
        let mut frames = FrameLoop::new(config("list", top.name(), RebuildPolicy::Refit, 1)).unwrap();
        for (i, scene) in (0_i8..).zip([figure(20), bodies(4), still()]) {
            frames.add(Arc::new(scene), DAffine3::from_translation(DVec3::new(f64::from(i), 0.0, 0.0)));
        }
        frames.advance(&[&at(0.8), &at(0.4)]).unwrap().0
    });
    assert!((2..=8).contains(&worlds[0].group_count()));
    let [list, others @ ..] = worlds.map(|world| cast(SimdLevel::Scalar, &world, &rays));
    assert!(others.iter().all(|other| *other == list));
    assert!(list.iter().any(|answer| answer.0.is_some()));
}

#[test]
fn a_world_stays_as_it_is_while_later_frames_are_made() {
    let rays = rays(100);
    for accel in AccelKind::ALL.iter().map(|kind| kind.name()) {
        let mut frames = looped(accel, RebuildPolicy::SwapEvery(2), figure(60));
        let held: Vec<_> = (0..12_u8)
            .map(|i| {
                let world = frames.advance(&[&at(f64::from(i) * 0.15)]).unwrap().0;
                let positions: Vec<Vec<Vec3>> = (0..3).map(|i| world.positions(InstanceId(i)).to_vec()).collect();
                let answers = cast(SimdLevel::Scalar, &world, &rays);
                (world, positions, answers)
            })
            .collect();
        for (world, positions, answers) in &held {
            assert!((0..3).all(|i| world.positions(InstanceId(i)) == positions[i as usize]));
            assert!(cast(SimdLevel::Scalar, world, &rays) == *answers);
        }
        assert!(held[0].2 != held[5].2, "the figure moves");
    }
}

#[test]
fn a_still_scene_is_built_once_and_never_touched_again() {
    let mut frames = looped("list", RebuildPolicy::Async, still());
    for i in 0..10_u8 {
        frames.advance(&[&at(f64::from(i))]).unwrap();
    }
    let counts = frames.counts();
    assert_eq!((counts.builds, counts.deforms, counts.refits, counts.rebuilds_begun), (1, 1, 0, 0));
    assert_eq!((counts.leaf_refits, counts.event_sorts), (0, 0));
    assert_eq!(counts.frames, 10);
    // As many as worlds turn: this frame's and the last one's.
    assert!(counts.tops <= 2, "{counts:?}");
}

#[test]
fn rigid_parts_move_without_a_refit_and_share_one_tree() {
    let rays = rays(200);
    let mut frames = looped("bvh2", RebuildPolicy::Async, bodies(40));
    for time_s in TIMES {
        let world = frames.advance(&[&at(time_s)]).unwrap().0;
        assert_eq!(world.group_count(), 40);
        let answers = cast(SimdLevel::Scalar, &world, &rays);
        assert!(answers.iter().any(|answer| answer.0.is_some()));
        assert!(levels().all(|level| cast(level, &world, &rays) == answers), "at {time_s}");
        world.validate().unwrap();
    }
    let counts = frames.counts();
    assert_eq!((counts.builds, counts.refits, counts.leaf_refits, counts.rebuilds_begun), (0, 0, 0, 0), "{counts:?}");
    assert_eq!(counts.moves, 40 * (TIMES.len() as u64 - 1));
}

#[test]
fn event_lists_are_sorted_only_where_the_level_over_groups_is_made_of_them() {
    for top in TopKind::ALL {
        let mut frames = FrameLoop::new(config("bvh2", top.name(), RebuildPolicy::Refit, 1)).unwrap();
        cast_of_actors(&mut frames);
        let inversions = TIMES.map(|time_s| {
            drop(advance(&mut frames, time_s));
            let found = frames.last_frame().inversions;
            found.swaps + found.whole
        });
        let counts = frames.counts();
        assert_eq!(counts.tops, TIMES.len() as u64, "everything moves");
        assert_eq!(counts.event_sorts, if top == TopKind::Events { counts.tops } else { 0 }, "{top:?}");
        assert_eq!(inversions.iter().any(|&found| found > 0), top == TopKind::Events, "{top:?} {inversions:?}");
    }
}

#[test]
fn an_actor_that_holds_its_pose_costs_nothing() {
    let mut frames = looped("list", RebuildPolicy::Refit, figure(30));
    frames.advance(&[&at(0.5)]).unwrap();
    let before = frames.counts();
    for _ in 0..5 {
        frames.advance(&[&at(0.5)]).unwrap();
    }
    let after = frames.counts();
    assert_eq!((after.poses, after.deforms, after.refits), (before.poses, before.deforms, before.refits));
    frames.advance(&[&at(0.6)]).unwrap();
    let moved = frames.counts();
    assert_eq!((moved.poses, moved.deforms, moved.refits), (after.poses + 1, after.deforms + 1, after.refits + 1));
}

#[test]
fn a_pose_past_the_last_key_moves_nothing_and_refits_nothing() {
    let mut frames = looped("list", RebuildPolicy::Refit, figure(30));
    frames.advance(&[&at(2.5)]).unwrap();
    let before = frames.counts();
    frames.advance(&[&at(3.5)]).unwrap();
    let after = frames.counts();
    assert_eq!(after.poses, before.poses + 1, "the time is another");
    assert_eq!((after.deforms, after.refits), (before.deforms, before.refits), "but no joint moved");
}

#[test]
fn the_vertices_are_those_that_deforming_gives() {
    let scene = Arc::new(figure(40));
    let placed = DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0));
    let mut frames = FrameLoop::new(config("list", "bvh2", RebuildPolicy::Async, 2)).unwrap();
    frames.add(scene.clone(), placed);
    let mut pose = kinora::anim::Pose::rest(&scene);
    for time_s in TIMES {
        let world = frames.advance(&[&at(time_s)]).unwrap().0;
        pose.evaluate(&scene, &at(time_s), &placed);
        for (id, &part) in (0..).map(InstanceId).zip(&scene.instances) {
            let mut expected = vec![Vec3::NAN; scene.part(part).positions.len()];
            kinora::anim::deform(&scene, &pose, part, &mut expected);
            assert_eq!(world.positions(id), expected);
        }
    }
}

#[test]
fn an_actor_moved_as_a_whole_is_where_one_added_there_would_be() {
    let rays = rays(200);
    let there = DAffine3::from_translation(DVec3::new(0.5, 0.25, -0.5));
    let mut moved = looped("list", RebuildPolicy::Refit, figure(30));
    moved.advance(&[&at(0.5)]).unwrap();
    moved.place(0, there);
    let mut added = FrameLoop::new(config("list", "bvh2", RebuildPolicy::Refit, 2)).unwrap();
    added.add(Arc::new(figure(30)), there);
    let [moved, added] = [&mut moved, &mut added].map(|f| f.advance(&[&at(0.5)]).unwrap().0);
    assert_eq!(moved.bounds(), added.bounds());
    assert!(cast(SimdLevel::Scalar, &moved, &rays) == cast(SimdLevel::Scalar, &added, &rays));
}

#[test]
fn a_decaying_tree_is_rebuilt_in_the_background_and_swapped_in() {
    let mut frames = looped("bvh2", RebuildPolicy::Async, burst(3000));
    let deadline = Instant::now() + Duration::from_secs(60);
    let mut frame = 0_u32;
    while frames.counts().swaps < 3 {
        assert!(Instant::now() < deadline, "no swap: {:?}", frames.counts());
        frames.advance(&[&at(f64::from(frame % 200) * 0.01)]).unwrap();
        frame += 1;
    }
    assert!(frames.counts().quality_max > 1.25);
    assert!(frames.counts().rebuilds_begun >= 3);
}

#[test]
fn a_clip_that_was_learnt_swaps_its_trees_by_time_and_rebuilds_nothing() {
    let rays = rays(60);
    let mut learnt = looped("bvh2", RebuildPolicy::Auto, burst(5000));
    let mut fresh = looped("bvh2", RebuildPolicy::Rebuild, burst(5000));
    let trees = learnt.learn(0, &[ClipId(0)]).unwrap();
    assert!((2..48).contains(&trees), "{trees} trees");
    let play = |learnt: &mut FrameLoop, fresh: &mut FrameLoop| {
        for frame in 0..40_u8 {
            let clip = at(f64::from(frame) * 0.05);
            let [a, b] = [learnt.advance(&[&clip]).unwrap().0, fresh.advance(&[&clip]).unwrap().0];
            if frame % 8 == 5 {
                assert!(cast(SimdLevel::Scalar, &a, &rays) == cast(SimdLevel::Scalar, &b, &rays), "frame {frame}");
                a.validate().unwrap();
            }
        }
    };
    play(&mut learnt, &mut fresh);
    let once = learnt.counts();
    // Frames may pass over a tree.
    assert_eq!((once.builds, once.rebuilds_begun), (0, 0), "{once:?}");
    assert!(once.swaps >= 2 && once.swaps <= trees as u64, "{once:?} of {trees}");
    assert!(once.quality_max < 1.5, "{once:?}");
    play(&mut learnt, &mut fresh);
    assert_eq!(learnt.counts().swaps, 2 * once.swaps, "the same trees again");
    // A walk is served by one tree, a loop of another policy learns nothing.
    let mut walk = looped("bvh2", RebuildPolicy::Auto, figure(400));
    assert_eq!(walk.learn(0, &[ClipId(0)]).unwrap(), 1);
    assert_eq!(fresh.learn(0, &[ClipId(0)]).unwrap(), 0);
}

#[test]
fn a_cross_fade_begins_and_ends_at_the_clips_and_moves_between() {
    let scene = Arc::new(figure(40));
    let (from, to) = (at(0.2), at(1.4));
    let top = |playing: Playing<'_>| {
        let mut frames = FrameLoop::new(config("list", "list", RebuildPolicy::Refit, 1)).unwrap();
        frames.add(scene.clone(), DAffine3::IDENTITY);
        let world = frames.advance_playing(&[playing]).unwrap().0;
        (0..3).map(|i| world.positions(InstanceId(i)).to_vec()).collect::<Vec<_>>()
    };
    let plain = |clips| top(Playing { clips, fade: None });
    let faded = |alpha| top(Playing { clips: &to, fade: Some(Fade { from: &from, alpha }) });
    assert_eq!(faded(0.0), plain(&from));
    assert_eq!(faded(-3.0), plain(&from));
    assert_eq!(faded(1.0), plain(&to));
    assert_eq!(faded(f64::NAN), plain(&to));
    let half = faded(0.5);
    assert!(half != plain(&from) && half != plain(&to));
    assert_eq!(half[0], plain(&from)[0], "what stands still in both stands still between them");
    let ends = [plain(&from), half, plain(&to)].map(|parts| parts[2][0]);
    let reach = ends[0].distance(ends[2]);
    assert!(ends[1].distance(ends[0]) < reach && ends[1].distance(ends[2]) < reach, "{ends:?}");
}

#[test]
fn without_motion_nothing_is_rebuilt_in_the_background() {
    let mut frames = looped("bvh2", RebuildPolicy::SwapEvery(1), burst(300));
    for _ in 0..5 {
        frames.advance(&[&at(0.5)]).unwrap();
    }
    assert_eq!(frames.counts().rebuilds_begun, 0);
}

#[test]
fn swapping_every_k_frames_does_not_depend_on_timing() {
    for (every, swaps) in [(1, 8), (2, 3), (3, 2), (0, 8)] {
        let mut frames = looped("bvh2", RebuildPolicy::SwapEvery(every), burst(2000));
        for frame in 0..10_u8 {
            frames.advance(&[&at(f64::from(frame) * 0.1)]).unwrap();
        }
        // Frame 0 is built where it stands; the first rebuild begins at frame `every`.
        assert_eq!(frames.counts().swaps, swaps, "every {every}");
        assert_eq!(frames.counts().rebuilds_dropped, 0);
    }
}

#[test]
fn scenes_exchanged_while_trees_are_built_drop_the_stale_ones() {
    let rays = rays(30);
    let scenes = [burst(1500), figure(40), bodies(20), burst(400)].map(Arc::new);
    for policy in [RebuildPolicy::Async, RebuildPolicy::SwapEvery(1), RebuildPolicy::SwapEvery(2)] {
        let mut frames = FrameLoop::new(config("bvh2", "bvh2", policy, 2)).unwrap();
        let mut oracle = FrameLoop::new(config("bvh2", "list", RebuildPolicy::Rebuild, 1)).unwrap();
        for i in [0, 1] {
            frames.add(scenes[i].clone(), DAffine3::IDENTITY);
            oracle.add(scenes[i].clone(), DAffine3::IDENTITY);
        }
        for frame in 0..45_u8 {
            if frame % 7 == 3 {
                let (actor, scene) = (usize::from(frame % 2), &scenes[usize::from(frame / 7) % 4]);
                let placed = DAffine3::from_translation(DVec3::new(f64::from(frame) * 0.01, 0.0, 0.0));
                frames.replace(actor, scene.clone(), placed);
                oracle.replace(actor, scene.clone(), placed);
            }
            let clip = at(f64::from(frame) * 0.07 % 2.0);
            let [world, expected] = [&mut frames, &mut oracle].map(|f| f.advance(&[&clip, &clip]).unwrap().0);
            if frame % 5 == 0 {
                let answers = cast(SimdLevel::Scalar, &world, &rays);
                assert!(answers == cast(SimdLevel::Scalar, &expected, &rays), "{policy:?} frame {frame}");
            }
        }
        let counts = frames.counts();
        assert!(counts.rebuilds_begun >= counts.swaps + counts.rebuilds_dropped, "{counts:?}");
        if policy != RebuildPolicy::Async {
            assert!(counts.rebuilds_dropped > 0, "{policy:?} {counts:?}");
        }
    }
}

#[test]
fn dropping_a_loop_waits_for_one_build_at_most() {
    let scene = Arc::new(burst(4000));
    let mut frames = FrameLoop::new(config("bvh2", "bvh2", RebuildPolicy::SwapEvery(1), 2)).unwrap();
    for _ in 0..10 {
        frames.add(scene.clone(), DAffine3::IDENTITY);
    }
    let clips = [at(0.0), at(0.4)].map(|clip| vec![clip; 10]);
    let began = Instant::now();
    for clips in &clips {
        let clips: Vec<&[ActiveClip]> = clips.iter().map(|clip| &clip[..]).collect();
        frames.advance(&clips).unwrap();
    }
    let making = began.elapsed();
    assert_eq!(frames.counts().rebuilds_begun, 10, "ten builds wait");
    let began = Instant::now();
    drop(frames);
    // The first frame built ten trees on two threads, so ten on one would take longer than all of it.
    assert!(began.elapsed() < making, "{:?} to drop, {making:?} to make", began.elapsed());
}

#[test]
fn structures_that_do_not_exist_are_named_with_those_that_do() {
    for (accel, top, wrong) in [("quadtree", "bvh2", "quadtree"), ("list", "tlas", "tlas")] {
        let error = FrameLoop::new(config(accel, top, RebuildPolicy::Refit, 1)).unwrap_err().to_string();
        assert!(error.contains(wrong) && error.contains("list") && error.contains("bvh2"), "{error}");
    }
}

#[test]
fn more_triangles_than_numbers_allow_for_are_an_error() {
    let mut maker = Maker::default();
    let mut part = cuboid(Vec3::ONE);
    part.triangles = part.triangles.repeat(1 << 11);
    let mesh = maker.mesh(part);
    let copies = vec![Trs::IDENTITY; 1 << 16];
    let placed = scenes_node(mesh, copies);
    maker.node(None, placed);
    let mut frames = looped("list", RebuildPolicy::Refit, maker.finish());
    let error = frames.advance(&[]).unwrap_err();
    assert!(matches!(error, FrameError::TooMany { what: "triangles", actual: 1_610_612_736, .. }), "{error}");
}

fn scenes_node(mesh: kinora::scene::MeshId, copies: Vec<Trs>) -> kinora::scene::SceneNode {
    kinora::scene::SceneNode { mesh: Some(mesh), copies: Some(copies), ..node(DVec3::ZERO) }
}

#[test]
fn a_loop_without_actors_or_triangles_makes_empty_worlds() {
    let mut frames = FrameLoop::new(config("list", "bvh2", RebuildPolicy::Async, 1)).unwrap();
    let world = frames.advance(&[]).unwrap().0;
    assert!(world.bounds().is_empty());
    assert_eq!((world.actor_count(), world.triangle_count()), (0, 0));
    frames.add(Arc::new(Scene::default()), DAffine3::IDENTITY);
    let mut maker = Maker::default();
    let mesh = maker.mesh(scenes::part(vec![Vec3::ONE], vec![]));
    maker.node(None, kinora::scene::SceneNode { mesh: Some(mesh), ..node(DVec3::ZERO) });
    frames.add(Arc::new(maker.finish()), DAffine3::IDENTITY);
    let world = frames.advance(&[]).unwrap().0;
    assert_eq!((world.actor_count(), world.instances().len()), (2, 1));
    assert_eq!(world.positions(InstanceId(0)), [Vec3::ONE]);
    assert!(world.bounds().is_empty());
    assert!(cast(SimdLevel::Scalar, &world, &rays(10)).iter().all(|answer| answer.0.is_none() && !answer.2));
}
