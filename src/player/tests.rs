//! The player without a window: inputs, jobs, pictures that come back.

use std::{path::Path, sync::Arc};

use glam::{DAffine3, DVec3};

use super::{
    PlayOptions, StartCamera,
    input::{Action, Button, Input, Key},
    request::{FrameTimes, Job, Picture, Report, Shot, StillFile, ViewSpec},
    state::{Command, Player},
};
use crate::{
    dynamics::LoopCounts,
    geom::Aabb,
    render::{CameraView, Shading},
    scene::{Clip, Projection, Scene},
};

fn scene(name: &str) -> Arc<Scene> {
    let clip = |duration_s| Clip { duration_s, ..Clip::default() };
    Arc::new(Scene { file: name.to_owned(), clips: vec![clip(2.0), clip(4.0)], ..Scene::default() })
}

fn options() -> PlayOptions {
    PlayOptions {
        clips: None,
        speed: 1.0,
        at_s: None,
        camera: StartCamera::Auto,
        shading: Shading::Direct,
        structure: "bvh2".to_owned(),
        structures: vec!["list".to_owned(), "bvh2".to_owned()],
        size: (640, 360),
        fps_limit: 50.0,
        exit_after_s: None,
        screenshot: None,
        still_samples: 1,
    }
}

fn player(options: &PlayOptions) -> Player {
    Player::new(0.0, scene("a.glb"), options)
}

fn picture(shot: &Shot, divisor: u32, samples: u32) -> Report {
    let projection = Projection::Perspective { y_fov: 0.7, aspect: None, z_near: 0.0, z_far: None };
    let world_from_camera = DAffine3::from_translation(DVec3::Z * 5.0);
    Report::Picture(Box::new(Picture {
        rgba: vec![200; 4 * 64],
        width: 8,
        height: 8,
        shot: shot.clone(),
        divisor,
        samples,
        is_final: samples >= 64,
        times: FrameTimes::default(),
        rays: 1,
        counts: LoopCounts::default(),
        view: CameraView { world_from_camera, projection },
        bounds: Aabb::EMPTY,
    }))
}

/// The shot of a job, which is a draft if `is_draft`.
fn expect_job(job: Option<Job>, is_draft: bool) -> Shot {
    match job {
        Some(Job::Draft(shot, _)) if is_draft => shot,
        Some(Job::Refine(shot)) if !is_draft => shot,
        other => panic!("{other:?}"),
    }
}

/// Plays the part of a render thread that needs no time: answers the next job at once.
fn answer(player: &mut Player, now_s: f64) -> Job {
    let job = player.next_job(now_s).expect("a job");
    let report = match &job {
        Job::Draft(shot, divisor) => picture(shot, *divisor, 1),
        Job::Refine(shot) => picture(shot, 1, 64),
    };
    player.report(now_s, report);
    job
}

fn press(player: &mut Player, now_s: f64, key: Key) {
    player.handle(now_s, Input::Key(key));
}

#[test]
fn playing_asks_for_one_draft_at_a_time_no_faster_than_the_limit() {
    let mut player = player(&options());
    let first = expect_job(player.next_job(0.0), true);
    assert!(player.next_job(0.5).is_none(), "one at a time");
    player.report(0.5, picture(&first, 2, 1));
    let second = expect_job(player.next_job(0.5), true);
    assert!((second.time_s - 0.5).abs() < 1e-12);
    player.report(0.505, picture(&second, 2, 1));
    assert!(player.next_job(0.51).is_none(), "not before 1/50 s");
    assert!(player.wake_s(0.51).is_some_and(|s| (s - 0.52).abs() < 1e-12));
    assert!(player.next_job(0.53).is_some());
}

#[test]
fn paused_player_refines_once_and_asks_for_nothing_more() {
    let mut player = player(&options());
    answer(&mut player, 0.0);
    press(&mut player, 1.0, Key::Space);
    let shot = expect_job(player.next_job(1.0), false);
    assert!((shot.time_s - 1.0).abs() < 1e-12);
    assert!(player.next_job(5.0).is_none());
    press(&mut player, 6.0, Key::Space);
    let shot = expect_job(player.next_job(6.5), true);
    assert!((shot.time_s - 1.5).abs() < 1e-12, "goes on where it stopped");
}

