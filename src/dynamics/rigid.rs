use std::sync::Arc;

use glam::{DAffine3, Vec3};

use crate::{
    accel::{AccelKind, AccelSpec, AnyAccel, BuildError, RigidPlace, RigidTree},
    geom::{Aabb, Triangles},
    scene::{PartInstance, Scene},
};

/// What all copies of a part that moves as a whole share.
#[derive(Debug)]
pub(super) struct RigidPart {
    scene: Arc<Scene>,
    part: PartInstance,
    pub(super) tree: Arc<RigidTree>,
    /// A structure over nothing, where one must be named.
    pub(super) nothing: Arc<AnyAccel>,
    /// Vertices of the triangles that can be hit.
    corners: Vec<u32>,
}

/// One copy in one frame.
#[derive(Debug)]
pub(super) struct Rigid {
    pub(super) part: Arc<RigidPart>,
    pub(super) world_from_part: DAffine3,
    /// Vertices are computed in f32.
    pub(super) is_fast: bool,
    pub(super) place: RigidPlace,
    pub(super) bounds: Aabb,
}

impl RigidPart {
    /// Builds the tree over a part in its own space.
    ///
    /// # Errors
    /// When the part has more triangles than fit.
    pub(super) fn new(scene: &Arc<Scene>, part: PartInstance) -> Result<Self, BuildError> {
        let mesh = scene.part(part);
        let prims = Triangles { positions: &mesh.positions, indices: &mesh.triangles, topology_epoch: 0 };
        let tree = Arc::new(RigidTree::build(&prims)?);
        let none = Triangles { positions: &[], indices: &[], topology_epoch: 0 };
        let nothing = Arc::new(AccelSpec::new(AccelKind::List).build(&none)?);
        let finite = |corners: &&[u32; 3]| corners.iter().all(|&i| mesh.positions[i as usize].is_finite());
        let mut corners: Vec<u32> = mesh.triangles.iter().filter(finite).flatten().copied().collect();
        corners.sort_unstable();
        corners.dedup();
        Ok(Self { scene: scene.clone(), part, tree, nothing, corners })
    }

    /// True for a copy of the same part.
    pub(super) fn is_of(&self, scene: &Arc<Scene>, part: PartInstance) -> bool {
        Arc::ptr_eq(&self.scene, scene) && self.part.mesh == part.mesh && self.part.part == part.part
    }

    /// A number that copies of the same part share.
    pub(super) fn number(scene: &Arc<Scene>, part: PartInstance) -> (usize, u32, u32) {
        (Arc::as_ptr(scene).addr(), part.mesh.0, part.part)
    }

    /// The number of this part.
    pub(super) fn own_number(&self) -> (usize, u32, u32) {
        Self::number(&self.scene, self.part)
    }

    /// The least box around the triangles that can be hit, at places in the world.
    pub(super) fn bounds(&self, positions: &[Vec3]) -> Aabb {
        Aabb::from_points(self.corners.iter().map(|&i| positions[i as usize]))
    }
}

impl Rigid {
    /// A copy that is nowhere yet.
    pub(super) fn new(part: Arc<RigidPart>) -> Self {
        let place = RigidPlace::new(&part.tree, &DAffine3::IDENTITY, Aabb::EMPTY, false);
        Self { part, world_from_part: DAffine3::IDENTITY, is_fast: false, place, bounds: Aabb::EMPTY }
    }
}
