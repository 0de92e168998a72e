//! Geometry from files: soups of corners, welded into one indexed mesh over all frames.

pub(crate) mod bytes;
mod mesh_files;

use std::{collections::HashMap, path::Path};

use kinora::{
    anim::{Pose, deform},
    glam::{DAffine3, Vec3},
};

use super::{error::CliError, scene, settings::Settings};

/// Triangles over vertices that have a place in every frame.
#[derive(Debug)]
pub(crate) struct Frames {
    /// Positions by frame.
    pub(crate) positions: Vec<Vec<Vec3>>,
    /// Corners of each triangle.
    pub(crate) indices: Vec<[u32; 3]>,
}

/// Reads all frames and welds corners whose bits agree in every one.
///
/// # Errors
/// A usage error naming the file and what is wrong with it.
pub(crate) fn read(files: &[String], settings: &Settings) -> Result<Frames, CliError> {
    let mut frames = Vec::with_capacity(files.len());
    for file in files {
        let corners = read_corners(file, settings)?;
        if corners.len() >= u32::MAX as usize {
            return Err(CliError::usage(format!(
                "{file}: {} triangles, at most {} fit",
                corners.len() / 3,
                u32::MAX / 3
            )));
        }
        let first: &Vec<Vec3> = frames.first().unwrap_or(&corners);
        if first.len() != corners.len() {
            let (due, found) = (first.len() / 3, corners.len() / 3);
            return Err(CliError::usage(format!("{file}: {found} triangles, but {} has {due}", files[0])));
        }
        frames.push(corners);
    }
    Ok(weld(&frames))
}

/// True for a file of triangles alone, false for a scene.
pub(crate) fn is_mesh(file: &str) -> bool {
    matches!(extension(file).as_deref(), Some("tris" | "ply" | "obj" | "stl"))
}

fn extension(file: &str) -> Option<String> {
    Path::new(file).extension().map(|e| e.to_ascii_lowercase().to_string_lossy().into_owned())
}

/// Three corners a triangle, in file order.
fn read_corners(file: &str, settings: &Settings) -> Result<Vec<Vec3>, CliError> {
    let path = Path::new(file);
    match extension(file).as_deref() {
        Some("tris") => {
            let content = bytes::read(path)?;
            let mut floats = bytes::floats(bytes::records(path, &content, "TRI1", 36)?);
            let mut next = || Some(Vec3::new(floats.next()?, floats.next()?, floats.next()?));
            Ok(std::iter::from_fn(&mut next).collect())
        }
        Some("ply") => mesh_files::ply(path, &bytes::read(path)?),
        Some("obj") => mesh_files::obj(path, &bytes::read(path)?),
        Some("stl") => mesh_files::stl(path, &bytes::read(path)?),
        _ => scene_corners(file, settings),
    }
}

/// The rest pose of a scene.
fn scene_corners(file: &str, settings: &Settings) -> Result<Vec<Vec3>, CliError> {
    let scene = scene::load(Some(file), settings)?;
    let mut pose = Pose::rest(&scene);
    pose.evaluate(&scene, &[], &DAffine3::IDENTITY);
    let mut corners = Vec::with_capacity(3 * scene.triangles_drawn());
    for &instance in &scene.instances {
        let part = scene.part(instance);
        let mut positions = vec![Vec3::ZERO; part.positions.len()];
        deform(&scene, &pose, instance, &mut positions);
        corners.extend(part.triangles.iter().flatten().map(|&i| positions[i as usize]));
    }
    Ok(corners)
}

/// Gives equal numbers to corners with equal bits in every frame, in order of first appearance.
#[expect(clippy::cast_possible_truncation, reason = "there are fewer than 2^32 corners")]
fn weld(frames: &[Vec<Vec3>]) -> Frames {
    let count = frames[0].len();
    let mut classes = vec![0_u32; count];
    for frame in frames {
        let mut known = HashMap::with_capacity(count / 4);
        for (class, corner) in classes.iter_mut().zip(frame) {
            let next = known.len() as u32;
            *class = *known.entry((*class, corner.to_array().map(f32::to_bits))).or_insert(next);
        }
    }
    let vertices = classes.iter().max().map_or(0, |&m| m as usize + 1);
    let place = |frame: &Vec<Vec3>| {
        let mut positions = vec![Vec3::ZERO; vertices];
        for (&class, &corner) in classes.iter().zip(frame) {
            positions[class as usize] = corner;
        }
        positions
    };
    Frames { positions: frames.iter().map(place).collect(), indices: classes.as_chunks::<3>().0.to_vec() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_corners_that_agree_in_every_frame_are_welded() {
        let (a, b, c, d) = (Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z);
        let first = vec![a, b, c, b, a, d];
        let second = vec![a, b, c, b, d, d];
        let one = weld(std::slice::from_ref(&first));
        assert_eq!(one.indices, [[0, 1, 2], [1, 0, 3]]);
        assert_eq!(one.positions, [vec![a, b, c, d]]);
        let both = weld(&[first, second]);
        assert_eq!(both.indices, [[0, 1, 2], [1, 3, 4]]);
        assert_eq!(both.positions[1], [a, b, c, d, d]);
    }

    #[test]
    fn zeros_of_different_sign_stay_apart() {
        let frames = weld(&[vec![Vec3::ZERO, -Vec3::ZERO, Vec3::X]]);
        assert_eq!(frames.indices, [[0, 1, 2]]);
    }
}
