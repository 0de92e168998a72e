//! World-space vertices as a `.pos` file: one line of JSON, then little-endian `f64`.
//!
//! The line names the parts in pose order with their vertex counts; x, y, z of every vertex follow, part after
//! part, with nothing between. The numbers are the `f32` that structures hold, widened.

use std::io::{self, Write};

use glam::Vec3;
use serde::{Serialize, Serializer};

use crate::{
    anim::{Pose, deform_parallel_as},
    geom::Precision,
    scene::{ClipId, PartInstance, Scene},
    simd::SimdLevel,
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

/// A pose and what a file of it says.
#[derive(Clone, Copy, Debug)]
pub struct PosFile<'a> {
    /// The scene, all of whose part instances are written.
    pub scene: &'a Scene,
    /// The pose they are in.
    pub pose: &'a Pose,
    /// The clips that the pose was evaluated with; goes into the header.
    pub clips: PosClips,
    /// The time that the pose was evaluated at in seconds, finite; goes into the header.
    pub time_s: f64,
    /// How vertices are computed.
    pub precision: Precision,
    /// SIMD level of the deform kernel; changes no byte.
    pub simd: SimdLevel,
}

impl PosFile<'_> {
    /// Writes the file, part instances in pose order. Deforms in the current rayon pool, one part in memory at a
    /// time.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        serde_json::to_writer(&mut *out, &self.header())?;
        out.write_all(b"\n")?;
        let mut positions = Vec::new();
        let mut bytes = Vec::new();
        for &instance in &self.scene.instances {
            positions.resize(self.scene.part(instance).positions.len(), Vec3::ZERO);
            deform_parallel_as(self.precision, self.simd, self.scene, self.pose, instance, &mut positions);
            bytes.clear();
            bytes.extend(positions.iter().flat_map(Vec3::to_array).flat_map(|x| f64::from(x).to_le_bytes()));
            out.write_all(&bytes)?;
        }
        Ok(())
    }

    fn header(&self) -> Header<'_> {
        let entry = |i: &PartInstance| PartEntry {
            node: i.node.0,
            mesh: i.mesh.0,
            primitive: i.part,
            instance: i.copy,
            count: self.scene.part(*i).positions.len(),
        };
        Header {
            format: "gltf-worldpos-1",
            source: &self.scene.file,
            generator: concat!("kinora ", env!("CARGO_PKG_VERSION")),
            animation: self.clips,
            times: [self.time_s],
            dtype: "<f8",
            primitives: self.scene.instances.iter().map(entry).collect(),
        }
    }
}
