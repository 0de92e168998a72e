//! Writes the built-in scenes of `animations/`.
//!
//! `cargo run --release --example make_scenes -- [--output DIR] [--large DIR]`
//!
//! `--output DIR` (default `animations`) gets the four scenes; `--large DIR` gets, instead, a figure of about
//! 100,000 triangles for speed measurements. The bytes are the same on every machine.

mod scenes;

use std::{path::Path, process::ExitCode};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments[..] {
        [] => write_all(Path::new("animations")),
        ["--output", folder] => write_all(Path::new(folder)),
        ["--large", folder] => write(Path::new(folder), "walk-large", &scenes::figure::walk(2.9)),
        _ => {
            eprintln!("usage: make_scenes [--output DIR | --large DIR]");
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn write_all(folder: &Path) -> std::io::Result<()> {
    scenes::all().iter().try_for_each(|(name, bytes)| write(folder, name, bytes))
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let path = folder.join(format!("{name}.glb"));
    std::fs::write(&path, bytes)?;
    println!("{}: {} bytes", path.display(), bytes.len());
    Ok(())
}
