//! `kinora cast` on small files: hits, summary, refit over frames, and what it refuses.
#![cfg(feature = "cli")]
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

fn kinora() -> Command {
    Command::cargo_bin("kinora").expect("the program is built")
}

fn file(magic: &str, size: usize, numbers: &[f32]) -> Vec<u8> {
    let mut bytes = magic.as_bytes().to_vec();
    bytes.extend(((numbers.len() * 4 / size) as u32).to_le_bytes());
    bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
    bytes
}

/// Two triangles that share an edge, at a height.
fn square(z: f32) -> Vec<u8> {
    let (a, b, c, d) = ([0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]);
    file("TRI1", 36, &[a, b, c, a, c, d].concat())
}

/// Down onto the shared edge, onto the second triangle, past both, and one that is no ray.
fn rays() -> Vec<u8> {
    let down = |x: f32, y: f32| [x, y, 5.0, 0.0, 0.0, 0.0, -1.0, f32::INFINITY];
    file("RAY1", 32, &[down(0.5, 0.5), down(0.25, 0.75), down(2.0, 0.5), down(f32::NAN, 0.0)].concat())
}

fn records(path: &Path) -> Vec<(u32, [f32; 3])> {
    let bytes = std::fs::read(path).expect("the hits are written");
    assert_eq!(&bytes[..8], b"HIT1\x04\0\0\0");
    let word = |r: &[u8], i: usize| [r[i], r[i + 1], r[i + 2], r[i + 3]];
    let number = |r: &[u8], i: usize| f32::from_le_bytes(word(r, i));
    let hit = |r: &[u8]| (u32::from_le_bytes(word(r, 0)), [number(r, 4), number(r, 8), number(r, 12)]);
    bytes[8..].chunks_exact(16).map(hit).collect()
}

#[test]
fn hits_of_the_last_frame_are_written_and_summed_up() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = |name: &str| dir.path().join(name);
    std::fs::write(path("a.tris"), square(0.0)).expect("written");
    std::fs::write(path("b.tris"), square(1.0)).expect("written");
    std::fs::write(path("r.rays"), rays()).expect("written");
    for (accel, packet) in [("list", false), ("bvh2", false), ("bvh2", true), ("bvh8", false), ("bvh8", true)] {
        let mut command = kinora();
        command.arg("cast").args([path("a.tris"), path("b.tris")]).arg("--rays").arg(path("r.rays"));
        command.arg("--hits").arg(path("h.hits")).args(["--accel", accel, "--repeat", "3", "--json", "--threads", "1"]);
        if packet {
            command.arg("--packet");
        }
        let output = command.assert().success().get_output().stdout.clone();
        let json: Value = serde_json::from_slice(&output).expect("one JSON object");
        for (key, due) in [("triangles", 2), ("rays", 4), ("hits", 2), ("threads", 1)] {
            assert_eq!(json[key], due, "{key}");
        }
        assert_eq!(json["accel"], accel);
        assert_eq!(
            (&json["build"], &json["layout"], &json["precision"]),
            (&"sah".into(), &"full".into(), &"exact".into())
        );
        assert!(json["refit_ms"].is_f64() && json["build_ms"].is_f64() && json["mrays_per_s"].is_f64());
        let hits = records(&path("h.hits"));
        assert_eq!(hits[0], (0, [4.0, 0.0, 0.5]), "the lower triangle of two that share the point");
        assert_eq!(hits[1], (1, [4.0, 0.25, 0.5]));
        assert_eq!((hits[2].0, hits[3].0), (u32::MAX, u32::MAX));
    }
    let blocked = |extra: &[&str]| {
        let mut command = kinora();
        command.arg("cast").arg(path("a.tris")).arg("--rays").arg(path("r.rays")).arg("--hits").arg(path("h.hits"));
        command.arg("--any-hit").args(extra).assert().success();
        records(&path("h.hits")).iter().map(|h| h.0).collect::<Vec<_>>()
    };
    assert_eq!(blocked(&[]), [0, 0, u32::MAX, u32::MAX]);
    assert_eq!(blocked(&["--packet"]), [0, 0, u32::MAX, u32::MAX]);
    assert_eq!(blocked(&["--precision", "fast"]), [0, 0, u32::MAX, u32::MAX]);
    for accel in ["list", "bvh2", "ssh"] {
        let mut command = kinora();
        command.arg("cast").arg(path("a.tris")).arg("--rays").arg(path("r.rays"));
        let output = command.args(["--accel", accel, "--precision", "fast", "--json"]).assert().success();
        let json: Value = serde_json::from_slice(&output.get_output().stdout).expect("one JSON object");
        assert_eq!((&json["precision"], &json["hits"]), (&"fast".into(), &2.into()), "{accel}");
    }
}

#[test]
fn what_cannot_be_used_ends_in_exit_2_with_a_reason() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = |name: &str| dir.path().join(name);
    std::fs::write(path("a.tris"), square(0.0)).expect("written");
    std::fs::write(path("short.tris"), &square(0.0)[..40]).expect("written");
    std::fs::write(path("one.tris"), file("TRI1", 36, &[0.0; 9])).expect("written");
    std::fs::write(path("r.rays"), rays()).expect("written");
    let refuses = |geometry: &[&str], extra: &[&str], reason: &str| {
        let mut command = kinora();
        command.arg("cast").args(geometry.iter().map(|g| path(g))).arg("--rays").arg(path("r.rays")).args(extra);
        let assert = command.assert().code(2);
        let message = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(message.contains(reason), "{message}");
    };
    refuses(&["short.tris"], &[], "2 records of 36 bytes announced, 32 bytes found");
    refuses(&["a.tris", "one.tris"], &[], "1 triangles, but");
    refuses(&["r.rays"], &[], "r.rays");
    refuses(&["a.tris"], &["--build", "fast"], "possible values: sah");
    refuses(&["a.tris"], &["--layout", "compact"], "possible values: full");
    refuses(&["missing.ply"], &[], "cannot read");
}
