//! `kinora render` as a farm sees it: names, formats, resume, shards, exit codes, signals.
#![cfg(feature = "cli")]

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
};

use serde_json::Value;
use tempfile::TempDir;

/// A triangle that turns once around its middle in half a second: `tri.gltf` beside `tri.bin`.
struct Stage {
    folder: TempDir,
}

impl Stage {
    fn new() -> Self {
        let stage = Self { folder: tempfile::tempdir().unwrap() };
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let mut floats = vec![-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0];
        floats.extend([0.0, 0.5]);
        floats.extend([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]);
        stage.write_bin(&floats);
        let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
            "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
            "animations":[{"name":"turn","channels":[{"sampler":0,"target":{"node":0,"path":"rotation"}}],
              "samplers":[{"input":1,"output":2}]}],
            "accessors":[
              {"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[-1,-1,0],"max":[1,1,0]},
              {"bufferView":0,"byteOffset":36,"componentType":5126,"count":2,"type":"SCALAR","min":[0],"max":[0.5]},
              {"bufferView":0,"byteOffset":44,"componentType":5126,"count":2,"type":"VEC4"}],
            "bufferViews":[{"buffer":0,"byteLength":76}],
            "buffers":[{"byteLength":76,"uri":"tri.bin"}]}"#;
        fs::write(stage.path("tri.gltf"), json).unwrap();
        stage
    }

    fn write_bin(&self, floats: &[f32]) {
        let bytes: Vec<u8> = floats.iter().flat_map(|f| f.to_le_bytes()).collect();
        fs::write(self.path("tri.bin"), bytes).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `kinora render tri.gltf --size 16x9 --output OUTPUT ...`
    fn command(&self, output: &str, more: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kinora"));
        for variable in SCHEDULERS {
            command.env_remove(variable);
        }
        let output = if output == "-" { output.to_owned() } else { self.path(output).display().to_string() };
        command.arg("render").arg(self.path("tri.gltf")).args(["--output", &output]).args(more);
        if !more.contains(&"--size") {
            command.args(["--size", "16x9"]);
        }
        command
    }

    fn run(&self, output: &str, more: &[&str]) -> Output {
        self.command(output, more).output().unwrap()
    }

    /// Runs what must succeed.
    fn render(&self, output: &str, more: &[&str]) -> Output {
        let run = self.run(output, more);
        assert_eq!(run.status.code(), Some(0), "{output} {more:?}: {}", text(&run.stderr));
        run
    }

    fn json(&self, output: &str, more: &[&str]) -> Value {
        let more: Vec<&str> = more.iter().copied().chain(["--json"]).collect();
        serde_json::from_slice(&self.render(output, &more).stdout).unwrap()
    }

    /// Runs what must fail with `code`, and gives its message.
    fn fails(&self, code: i32, output: &str, more: &[&str]) -> String {
        let run = self.run(output, more);
        assert_eq!(run.status.code(), Some(code), "{output} {more:?}: {}", text(&run.stderr));
        assert!(!text(&run.stderr).contains("panicked"), "{}", text(&run.stderr));
        text(&run.stderr)
    }

    fn names(&self, folder: &str) -> BTreeSet<String> {
        let name = |e: std::io::Result<fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
        fs::read_dir(self.path(folder)).unwrap().map(name).collect()
    }

    fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }
}

const SCHEDULERS: [&str; 10] = [
    "KINORA_THREADS",
    "SLURM_CPUS_PER_TASK",
    "HQ_CPUS",
    "SLURM_ARRAY_TASK_ID",
    "SLURM_ARRAY_TASK_MIN",
    "SLURM_ARRAY_TASK_STEP",
    "SLURM_ARRAY_TASK_COUNT",
    "HQ_TASK_ID",
    "AWS_BATCH_JOB_ARRAY_INDEX",
    "JOB_COMPLETION_INDEX",
];

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn pixels(path: &Path) -> Vec<u8> {
    image::open(path).unwrap().into_rgb8().into_raw()
}

#[test]
fn without_options_every_frame_of_the_animation_is_a_numbered_png() {
    let stage = Stage::new();
    stage.render("out/f_####.png", &[]);
    let want: BTreeSet<_> = (0..=15).map(|k| format!("f_{k:04}.png")).collect();
    assert_eq!(stage.names("out"), want);
    let first = image::open(stage.path("out/f_0000.png")).unwrap();
    assert_eq!((first.width(), first.height()), (16, 9));
    assert_ne!(pixels(&stage.path("out/f_0000.png")), pixels(&stage.path("out/f_0015.png")));
}