#[test]
fn moving_the_camera_while_paused_drafts_until_it_rests() {
    let mut player = player(&PlayOptions { at_s: Some(1.0), ..options() });
    answer(&mut player, 0.0);
    player.handle(1.0, Input::Pointer { x: 100.0, y: 100.0 });
    player.handle(1.0, Input::Button(Button::Left, true));
    player.handle(1.0, Input::Pointer { x: 150.0, y: 100.0 });
    let Job::Draft(shot, _) = answer(&mut player, 1.0) else { panic!("refines while it moves") };
    let ViewSpec::Fixed(view) = shot.view else { panic!("{:?}", shot.view) };
    assert!(view.world_from_camera.translation.x < 0.0, "dragging to the right turns to the left");
    assert!(player.next_job(1.1).is_none());
    let rest_s = player.wake_s(1.1).unwrap();
    assert!(rest_s < 1.5);
    expect_job(player.next_job(rest_s), false);
}

#[test]
fn held_time_is_exact_and_steps_leave_it() {
    let mut player = player(&PlayOptions { at_s: Some(0.123), ..options() });
    assert_eq!(expect_job(player.next_job(9.0), false).time_s.to_bits(), 0.123f64.to_bits());
    press(&mut player, 9.0, Key::Char('.'));
    assert_eq!(player.shot(9.0).time_s.to_bits(), (4.0f64 / 30.0).to_bits());
}

#[test]
fn keys_walk_through_clips_shadings_and_structures() {
    let mut player = player(&options());
    let mut clips = vec![];
    for _ in 0..4 {
        clips.push(player.shot(0.0).clips.len());
        press(&mut player, 0.0, Key::Char('n'));
    }
    assert_eq!(clips, [1, 1, 2, 0]);
    let mut shadings = vec![];
    while !shadings.contains(&player.shot(0.0).shading) {
        shadings.push(player.shot(0.0).shading);
        press(&mut player, 0.0, Key::Char('s'));
    }
    assert_eq!(shadings.len(), 5);
    assert_eq!(&*player.shot(0.0).structure, "bvh2");
    press(&mut player, 0.0, Key::Char('a'));
    assert_eq!(&*player.shot(0.0).structure, "list");
}

#[test]
fn structure_given_with_settings_joins_the_others() {
    let mut player = player(&PlayOptions { structure: "bvh2:leaf=2".to_owned(), ..options() });
    let mut seen = vec![];
    for _ in 0..3 {
        seen.push(player.shot(0.0).structure.to_string());
        press(&mut player, 0.0, Key::Char('a'));
    }
    assert_eq!(seen, ["bvh2:leaf=2", "list", "bvh2"]);
}

#[test]
fn scrubbing_holds_and_then_goes_on() {
    let mut player = player(&options());
    answer(&mut player, 0.0);
    player.handle(1.0, Input::Pointer { x: 320.0, y: 348.0 });
    player.handle(1.0, Input::Button(Button::Left, true));
    let held = player.shot(7.0).time_s;
    assert!((held - 1.0).abs() < 0.01, "{held}");
    player.handle(8.0, Input::Pointer { x: 5000.0, y: 0.0 });
    assert!((player.shot(9.0).time_s - 2.0).abs() < 1e-12, "clamped to the end, wherever the pointer goes");
    player.handle(9.0, Input::Pointer { x: 320.0, y: 0.0 });
    player.handle(9.0, Input::Button(Button::Left, false));
    assert!((player.shot(9.5).time_s - held - 0.5).abs() < 1e-9);
}

#[test]
fn dropped_file_replaces_the_scene_and_a_broken_one_does_not() {
    let mut player = player(&options());
    answer(&mut player, 0.0);
    player.handle(1.0, Input::Dropped("b.glb".into()));
    assert_eq!(player.next_command(), Some(Command::Open("b.glb".into())));
    player.opened(1.0, Path::new("b.glb"), Err("b.glb: accessors[3].count: too many".to_owned()));
    assert_eq!(player.shot(1.0).scene.file, "a.glb");
    assert!(player.message().is_some_and(|m| m.is_error && m.text.contains("accessors[3]")));
    player.opened(2.0, Path::new("c.glb"), Ok(scene("c.glb")));
    let shot = player.shot(2.5);
    assert_eq!(shot.scene.file, "c.glb");
    assert!((shot.time_s - 0.5).abs() < 1e-12, "begins at its start");
}

#[test]
fn scene_that_cannot_be_traced_gives_way_to_the_one_before() {
    let mut player = player(&options());
    answer(&mut player, 0.0);
    player.opened(1.0, Path::new("b.glb"), Ok(scene("b.glb")));
    player.next_job(1.0);
    player.report(1.0, Report::Failed("too many triangles".to_owned()));
    assert_eq!(player.shot(1.0).scene.file, "a.glb");
    assert!(player.message().is_some_and(|m| m.text == "too many triangles"));
    assert!(player.next_job(2.0).is_some(), "and plays on");
}

