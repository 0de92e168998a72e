//! Worlds of a few meshes; see `tests/common/fuzz/worlds.rs`.
#![no_main]
#![allow(dead_code, reason = "the modules serve several targets")]

use libfuzzer_sys::fuzz_target;

#[path = "../../tests/common/fuzz/decode.rs"]
mod decode;
#[path = "../../tests/common/integers.rs"]
mod integers;
#[path = "../../tests/common/trace.rs"]
mod trace;
#[path = "../../tests/common/fuzz/worlds.rs"]
mod worlds;

fuzz_target!(|data: &[u8]| worlds::check(data));
