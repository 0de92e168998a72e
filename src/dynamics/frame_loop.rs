use std::{fmt, sync::Arc, time::Instant};

use glam::DAffine3;

use super::{
    FrameConfig, FrameError, FrameState, LoopCounts, Playing, RebuildPolicy, StageTimes,
    builder::{self, Builder, Failure, Outcome},
    group::Group,
    grouping::Grouping,
    pool::Pool,
    stage::Stage,
};
use crate::{
    accel::{AccelSpec, BuildError},
    anim::ActiveClip,
    scene::{ClipId, Scene},
    simd::check_float_mode,
    world::{TopKind, World},
};

/// A background rebuild is begun when a structure will have decayed to this by the time that it is ready.
const DECAYED: f64 = 1.1;

/// Rebuilds are handed to the builder until this many triangles wait there; at least one is.
const QUEUED_TRIANGLES: usize = 1 << 16;

/// Poses actors and makes one [`World`] a frame.
///
/// Worlds may be kept as long as anyone likes; the loop writes the next frame into other buffers. In steady
/// state (the caller holds no more than the last world or two) a frame allocates nothing. Dropping the loop
/// waits for the background build under way, if any.
pub struct FrameLoop {
    config: FrameConfig,
    pub(super) spec: Arc<AccelSpec>,
    top: TopKind,
    pub(super) stage: Stage,
    builder: Option<Builder>,
    worlds: Pool<World>,
    counts: LoopCounts,
    last: FrameState,
    #[cfg(test)]
    pub(super) panic_in_next_rebuild: bool,
}

impl fmt::Debug for FrameLoop {
    /// Settings and counts: the contents fill pages.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FrameLoop").field("config", &self.config).field("counts", &self.counts).finish_non_exhaustive()
    }
}

impl FrameLoop {
    /// An empty loop.
    ///
    /// # Errors
    /// When a structure's name or setting is unknown.
    pub fn new(config: FrameConfig) -> Result<Self, FrameError> {
        Self::with_grouping(config, Grouping::default())
    }

    /// [`FrameLoop::new`] with a given choice of groups, which changes no answer.
    pub(super) fn with_grouping(config: FrameConfig, grouping: Grouping) -> Result<Self, FrameError> {
        let spec: AccelSpec = config.accel.parse().map_err(BuildError::from)?;
        Ok(Self {
            spec: Arc::new(spec),
            top: config.top.parse().map_err(BuildError::from)?,
            config,
            stage: Stage::new(grouping),
            builder: None,
            worlds: Pool::default(),
            counts: LoopCounts { quality_max: 1.0, ..LoopCounts::default() },
            last: FrameState::default(),
            #[cfg(test)]
            panic_in_next_rebuild: false,
        })
    }

    /// Adds a scene placed by `world_from_scene`; the number of the actor.
    pub fn add(&mut self, scene: Arc<Scene>, world_from_scene: DAffine3) -> usize {
        self.stage.add(scene, world_from_scene)
    }

    /// Puts another scene in an actor's stead, from the next frame on. Rebuilds of the old one are dropped.
    ///
    /// # Panics
    /// When there is no such actor.
    pub fn replace(&mut self, actor: usize, scene: Arc<Scene>, world_from_scene: DAffine3) {
        self.stage.replace(actor, scene, world_from_scene);
    }

    /// Moves an actor as a whole, from the next frame on. From the first such call on none of its parts counts
    /// as static.
    ///
    /// # Panics
    /// When there is no such actor.
    pub fn place(&mut self, actor: usize, world_from_scene: DAffine3) {
        self.stage.place(actor, world_from_scene);
    }

    /// Poses every actor (`clips[i]` for actor i, none for the rest pose) and returns the frame's world.
    ///
    /// # Errors
    /// When foreign code changed how this thread or the pool's compute, a build fails, the background builder panicked, a vertex lies at the end of f32, or more is placed than numbers allow for. The loop
    /// can go on after a failed rebuild; the group concerned keeps its refitted tree.
    pub fn advance(&mut self, clips: &[&[ActiveClip]]) -> Result<(Arc<World>, StageTimes), FrameError> {
        self.advance_by(&|actor| Playing { clips: clips.get(actor).copied().unwrap_or(&[]), fade: None })
    }

