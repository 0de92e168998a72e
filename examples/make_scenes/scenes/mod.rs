#![expect(dead_code, reason = "scenes being added use the rest")]
//! The built-in scenes, made from nothing but this code.

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

/// Every built-in scene: its name and the bytes of its `.glb`.
pub fn all() -> Vec<(&'static str, Vec<u8>)> {
    vec![("walk", figure::walk(1.0)), ("cloth", cloth::cloth()), ("explode", explode::explode())]
}
