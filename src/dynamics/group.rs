use std::{mem, sync::Arc};

use glam::Vec3;

use super::{
    FrameError,
    actor::Actor,
    builder::{Built, Job},
    deform::deform_chunks,
    layout::Shape,
    phases::Phases,
    pool::Pool,
    rigid::{Rigid, RigidPart},
};
use crate::{
    accel::{AccelSpec, AnyAccel, Refit, RigidPlace},
    anim::{ActiveClip, whole_placement},
    geom::Precision,
    scene::ClipId,
    world::GroupFrame,
};

/// How many times as fast the fast builder is, about.
const FAST_GAIN: u64 = 3;

/// By how much rays at its trees are dearer.
const FAST_COST: f64 = 1.15;

/// Frames that a rebuild takes when nobody knows.
const UNKNOWN_LAG: u64 = 8;

/// Decay during the build of a good tree from which on a fast one is better. Before the next swap a tree has decayed for two builds: a good one to 1 and twice this, a
/// fast one, ready in a third of the time, to [`FAST_COST`] and two thirds of this.
const HASTE: f64 = 0.12;

/// A group of the loop: its vertices and structure of the last frame, and buffers for the next one.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) shape: Shape,
    /// Which parts of which scenes it holds; equal keys mean equal triangles.
    pub(super) key: Vec<MemberKey>,
    /// The actor that moves it; `None` for the static group.
    actor: Option<usize>,
    positions: Arc<Vec<Vec3>>,
    accel: Option<Arc<AnyAccel>>,
    position_pool: Pool<Vec<Vec3>>,
    accel_pool: Pool<AnyAccel>,
    /// Vertices changed in the frame being made.
    deformed: bool,
    /// The vertices are not those that the structure was built from.
    moved_since_build: bool,
    /// The frame whose vertices the structure was built from.
    built_of: u64,
    /// The vertices of the frame before, where they moved since and somebody asks for them.
    before: Option<Arc<Vec<Vec3>>>,
    /// By how much the decay grew with the last refit.
    growth: f64,
    /// Frames that the last background rebuild took.
    lag: u64,
    /// Frames that one by the builder of good trees takes, if that is known.
    full_lag: Option<u64>,
    /// The structure was built by the fast builder.
    is_fast: bool,
    /// Trees of clips that are known.
    phases: Vec<Phases>,
    /// The clip that plays in the frame being made.
    playing: Option<ActiveClip>,
    /// The clip and the number of its tree that is in use.
    phase: Option<(ClipId, usize)>,
    rebuild: Rebuild,
    /// Of a part that moves as a whole: its tree, and where it is.
    rigid: Option<Rigid>,
    /// What the last `update` did, or why it failed.
    pub(super) outcome: Result<Work, FrameError>,
}

/// A part instance by actor, version of the actor's scene, and number in that scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct MemberKey {
    pub(super) actor: usize,
    pub(super) generation: u64,
    pub(super) instance: u32,
}

/// Where a group's background rebuild stands.
#[derive(Debug, Default)]
enum Rebuild {
    #[default]
    Idle,
    /// With the builder.
    Begun,
    /// Waits for a frame boundary.
    Finished(Box<Built>),
    /// Failed once; not tried again.
    Failed,
}

/// What a group did to its structure in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Work {
    pub(super) refits: u64,
    pub(super) leaf_refits: u64,
    pub(super) moves: u64,
    pub(super) builds: u64,
    pub(super) swaps: u64,
    /// Rebuilds that were worse than the tree in use.
    pub(super) dropped: u64,
}

impl Group {
    pub(super) fn new(shape: Shape, key: Vec<MemberKey>, actor: Option<usize>, rigid: Option<Rigid>) -> Self {
        Self {
            shape,
            key,
            actor,
            positions: Arc::default(),
            accel: None,
            position_pool: Pool::default(),
            accel_pool: Pool::default(),
            deformed: false,
            moved_since_build: false,
            built_of: 0,
            before: None,
            growth: 0.0,
            lag: 0,
            full_lag: None,
            is_fast: false,
            phases: Vec::new(),
            playing: None,
            phase: None,
            rebuild: Rebuild::Idle,
            rigid,
            outcome: Ok(Work::default()),
        }
    }

