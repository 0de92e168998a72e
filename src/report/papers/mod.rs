//! The papers' tables beside ours.

pub mod objects;
pub mod spd;
