//! The built-in scenes, made from nothing but this code.
//!
//! Shared with `tests/builtin.rs`, which checks that the files in `animations/` are what it makes.
#![expect(unreachable_pub, reason = "the module belongs to a program and to a test, not to a library")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers of vertices, texels and keys are small, and colours are clamped"
)]

pub mod atlas;
pub mod bake;
pub mod cloth;
pub mod explode;
pub mod figure;
pub mod glb;
pub mod maths;
pub mod nets;
pub mod png;
pub mod sdf;
pub mod shape;
pub mod tumble;

/// Every built-in scene: its name and the bytes of its `.glb`.
pub fn all() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("walk", figure::walk(1.0)),
        ("cloth", cloth::cloth()),
        ("explode", explode::explode()),
        ("tumble", tumble::tumble()),
    ]
}
