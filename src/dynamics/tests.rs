//! Tests that reach into the loop: other groupings, a builder that panics.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use glam::{DAffine3, DVec3, Vec3};

use super::{FrameConfig, FrameError, FrameLoop, RebuildPolicy, builder::Built, grouping::Grouping, pool::Pool};
use crate::{
    accel::{LanePacket, PACKET},
    anim::ActiveClip,
    geom::{Forms, Hit, InstanceId, PrimId, Ray},
    scene::{ClipId, Scene},
    simd::{Scalar, Simd, SimdLevel, Task, dispatch},
    world::World,
};

#[path = "../../tests/common/scenes.rs"]
#[allow(dead_code, reason = "shared with the integration tests, which use the rest")]
#[allow(unreachable_pub, clippy::pedantic, missing_docs, reason = "a test file")]
mod scenes;

use scenes::{Random, bodies, burst, figure, still};

fn config(accel: &str, policy: RebuildPolicy) -> FrameConfig {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    FrameConfig { accel: accel.into(), top: "bvh2".into(), policy, forms: Forms::EXACT, pool: Arc::new(pool) }
}

fn at(time_s: f64) -> [ActiveClip; 1] {
    [ActiveClip { clip: ClipId(0), time_s }]
}

fn hits(world: &World) -> Vec<Option<Hit>> {
    let mut random = Random::new(77);
    (0..400)
        .map(|_| {
            let ray = Ray::new(random.vec() * 5.0, random.vec());
            world.closest_hit::<Scalar, _>(&ray, &|_| true)
        })
        .collect()
}

fn crowd(grouping: Grouping) -> FrameLoop {
    let mut frames = FrameLoop::with_grouping(config("list", RebuildPolicy::Refit), grouping).unwrap();
    let scenes: [Scene; 4] = [figure(30), bodies(12), still(), burst(100)];
    for (i, scene) in (0_u8..).zip(scenes) {
        frames.add(Arc::new(scene), DAffine3::from_translation(DVec3::new(f64::from(i) - 1.5, 0.0, 0.0)));
    }
    frames
}

#[test]
fn grouping_changes_no_hit() {
    let mut loops = [Grouping::ByMotion, Grouping::Single, Grouping::ByActor].map(crowd);
    for time_s in [0.0, 0.7, 1.9, 0.7] {
        let clip = at(time_s);
        let clips: [&[ActiveClip]; 4] = [&clip, &clip, &[], &clip];
        let [by_motion, single, by_actor] = loops.each_mut().map(|l| l.advance(&clips).unwrap().0);
        assert_eq!(single.group_count(), single.instances().len());
        assert_eq!(by_actor.group_count(), 4);
        assert!(by_motion.group_count() < single.group_count());
        let expected = hits(&by_motion);
        assert!(expected.iter().flatten().count() > 20, "rays must hit something");
        assert!(hits(&single) == expected, "single at {time_s}");
        assert!(hits(&by_actor) == expected, "by actor at {time_s}");
        assert_eq!(by_motion.bounds(), single.bounds());
    }
}

/// Packets of every length over a fan of rays, with one in eleven that is no ray.
struct Together<'a>(&'a World, &'a [Ray]);

impl Task for Together<'_> {
    type Output = (Vec<Option<Hit>>, Vec<Option<Hit>>, Vec<bool>, Vec<bool>);

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let Self(world, rays) = self;
        let singly = rays.iter().map(|ray| world.nearest_hit::<S>(ray)).collect();
        let blocked_singly = rays.iter().map(|ray| world.is_blocked::<S>(ray)).collect();
        let (mut hits, mut blocked) = (Vec::new(), Vec::new());
        let left_over = Hit { t: 1.0, u: 0.0, v: 0.0, prim: PrimId(0), instance: InstanceId(0) };
        let mut lanes = LanePacket::EMPTY;
        let (mut first, mut len) = (0, 1);
        while first < rays.len() {
            let end = rays.len().min(first + len);
            let mut found = [Some(left_over); PACKET];
            world.nearest_hits_with::<S>(&mut lanes, &rays[first..end], &mut found);
            assert!(found[end - first..].iter().all(Option::is_none), "hits without rays");
            hits.extend(&found[..end - first]);
            let mask = world.blocked_with::<S>(&mut lanes, &rays[first..end]);
            blocked.extend((0..end - first).map(|i| (mask >> i) & 1 == 1));
            (first, len) = (end, len % PACKET + 1);
        }
        (singly, hits, blocked_singly, blocked)
    }
}

