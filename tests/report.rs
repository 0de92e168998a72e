//! `kinora report`: files, rows, bounds, comparison with an earlier run, and what it refuses.
#![cfg(feature = "cli")]

use std::{
    fs,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use assert_cmd::Command;
use serde_json::Value;

fn kinora() -> Command {
    Command::cargo_bin("kinora").expect("the program is built")
}

/// A small wavy grid: quick to measure with every structure.
fn mesh(folder: &Path) -> String {
    const SIDE: usize = 12;
    let mut lines = Vec::new();
    for i in 0..SIDE * SIDE {
        let (x, y) = (i % SIDE, i / SIDE);
        lines.push(format!("v {x} {} {y}", x * y % 5));
    }
    for i in (0..SIDE * (SIDE - 1)).filter(|i| i % SIDE < SIDE - 1) {
        let (a, b) = (i + 1, i + 1 + SIDE);
        lines.push(format!("f {a} {} {} {b}", a + 1, b + 1));
    }
    let path = folder.join("grid.obj");
    fs::write(&path, lines.join("\n")).expect("written");
    path.display().to_string()
}

/// One quick run that several tests look at: its folder, mesh and stdout.
fn first_run() -> &'static (PathBuf, String, String) {
    static RUN: OnceLock<(PathBuf, String, String)> = OnceLock::new();
    RUN.get_or_init(|| {
        let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report");
        let _absent_the_first_time = fs::remove_dir_all(&dir);
        fs::create_dir_all(&dir).expect("a folder");
        let (mesh, out) = (mesh(&dir), dir.join("new/report"));
        let assert = measure(&mesh, &out, &[]).assert().success();
        let stdout = String::from_utf8_lossy(&assert.get_output().stdout).into_owned();
        (out, mesh, stdout)
    })
}

fn measure(mesh: &str, output: &Path, extra: &[&str]) -> Command {
    let mut command = kinora();
    command.args(["report", "structures", mesh, "--quick", "--threads", "1", "--output"]).arg(output).args(extra);
    command
}

fn json(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("structures.json")).expect("written")).expect("JSON")
}

/// Names of the structures of this build, as `--accel` lists them.
fn structures() -> Vec<&'static str> {
    kinora::accel::AccelKind::ALL.iter().map(|k| k.name()).collect()
}

#[test]
fn every_structure_has_rows_and_all_files_are_written() {
    let (out, _, stdout) = first_run();
    let report = json(out);
    assert_eq!((&report["schema"], &report["kind"]), (&1.into(), &"structures".into()));
    for (key, is_right) in [
        ("commit", report["commit"].is_string()),
        ("machine", report["machine"]["cpu"].is_string() && report["machine"]["cores"].as_u64() > Some(0)),
        ("settings", report["settings"]["quick"] == true && report["settings"]["threads"] == 1),
        ("date", report["date"].as_str().is_some_and(|d| d.len() == 10)),
    ] {
        assert!(is_right, "{key}: {}", report[key]);
    }
    let rows = report["rows"].as_array().expect("rows");
    for name in structures() {
        let of =
            |table: &str| rows.iter().filter(|r| r["table"] == table && r["structure"] == name).collect::<Vec<_>>();
        let [build] = of("build")[..] else { panic!("{name}: one row of builds") };
        assert!(build["triangles"] == 242 && build["build_ms"].as_f64() > Some(0.0), "{build}");
        assert!(build["refit_ms"].as_f64() > Some(0.0) || build["note"].is_string(), "{build}");
        let rays = of("rays");
        assert_eq!(rays.len(), 4, "{name}: primary, shadow, ao, diffuse");
        for row in rays {
            assert_eq!(row["differences"], 0, "{row}");
            assert!(row["single_mrays_per_s"].as_f64() > Some(0.0) && row["packet_mrays_per_s"].as_f64() > Some(0.0));
            let counted = ["nodes", "tests", "blocks", "steps", "events"];
            assert!(counted.iter().any(|c| row[format!("{c}_per_ray")].as_f64() > Some(0.0)), "{row}");
        }
    }
    let mut files: Vec<String> =
        fs::read_dir(out).expect("a folder").map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    for file in &files {
        assert!(stdout.contains(file.as_str()), "{file} is named on stdout");
    }
    let plots: Vec<&String> = files.iter().filter(|f| Path::new(f).extension().is_some_and(|e| e == "svg")).collect();
    assert_eq!(plots.len(), report["plots"].as_array().map_or(0, Vec::len));
    assert_eq!(files.len(), plots.len() + 2, "{files:?}");
    let markdown = fs::read_to_string(out.join("structures.md")).expect("written");
    for plot in plots {
        let svg = fs::read_to_string(out.join(plot)).expect("written");
        assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>"));
        assert!(markdown.contains(plot.as_str()));
    }
    for line in markdown.lines().filter(|l| l.starts_with('|')) {
        assert!(line.ends_with('|'), "{line}");
    }
}

