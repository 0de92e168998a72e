use std::{ops::Range, sync::Arc};

use super::{FrameError, grouping::GroupPlan};
use crate::{
    anim::DEFORM_GRAIN,
    geom::InstanceId,
    scene::{MeshPart, PartInstance, Scene},
    world::GroupLayout,
};

/// Most triangles or vertices of a group: structures number up to four corners or lanes each in 32 bits.
pub(super) const LIMIT: u64 = u32::MAX as u64 / 4;

/// A run of one member's vertices, deformed by one task.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    pub(super) part: PartInstance,
    /// Number of the actor.
    pub(super) actor: usize,
    /// Vertices of the part.
    pub(super) vertices: Range<usize>,
}

/// A group's layout with what deforming it needs.
#[derive(Debug)]
pub(super) struct Shape {
    pub(super) layout: Arc<GroupLayout>,
    /// Every vertex of every member, in order.
    pub(super) chunks: Vec<Chunk>,
}

/// An instance as the world numbers it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member<'a> {
    pub(super) id: InstanceId,
    pub(super) actor: usize,
    pub(super) scene: &'a Scene,
    pub(super) part: PartInstance,
}

impl<'a> Member<'a> {
    fn mesh_part(&self) -> &'a MeshPart {
        self.scene.part(self.part)
    }

    /// Number of vertices, of a member of a group that was laid out.
    pub(super) fn vertex_count(&self) -> u32 {
        narrow(self.mesh_part().positions.len() as u64)
    }
}

/// Lays out one group.
///
/// # Errors
/// When the group has more vertices or triangles than fit; nothing was allocated then.
pub(super) fn lay_out<'a>(
    plan: &GroupPlan,
    topology_epoch: u64,
    member: impl Fn(InstanceId) -> Member<'a>,
) -> Result<Shape, FrameError> {
    let members = || plan.members.iter().map(|&id| member(id));
    let total = |count: fn(&MeshPart) -> usize| members().map(|m| count(m.mesh_part()) as u64).sum::<u64>();
    let (vertices, triangles) = (total(|p| p.positions.len()), total(|p| p.triangles.len()));
    check("vertices", vertices, LIMIT)?;
    check("triangles", triangles, LIMIT)?;

    let mut layout = GroupLayout { topology_epoch, ..GroupLayout::default() };
    layout.indices.reserve_exact(narrow(triangles) as usize);
    let mut chunks = Vec::new();
    for member in members() {
        let part = member.mesh_part();
        let first_vertex = narrow(layout.vertex_count as u64);
        layout.instances.push(member.id);
        layout.first_prims.push(narrow(layout.indices.len() as u64));
        layout.indices.extend(part.triangles.iter().map(|corners| corners.map(|c| c + first_vertex)));
        layout.vertex_count += part.positions.len();
        let runs = (0..part.positions.len()).step_by(DEFORM_GRAIN);
        chunks.extend(runs.map(|first| Chunk {
            part: member.part,
            actor: member.actor,
            vertices: first..part.positions.len().min(first + DEFORM_GRAIN),
        }));
    }
    Ok(Shape { layout: Arc::new(layout), chunks })
}

/// `TooMany` when `actual` exceeds `limit`.
pub(super) fn check(what: &'static str, actual: u64, limit: u64) -> Result<(), FrameError> {
    if actual > limit { Err(FrameError::TooMany { what, actual, limit }) } else { Ok(()) }
}

#[expect(clippy::cast_possible_truncation, reason = "groups are checked against LIMIT before they are laid out")]
fn narrow(count: u64) -> u32 {
    count as u32
}
