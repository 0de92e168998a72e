//! Arbitrary bytes go through the importer; what it accepts must keep every promise of `Scene`.
#![no_main]

use kinora::scene::import;
use libfuzzer_sys::fuzz_target;

#[path = "../../tests/common/invariants.rs"]
mod invariants;

fuzz_target!(|data: &[u8]| {
    // Half of the URIs cannot be read, the others give back slices of the input.
    let mut resolve = |uri: &str| match uri.len() % 4 {
        0 => Err("not there".to_owned()),
        1 => Ok(data[data.len() / 2..].to_vec()),
        _ => Ok(data.to_vec()),
    };
    match import::from_bytes("fuzz.glb", data, &mut resolve) {
        Ok(scene) => invariants::check(&scene),
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
});