    /// Computes the vertices when the poses of this frame call for it; `foresees` keeps those of the frame before.
    pub(super) fn deform(&mut self, precision: Precision, actors: &[Actor], foresees: bool) {
        self.before = None;
        self.deformed = self.accel.is_none() || self.moved(actors);
        if !self.deformed {
            return;
        }
        if let (Some(rigid), Some(chunk)) = (&mut self.rigid, self.shape.chunks.first()) {
            let actor = &actors[chunk.actor];
            rigid.is_fast = precision == Precision::Fast;
            rigid.world_from_part =
                whole_placement(&actor.scene, &actor.pose, chunk.part).unwrap_or(rigid.world_from_part);
        }
        self.playing = self.actor.and_then(|actor| actors[actor].sole_clip());
        let count = self.shape.layout.vertex_count;
        let mut next = self.position_pool.take(|| vec![Vec3::ZERO; count]);
        let out = Arc::get_mut(&mut next).expect("a taken buffer has one owner");
        deform_chunks(precision, &self.shape.chunks, actors, out);
        self.position_pool.keep(next.clone());
        let before = mem::replace(&mut self.positions, next);
        if foresees && self.accel.is_some() {
            self.before = Some(before);
        }
        self.moved_since_build = true;
    }

    fn moved(&self, actors: &[Actor]) -> bool {
        let Some(actor) = self.actor.map(|actor| &actors[actor]) else { return false };
        actor.previous.is_some() && self.shape.chunks.iter().any(|chunk| actor.moved(chunk.part))
    }

    /// True when the vertices changed in the frame being made.
    pub(super) fn deformed(&self) -> bool {
        self.deformed
    }

    /// Brings the structure to the vertices: takes a finished rebuild, refits or builds, in the current rayon pool.
    pub(super) fn update(&mut self, spec: &AccelSpec, rebuild_always: bool, frame: u64) {
        let quality = self.quality();
        self.outcome = self.try_update(spec, rebuild_always, frame);
        match &self.outcome {
            Ok(work) if work.refits > 0 && work.swaps + work.dropped == 0 => {
                self.growth = (self.quality() - quality).max(0.0);
            }
            // The motion goes on.
            Ok(work) if self.deformed && work.swaps + work.dropped > 0 => {}
            _ => self.growth = 0.0,
        }
        if self.outcome.is_err() {
            // Without a structure the next frame deforms and builds anew.
            self.accel = None;
        }
    }

    /// Takes the matrix and the box of this frame.
    fn move_whole(&mut self, rigid: &mut Rigid) -> Work {
        if !self.deformed {
            return Work::default();
        }
        let tree = &rigid.part.tree;
        rigid.bounds = rigid.part.bounds(&self.positions);
        rigid.place = RigidPlace::new(tree, &rigid.world_from_part, rigid.bounds, rigid.is_fast);
        let first = self.accel.is_none();
        self.accel = Some(rigid.part.nothing.clone());
        Work { moves: u64::from(!first), ..Work::default() }
    }

    fn try_update(&mut self, spec: &AccelSpec, rebuild_always: bool, frame: u64) -> Result<Work, FrameError> {
        if let Some(mut rigid) = self.rigid.take() {
            let work = self.move_whole(&mut rigid);
            self.rigid = Some(rigid);
            return Ok(work);
        }
        match mem::take(&mut self.rebuild) {
            Rebuild::Finished(built) => return self.swap(*built, spec, frame),
            other => self.rebuild = other,
        }
        if !self.deformed {
            return Ok(Work::default());
        }
        if let Some((number, tree)) = self.playing.and_then(|now| self.phases.iter().find_map(|phases| phases.at(now)))
        {
            let (tree, phase) = (tree.clone(), self.playing.map(|now| (now.clip, number)));
            return self.follow(&tree, phase, spec, frame);
        }
        self.phase = None;
        match self.accel.take() {
            Some(accel) if !rebuild_always => self.refit(&accel, spec, frame),
            _ => self.build(spec, frame),
        }
    }

    /// Refits the tree of a phase, which is swapped in when another was in use.
    fn follow(
        &mut self,
        tree: &Arc<AnyAccel>,
        phase: Option<(ClipId, usize)>,
        spec: &AccelSpec,
        frame: u64,
    ) -> Result<Work, FrameError> {
        let swaps = u64::from(self.phase != phase);
        if swaps > 0 {
            self.built_of = frame;
        }
        let work = self.refit(tree, spec, frame)?;
        self.phase = phase;
        Ok(Work { swaps, ..work })
    }

