//! The import rules of ARCHITECTURE.md, read off the sources.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Module, and what else it may import besides itself, `geom` and `error`.
const MAY_IMPORT: &[(&str, &[&str])] = &[
    ("geom", &[]),
    ("simd", &[]),
    ("scene", &[]),
    ("anim", &["scene", "simd"]),
    ("accel", &["simd"]),
    ("world", &["accel", "anim", "scene", "simd"]),
    ("dynamics", &["world", "anim", "accel", "scene", "simd"]),
    ("collide", &["dynamics", "world", "anim", "accel", "scene", "simd"]),
    ("render", &["world", "scene", "anim", "accel", "simd"]),
    ("output", &["render", "dynamics", "world", "anim", "scene", "simd"]),
    ("report", &["collide", "output", "render", "dynamics", "world", "anim", "accel", "scene", "simd"]),
    ("player", &["collide", "output", "render", "dynamics", "world", "anim", "accel", "scene", "simd"]),
];

/// A word that names a foreign vocabulary, and the folders that may speak it.
const ROOMS: &[(&str, &[&str])] = &[
    ("gltf::", &["scene/import"]),
    ("winit::", &["player"]),
    ("softbuffer::", &["player"]),
    ("plotters::", &["report"]),
    ("clap::", &["cli", "main.rs"]),
    ("core::arch", &["simd"]),
    ("std::arch", &["simd"]),
];

fn sources(dir: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found
}

fn src() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// The code of a file: without comments, and without what follows `#[cfg(test)]`.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]").next().unwrap_or_default();
    text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// Splits at commas outside braces, up to the brace that closes what came before.
fn group_items(text: &str) -> Vec<&str> {
    let (mut depth, mut start, mut items) = (0, 0, Vec::new());
    for (at, c) in text.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => {
                items.push(&text[start..at]);
                return items;
            }
            '}' => depth -= 1,
            ',' if depth == 0 => {
                items.push(&text[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    items
}

/// Top-level modules named after `crate::`, also in grouped `use` lines.
fn imported(code: &str) -> Vec<String> {
    let mut modules = Vec::new();
    for (at, found) in code.match_indices("crate::") {
        let rest = &code[at + found.len()..];
        let items = rest.strip_prefix('{').map_or_else(|| vec![rest], group_items);
        for item in items {
            modules.push(item.trim().chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect());
        }
    }
    modules
}

#[test]
fn grouped_imports_are_read() {
    let names = imported("use crate::{accel::{a, b}, geom::Aabb,\n world};\nlet x = crate::scene::Scene;");
    assert_eq!(names, ["accel", "geom", "world", "scene"]);
}

#[test]
fn modules_import_only_what_lies_below_them() {
    for (module, allowed) in MAY_IMPORT {
        for path in sources(&src().join(module)) {
            for name in imported(&code(&path)) {
                let known = MAY_IMPORT.iter().any(|(m, _)| *m == name);
                let ok = !known || name == *module || name == "geom" || allowed.contains(&name.as_str());
                assert!(ok, "{}: `{module}` must not import `{name}`", path.display());
            }
        }
    }
}

#[test]
fn foreign_vocabularies_stay_in_their_rooms() {
    for path in sources(&src()) {
        let code = code(&path);
        let place = path.strip_prefix(src()).unwrap();
        for (word, homes) in ROOMS {
            let named = code
                .match_indices(word)
                .any(|(at, _)| !code[..at].ends_with(|c: char| c.is_ascii_alphanumeric() || c == '_' || c == ':'));
            assert!(!named || homes.iter().any(|h| place.starts_with(h)), "{}: names `{word}`", path.display());
        }
    }
}

#[test]
fn unsafe_code_lives_in_simd_only() {
    for path in sources(&src()) {
        let place = path.strip_prefix(src()).unwrap();
        let found = ["unsafe {", "unsafe fn", "unsafe impl"].iter().any(|w| code(&path).contains(w));
        assert!(!found || place.starts_with("simd"), "{}: unsafe outside src/simd", path.display());
    }
}