#[test]
fn counts_are_the_same_in_every_run_and_a_worse_count_fails_the_check() {
    let (first, mesh, _) = first_run();
    let dir = tempfile::tempdir().expect("a folder");
    let mut report = json(first);
    let rows = report["rows"].as_array_mut().expect("rows");
    let row = rows.iter_mut().find(|r| r["table"] == "build" && r["structure"] == "bvh2").expect("bvh2 has a row");
    row["node_bytes_per_triangle"] = 1.0.into();
    let baseline = dir.path().join("baseline.json");
    fs::write(&baseline, report.to_string()).expect("written");
    let out = dir.path().join("second");
    let assert = measure(mesh, &out, &["--check", "--baseline", baseline.to_str().unwrap()]).assert().code(1);
    let output = assert.get_output();
    let (stdout, stderr) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let counted: Vec<&str> = stdout.lines().filter(|l| l.ends_with("counted)")).collect();
    let [change] = counted[..] else { panic!("one count differs: {counted:?}") };
    assert!(
        change.starts_with("worse: build / ") && change.contains("bvh2 / node_bytes_per_triangle: 1.0000 ->"),
        "{change}"
    );
    assert!(stdout.contains("0 rows new, 0 gone"), "{stdout}");
    assert!(stderr.contains("counted values worse than the baseline"), "{stderr}");
    assert!(out.join("structures.json").exists(), "the files are written all the same");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes without optimisation")]
fn accuracy_sets_speed_against_error_and_conservative_points_err_never() {
    let dir = tempfile::tempdir().expect("a folder");
    let (mesh, out) = (mesh(dir.path()), dir.path().join("out"));
    let mut command = kinora();
    command.args(["report", "accuracy", &mesh, "--quick", "--check", "--threads", "1", "--output"]).arg(&out);
    command.assert().success();
    let report: Value = serde_json::from_slice(&fs::read(out.join("accuracy.json")).expect("written")).expect("JSON");
    let rows = report["rows"].as_array().expect("rows");
    let of = |table: &'static str| rows.iter().filter(move |r| r["table"] == table);
    for name in structures() {
        let mine: Vec<&Value> = of("rays").filter(|r| r["structure"] == name && r["cast"] == "single").collect();
        for class in ["primary", "shadow", "diffuse", "edges"] {
            let exact = mine.iter().find(|r| r["rays"] == class && r["precision"] == "exact");
            let row = exact.unwrap_or_else(|| panic!("{name}: {class}"));
            assert_eq!(row["kind"], "conservative");
            assert!(row["ns_per_ray"].as_f64() > Some(0.0) && row["count"].as_u64() >= Some(16), "{row}");
            for error in ["false_misses", "false_hits", "wrong_triangles"] {
                assert_eq!(row[error], 0, "{row}");
                assert!(row[format!("{error}_below")].as_f64() > Some(0.0), "{row}");
            }
            assert!(class == "shadow" || row["t_error_max"].as_f64() <= Some(1.0), "{row}");
        }
        assert!(mine.iter().any(|r| r["kind"] == "lossy"), "{name}");
    }
    let best: Vec<&Value> = of("pareto").filter(|r| r["non_dominated"] == true).collect();
    assert!(!best.is_empty() && best.len() < of("pareto").count());
    assert!(of("bounds").count() > 1);
    let exact: Vec<&Value> = of("contacts").filter(|r| r["kind"] == "exact").collect();
    for question in
        ["triangles_meet", "triangle_contact", "triangle_meets_box", "boxes_meet", "box_pairs", "sweep_box", "ray_box"]
    {
        assert!(
            exact.iter().any(|r| r["question"] == question && r["missed"] == 0 && r["false_contacts"] == 0),
            "{question}"
        );
    }
    assert!(of("contacts").any(|r| r["kind"] == "conservative" && r["missed"] == 0 && r["late"] == 0));
    assert!(of("contacts").any(|r| r["kind"] == "lossy" && r["error"].as_f64() > Some(0.0)));
    for row in of("points") {
        assert!(row["missed_below"].as_f64() > Some(0.0), "{row}");
    }
    assert!(of("hard").count() > 1 && of("left_out").all(|r| r["feature"].is_string()));
    let page = fs::read_to_string(out.join("accuracy.md")).expect("written");
    assert!(
        page.contains("lossy") && page.contains("## Collision") && page.contains("`rays`, ") && page.len() < 60_000,
        "{}",
        page.len()
    );
}

#[test]
fn what_cannot_be_used_ends_in_exit_2_with_a_reason_and_no_files() {
    let dir = tempfile::tempdir().expect("a folder");
    let mesh = mesh(dir.path());
    let refuses = |args: &[&str], reason: &str| {
        let out = dir.path().join("none");
        let assert = kinora().args(["report", "--output"]).arg(&out).args(args).assert().code(2);
        let message = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(message.contains(reason), "{message}");
        assert!(!out.join("structures.json").exists());
    };
    refuses(&["weather"], "possible values: ");
    refuses(&["structures", "missing.glb"], "missing.glb");
    refuses(&["structures", &mesh, "--baseline", "missing.json"], "missing.json: cannot read");
    refuses(&["structures", &mesh, "--baseline", &mesh], "no report");
    let other = dir.path().join("other.json");
    fs::write(&other, r#"{"schema": 1, "kind": "frames", "rows": []}"#).expect("written");
    refuses(&["structures", &mesh, "--baseline", other.to_str().unwrap()], "of kind \"frames\"");
    fs::write(&other, r#"{"schema": 99}"#).expect("written");
    refuses(&["structures", &mesh, "--baseline", other.to_str().unwrap()], "schema version 99");
}

#[test]
fn an_output_that_is_no_folder_ends_in_exit_1_before_anything_is_measured() {
    let dir = tempfile::tempdir().expect("a folder");
    let mesh = mesh(dir.path());
    measure(&mesh, Path::new(&mesh), &[]).assert().code(1);
}

#[cfg(unix)]
#[test]
fn an_interrupt_leaves_no_file() {
    use std::{
        process::{Command as Process, Stdio},
        thread::sleep,
        time::Duration,
    };
    let dir = tempfile::tempdir().expect("a folder");
    let mut child = Process::new(assert_cmd::cargo::cargo_bin!("kinora"))
        .args(["report", "structures", "--output"])
        .arg(dir.path())
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("starts");
    sleep(Duration::from_millis(400));
    let id = child.id().to_string();
    assert!(Process::new("kill").args(["-INT", &id]).status().expect("kill runs").success());
    assert_eq!(child.wait().expect("ends").code(), Some(130));
    assert_eq!(fs::read_dir(dir.path()).expect("a folder").count(), 0);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "takes minutes without optimisation")]
fn the_papers_tables_stand_beside_ours_and_name_what_is_substituted() {
    let dir = tempfile::tempdir().expect("a folder");
    // Here no models are at hand.
    kinora().current_dir(&dir).args(["report", "papers", "--quick", "--output", "out"]).assert().success();
    let bytes = fs::read(dir.path().join("out/papers.json")).expect("written");
    let report: Value = serde_json::from_slice(&bytes).expect("JSON");
    let rows = report["rows"].as_array().expect("rows");
    let of = |table: &'static str| rows.iter().filter(move |r| r["table"] == table);
    for table in ["slabs", "lists", "lists-growth", "groups-memory", "groups-reads", "databases"] {
        assert!(of(table).count() > 1, "{table}");
    }
    for row in of("slabs").chain(of("groups-memory")).filter(|r| r["model"].is_string()) {
        assert_eq!(row["standing"], "substituted", "{row}");
    }
    let nodes = |structure: &'static str| {
        of("slabs")
            .filter(move |r| r["structure"] == structure && r["setup"] != "defaults")
            .map(|r| r["node_mebibytes"].as_f64().expect("a size"))
    };
    for (bvh2, ssh) in nodes("bvh2").zip(nodes("ssh")) {
        assert!((ssh / bvh2 - 0.25).abs() < 1e-12, "{ssh} of {bvh2}");
    }
    for row in of("lists").filter(|r| r["set"] == "primary" && r["structure"] == "lists, flat") {
        assert_eq!(row["tests_per_ray"], row["fewest_tests_per_ray"], "{row}");
    }
    let checks = report["checks"].as_array().expect("checks");
    assert!(checks.iter().all(|c| c["verdict"].is_string()) && checks.len() > 10);
    assert_eq!(report["plots"].as_array().map(Vec::len), Some(10));
}

/// Three frames of two triangles that part, as .tris.
fn sequence(folder: &Path) -> String {
    let folder = folder.join("parting");
    fs::create_dir_all(&folder).expect("a folder");
    for frame in 0..3_u8 {
        let mut bytes = b"TRI1".to_vec();
        bytes.extend(2_u32.to_le_bytes());
        for side in [-1.0_f32, 1.0] {
            let x = side * (0.1 + f32::from(frame));
            let corners = [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.2], [x, 1.0, 0.1]];
            bytes.extend(corners.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        }
        fs::write(folder.join(format!("frame_{frame:04}.tris")), bytes).expect("written");
    }
    folder.display().to_string()
}

#[test]
fn frames_are_reported_for_every_policy_with_equal_answers() {
    let dir = tempfile::tempdir().expect("a folder");
    let out = dir.path().join("report");
    let mut command = kinora();
    command.args(["report", "frames", &sequence(dir.path()), "--quick", "--check", "--threads", "2"]);
    command.args(["--policy", "rebuild,refit,async,swap-every=2", "--output"]).arg(&out).assert().success();
    let value: Value = serde_json::from_slice(&fs::read(out.join("frames.json")).expect("written")).expect("JSON");
    let rows = |table: &str| {
        let rows = value["rows"].as_array().expect("rows").iter();
        rows.filter(|row| row["table"] == table).cloned().collect::<Vec<_>>()
    };
    let summary = rows("summary");
    let policies: Vec<_> = summary.iter().map(|row| row["policy"].as_str().expect("a name").to_owned()).collect();
    assert_eq!(policies, ["rebuild", "refit", "async", "swap-every=2"]);
    assert!(summary.iter().all(|row| row["differences"] == 0 && row["scene"] == "parting"));
    assert!(summary[3]["swaps"].as_u64().expect("a count") > 10, "{}", summary[3]);
    assert_eq!(rows("frames").len(), 4 * 40);
    let markdown = fs::read_to_string(out.join("frames.md")).expect("written");
    assert!(markdown.contains("swap-every=2") && !markdown.contains("## Frames"), "{markdown}");
    assert!(out.join("trace-parting.svg").is_file());
}
