//! Makes the next world: poses, deforms, refits, and takes trees that were rebuilt in the background.
//!
//! [`FrameLoop`] holds actors (scenes at places) and makes one [`World`](crate::world::World) a frame. Only
//! actors whose clips or times changed are posed, only groups that then moved are deformed and refitted.
//! Buffers turn in pools; what a reader holds is never written.

mod actor;
mod builder;
mod config;
mod deform;
mod frame_loop;
mod group;
mod grouping;
mod layout;
mod phases;
mod pool;
mod rigid;
mod stage;
mod sync;
#[cfg(test)]
mod tests;
mod worker;

pub use config::{FrameConfig, FrameError, FrameState, LoopCounts, Playing, RebuildPolicy, StageTimes};
pub use frame_loop::FrameLoop;
pub(crate) use pool::Pool;
