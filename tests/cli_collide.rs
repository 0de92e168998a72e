//! `kinora collide`: lines, levels, filters, exit codes.
#![cfg(feature = "cli")]

use std::{collections::BTreeMap, process::Output};

use serde_json::Value;

fn run(args: &[&str]) -> Output {
    let mut command = assert_cmd::Command::cargo_bin("kinora").expect("the program is built");
    command.arg("collide").args(args).output().expect("it runs")
}

fn lines(args: &[&str]) -> Vec<Value> {
    let out = run(args);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8(out.stdout).expect("UTF-8");
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

fn error(args: &[&str]) -> String {
    let out = run(args);
    assert_eq!(out.status.code(), Some(2), "{args:?}");
    assert!(out.stdout.is_empty());
    String::from_utf8(out.stderr).expect("UTF-8")
}

#[test]
fn contacts_begin_once_persist_and_end() {
    let lines = lines(&["builtin:tumble", "--frames", "0..12"]);
    assert!(!lines.is_empty());
    let mut touching: BTreeMap<String, u64> = BTreeMap::new();
    for line in &lines {
        let frame = line["frame"].as_u64().expect("a frame");
        assert!((line["time_s"].as_f64().expect("a time") - frame as f64 / 30.0).abs() < 1e-12);
        assert!(line["a"]["node"].is_string() && line["b"]["part"].is_u64(), "{line}");
        assert!(line["point"].as_array().is_some_and(|p| p.len() == 3) && line["depth"].as_f64().is_some(), "{line}");
        assert!(line.get("toi_s").is_none());
        let key = format!("{} {}", line["a"], line["b"]);
        let before = touching.insert(key.clone(), frame);
        match line["kind"].as_str() {
            Some("begin") => assert_eq!(before, None, "{line}"),
            Some("persist") => assert_eq!(before, Some(frame - 1), "{line}"),
            Some("end") => {
                assert_eq!((before, &line["triangles"]), (Some(frame - 1), &Value::from(0)), "{line}");
                touching.remove(&key);
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn triangles_and_pairs_narrow_what_parts_say() {
    let parts = lines(&["--frames", "1"]);
    let triangles = lines(&["--frames", "1", "--level", "triangle"]);
    let count: u64 = parts.iter().filter_map(|l| l["triangles"].as_u64()).sum();
    assert_eq!(triangles.len() as u64, count);
    assert!(triangles.iter().all(|l| l["triangles"].as_array().is_some_and(|t| t.len() == 2)));
    let (a, b) = (&parts[0]["a"]["node"], &parts[0]["b"]["node"]);
    let last = |path: &Value| path.as_str().expect("a path").rsplit('/').next().unwrap_or_default().to_owned();
    let filter = format!("{},{}", last(b), last(a));
    let some = lines(&["--frames", "1", "--pairs", &filter]);
    assert!(!some.is_empty() && some.len() < parts.len());
    assert!(some.iter().all(|l| l["a"]["node"] == *a && l["b"]["node"] == *b));
}

#[test]
fn continuous_adds_times_within_the_step() {
    let lines = lines(&["builtin:tumble", "--frames", "0..3", "--continuous", "--threads", "1"]);
    assert!(lines.iter().any(|l| l["frame"].as_u64() > Some(0)));
    for line in &lines {
        let (time, toi) = (line["time_s"].as_f64().expect("a time"), &line["toi_s"]);
        if line["kind"] == "end" {
            assert!(toi.is_null(), "{line}");
        } else {
            let toi = toi.as_f64().expect("a time");
            assert!(toi <= time + 1e-12 && toi >= time - 1.0 / 30.0 - 1e-12, "{line}");
        }
    }
}

#[test]
fn wrong_input_ends_in_2_with_a_reason() {
    assert!(error(&["none.glb"]).contains("none.glb"));
    assert!(error(&["--pairs", "figure,no such node"]).contains("no such node"));
    assert!(error(&["--pairs", "no such node,figure"]).contains("there are `"), "names that would do");
    assert!(error(&["--pairs", "figure"]).contains("--pairs"));
    assert!(error(&["--level", "vertex"]).contains("vertex"));
    assert!(error(&["--continuous", "--tolerance=-1"]).contains("--tolerance"));
    assert!(error(&["--tolerance", "1"]).contains("--continuous"));
    assert!(error(&["--frames", "5..1"]).contains("5..1"));
    assert!(error(&["--precision", "fast"]).contains("exact"));
}