    /// Takes a finished rebuild, unless it was made for a motion that did not come and the tree in use is the better one.
    fn swap(&mut self, built: Built, spec: &AccelSpec, frame: u64) -> Result<Work, FrameError> {
        let base = Arc::new(built.accel);
        let lag = frame.saturating_sub(built.frame);
        let work = if built.positions.is_some_and(|positions| Arc::ptr_eq(&positions, &self.positions)) {
            self.moved_since_build = false;
            self.accel = Some(base.clone());
            Work::default()
        } else {
            let current = self.accel.take();
            let mut work = self.refit(&base, spec, frame)?;
            if let Some(current) = current.filter(|_| built.on_trial && work.builds == 0) {
                let swapped = self.accel.take();
                let again = self.refit(&current, spec, frame)?;
                work.refits += again.refits;
                work.leaf_refits += again.leaf_refits;
                let cost = |accel: &Option<Arc<AnyAccel>>| accel.as_ref().map_or(f64::INFINITY, |a| a.stats().sah_cost);
                if cost(&self.accel) < cost(&swapped) {
                    // The next one is built for where vertices are.
                    self.lag = 0;
                    self.note_lag(lag, built.is_fast);
                    return Ok(Work { dropped: 1, ..work });
                }
                self.accel = swapped;
            }
            work
        };
        self.built_of = built.frame;
        self.lag = lag;
        self.note_lag(lag, built.is_fast);
        // A structure that could not be refitted was built anew, as it is first.
        self.is_fast = built.is_fast && work.builds == 0;
        self.phase = None;
        if base.refits() {
            self.accel_pool.keep(base);
        }
        Ok(Work { swaps: 1, ..work })
    }

    /// Notes how many frames a rebuild took.
    fn note_lag(&mut self, lag: u64, is_fast: bool) {
        self.full_lag = Some(if is_fast { lag.max(1) * FAST_GAIN } else { lag.max(1) });
    }

    fn refit(&mut self, from: &Arc<AnyAccel>, spec: &AccelSpec, frame: u64) -> Result<Work, FrameError> {
        if !from.refits() {
            return self.build(spec, frame);
        }
        let mut next = self.accel_pool.take(|| AnyAccel::clone(from));
        let out = Arc::get_mut(&mut next).expect("a taken buffer has one owner");
        match from.refit_into(out, &self.shape.layout.triangles(&self.positions)) {
            Refit::Done => {
                self.accel_pool.keep(next.clone());
                self.accel = Some(next);
                Ok(Work { refits: 1, leaf_refits: self.triangle_count() as u64, ..Work::default() })
            }
            Refit::NeedsRebuild => self.build(spec, frame),
        }
    }

    fn build(&mut self, spec: &AccelSpec, frame: u64) -> Result<Work, FrameError> {
        let accel = Arc::new(spec.build(&self.shape.layout.triangles(&self.positions))?);
        if accel.refits() {
            self.accel_pool.keep(accel.clone());
        }
        self.accel = Some(accel);
        self.moved_since_build = false;
        self.is_fast = false;
        self.built_of = frame;
        Ok(Work { builds: 1, ..Work::default() })
    }

    /// What the world holds of this frame; `None` before the first `update`.
    pub(super) fn frame(&self) -> Option<GroupFrame> {
        let accel = self.accel.clone()?;
        let (rigid, bounds) = match &self.rigid {
            Some(rigid) => (Some((rigid.part.tree.clone(), rigid.place)), rigid.bounds),
            None => (None, accel.bounds()),
        };
        Some(GroupFrame { layout: self.shape.layout.clone(), positions: self.positions.clone(), accel, rigid, bounds })
    }

    /// How much dearer rays are than right after the last build, by surface areas.
    pub(super) fn quality(&self) -> f64 {
        self.accel.as_ref().map_or(1.0, |accel| accel.decay())
    }

    /// The same beside what a good tree would cost. A fast one is never good, even if it was built for a motion that would have been worse for it.
    pub(super) fn excess(&self) -> f64 {
        if self.is_fast { self.quality().max(1.0) * FAST_COST } else { self.quality() }
    }