/// Full packets, each with storage of its own.
struct Apart<'a>(&'a World, &'a [Ray]);

impl Task for Apart<'_> {
    type Output = (Vec<Option<Hit>>, Vec<bool>);

    #[inline(always)]
    fn run<S: Simd>(self) -> Self::Output {
        let (mut hits, mut blocked) = (Vec::new(), Vec::new());
        for rays in self.1.chunks(PACKET) {
            let mut found = [None; PACKET];
            self.0.nearest_hits::<S>(rays, &mut found);
            hits.extend(&found[..rays.len()]);
            let mask = self.0.blocked::<S>(rays);
            blocked.extend((0..rays.len()).map(|i| (mask >> i) & 1 == 1));
        }
        (hits, blocked)
    }
}

#[test]
fn packets_answer_as_single_rays_do() {
    let ray = |i: u16| {
        let (x, y) = (f32::from(i % 25) / 12.0 - 1.0, f32::from(i / 25) / 12.0 - 1.0);
        // One in eleven is no ray; runs of others are too long, short or far away for f32.
        let odd = [(1e9, 6.0), (1e-9, 6.0), (1.0, 5e3), (1e30, 6.0), (9e8, 5.5)];
        let (size, z) = odd.get(usize::from(i / 40 % 7)).map_or((1.0, 6.0), |&odd| odd);
        let size = if i.is_multiple_of(11) { f32::NAN } else { size };
        Ray::new(Vec3::new(0.0, 0.3, z), Vec3::new(x * 0.2, y * 0.2, -1.0) * size)
    };
    let rays: Vec<Ray> = (0..625).map(ray).collect();
    let cases = [
        ("list", Grouping::ByMotion, bodies(12), 60),
        ("bvh2", Grouping::ByMotion, bodies(12), 60),
        ("bvh2", Grouping::Single, bodies(12), 60),
        // Rigid parts by lane: few, and many with a level over them.
        ("bvh8", Grouping::ByMotion, bodies(3), 2),
        ("bvh8", Grouping::ByMotion, bodies(12), 60),
        ("bvh8", Grouping::ByMotion, bodies(70), 60),
        // Few rigid parts, many that deform.
        ("bvh8", Grouping::ByMotion, figure(20), 60),
        ("bvh8", Grouping::Single, figure(20), 60),
    ];
    for (accel, grouping, second, small) in cases {
        let mut frames = FrameLoop::with_grouping(config(accel, RebuildPolicy::Refit), grouping).unwrap();
        for (i, scene) in (0_u8..).zip([figure(30), second, still()]) {
            frames.add(Arc::new(scene), DAffine3::from_translation(DVec3::new(f64::from(i) - 1.0, 0.0, 0.0)));
        }
        // So small that the longest rays are too long for f32 in its space.
        let placed = DAffine3::from_translation(DVec3::new(0.0, 0.3, 5.997));
        frames.add(Arc::new(bodies(small)), placed * DAffine3::from_scale(DVec3::splat(1.0 / 2048.0)));
        let clip = at(0.7);
        let world = frames.advance(&[&clip, &clip, &[], &clip]).unwrap().0;
        for level in SimdLevel::available() {
            let (singly, together, blocked_singly, blocked) = dispatch(level, Together(&world, &rays));
            assert!(singly.iter().flatten().count() > 20, "rays must hit something");
            assert!(together == singly, "{accel} at {level}");
            assert!(blocked == blocked_singly, "{accel} at {level}");
            assert!(dispatch(level, Apart(&world, &rays)) == (singly, blocked_singly), "{accel} at {level}");
        }
    }
}

