//! Counts leaks of closed meshes, and judges hits by exact arithmetic.
//!
//! ```text
//! cargo run --release --example leak_proof -- --rays 1000000000 --judged 10000000 --aimed 10000000
//! cargo run --release --example leak_proof -- edges SCENE.tris RAYS.rays ORACLE.orc HITS.hits
//! ```
//!
//! The first form casts rays from inside closed meshes of 10^3 to 10^6 triangles: each that hits nothing is a leak. A part of
//! them, and rays aimed at corners and edges from inside and outside, is judged by `report::reference`. The second form takes the files of
//! `kinora cast` and of an oracle in f64 and says of every ray on which they differ who is right.

mod edges;
mod leaks;

use std::process::ExitCode;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let done = match words.split_first() {
        Some((first, files)) if first == "edges" => edges::run(files),
        _ => leaks::run(&words),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(reason) => {
            eprintln!("{reason}");
            ExitCode::from(2)
        }
    }
}
