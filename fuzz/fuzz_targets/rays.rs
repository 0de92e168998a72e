//! Every structure at every level against `list`, `list` against integers; see `tests/common/fuzz/rays.rs`.
#![no_main]
#![allow(dead_code, reason = "the modules serve several targets")]

use libfuzzer_sys::fuzz_target;

#[path = "../../tests/common/fuzz/decode.rs"]
mod decode;
#[path = "../../tests/common/integers.rs"]
mod integers;
#[path = "../../tests/common/fuzz/rays.rs"]
mod rays;
#[path = "../../tests/common/trace.rs"]
mod trace;

fuzz_target!(|data: &[u8]| rays::check(data));