#[test]
fn a_buffer_is_written_again_only_when_no_reader_holds_it() {
    let mut pool = Pool::default();
    let first = pool.take(|| vec![1]);
    pool.keep(first.clone());
    let second = pool.take(|| vec![2]);
    pool.keep(second.clone());
    assert_eq!(*second, [2], "the first is held");
    drop(first);
    let third = pool.take(|| vec![3]);
    assert_eq!(*third, [1], "the first is free again");
    assert_eq!(*second, [2]);
}

#[test]
fn a_pool_does_not_grow_with_readers_that_never_let_go() {
    let mut pool = Pool::default();
    let hold = |i: usize| {
        let item = pool.take(|| i);
        pool.keep(item.clone());
        item
    };
    let held: Vec<Arc<usize>> = (0..20).map(hold).collect();
    assert!(held.iter().enumerate().all(|(i, item)| **item == i));
    assert_eq!(held.iter().filter(|item| Arc::strong_count(item) > 1).count(), 4, "the last few");
}

#[test]
fn thousands_of_panics_of_the_builder_are_thousands_of_errors_and_nothing_else() {
    std::panic::set_hook(Box::new(|_| {}));
    let mut frames = FrameLoop::new(config("bvh2", RebuildPolicy::SwapEvery(1))).unwrap();
    let scenes = [burst(40), burst(25)].map(Arc::new);
    frames.add(scenes[0].clone(), DAffine3::IDENTITY);
    let (mut failed, mut made) = (0, 0);
    for frame in 0..3000_u32 {
        // A group whose rebuild failed is not rebuilt again, so each panic is followed by another scene, some while a tree is built.
        if frame % 4 == 3 {
            frames.replace(0, scenes[usize::from(frame % 8 == 3)].clone(), DAffine3::IDENTITY);
        }
        frames.panic_in_next_rebuild = frame % 4 == 1;
        match frames.advance(&[&at(f64::from(frame % 19) * 0.1)]) {
            Ok((world, _)) => {
                made += 1;
                assert!(world.triangle_count() == 40 || world.triangle_count() == 25);
            }
            Err(FrameError::BuilderPanicked(message)) => {
                failed += 1;
                assert!(message.contains("asked to panic"), "{message}");
            }
            Err(other) => panic!("{other}"),
        }
    }
    drop(std::panic::take_hook());
    assert!(failed >= 700 && made + failed == 3000, "{failed} failed, {made} made");
    let counts = frames.counts();
    assert!(counts.swaps > 500, "{counts:?}");
}

#[test]
fn a_panic_of_the_builder_is_an_error_of_one_frame() {
    let mut frames = FrameLoop::new(config("list", RebuildPolicy::SwapEvery(1))).unwrap();
    frames.add(Arc::new(burst(50)), DAffine3::IDENTITY);
    frames.advance(&[&at(0.0)]).unwrap();
    frames.panic_in_next_rebuild = true;
    frames.advance(&[&at(0.1)]).unwrap();
    let error = frames.advance(&[&at(0.2)]).unwrap_err();
    assert!(matches!(&error, FrameError::BuilderPanicked(m) if m.contains("asked to panic")), "{error}");
    let (world, _) = frames.advance(&[&at(0.2)]).unwrap();
    assert_eq!(world.triangle_count(), 50);
    assert_eq!(frames.counts().swaps, 0);
}

/// A tree that is swapped in on trial at the next frame, over the vertices of the last one or others of the same group.
fn on_trial(frames: &mut FrameLoop, world: &World, positions: &[Vec3]) {
    let group = &world.groups[0];
    let accel = frames.spec.build(&group.layout.triangles(positions)).unwrap();
    let frame = frames.counts().frames;
    let built = Built { accel, positions: None, frame, on_trial: true, is_fast: false };
    frames.stage.groups[0].end_rebuild(Some(built));
}

