//! Refitted structures against fresh ones; see `tests/common/fuzz/refit.rs`.
#![no_main]
#![allow(dead_code, reason = "the modules serve several targets")]

use libfuzzer_sys::fuzz_target;

#[path = "../../tests/common/fuzz/decode.rs"]
mod decode;
#[path = "../../tests/common/integers.rs"]
mod integers;
#[path = "../../tests/common/fuzz/rays.rs"]
mod rays;
#[path = "../../tests/common/fuzz/refit.rs"]
mod refit;
#[path = "../../tests/common/trace.rs"]
mod trace;

fuzz_target!(|data: &[u8]| refit::check(data));