    /// The same once a rebuild that is begun now is ready, if the tree goes on to decay as it did last.
    #[expect(clippy::cast_precision_loss, reason = "few frames")]
    pub(super) fn excess_to_come(&self, frame: u64) -> f64 {
        let lag = self.full_lag.map_or(0, |full| if self.is_hasty(frame) { full.div_ceil(FAST_GAIN) } else { full });
        self.excess() + self.growth * lag as f64
    }

    /// True while the tree in use is not what this motion, or rest, calls for.
    #[cfg(test)]
    pub(super) fn wants_good_tree(&self) -> bool {
        self.is_fast || self.is_rebuilding() || self.quality() > 1.1
    }

    /// True when a good tree would be too old once it is ready: when it decays by more until then than a fast one is worse.
    #[expect(clippy::cast_precision_loss, reason = "few frames")]
    fn is_hasty(&self, frame: u64) -> bool {
        let per_frame = (self.quality() - 1.0) / self.tree_age(frame).max(1) as f64;
        per_frame.max(self.growth) * self.full_lag.unwrap_or(UNKNOWN_LAG) as f64 > HASTE
    }

    /// Frames between `frame` and the one that the structure was built from; 0 when nothing moved since.
    pub(super) fn tree_age(&self, frame: u64) -> u64 {
        if self.moved_since_build && self.rigid.is_none() { frame - self.built_of } else { 0 }
    }

    /// True when a background rebuild could improve the structure.
    pub(super) fn wants_rebuild(&self) -> bool {
        self.rigid.is_none()
            && (self.moved_since_build || self.is_fast)
            && self.phase.is_none()
            && self.triangle_count() > 0
            && matches!(self.rebuild, Rebuild::Idle)
    }

    /// Takes the trees of a clip in place of those that it had for it.
    pub(super) fn learn(&mut self, phases: Phases) {
        self.phases.retain(|known| known.clip() != phases.clip());
        self.phases.push(phases);
    }

    /// The actor that moves the group.
    pub(super) fn actor(&self) -> Option<usize> {
        self.actor
    }

    /// What of a part that moves as a whole its copies share.
    pub(super) fn rigid_part(&self) -> Option<&Arc<RigidPart>> {
        self.rigid.as_ref().map(|rigid| &rigid.part)
    }

    /// True while the builder has this group.
    pub(super) fn is_rebuilding(&self) -> bool {
        matches!(self.rebuild, Rebuild::Begun)
    }

    pub(super) fn triangle_count(&self) -> usize {
        self.shape.layout.indices.len()
    }

    /// Frames that a rebuild is expected to take; 0 where that is not known, or where the last one was of no use.
    fn lag_of(&self, is_fast: bool) -> u64 {
        match self.full_lag {
            Some(full) if self.lag > 0 => {
                if is_fast {
                    full.div_ceil(FAST_GAIN)
                } else {
                    full
                }
            }
            _ => 0,
        }
    }

    /// The rebuild job of this frame's geometry, noted as begun. It is to be swapped in after `lag` frames, if that is known.
    ///
    /// The tree will be in use from its swap to the next one, about as many frames later, so it is built for the middle of these.
    #[expect(clippy::cast_precision_loss, reason = "few frames")]
    pub(super) fn begin_rebuild(&mut self, frame: u64, lag: Option<u64>) -> Job {
        self.rebuild = Rebuild::Begun;
        // What is swapped in at given frames is to be the same whatever the timing.
        let is_fast = lag.is_none() && self.is_hasty(frame);
        Job {
            layout: self.shape.layout.clone(),
            positions: self.positions.clone(),
            before: self.before.take(),
            ahead: 1.5 * lag.unwrap_or(self.lag_of(is_fast)).min(1000) as f32,
            frame,
            on_trial: lag.is_none(),
            is_fast,
            #[cfg(test)]
            panic: false,
        }
    }

    /// Notes a finished rebuild, to be swapped in by the next `update`; `None` when it failed.
    pub(super) fn end_rebuild(&mut self, built: Option<Built>) {
        self.rebuild = built.map_or(Rebuild::Failed, |built| Rebuild::Finished(Box::new(built)));
    }
}
