//! Inputs that once broke something, and those that start the fuzz targets of the same names, through the same checks.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "common/fuzz/decode.rs"]
mod decode;
#[path = "common/integers.rs"]
mod integers;
#[path = "common/fuzz/rays.rs"]
mod rays;
#[path = "common/fuzz/refit.rs"]
mod refit;
#[path = "common/trace.rs"]
mod trace;
#[path = "common/fuzz/triangles.rs"]
mod triangles;
#[path = "common/fuzz/worlds.rs"]
mod worlds;

use std::{fs, path::Path};

use trace::Random;

/// Every committed input of a target, then some made of random bytes.
fn replay(target: &str, lengths: usize, check: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/fuzz").join(target);
    let mut files: Vec<_> = fs::read_dir(&folder).expect("inputs").map(|e| e.expect("an entry").path()).collect();
    files.sort();
    assert!(!files.is_empty(), "{} is empty", folder.display());
    for file in files {
        println!("{}", file.display());
        check(&fs::read(file).expect("a readable input"));
    }
    let mut random = Random(11);
    for length in 0..lengths {
        let input: Vec<u8> = (0..length * 3).map(|_| random.bits() as u8).collect();
        check(&input);
    }
}

#[test]
fn rays_are_answered_alike() {
    replay("rays", 120, rays::check);
}

#[test]
fn refitted_structures_answer_as_fresh_ones() {
    replay("refit", 120, refit::check);
}

#[test]
fn triangles_meet_as_integers_say() {
    replay("triangles", 120, triangles::check);
}

#[test]
fn worlds_answer_as_all_their_triangles_say() {
    replay("worlds", 40, worlds::check);
}