#[test]
fn a_tree_on_trial_is_kept_only_where_it_is_no_worse_than_the_one_in_use() {
    for accel in ["bvh2", "bvh8", "ssh"] {
        let mut frames = FrameLoop::new(config(accel, RebuildPolicy::Refit)).unwrap();
        frames.add(Arc::new(burst(2000)), DAffine3::IDENTITY);
        let world = frames.advance(&[&at(0.0)]).unwrap().0;
        let cost = |world: &World| world.groups[0].accel.stats().sah_cost;
        let fresh = cost(&world);
        let elsewhere: Vec<Vec3> = world.groups[0].positions.iter().rev().map(|p| Vec3::new(-p.y, p.z, p.x)).collect();
        on_trial(&mut frames, &world, &elsewhere);
        let world = frames.advance(&[&at(1e-6)]).unwrap().0;
        let counts = frames.counts();
        assert_eq!((counts.rebuilds_dropped, counts.swaps), (1, 0), "{accel}: built for a motion that did not come");
        assert!(cost(&world) < 1.01 * fresh, "{accel}: {} after {fresh}", cost(&world));
        // Half a second later the tree is worse than a new one.
        let world = frames.advance(&[&at(0.5)]).unwrap().0;
        let decayed = cost(&world);
        let there = world.groups[0].positions.to_vec();
        on_trial(&mut frames, &world, &there);
        let world = frames.advance(&[&at(0.5 + 1e-6)]).unwrap().0;
        let counts = frames.counts();
        assert_eq!((counts.rebuilds_dropped, counts.swaps), (1, 1), "{accel}: the better tree");
        assert!(cost(&world) < decayed, "{accel}: {} after {decayed}", cost(&world));
        world.validate().unwrap();
    }
}

/// Plays frames until there were so many swaps.
fn until_swapped(frames: &mut FrameLoop, swaps: u64, time_s: impl Fn(u32) -> f64) {
    let deadline = Instant::now() + Duration::from_secs(60);
    let mut frame = 0;
    while frames.counts().swaps < swaps {
        assert!(Instant::now() < deadline, "no swap: {:?}", frames.counts());
        frames.advance(&[&at(time_s(frame))]).unwrap();
        frame += 1;
    }
}

#[test]
fn what_moves_fast_gets_trees_that_are_built_fast_and_good_ones_when_it_rests() {
    let mut frames = FrameLoop::new(config("bvh8", RebuildPolicy::Async)).unwrap();
    frames.add(Arc::new(burst(3000)), DAffine3::IDENTITY);
    until_swapped(&mut frames, 2, |frame| f64::from(frame % 20) * 0.1);
    let moving = frames.counts();
    assert!(moving.fast_rebuilds > 0, "{moving:?}");
    let deadline = Instant::now() + Duration::from_secs(60);
    while frames.stage.groups[0].wants_good_tree() {
        assert!(Instant::now() < deadline, "{:?}", frames.counts());
        frames.advance(&[&at(0.7)]).unwrap();
    }
    let resting = frames.counts();
    for _ in 0..20 {
        frames.advance(&[&at(0.7)]).unwrap();
    }
    assert_eq!(frames.counts().rebuilds_begun, resting.rebuilds_begun, "nothing is left to do");
    assert!(frames.last_frame().quality <= 1.1);
}

#[test]
fn swaps_at_given_frames_are_of_good_trees() {
    let mut frames = FrameLoop::new(config("bvh8", RebuildPolicy::SwapEvery(2))).unwrap();
    frames.add(Arc::new(burst(1000)), DAffine3::IDENTITY);
    until_swapped(&mut frames, 5, |frame| f64::from(frame % 20) * 0.1);
    assert_eq!(frames.counts().fast_rebuilds, 0);
}

#[test]
fn decay_is_foreseen_while_things_move_and_none_when_they_rest() {
    let mut frames = FrameLoop::new(config("bvh8", RebuildPolicy::Async)).unwrap();
    frames.add(Arc::new(burst(3000)), DAffine3::IDENTITY);
    // How long a rebuild takes is known after one.
    until_swapped(&mut frames, 1, |frame| f64::from(frame % 20) * 0.1);
    let mut foreseen = |time_s: f64| {
        frames.advance(&[&at(time_s)]).unwrap();
        let (group, frame) = (&frames.stage.groups[0], frames.counts().frames);
        let more = group.excess_to_come(frame) - group.excess();
        assert!(more >= 0.0, "{more}");
        more
    };
    assert!((0..100).any(|frame| foreseen(0.02 * f64::from(frame)) > 0.0));
    foreseen(0.7);
    assert!(foreseen(0.7) <= 0.0);
}
