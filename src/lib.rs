//! Plays, renders and queries animated glTF scenes by ray tracing on the CPU.
//!
//! A file becomes an immutable [`scene::Scene`]; [`anim`] evaluates its clips into a pose and deforms
//! vertices; [`dynamics`] turns the pose into the next [`world::World`], refitting what deformed and
//! taking rebuilt trees; [`render`] shoots rays at a world and [`output`] writes frames.
//!
//! Coordinates are glTF's: right-handed, +Y up, metres; times are seconds as `f64`. Colours are linear
//! Rec. 709 unless a name says sRGB.
#![deny(unsafe_code)]
#![deny(clippy::print_stdout)]

pub use {glam, rayon};

#[cfg(test)]
extern crate self as kinora;

pub mod accel;
pub mod anim;
pub mod collide;
pub mod dynamics;
mod error;
pub mod geom;
pub mod output;
#[cfg(feature = "player")]
pub mod player;
pub mod render;
pub mod report;
pub mod scene;
#[expect(unsafe_code, reason = "the only home of intrinsics and of the dispatch into them")]
pub mod simd;
pub mod world;

pub use error::{Error, Result};

/// The commands and the example of the README are tested with the documentation.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
