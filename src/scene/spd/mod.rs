//! The Standard Procedural Databases: scenes that are numbers, not files.
//!
//! [`SpdKind::generate`] lists a scene's primitives at a size factor: spheres, cones, polygons and triangles in f64,
//! with materials, lights, camera and background; [`SpdScene::tessellate`] turns them into a [`Scene`](super::Scene).
//!
//! # Source
//! E. Haines, "A Proposal for Standard Graphics Environments", 1987, and the package's versions 3.4 to 3.15 (not
//! copyrighted, free to use). The scenes are made again from the package's numbers. They stay in its coordinates,
//! right-handed with +Z up in most scenes.

mod balls;
mod gears;
mod jacks;
mod lattice;
mod mesh;
mod mount;
mod object;
mod rings;
mod rotate;
mod teapot;
mod teapot_net;
mod tessellate;
mod tetra;
mod tree;

#[cfg(test)]
mod tests;

pub use object::{SpdObject, SpdScene, SpdShape, SpdSurface, SpdView};

use glam::DVec3;

/// Which of the databases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SpdKind {
    /// A flake of mirroring spheres on a floor.
    Balls,
    /// Meshed gears, some of glass; their faces are concave polygons of 144 corners.
    Gears,
    /// A fractal mountain under four glass spheres.
    Mount,
    /// A pyramid of interlocked rings of spheres and cylinders before a wall.
    Rings,
    /// A recursive tetrahedron.
    Tetra,
    /// A tree of cones and spheres on a large field.
    Tree,
    /// The teapot on a checkerboard.
    Teapot,
    /// A cubic lattice of spheres joined by cylinders, seen from within.
    Lattice,
    /// Nested crosses of cylinders with spheres at their ends.
    Jacks,
}

/// Why a scene was not made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("size {size} is not in 1..={max}")]
pub struct SpdSizeError {
    /// The size factor asked for.
    pub size: u32,
    /// The largest one.
    pub max: u32,
}

impl SpdKind {
    /// All databases.
    pub const ALL: [Self; 9] = [
        Self::Balls,
        Self::Gears,
        Self::Mount,
        Self::Rings,
        Self::Tetra,
        Self::Tree,
        Self::Teapot,
        Self::Lattice,
        Self::Jacks,
    ];

    /// Name in lower case, as the package calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Balls => "balls",
            Self::Gears => "gears",
            Self::Mount => "mount",
            Self::Rings => "rings",
            Self::Tetra => "tetra",
            Self::Tree => "tree",
            Self::Teapot => "teapot",
            Self::Lattice => "lattice",
            Self::Jacks => "jacks",
        }
    }

    /// The database of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// The size factor that published statistics use; below 10,000 objects.
    pub fn default_size(self) -> u32 {
        match self {
            Self::Balls | Self::Gears => 4,
            Self::Mount | Self::Tetra => 6,
            Self::Rings => 7,
            Self::Tree => 11,
            Self::Teapot | Self::Lattice => 12,
            Self::Jacks => 1,
        }
    }

    /// The largest size factor: about a million objects at most.
    pub fn max_size(self) -> u32 {
        match self {
            Self::Balls | Self::Jacks => 6,
            Self::Gears | Self::Tree => 18,
            Self::Mount => 9,
            Self::Rings => 36,
            Self::Tetra => 10,
            Self::Teapot => 120,
            Self::Lattice => 61,
        }
    }

    /// Number of objects at a size factor; meaningful in `1..=max_size`.
    pub fn object_count(self, size: u32) -> u64 {
        let n = u64::from(size);
        match self {
            Self::Balls => 1 + (0..=size).map(|k| 9u64.pow(k)).sum::<u64>(),
            Self::Gears => 146 * n.pow(3) + 1,
            Self::Mount => 2 * 4u64.pow(size) + 4,
            Self::Rings => 10 * n * (n + 1) * (2 * n + 1) + 1,
            Self::Tetra => 4u64.pow(size),
            Self::Tree => 2 * (2u64.pow(size + 1) - 1) + 1,
            Self::Teapot => 64 * n * n - 8 * n + n * n,
            Self::Lattice => (n + 1).pow(3) + 3 * n * (n + 1).pow(2),
            Self::Jacks => 9 * (0..size).map(|k| 8u64.pow(k)).sum::<u64>(),
        }
    }

    /// Makes the scene.
    ///
    /// # Errors
    /// When `size` is 0 or above [`SpdKind::max_size`].
    pub fn generate(self, size: u32) -> Result<SpdScene, SpdSizeError> {
        let max = self.max_size();
        if size == 0 || size > max {
            return Err(SpdSizeError { size, max });
        }
        let mut scene = SpdScene::empty(self, size);
        match self {
            Self::Balls => balls::make(&mut scene),
            Self::Gears => gears::make(&mut scene),
            Self::Mount => mount::make(&mut scene),
            Self::Rings => rings::make(&mut scene),
            Self::Tetra => tetra::make(&mut scene),
            Self::Tree => tree::make(&mut scene),
            Self::Teapot => teapot::make(&mut scene),
            Self::Lattice => lattice::make(&mut scene),
            Self::Jacks => jacks::make(&mut scene),
        }
        Ok(scene)
    }
}

/// The sky of most scenes.
const SKY: DVec3 = DVec3::new(0.078, 0.361, 0.753);