#[test]
fn a_frame_is_the_same_alone_in_a_list_and_past_the_end() {
    let stage = Stage::new();
    stage.render("all/#.png", &["--frames", "0..=20"]);
    stage.render("one/#.png", &["--frames", "7"]);
    stage.render("half/#.png", &["--frames", "14", "--fps", "60"]);
    assert_eq!(stage.read("all/7.png"), stage.read("one/7.png"));
    assert_eq!(pixels(&stage.path("all/7.png")), pixels(&stage.path("half/14.png")));
    assert_eq!(pixels(&stage.path("all/15.png")), pixels(&stage.path("all/20.png")));
    assert_ne!(pixels(&stage.path("all/14.png")), pixels(&stage.path("all/15.png")));
}

#[test]
fn threads_structures_levels_and_policies_change_no_byte() {
    let stage = Stage::new();
    let run = |name: &str, more: &[&str]| {
        let more: Vec<&str> = more.iter().copied().chain(["--frames", "0-4", "--samples", "2"]).collect();
        stage.render(&format!("{name}/#.png"), &more);
        (0..=4).map(|k| stage.read(&format!("{name}/{k}.png"))).collect::<Vec<_>>()
    };
    let want = run("base", &[]);
    for (i, more) in [
        &["--threads", "1"][..],
        &["--threads", "2"],
        &["--accel", "list"],
        &["--accel", "bvh2"],
        &["--top", "list"],
        &["--simd", "scalar"],
        &["--policy", "refit"],
        &["--policy", "rebuild"],
        &["--policy", "swap-every=2"],
    ]
    .iter()
    .enumerate()
    {
        assert!(run(&i.to_string(), more) == want, "{more:?}");
    }
}

#[test]
fn existing_files_end_in_2_before_anything_is_rendered() {
    let stage = Stage::new();
    fs::create_dir(stage.path("out")).unwrap();
    fs::write(stage.path("out/3.png"), b"mine").unwrap();
    let message = stage.fails(2, "out/#.png", &[]);
    assert!(message.contains("3.png") && message.contains("--resume") && message.contains("--overwrite"), "{message}");
    assert_eq!(stage.names("out").len(), 1);
    assert_eq!(stage.read("out/3.png"), b"mine");
    stage.render("out/#.png", &["--frames", "4-5"]);
    stage.render("out/#.png", &["--overwrite", "--frames", "3-4"]);
    assert_eq!(pixels(&stage.path("out/3.png")).len(), 16 * 9 * 3);
}

#[test]
fn several_frames_need_a_number_or_a_film() {
    let stage = Stage::new();
    for output in ["out/still.png", "out/still.exr"] {
        let message = stage.fails(2, output, &[]);
        assert!(message.contains('#'), "{message}");
        assert!(!stage.path("out").exists());
    }
    stage.fails(2, "out/still.png", &["--shard", "1/16"]);
    stage.render("out/still.png", &["--frames", "3"]);
    stage.render("out/still.exr", &["--frames", "3"]);
    assert_eq!(stage.names("out").len(), 2);
}

#[test]
fn resume_keeps_good_files_and_redoes_the_rest() {
    let stage = Stage::new();
    for (pattern, extension) in [("png/#.png", "png"), ("exr/#.exr", "exr")] {
        let file = |k: u32| format!("{extension}/{k}.{extension}");
        stage.render(pattern, &["--frames", "0-5"]);
        let good = stage.read(&file(2));
        let kept = fs::metadata(stage.path(&file(0))).unwrap().modified().unwrap();
        fs::write(stage.path(&file(2)), &good[..good.len() - 7]).unwrap();
        fs::write(stage.path(&file(3)), b"").unwrap();
        fs::remove_file(stage.path(&file(4))).unwrap();
        fs::copy(stage.path(&file(0)), stage.path(&file(5))).unwrap();
        let summary = stage.json(pattern, &["--frames", "0-6", "--resume"]);
        assert_eq!((&summary["frames"], &summary["skipped"]), (&5.into(), &2.into()), "{extension}");
        assert_eq!(stage.read(&file(2)), good);
        assert_eq!(fs::metadata(stage.path(&file(0))).unwrap().modified().unwrap(), kept);
        let summary = stage.json(pattern, &["--frames", "0-6", "--resume"]);
        assert_eq!((&summary["frames"], &summary["skipped"]), (&0.into(), &7.into()), "{extension}");
    }
}

