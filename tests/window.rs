//! `kinora play` in a real window. Skipped where there is no display; `.ci/window` runs it under Xvfb.

#![cfg(all(feature = "cli", feature = "player"))]

use std::{
    path::Path,
    process::{Child, Command, ExitStatus, Output, Stdio},
    time::{Duration, Instant},
};

const LIMIT: Duration = Duration::from_secs(240);
const SIZE: &str = "192x108";

/// True when windows can be opened; says so when not.
///
/// # Panics
/// When there is no display and `KINORA_TEST_WINDOW` is set.
fn has_display() -> bool {
    let found = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some_and(|v| !v.is_empty()));
    assert!(found || std::env::var_os("KINORA_TEST_WINDOW").is_none(), "no display; run it through .ci/window");
    if !found {
        println!("skipped: no display");
    }
    found
}

fn kinora(command: &str, args: &[&str]) -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_kinora"));
    program.arg(command).args(["--threads", "2"]).args(args).stdin(Stdio::null());
    program
}

/// Waits for the program to end by itself.
fn wait(mut child: Child) -> ExitStatus {
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if begun.elapsed() > LIMIT {
            child.kill().unwrap();
            panic!("still running after {LIMIT:?}");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn succeed(program: &mut Command) {
    let status = wait(program.spawn().unwrap());
    assert!(status.success(), "{program:?}: {status}");
}

fn pixels(file: &Path) -> image::RgbImage {
    image::open(file).unwrap_or_else(|e| panic!("{}: {e}", file.display())).to_rgb8()
}

/// The time of a frame of `render`, in digits that give the same number back.
fn time_of(frame: u32) -> String {
    (f64::from(frame) / 30.0).to_string()
}

/// Holds the time of `frame` in a window and gives the screenshot.
fn held(folder: &Path, frame: u32, args: &[&str]) -> image::RgbImage {
    let file = folder.join(format!("held_{frame}.png"));
    let mut program = kinora("play", args);
    program.args(["--at", &time_of(frame), "--size", SIZE, "--exit-after", "0", "--screenshot"]).arg(&file);
    succeed(&mut program);
    pixels(&file)
}

/// What `render` gives for `frame` at the size of `like` (a window manager may have chosen another).
fn rendered(folder: &Path, frame: u32, like: &image::RgbImage, args: &[&str]) -> image::RgbImage {
    let size = format!("{}x{}", like.width(), like.height());
    let mut program = kinora("render", args);
    program.args(["--frames", &frame.to_string(), "--size", &size, "--overwrite", "-q", "--output"]);
    succeed(program.arg(folder.join("rendered_##.png")));
    pixels(&folder.join(format!("rendered_{frame:02}.png")))
}

#[test]
fn held_times_look_as_render_makes_them() {
    if !has_display() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut seen = Vec::new();
    for (frame, args) in [(7, &[][..]), (19, &[][..]), (11, &["--camera", "framed", "--shading", "ao"][..])] {
        let shown = held(folder.path(), frame, args);
        assert!(shown == rendered(folder.path(), frame, &shown, args), "frame {frame} differs");
        seen.push(shown);
    }
    assert!(seen[0] != seen[1], "nothing moves");
}

#[test]
fn picture_after_two_seconds_of_play_differs_from_the_first() {
    if !has_display() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("played.png");
    // A speed at which two seconds are no whole number of loops, whatever the scene's length in frames.
    let args = ["--size", SIZE, "--speed", "0.137", "--exit-after", "2", "--screenshot"];
    succeed(kinora("play", &args).arg(&file));
    let played = pixels(&file);
    let first = rendered(folder.path(), 0, &played, &[]);
    let moved = played.pixels().zip(first.pixels()).filter(|(a, b)| a != b).count();
    assert!(moved > 100, "{moved} pixels differ");
}

/// The whole screen as the X server has it; `None` (with a note) without `xwd`.
fn screen() -> Option<image::RgbImage> {
    let Ok(Output { stdout, status, .. }) = Command::new("xwd").args(["-root", "-silent"]).output() else {
        println!("skipped: there is no xwd");
        return None;
    };
    if !status.success() {
        println!("skipped: xwd cannot read the screen");
        return None;
    }
    // The header of an XWD file: 25 big-endian words, then a name; then colours of 12 bytes; then rows.
    let word = |i: usize| usize::try_from(u32::from_be_bytes(stdout[4 * i..4 * i + 4].try_into().unwrap())).unwrap();
    let (width, height, little_endian, bits, row, colors) =
        (word(4), word(5), word(7) == 0, word(11), word(12), word(19));
    assert!(bits == 32 && little_endian, "{bits} bits a pixel");
    let rows = &stdout[word(0) + 12 * colors..];
    let pixel = |x: u32, y: u32| {
        let at = y as usize * row + x as usize * 4;
        image::Rgb([rows[at + 2], rows[at + 1], rows[at]])
    };
    Some(image::RgbImage::from_fn(u32::try_from(width).unwrap(), u32::try_from(height).unwrap(), pixel))
}

/// Mean difference of two pictures' channels, in 1/255, over the rows between figures and scrub bar.
fn difference(screen: &image::RgbImage, picture: &image::RgbImage, row_of: impl Fn(u32) -> u32) -> f64 {
    let (width, height) = picture.dimensions();
    let (mut sum, mut count) = (0.0, 0.0);
    for y in height * 7 / 20..height * 4 / 5 {
        for x in 0..width {
            let (a, b) = (screen.get_pixel(x, y), picture.get_pixel(x, row_of(y)));
            sum += (0..3).map(|c| f64::from(a[c].abs_diff(b[c]))).sum::<f64>();
            count += 3.0;
        }
    }
    sum / count
}

#[test]
fn window_on_the_screen_shows_the_picture_upright() {
    if !has_display() || screen().is_none() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("shot.png");
    let args = ["--at", &time_of(7), "--size", "480x270", "--exit-after", "4", "--screenshot"];
    let mut child = kinora("play", &args).arg(&file).spawn().unwrap();
    // The window is at the top left and shows the picture for some time before it closes.
    let mut shots = Vec::new();
    let begun = Instant::now();
    while child.try_wait().unwrap().is_none() && begun.elapsed() < LIMIT {
        shots.extend(screen());
        std::thread::sleep(Duration::from_millis(300));
    }
    assert!(wait(child).success());
    let picture = pixels(&file);
    let height = picture.height();
    let fits = |s: &&image::RgbImage| s.width() >= picture.width() && s.height() >= height;
    let upright = shots.iter().filter(fits).map(|s| difference(s, &picture, |y| y)).fold(f64::MAX, f64::min);
    let flipped =
        shots.iter().filter(fits).map(|s| difference(s, &picture, |y| height - 1 - y)).fold(f64::MAX, f64::min);
    assert!(upright < 4.0, "differs by {upright} on average");
    assert!(upright < flipped * 0.5, "upright {upright}, upside down {flipped}");
}

#[cfg(unix)]
#[test]
fn sigterm_closes_the_window_with_exit_code_143() {
    if !has_display() {
        return;
    }
    let mut child = kinora("play", &["--size", "160x90", "--exit-after", "200"]).stderr(Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_secs(2));
    assert!(child.try_wait().unwrap().is_none(), "ended by itself");
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(wait(child).code(), Some(143));
}

#[test]
fn screenshot_that_cannot_be_written_is_exit_code_1_with_the_file_named() {
    if !has_display() {
        return;
    }
    let args = ["--size", "160x90", "--exit-after", "0", "--screenshot", "no/such/folder/a.png"];
    let output = kinora("play", &args).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("no/such/folder/a.png"), "{message}");
}

#[cfg(target_os = "linux")]
#[test]
fn without_a_display_there_is_one_clear_line_and_exit_code_1() {
    let mut program = kinora("play", &[]);
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
        program.env_remove(name);
    }
    let output = program.output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(message.contains("no display") && message.contains("kinora render"), "{message}");
}

#[test]
fn values_that_make_no_sense_are_usage_errors_before_a_window_opens() {
    let cases: [&[&str]; 9] = [
        &["--size", "0x5"],
        &["--size", "20000x10"],
        &["--shading", "shiny"],
        &["--fps-limit", "0"],
        &["--speed", "nan"],
        &["--at", "-1"],
        &["--samples", "0"],
        &["--camera", "no such camera"],
        &["--animation", "no such animation"],
    ];
    for args in cases {
        let output = kinora("play", args).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert!(!message.is_empty() && output.stdout.is_empty(), "{args:?}");
    }
    let output = kinora("play", &["no-such-file.glb"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("no-such-file.glb"));
}
