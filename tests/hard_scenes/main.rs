//! The twelve hard scenes, each with its own pass criterion, over every structure.
//!
//! `cargo test --release --test hard_scenes` takes shares of the counts that prove something; all of them:
//!
//! ```text
//! KINORA_HARD_SCENES=full cargo test --release --test hard_scenes -- --nocapture --test-threads 1
//! ```
//!
//! That takes hours; `KINORA_HARD_SCENES=60` takes as many of those rays as fit into 60 seconds a trial, and says how many they were.
//! `KINORA_HARD_SCENES_KINDS=bvh8,bvh2` takes these structures only.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "../common/ccd.rs"]
mod ccd;
#[path = "../common/mod.rs"]
mod common;
#[path = "../common/scenes.rs"]
#[allow(dead_code, unreachable_pub, reason = "shared with other test files")]
mod scenes;
#[path = "../common/stage.rs"]
mod stage;
#[path = "../common/trace.rs"]
mod trace;

mod fast;
mod meshes;
mod trial;

mod h01_watertight;
mod h02_lattice;
mod h03_far_away;
mod h04_stadium;
mod h05_needles;
mod h06_coplanar;
mod h07_grazing;
mod h08_closed_box;
mod h09_flat;
mod h10_range;
mod h11_motion;
mod h12_contact;
