//! Counts of every public asset agree with the table that came with them.

mod common;

use std::{fs, path::Path};

use kinora::scene::{
    Scene,
    import::{ImportError, from_path},
};

/// One row of the table, `drawn` equal to `triangles` where the table has no brackets.
#[derive(Debug)]
struct Row {
    path: String,
    exercises: String,
    triangles: usize,
    drawn: usize,
    vertices: usize,
    joints: String,
    animations: String,
}

fn number(text: &str) -> Option<usize> {
    text.replace(',', "").parse().ok()
}

fn rows(table: &str) -> Vec<Row> {
    let row = |line: &str| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let path = cells[0].to_owned();
        let is_scene = Path::new(&path).extension().is_some_and(|e| e == "gltf" || e == "glb");
        if cells.len() < 10 || !is_scene {
            return None;
        }
        let (triangles, drawn) = match cells[2].split_once(" (") {
            Some((once, drawn)) => (number(once)?, number(drawn.trim_end_matches(')'))?),
            None => (number(cells[2])?, number(cells[2])?),
        };
        let [exercises, joints, animations] = [cells[1], cells[4], cells[5]].map(str::to_owned);
        Some(Row { path, exercises, triangles, drawn, vertices: number(cells[3])?, joints, animations })
    };
    table.lines().filter(|l| l.starts_with("| ")).filter_map(row).collect()
}

fn compare(row: &Row, scene: &Scene) -> Result<(), String> {
    let parts = || scene.meshes.iter().flat_map(|m| &m.parts);
    let equal = |what: &str, ours: usize, theirs: usize| {
        if ours == theirs { Ok(()) } else { Err(format!("{what}: {ours}, the table says {theirs}")) }
    };
    equal("triangles", parts().map(|p| p.triangles.len()).sum(), row.triangles)?;
    equal("triangles drawn", scene.triangles_drawn(), row.drawn)?;
    equal("vertices", parts().map(|p| p.positions.len()).sum(), row.vertices)?;
    let joints: Vec<usize> = scene.skins.iter().map(|s| s.joints.len()).collect();
    let (skins, each) = match row.joints.split_once(" skins × ") {
        Some((skins, each)) => (number(skins).ok_or("skins")?, number(each).ok_or("joints")?),
        None => (joints.len(), number(&row.joints).unwrap_or(0)),
    };
    equal("skins", joints.len(), skins)?;
    equal("joints", joints.iter().copied().max().unwrap_or(0), each)?;
    compare_animations(row, scene)
}

/// `3: Survey 3.417 s, Walk 0.708 s, Run 1.158 s`, `9: 1.667–1.708 s` (a range), `1: 2 s` (no name).
fn compare_animations(row: &Row, scene: &Scene) -> Result<(), String> {
    let Some((count, list)) = row.animations.split_once(": ") else {
        return if scene.clips.is_empty() { Ok(()) } else { Err(format!("{} animations", scene.clips.len())) };
    };
    if number(count) != Some(scene.clips.len()) {
        return Err(format!("{} animations, the table says {count}", scene.clips.len()));
    }
    if let Some(clip) = scene.clips.iter().find(|c| c.disabled.is_some()) {
        return Err(format!("animation `{}` is disabled: {:?}", clip.name, clip.disabled));
    }
    let near = |ours: f64, theirs: f64| (ours - theirs).abs() <= 0.0005 + 1e-9;
    let durations = || scene.clips.iter().map(|c| c.duration_s);
    if let Some((low, high)) = list.trim_end_matches(" s").split_once('–') {
        let bound = |text: &str| text.parse::<f64>().map_err(|e| e.to_string());
        let (low, high) = (bound(low)?, bound(high)?);
        let (least, most) = (durations().fold(f64::MAX, f64::min), durations().fold(0.0, f64::max));
        return if near(least, low) && near(most, high) { Ok(()) } else { Err(format!("{least} to {most} s")) };
    }
    for (clip, text) in scene.clips.iter().zip(list.split(", ")) {
        let text = text.trim_end_matches(" s");
        let (name, duration) = text.rsplit_once(' ').unwrap_or(("", text));
        let theirs: f64 = duration.parse().map_err(|_| format!("`{text}` is no duration"))?;
        if !near(clip.duration_s, theirs) || (!name.is_empty() && name != clip.name) {
            return Err(format!("animation `{}` of {} s, the table says `{text}`", clip.name, clip.duration_s));
        }
    }
    Ok(())
}

#[test]
fn counts_agree_with_the_table_of_assets() {
    let Some(shared) = common::shared_dir() else { return };
    let assets = shared.join("assets");
    let rows = rows(&fs::read_to_string(assets.join("ASSETS.md")).expect("readable"));
    assert!(rows.len() >= 85, "{} rows", rows.len());
    let mut faults = Vec::new();
    let mut loaded = 0;
    for row in &rows {
        let needs_draco = row.exercises.contains("KHR_draco_mesh_compression!");
        match from_path(&assets.join(&row.path)) {
            Err(ImportError::Unsupported { extension, .. }) if needs_draco && extension.contains("draco") => {}
            Err(error) => faults.push(error.to_string()),
            Ok(_) if needs_draco => faults.push(format!("{}: loads although it requires Draco", row.path)),
            Ok(scene) => {
                loaded += 1;
                if let Err(fault) = compare(row, &scene) {
                    faults.push(format!("{}: {fault}", row.path));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(loaded >= 80, "{loaded} files loaded");
}