#[test]
fn resume_redoes_files_of_other_settings_or_another_scene() {
    let stage = Stage::new();
    stage.render("out/#.png", &["--frames", "0-1"]);
    let redone = |more: &[&str]| {
        let more: Vec<&str> = more.iter().copied().chain(["--frames", "0-1", "--resume"]).collect();
        stage.json("out/#.png", &more)["frames"].as_u64().unwrap()
    };
    assert_eq!(redone(&[]), 0);
    assert_eq!(redone(&["--threads", "1", "--accel", "list", "--simd", "scalar"]), 0);
    assert_eq!(redone(&["--camera", "framed"]), 0, "auto frames a file without cameras too");
    for more in [
        &["--samples", "2"][..],
        &["--seed", "5"],
        &["--fps", "25"],
        &["--shading", "normals"],
        &["--animation", "none"],
        &["--size", "9x16"],
        &["--precision", "fast"],
        &["--precision", "fast", "--accel", "ssh"],
    ] {
        assert_eq!(redone(more), 2, "{more:?}");
        assert_eq!(redone(more), 0, "{more:?}");
    }
    assert_eq!(redone(&[]), 2);
    let mut floats = vec![-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.5];
    floats.extend([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    stage.write_bin(&floats);
    assert_eq!(redone(&[]), 2, "the file beside the scene counts too");
}

#[test]
fn films_resume_as_a_whole() {
    let stage = Stage::new();
    for name in ["a.apng", "a.gif", "a.y4m"] {
        let frames = |more: &[&str]| stage.json(name, more)["frames"].as_u64().unwrap();
        assert_eq!(frames(&[]), 16, "{name}");
        let good = stage.read(name);
        assert_eq!(frames(&["--resume"]), 0, "{name}");
        fs::write(stage.path(name), &good[..good.len() / 2]).unwrap();
        assert_eq!(frames(&["--resume"]), 16, "{name}");
        assert!(stage.read(name) == good, "{name}");
        assert_eq!(frames(&["--resume", "--frames", "0-3"]), 4, "{name}");
        assert!(stage.fails(2, name, &[]).contains(name));
    }
    assert_eq!(stage.names(".").len(), 5, "{:?}", stage.names("."));
}

#[test]
fn shards_partition_the_list_whoever_names_them() {
    let stage = Stage::new();
    let mut seen = BTreeSet::new();
    for i in 1..=3 {
        stage.render(&format!("s{i}/#.png"), &["--shard", &format!("{i}/3")]);
        for name in stage.names(&format!("s{i}")) {
            assert!(seen.insert(name.clone()), "{name} twice");
        }
    }
    assert_eq!(seen.len(), 16);
    assert_eq!(stage.names("s2"), ["1", "4", "7", "10", "13"].map(|k| format!("{k}.png")).into());

    let mut slurm = stage.command("slurm/#.png", &["--shard", "auto"]);
    slurm.envs([
        ("SLURM_ARRAY_TASK_ID", "4"),
        ("SLURM_ARRAY_TASK_MIN", "2"),
        ("SLURM_ARRAY_TASK_STEP", "2"),
        ("SLURM_ARRAY_TASK_COUNT", "3"),
    ]);
    assert!(slurm.output().unwrap().status.success());
    assert_eq!(stage.names("slurm"), stage.names("s2"));

    let mut kubernetes = stage.command("k8s/#.png", &["--shard", "auto", "--shard-count", "3"]);
    assert!(kubernetes.env("JOB_COMPLETION_INDEX", "1").output().unwrap().status.success());
    assert_eq!(stage.names("k8s"), stage.names("s2"));

    assert!(stage.fails(2, "x/#.png", &["--shard", "auto"]).contains("--shard auto"));
    let lost = stage.command("x/#.png", &["--shard", "auto"]).env("HQ_TASK_ID", "1").output().unwrap();
    assert_eq!(lost.status.code(), Some(2));
    assert!(text(&lost.stderr).contains("HQ_TASK_ID"), "{}", text(&lost.stderr));

    let summary = stage.json("late/#.png", &["--shard", "20/20"]);
    assert_eq!((&summary["frames"], stage.path("late").exists()), (&0.into(), false));
}

#[test]
fn json_is_one_object_with_exactly_the_named_fields() {
    let stage = Stage::new();
    let run = stage.render("out/#.png", &["--json", "--frames", "0-2", "--samples", "2", "--accel", "list"]);
    let summary: Value = serde_json::from_slice(&run.stdout).unwrap();
    let keys = |v: &Value| v.as_object().unwrap().keys().cloned().collect::<BTreeSet<_>>();
    let named = |names: &[&str]| names.iter().map(|&n| n.to_owned()).collect::<BTreeSet<_>>();
    assert_eq!(
        keys(&summary),
        named(&[
            "frames",
            "skipped",
            "size",
            "samples",
            "accel",
            "rays",
            "mrays_per_s",
            "median_ms",
            "p99_ms",
            "swaps",
            "rebuilds_dropped",
            "quality_max",
        ])
    );
    for stages in [&summary["median_ms"], &summary["p99_ms"]] {
        assert_eq!(keys(stages), named(&["pose", "deform", "refit", "trace", "encode", "frame"]));
        assert!(stages["trace"].as_f64().unwrap() > 0.0 && stages["encode"].as_f64().unwrap() > 0.0);
        assert!(stages["frame"].as_f64() >= stages["trace"].as_f64());
    }
    assert_eq!(summary["frames"], 3);
    assert_eq!(summary["size"], serde_json::json!([16, 9]));
    assert_eq!(summary["samples"], 2);
    assert_eq!(summary["accel"], "list");
    assert!(summary["rays"].as_u64().unwrap() > 0);
}

#[test]
fn progress_is_a_line_a_frame_on_stderr_and_none_when_quiet() {
    let stage = Stage::new();
    let run = stage.render("a/#.png", &["--frames", "0-2"]);
    assert!(run.stdout.is_empty());
    let lines = text(&run.stderr);
    assert_eq!(lines.lines().filter(|l| l.starts_with("frame ")).count(), 3, "{lines}");
    assert!(lines.contains("(3 of 3)") && lines.contains("left"), "{lines}");
    let run = stage.render("b/#.png", &["--frames", "0-2", "-q"]);
    assert!(run.stdout.is_empty() && run.stderr.is_empty(), "{}", text(&run.stderr));
}

#[test]
fn a_stream_to_stdout_holds_every_frame_and_nothing_else() {
    let stage = Stage::new();
    for (chroma, frame) in [("420", 6 + 16 * 9 + 2 * 8 * 5), ("444", 6 + 3 * 16 * 9)] {
        let run = stage.render("-", &["--chroma", chroma, "--frames", "0..10", "--fps", "24"]);
        let end = run.stdout.iter().position(|&b| b == b'\n').unwrap();
        let header = text(&run.stdout[..end]);
        assert!(header.starts_with("YUV4MPEG2 W16 H9 F24:1 Ip A1:1 C4"), "{header}");
        let frames = &run.stdout[end + 1..];
        assert_eq!(frames.len(), 10 * frame);
        assert!(frames.chunks(frame).all(|f| f.starts_with(b"FRAME\n")));
    }
    assert_eq!(stage.names(".").len(), 2);
}

#[cfg(unix)]
#[test]
fn a_closed_pipe_ends_in_1_with_a_message() {
    let stage = Stage::new();
    let mut command = stage.command("-", &["--frames", "0-500", "--size", "64x64"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("stdout: cannot write"), "{}", text(&output.stderr));
}

#[test]
fn films_decode_again_with_their_frames() {
    let stage = Stage::new();
    stage.render("a.apng", &[]);
    let file = std::io::BufReader::new(fs::File::open(stage.path("a.apng")).unwrap());
    let reader = png::Decoder::new(file).read_info().unwrap();
    assert_eq!(reader.info().animation_control.unwrap().num_frames, 16);
    stage.render("still/#.png", &["--frames", "0"]);
    assert_eq!(
        image::load_from_memory(&stage.read("a.apng")).unwrap().into_rgb8().into_raw(),
        pixels(&stage.path("still/0.png"))
    );

    stage.render("a.gif", &["--frames", "0-14x2"]);
    let mut decoder = gif::DecodeOptions::new().read_info(fs::File::open(stage.path("a.gif")).unwrap()).unwrap();
    let mut delays = Vec::new();
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        delays.push(frame.delay);
    }
    assert_eq!(delays.len(), 8);
    assert_eq!(delays.iter().sum::<u16>(), 53, "every other frame keeps its time");
}

#[test]
fn what_cannot_be_written_ends_in_1_with_the_place_named() {
    let stage = Stage::new();
    fs::write(stage.path("file"), b"").unwrap();
    let message = stage.fails(1, "file/f_#.png", &[]);
    assert!(message.contains("file"), "{message}");
    fs::create_dir(stage.path("0.png")).unwrap();
    let message = stage.fails(1, "#.png", &["--frames", "0", "--overwrite"]);
    assert!(message.contains("0.png"), "{message}");
}

#[test]
fn animations_and_cameras_that_are_not_there_end_in_2() {
    let stage = Stage::new();
    let message = stage.fails(2, "a/#.png", &["--animation", "run"]);
    assert!(message.contains("run") && message.contains("turn"), "{message}");
    assert!(stage.fails(2, "a/#.png", &["--animation", "1"]).contains("tri.gltf"));
    let message = stage.fails(2, "a/#.png", &["--camera", "0"]);
    assert!(message.contains("camera"), "{message}");
    assert!(!stage.path("a").exists());
    for (i, name) in ["0", "turn", "all", "none"].into_iter().enumerate() {
        stage.render(&format!("{i}/#.png"), &["--animation", name, "--frames", "9"]);
    }
    assert_eq!(stage.read("0/9.png"), stage.read("1/9.png"));
    assert_eq!(stage.read("0/9.png"), stage.read("2/9.png"));
    assert_ne!(pixels(&stage.path("0/9.png")), pixels(&stage.path("3/9.png")));
}

#[cfg(unix)]
mod signals {
    use std::{
        io::{BufRead, BufReader},
        thread::sleep,
        time::{Duration, Instant},
    };

    use super::*;

    /// Starts a long run, sends the signal when `ready` says so, and gives the exit code.
    fn stop(stage: &Stage, output: &str, more: &[&str], ready: impl Fn() -> bool, signal: &str) -> i32 {
        let more: Vec<&str> = more.iter().copied().chain(["--size", "96x96", "--frames", "0-100000", "-v"]).collect();
        let mut child = stage.command(output, &more).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut log = BufReader::new(child.stderr.take().unwrap()).lines();
        assert!(log.any(|line| line.unwrap().contains("frames to render")));
        let rest = std::thread::spawn(move || log.map_while(Result::ok).last());
        let start = Instant::now();
        while !ready() && start.elapsed().as_secs() < 60 {
            sleep(Duration::from_millis(5));
        }
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let sent = Instant::now();
        let code = child.wait().unwrap().code().expect("the program ends by itself");
        assert!(sent.elapsed().as_secs() < 15);
        assert!(rest.join().unwrap().is_some_and(|line| line.contains("signal")));
        code
    }

    #[test]
    fn interrupted_sequences_leave_whole_files_only() {
        for (signal, code) in [("-INT", 130), ("-TERM", 143)] {
            let stage = Stage::new();
            let some = || stage.path("out/2.png").exists();
            assert_eq!(stop(&stage, "out/#.png", &[], some, signal), code);
            let names = stage.names("out");
            assert!(names.len() >= 3, "{names:?}");
            for name in names {
                assert!(Path::new(&name).extension().is_some_and(|e| e == "png"), "{name}");
                assert_eq!(pixels(&stage.path("out").join(name)).len(), 96 * 96 * 3);
            }
        }
    }

    #[test]
    fn an_interrupted_film_leaves_nothing() {
        let stage = Stage::new();
        let begun = || stage.path("out").exists() && stage.names("out").len() == 1;
        assert_eq!(stop(&stage, "out/film.gif", &[], begun, "-TERM"), 143);
        assert_eq!(stage.names("out"), BTreeSet::new());
    }

    #[test]
    fn a_frame_that_takes_long_is_dropped() {
        let stage = Stage::new();
        let samples = ["--samples", "1000000", "--shading", "ao"];
        assert_eq!(stop(&stage, "out/#.png", &samples, || true, "-INT"), 130);
        assert_eq!(stage.names("out"), BTreeSet::new());
    }
}
