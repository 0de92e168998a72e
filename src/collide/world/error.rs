use crate::{accel::BuildError, simd::FloatModeError};

use super::{ObjectId, PartId};

/// What is wrong with a request.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CollideError {
    /// A structure's name or setting is unknown, or it cannot be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// Foreign code changed how this thread computes.
    #[error(transparent)]
    FloatMode(#[from] FloatModeError),
    /// An object that was never added, or was removed.
    #[error("there is no object {}", .0.0)]
    NoSuchObject(ObjectId),
    /// A part that does not exist.
    #[error("there is no part {}; there are {count}", part.0)]
    NoSuchPart {
        /// The part.
        part: PartId,
        /// How many there are.
        count: usize,
    },
    /// A triangle that does not exist.
    #[error("part {} has no triangle {triangle}; it has {count}", part.0)]
    NoSuchTriangle {
        /// The part.
        part: PartId,
        /// The triangle.
        triangle: u32,
        /// How many there are.
        count: usize,
    },
    /// A clip that the object's scene does not have.
    #[error("object {}: there is no clip {clip}; there are {count}", object.0)]
    NoSuchClip {
        /// The object.
        object: ObjectId,
        /// The clip.
        clip: u32,
        /// How many there are.
        count: usize,
    },
    /// A number that is NaN or infinite where none may be.
    #[error("{what}: not a finite number")]
    NotFinite {
        /// What the number belongs to.
        what: &'static str,
    },
    /// A number that is out of its range.
    #[error("{what}: {value} is out of range")]
    OutOfRange {
        /// What the number says.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// A box without an inside, or with NaN.
    #[error("{what}: an empty box")]
    EmptyBox {
        /// What the box is.
        what: &'static str,
    },
    /// A list of another length than is needed.
    #[error("{what}: {actual} given, {expected} needed")]
    Count {
        /// What is listed.
        what: &'static str,
        /// How many are given.
        actual: usize,
        /// How many are needed.
        expected: usize,
    },
    /// A triangle of a mesh names a vertex that does not exist.
    #[error("triangle {triangle}: vertex {vertex} of {count}")]
    IndexOutOfRange {
        /// The triangle.
        triangle: usize,
        /// The vertex that it names.
        vertex: u32,
        /// How many there are.
        count: usize,
    },
    /// More than 32-bit numbers allow for.
    #[error("{actual} {what}, at most {limit} fit")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// Number given.
        actual: usize,
        /// Largest number that fits.
        limit: usize,
    },
    /// A vertex lies where f32 ends, so its place is not known.
    #[error("object {}, part {}: a vertex lies at or beyond the end of f32", object.0, part.0)]
    BeyondF32 {
        /// The object.
        object: ObjectId,
        /// The part.
        part: PartId,
    },
    /// Vertices can be set for meshes and boxes only.
    #[error("object {}: a scene's vertices follow from its pose", .0.0)]
    NotAMesh(ObjectId),
    /// Times and poses can be set for scenes only.
    #[error("object {}: a mesh has no clips and no pose", .0.0)]
    NotAScene(ObjectId),
    /// The pose was made for another scene.
    #[error("object {}: the pose belongs to another scene", .0.0)]
    PoseOfAnotherScene(ObjectId),
    /// A part has no inside: an edge is not shared by two triangles that run along it in opposite directions.
    #[error("part {} is not closed: the edge of vertices {} and {} {problem}", part.0, edge[0], edge[1])]
    NotClosed {
        /// The part.
        part: PartId,
        /// A vertex at either end of the edge.
        edge: [u32; 2],
        /// What is wrong with the edge.
        problem: &'static str,
    },
    /// A part whose triangles are not those of the other snapshot.
    #[error("part {} has other triangles in the other snapshot", .0.0)]
    OtherPart(PartId),
    /// A part without triangles, of which the question has no answer.
    #[error("part {} has no triangles", .0.0)]
    NoTriangles(PartId),
}