#[test]
fn structure_that_cannot_be_built_gives_way_to_the_one_before() {
    let mut player = player(&options());
    answer(&mut player, 0.0);
    press(&mut player, 1.0, Key::Char('a'));
    player.next_job(1.0);
    player.report(1.0, Report::Failed("list: no".to_owned()));
    assert_eq!(&*player.shot(1.0).structure, "bvh2");
}

#[test]
fn failure_before_the_first_picture_ends_the_player() {
    let mut player = player(&options());
    player.next_job(0.0);
    player.report(0.0, Report::Failed("no".to_owned()));
    assert_eq!(player.next_command(), Some(Command::Quit(Err("no".to_owned()))));
}

#[test]
fn script_shoots_the_held_time_once_it_is_refined_and_then_ends() {
    let script =
        PlayOptions { at_s: Some(0.5), screenshot: Some("s.png".into()), exit_after_s: Some(3.0), ..options() };
    let mut player = player(&script);
    let shot = expect_job(player.next_job(0.0), false);
    player.report(0.1, picture(&shot, 1, 1));
    player.tick(0.1);
    assert_eq!(player.next_command(), None, "not refined yet");
    player.report(0.2, picture(&shot, 1, 64));
    player.tick(0.2);
    let Some(Command::Still(job)) = player.next_command() else { panic!("no still") };
    assert_eq!(job.shot, shot);
    assert_eq!(job.file, StillFile::Exact("s.png".into()));
    player.report(0.3, Report::Still(Ok("s.png".into())));
    player.tick(0.3);
    assert_eq!(player.next_command(), None, "stays until its time");
    player.tick(3.2);
    assert_eq!(player.next_command(), Some(Command::Quit(Ok(()))));
}

#[test]
fn screenshot_that_cannot_be_written_fails_a_script_but_not_a_user() {
    let mut by_hand = player(&options());
    answer(&mut by_hand, 0.0);
    by_hand.act(0.0, Action::Screenshot);
    let Some(Command::Still(job)) = by_hand.next_command() else { panic!("no still") };
    assert_eq!(job.file, StillFile::Numbered("a".to_owned()));
    by_hand.report(0.1, Report::Still(Err("disk full".to_owned())));
    assert_eq!(by_hand.next_command(), None);
    assert!(by_hand.message().is_some_and(|m| m.is_error));

    let mut script = player(&PlayOptions { screenshot: Some("s.png".into()), ..options() });
    answer(&mut script, 0.0);
    script.act(0.0, Action::Quit);
    script.tick(0.0);
    assert!(matches!(script.next_command(), Some(Command::Still(_))));
    script.report(0.1, Report::Still(Err("disk full".to_owned())));
    assert_eq!(script.next_command(), Some(Command::Quit(Err("disk full".to_owned()))));
}

#[test]
fn escape_closes_the_help_before_the_window() {
    let mut player = player(&options());
    answer(&mut player, 0.0);
    press(&mut player, 0.0, Key::Char('h'));
    press(&mut player, 0.0, Key::Escape);
    player.tick(0.0);
    assert_eq!(player.next_command(), None);
    press(&mut player, 0.0, Key::Escape);
    player.tick(0.0);
    assert_eq!(player.next_command(), Some(Command::Quit(Ok(()))));
}

#[test]
fn resizing_asks_for_pictures_of_the_new_size_and_a_minimised_window_for_none() {
    let mut player = player(&PlayOptions { at_s: Some(0.0), ..options() });
    answer(&mut player, 0.0);
    player.handle(1.0, Input::Resized(0, 0));
    assert!(player.next_job(1.0).is_none());
    player.handle(2.0, Input::Resized(800, 600));
    let shot = expect_job(player.next_job(2.0), true);
    assert_eq!((shot.width, shot.height), (800, 600));
}

#[test]
fn drawing_covers_the_whole_canvas_with_every_overlay() {
    let mut player = player(&options());
    let (width, height) = (640, 360);
    answer(&mut player, 0.0);
    for keys in ["", "h", "o"] {
        keys.chars().for_each(|c| press(&mut player, 0.0, Key::Char(c)));
        let mut pixels = vec![0xdead_beef; width * height];
        player.draw(0.0, &mut super::canvas::Canvas::new(width, height, &mut pixels));
        assert!(pixels.iter().all(|p| p >> 24 == 0), "after {keys:?}");
    }
}
