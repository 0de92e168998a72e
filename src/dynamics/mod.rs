//! Makes the next world: poses, deforms, refits, and takes trees that were rebuilt in the background.

use std::{sync::Arc, time::Duration};

use glam::DAffine3;

use crate::{anim::ActiveClip, scene::Scene, world::World};

/// Why a frame could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// A structure could not be built.
    #[error(transparent)]
    Build(#[from] crate::accel::BuildError),
    /// The background builder panicked.
    #[error("the background builder panicked: {0}")]
    BuilderPanicked(String),
}

/// Wall time of the stages before tracing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageTimes {
    /// Clips to node transforms.
    pub pose: Duration,
    /// Pose to vertices.
    pub deform: Duration,
    /// Structures to the new vertices.
    pub refit: Duration,
}

/// What the loop did since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoopCounts {
    /// Rebuilt trees swapped in.
    pub swaps: u64,
    /// Rebuilt trees dropped because they were stale.
    pub rebuilds_dropped: u64,
    /// Worst quality seen: surface-area cost over that of a fresh build.
    pub quality_max: f64,
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
    /// As `Async`, but a rebuild is begun every K frames and taken K frames later, whatever the timing.
    SwapEvery(u32),
}

/// Settings of a loop.
#[derive(Clone, Debug)]
pub struct FrameConfig {
    /// Structure over triangles, as `bvh2` or `bvh2:leaf=4`.
    pub accel: String,
    /// Structure over groups.
    pub top: String,
    /// How trees are kept good.
    pub policy: RebuildPolicy,
    /// Pool that deform, refit and synchronous builds run in.
    pub pool: Arc<rayon::ThreadPool>,
}

/// Poses actors and makes one [`World`] a frame.
#[derive(Debug)]
pub struct FrameLoop {}

impl FrameLoop {
    /// An empty loop.
    ///
    /// # Errors
    /// When a structure's name or setting is unknown.
    pub fn new(_config: FrameConfig) -> Result<Self, FrameError> {
        Ok(Self {})
    }

    /// Adds a scene placed by `world_from_scene`; the number of the actor.
    pub fn add(&mut self, _scene: Arc<Scene>, _world_from_scene: DAffine3) -> usize {
        0
    }

    /// Poses every actor (`clips[i]` for actor i, none for the rest pose) and returns the frame's world.
    ///
    /// # Errors
    /// When a build fails or the background builder panicked.
    pub fn advance(&mut self, _clips: &[&[ActiveClip]]) -> Result<(Arc<World>, StageTimes), FrameError> {
        unreachable!("skeleton")
    }

    /// What the loop did since it began.
    pub fn counts(&self) -> LoopCounts {
        LoopCounts::default()
    }
}
