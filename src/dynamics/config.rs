use std::{fmt, sync::Arc, time::Duration};

use crate::{
    accel::events::Inversions,
    anim::{ActiveClip, Fade},
    geom::Forms,
};

/// Why a frame could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// A structure could not be built.
    #[error(transparent)]
    Build(#[from] crate::accel::BuildError),
    /// Foreign code changed how a thread computes.
    #[error(transparent)]
    FloatMode(#[from] crate::simd::FloatModeError),
    /// The background builder panicked. The loop goes on with the trees it has.
    #[error("the background builder panicked: {0}")]
    BuilderPanicked(String),
    /// The background builder could not be started.
    #[error("cannot start the background builder: {0}")]
    BuilderStart(#[source] std::io::Error),
    /// A vertex lies where f32 ends, so its place is not known.
    #[error("{file}: node {node}: a vertex lies at or beyond the end of f32 ({limit:e})", limit = f32::MAX)]
    OutOfRange {
        /// The scene's file.
        file: String,
        /// The glTF index of the node that places it.
        node: u32,
    },
    /// More than 32-bit numbers allow for.
    #[error("{actual} {what} are placed together, at most {limit} fit")]
    TooMany {
        /// What there is too much of: `triangles`, `vertices` or `instances`.
        what: &'static str,
        /// Number placed.
        actual: u64,
        /// Largest number that fits.
        limit: u64,
    },
}

/// Wall time of the stages before tracing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// Clips to node transforms.
    pub pose: Duration,
    /// Pose to vertices.
    pub deform: Duration,
    /// Structures to the new vertices, synchronous builds and the level over groups.
    pub refit: Duration,
    /// What of `refit` the level over groups took.
    pub sort: Duration,
}

impl StageTimes {
    /// All stages together.
    pub fn total(&self) -> Duration {
        self.pose + self.deform + self.refit
    }
}

/// What the loop did since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoopCounts {
    /// Frames made.
    pub frames: u64,
    /// Actors posed; an actor whose clips and times are those of the last frame is not.
    pub poses: u64,
    /// Groups whose vertices were computed; a group that no node, joint or weight moved is not.
    pub deforms: u64,
    /// Structures refitted, those of finished rebuilds included.
    pub refits: u64,
    /// Triangles whose place in a leaf was written by these refits.
    pub leaf_refits: u64,
    /// Parts that moved as a whole by their matrix and box alone.
    pub moves: u64,
    /// Structures built before tracing: first builds, and those of a policy or structure that cannot refit.
    pub builds: u64,
    /// Rebuilds handed to the background builder.
    pub rebuilds_begun: u64,
    /// Those of them that were to be ready soon rather than good: what moves fast gets trees of the fast builder.
    pub fast_rebuilds: u64,
    /// Rebuilt trees swapped in.
    pub swaps: u64,
    /// Levels over groups brought to a frame, by a refit or anew; a frame in which no group moved keeps the one it has.
    pub tops: u64,
    /// Those of them that sorted event lists: none unless the level over groups is `events`.
    pub event_sorts: u64,
    /// Rebuilt trees dropped because the triangles they were built over are gone, or because they were built for a motion that did not come and were worse
    /// than the tree in use.
    pub rebuilds_dropped: u64,
    /// Worst quality seen, at least 1: surface-area cost over that of the last fresh build of the same
    /// triangles, both relative to the area of the triangles' own boxes.
    pub quality_max: f64,
}

/// What the loop did for the last frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameState {
    /// The worst quality of any structure, as [`LoopCounts::quality_max`] has it.
    pub quality: f64,
    /// Rebuilt trees swapped in.
    pub swaps: u64,
    /// Structures built before tracing.
    pub builds: u64,
    /// The most frames that lie between a tree and the vertices that it was built from, over trees whose triangles have moved since.
    pub tree_age: u64,
    /// What it took to sort the event lists over groups again.
    pub inversions: Inversions,
}

/// What an actor plays in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Playing<'a> {
    /// The clips; none for the rest pose.
    pub clips: &'a [ActiveClip],
    /// What they are faded in from.
    pub fade: Option<Fade<'a>>,
}

/// How trees are kept good.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RebuildPolicy {
    /// Refit only.
    Refit,
    /// Rebuild every frame before tracing.
    Rebuild,
    /// Refit every frame, rebuild in the background when quality decays.
    #[default]
    Async,
    /// As `Async`, but what [`FrameLoop::learn`](super::FrameLoop::learn) has learnt of a clip beforehand serves while the clip plays.
    Auto,
    /// As `Async`, but a rebuild is begun every K frames (at least 1) and taken K frames later, whatever the
    /// timing and the quality.
    SwapEvery(u32),
}

impl fmt::Display for RebuildPolicy {
    /// The name on the command line and in reports.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refit => f.write_str("refit"),
            Self::Rebuild => f.write_str("rebuild"),
            Self::Async => f.write_str("async"),
            Self::Auto => f.write_str("auto"),
            Self::SwapEvery(every) => write!(f, "swap-every={every}"),
        }
    }
}

/// Settings of a loop.
#[derive(Clone, Debug)]
pub struct FrameConfig {
    /// Structure over triangles, as `bvh2` or `bvh2:leaf=4`.
    pub accel: String,
    /// Structure over groups: `bvh2` or `list`.
    pub top: String,
    /// How trees are kept good.
    pub policy: RebuildPolicy,
    /// How vertices are computed and rays answered: `Precision::Exact.into()` but for measurements.
    pub forms: Forms,
    /// Pool that deform, refit and synchronous builds run in.
    pub pool: Arc<rayon::ThreadPool>,
}