    /// As [`FrameLoop::advance`] with cross-fades: `playing[i]` for actor i.
    ///
    /// # Errors
    /// As there.
    pub fn advance_playing(&mut self, playing: &[Playing<'_>]) -> Result<(Arc<World>, StageTimes), FrameError> {
        self.advance_by(&|actor| playing.get(actor).copied().unwrap_or_default())
    }

    /// Looks at clips before they play: chooses, for each large part of the actor that they move, the fewest trees that serve each clip to its end
    /// by refitting. Frames of [`RebuildPolicy::Auto`] in which the actor plays one of them, at its place and without a fade, refit these trees and
    /// rebuild nothing. The number of trees.
    ///
    /// Takes some fifty builds and refits a clip, in the loop's pool, and memory for as many trees while it lasts, a gigabyte at most.
    ///
    /// # Errors
    /// As [`FrameLoop::advance`].
    ///
    /// # Panics
    /// When there is no such actor.
    pub fn learn(&mut self, actor: usize, clips: &[ClipId]) -> Result<usize, FrameError> {
        check_float_mode()?;
        self.settle()?;
        let pool = self.config.pool.clone();
        let mut trees = 0;
        for &clip in clips.iter().filter(|_| self.config.policy == RebuildPolicy::Auto) {
            trees += pool.install(|| self.stage.learn(actor, clip, &self.spec, self.config.forms.deform))?;
        }
        Ok(trees)
    }

    fn advance_by<'a>(
        &mut self,
        playing: &(impl Fn(usize) -> Playing<'a> + Sync),
    ) -> Result<(Arc<World>, StageTimes), FrameError> {
        check_float_mode()?;
        self.settle()?;
        self.take_rebuilds()?;
        let pool = self.config.pool.clone();
        let made = pool.install(|| self.make(playing))?;
        self.begin_rebuilds()?;
        self.counts.frames += 1;
        Ok(made)
    }

    /// What the loop did since it began.
    pub fn counts(&self) -> LoopCounts {
        self.counts
    }

    /// What the loop did for the last frame.
    pub fn last_frame(&self) -> FrameState {
        self.last
    }

    /// Forms the groups anew when actors have changed, in the loop's pool.
    fn settle(&mut self) -> Result<(), FrameError> {
        if self.stage.is_settled() {
            return Ok(());
        }
        let pool = self.config.pool.clone();
        pool.install(|| self.stage.settle())
    }

    fn rebuilds_in_background(&self) -> bool {
        !matches!(self.config.policy, RebuildPolicy::Refit | RebuildPolicy::Rebuild)
    }

    /// Pose, deform, refit; in the loop's pool.
    fn make<'a>(
        &mut self,
        playing: &(impl Fn(usize) -> Playing<'a> + Sync),
    ) -> Result<(Arc<World>, StageTimes), FrameError> {
        check_float_mode()?;
        let frame = self.counts.frames;
        let mut times = StageTimes::default();
        self.worlds.for_each_free(World::clear);

        let began = Instant::now();
        let span = tracing::info_span!("pose", frame).entered();
        self.counts.poses += self.stage.pose(playing);
        drop(span);
        times.pose = began.elapsed();

        let began = Instant::now();
        let span = tracing::info_span!("deform", frame).entered();
        self.counts.deforms += self.stage.deform(self.config.forms.deform, self.rebuilds_in_background());
        drop(span);
        times.deform = began.elapsed();

        let began = Instant::now();
        let prims = self.stage.deformed_triangles();
        let _span = tracing::info_span!("refit", frame, accel = self.spec.kind().name(), prims).entered();
        let work = self.stage.update(&self.spec, self.config.policy == RebuildPolicy::Rebuild, frame)?;
        self.counts.refits += work.refits;
        self.counts.leaf_refits += work.leaf_refits;
        self.counts.moves += work.moves;
        self.counts.builds += work.builds;
        self.counts.swaps += work.swaps;
        self.counts.rebuilds_dropped += work.dropped;
        let quality = self.stage.quality();
        self.counts.quality_max = self.counts.quality_max.max(quality);
        let mut world = self.worlds.take(World::default);
        let next = Arc::get_mut(&mut world).expect("a taken buffer has one owner");
        self.stage.fill(next);
        let sorting = Instant::now();
        let covered = self.stage.cover(next, self.top);
        times.sort = sorting.elapsed();
        self.counts.tops += u64::from(covered);
        self.counts.event_sorts += u64::from(covered && next.top.has_events());
        let tree_age = self.stage.tree_age(frame);
        let inversions = next.top.inversions();
        self.last = FrameState { quality, swaps: work.swaps, builds: work.builds, tree_age, inversions };
        next.forms = self.config.forms;
        if let Some(instance) = next.beyond_f32() {
            let file = next.actor_scene(instance.actor as usize).file.clone();
            return Err(FrameError::OutOfRange { file, node: instance.part.node.0 });
        }
        self.worlds.keep(world.clone());
        times.refit = began.elapsed();
        Ok((world, times))
    }

    /// Takes rebuilds that this frame boundary may see.
    fn take_rebuilds(&mut self) -> Result<(), FrameError> {
        let Some(builder) = &mut self.builder else { return Ok(()) };
        let mut first_failure = None;
        let wait = match self.config.policy {
            RebuildPolicy::SwapEvery(every) if self.counts.frames.is_multiple_of(u64::from(every.max(1))) => true,
            RebuildPolicy::SwapEvery(_) => return Ok(()),
            _ => false,
        };
        while let Some(Outcome { epoch, result }) = if wait { builder.wait() } else { builder.poll() } {
            let (built, failure) = match result {
                Ok(built) => (Some(built), None),
                Err(Failure::Build(error)) => (None, Some(FrameError::Build(error))),
                Err(Failure::Panicked(message)) => (None, Some(FrameError::BuilderPanicked(message))),
            };
            match self.stage.group(epoch) {
                Some(group) => group.end_rebuild(built),
                None => self.counts.rebuilds_dropped += 1,
            }
            first_failure = first_failure.or(failure);
        }
        first_failure.map_or(Ok(()), Err)
    }

    /// Hands snapshots of this frame to the builder, as the policy says.
    fn begin_rebuilds(&mut self) -> Result<(), FrameError> {
        match self.config.policy {
            RebuildPolicy::Refit | RebuildPolicy::Rebuild => Ok(()),
            RebuildPolicy::SwapEvery(every) => {
                if self.counts.frames.is_multiple_of(u64::from(every.max(1))) {
                    while let Some(number) = self.stage.groups.iter().position(Group::wants_rebuild) {
                        self.begin(number)?;
                    }
                }
                Ok(())
            }
            RebuildPolicy::Async | RebuildPolicy::Auto => {
                while self.stage.rebuilding_triangles() < QUEUED_TRIANGLES {
                    let Some(number) = self.stage.most_decayed(DECAYED, self.counts.frames) else { break };
                    self.begin(number)?;
                }
                Ok(())
            }
        }
    }

    fn begin(&mut self, number: usize) -> Result<(), FrameError> {
        if self.builder.is_none() {
            self.builder = Some(builder::start(self.spec.clone()).map_err(FrameError::BuilderStart)?);
        }
        let builder = self.builder.as_mut().expect("started above");
        let lag = match self.config.policy {
            RebuildPolicy::SwapEvery(every) => Some(u64::from(every.max(1))),
            _ => None,
        };
        #[cfg_attr(not(test), expect(unused_mut, reason = "tests change it"))]
        let mut job = self.stage.groups[number].begin_rebuild(self.counts.frames, lag);
        #[cfg(test)]
        {
            job.panic = std::mem::take(&mut self.panic_in_next_rebuild);
        }
        self.counts.fast_rebuilds += u64::from(job.is_fast);
        builder.send(job);
        self.counts.rebuilds_begun += 1;
        Ok(())
    }
}
