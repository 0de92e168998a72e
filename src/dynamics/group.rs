use std::{mem, sync::Arc};

use glam::Vec3;

use super::{
    FrameError,
    actor::Actor,
    builder::{Built, Job},
    deform::deform_chunks,
    layout::Shape,
    pool::Pool,
};
use crate::{
    accel::{AccelSpec, AnyAccel, Refit},
    geom::Precision,
    world::GroupFrame,
};

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
    rebuild: Rebuild,
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
    pub(super) builds: u64,
    pub(super) swaps: u64,
}

impl Group {
    pub(super) fn new(shape: Shape, key: Vec<MemberKey>, actor: Option<usize>) -> Self {
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
            rebuild: Rebuild::Idle,
            outcome: Ok(Work::default()),
        }
    }

    /// Computes the vertices when the poses of this frame call for it.
    pub(super) fn deform(&mut self, precision: Precision, actors: &[Actor]) {
        self.deformed = self.accel.is_none() || self.moved(actors);
        if !self.deformed {
            return;
        }
        let count = self.shape.layout.vertex_count;
        let mut next = self.position_pool.take(|| vec![Vec3::ZERO; count]);
        let out = Arc::get_mut(&mut next).expect("a taken buffer has one owner");
        deform_chunks(precision, &self.shape.chunks, actors, out);
        self.position_pool.keep(next.clone());
        self.positions = next;
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
        self.outcome = self.try_update(spec, rebuild_always, frame);
        if self.outcome.is_err() {
            // Without a structure the next frame deforms and builds anew.
            self.accel = None;
        }
    }

    fn try_update(&mut self, spec: &AccelSpec, rebuild_always: bool, frame: u64) -> Result<Work, FrameError> {
        match mem::take(&mut self.rebuild) {
            Rebuild::Finished(built) => return self.swap(*built, spec, frame),
            other => self.rebuild = other,
        }
        if !self.deformed {
            return Ok(Work::default());
        }
        match self.accel.take() {
            Some(accel) if !rebuild_always => self.refit(&accel, spec, frame),
            _ => self.build(spec, frame),
        }
    }

    fn swap(&mut self, built: Built, spec: &AccelSpec, frame: u64) -> Result<Work, FrameError> {
        let base = Arc::new(built.accel);
        self.built_of = built.frame;
        let work = if Arc::ptr_eq(&built.positions, &self.positions) {
            self.moved_since_build = false;
            self.accel = Some(base.clone());
            Work::default()
        } else {
            self.refit(&base, spec, frame)?
        };
        if base.refits() {
            self.accel_pool.keep(base);
        }
        Ok(Work { swaps: 1, ..work })
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
        self.built_of = frame;
        Ok(Work { builds: 1, ..Work::default() })
    }

    /// What the world holds of this frame; `None` before the first `update`.
    pub(super) fn frame(&self) -> Option<GroupFrame> {
        let accel = self.accel.clone()?;
        let bounds = accel.bounds();
        Some(GroupFrame { layout: self.shape.layout.clone(), positions: self.positions.clone(), accel, bounds })
    }

    /// How much dearer rays are than right after the last build, by surface areas.
    pub(super) fn quality(&self) -> f64 {
        self.accel.as_ref().map_or(1.0, |accel| accel.decay())
    }

    /// Frames between `frame` and the one that the structure was built from; 0 when nothing moved since.
    pub(super) fn tree_age(&self, frame: u64) -> u64 {
        if self.moved_since_build { frame - self.built_of } else { 0 }
    }

    /// True when a background rebuild could improve the structure.
    pub(super) fn wants_rebuild(&self) -> bool {
        self.moved_since_build && self.triangle_count() > 0 && matches!(self.rebuild, Rebuild::Idle)
    }

    /// True while the builder has this group.
    pub(super) fn is_rebuilding(&self) -> bool {
        matches!(self.rebuild, Rebuild::Begun)
    }

    pub(super) fn triangle_count(&self) -> usize {
        self.shape.layout.indices.len()
    }

    /// The rebuild job of this frame's geometry, noted as begun.
    pub(super) fn begin_rebuild(&mut self, frame: u64) -> Job {
        self.rebuild = Rebuild::Begun;
        Job {
            layout: self.shape.layout.clone(),
            positions: self.positions.clone(),
            frame,
            #[cfg(test)]
            panic: false,
        }
    }

    /// Notes a finished rebuild, to be swapped in by the next `update`; `None` when it failed.
    pub(super) fn end_rebuild(&mut self, built: Option<Built>) {
        self.rebuild = built.map_or(Rebuild::Failed, |built| Rebuild::Finished(Box::new(built)));
    }
}
