//! World-space vertices as a `.pos` file: one line of JSON, then little-endian `f64`.
//!
//! The line names the parts in pose order with their vertex counts; x, y, z of every vertex follow, part after
//! part, with nothing between. The numbers are the `f32` that structures hold, widened.

use std::io::{self, Write};

use glam::Vec3;
use serde::{Serialize, Serializer};

use crate::{
    anim::{Pose, deform_parallel},
    scene::{ClipId, PartInstance, Scene},
};

/// Which clips a pose was evaluated with, for the header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PosClips {
    /// The rest pose.
    None,
    /// One clip.
    One(ClipId),
    /// Every clip together.
    All,
}

impl Serialize for PosClips {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::None => serializer.serialize_str("none"),
            Self::One(clip) => serializer.serialize_u32(clip.0),
            Self::All => serializer.serialize_str("all"),
        }
    }
}

#[derive(Serialize)]
struct Header<'a> {
    format: &'static str,
    source: &'a str,
    generator: &'static str,
    animation: PosClips,
    times: [f64; 1],
    dtype: &'static str,
    primitives: Vec<PartEntry>,
}

#[derive(Serialize)]
struct PartEntry {
    node: u32,
    mesh: u32,
    primitive: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    instance: Option<u32>,
    count: usize,
}

/// Writes every part instance of `scene` as it is at `pose`, in pose order.
///
/// `clips` and `time_s` (finite) only go into the header. Deforms in the current rayon pool, one part in memory at
/// a time.
///
/// # Errors
/// Those of `out`.
pub fn write_pos(scene: &Scene, pose: &Pose, clips: PosClips, time_s: f64, out: &mut impl Write) -> io::Result<()> {
    let entry = |i: &PartInstance| PartEntry {
        node: i.node.0,
        mesh: i.mesh.0,
        primitive: i.part,
        instance: i.copy,
        count: scene.part(*i).positions.len(),
    };
    let header = Header {
        format: "gltf-worldpos-1",
        source: &scene.file,
        generator: concat!("kinora ", env!("CARGO_PKG_VERSION")),
        animation: clips,
        times: [time_s],
        dtype: "<f8",
        primitives: scene.instances.iter().map(entry).collect(),
    };
    serde_json::to_writer(&mut *out, &header)?;
    out.write_all(b"\n")?;
    let mut positions = Vec::new();
    let mut bytes = Vec::new();
    for &instance in &scene.instances {
        positions.resize(scene.part(instance).positions.len(), Vec3::ZERO);
        deform_parallel(scene, pose, instance, &mut positions);
        bytes.clear();
        bytes.extend(positions.iter().flat_map(Vec3::to_array).flat_map(|x| f64::from(x).to_le_bytes()));
        out.write_all(&bytes)?;
    }
    Ok(())
}
