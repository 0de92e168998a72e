use std::sync::Arc;

use glam::Vec3;

use crate::{
    accel::{AnyAccel, RigidPlace, RigidTree},
    geom::{Aabb, InstanceId, PrimId, Triangles},
};

/// What of a group stays the same from frame to frame: its triangles and whose they are.
///
/// Members are in ascending order of instance and their triangles lie one after the other, so the order of
/// the group's own triangle numbers is the order of (instance, prim).
#[derive(Clone, Debug, Default)]
pub(crate) struct GroupLayout {
    /// Corners of every triangle, as indices into the group's positions.
    pub(crate) indices: Vec<[u32; 3]>,
    /// Differs between any two layouts of one frame loop.
    pub(crate) topology_epoch: u64,
    /// Number of positions.
    pub(crate) vertex_count: usize,
    /// Members, ascending.
    pub(crate) instances: Vec<InstanceId>,
    /// Number of the first triangle of each member; equal to the next one's for a member without triangles.
    pub(crate) first_prims: Vec<u32>,
}

impl GroupLayout {
    /// (instance, prim) of one of the group's own triangle numbers. O(log members).
    #[inline]
    pub(crate) fn key(&self, prim: PrimId) -> (InstanceId, PrimId) {
        let member = self.first_prims.partition_point(|&first| first <= prim.0) - 1;
        (self.instances[member], PrimId(prim.0 - self.first_prims[member]))
    }

    /// The group's triangles over `positions`.
    #[inline(always)]
    pub(crate) fn triangles<'a>(&'a self, positions: &'a [Vec3]) -> Triangles<'a> {
        Triangles { positions, indices: &self.indices, topology_epoch: self.topology_epoch }
    }
}

/// One frame of a group: its vertices and the structure over them.
#[derive(Clone, Debug)]
pub(crate) struct GroupFrame {
    pub(crate) layout: Arc<GroupLayout>,
    pub(crate) positions: Arc<Vec<Vec3>>,
    pub(crate) accel: Arc<AnyAccel>,
    /// Of a part that moves as a whole: the tree in its own space, which answers rays in `accel`'s stead, and where the part is.
    pub(crate) rigid: Option<(Arc<RigidTree>, RigidPlace)>,
    /// The least box around every triangle that can be hit (those with finite corners), or a larger one.
    pub(crate) bounds: Aabb,
}

impl GroupFrame {
    #[inline(always)]
    pub(crate) fn triangles(&self) -> Triangles<'_> {
        self.layout.triangles(&self.positions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_numbers_its_triangles_in_the_order_of_instance_and_prim() {
        // Members without triangles first, in the middle and last.
        let layout = GroupLayout {
            indices: vec![[0; 3]; 5],
            instances: [2, 3, 5, 8, 9].map(InstanceId).to_vec(),
            first_prims: vec![0, 0, 2, 2, 5],
            ..Default::default()
        };
        let keys: Vec<_> = (0..5).map(|p| layout.key(PrimId(p))).map(|(i, p)| (i.0, p.0)).collect();
        assert_eq!(keys, [(3, 0), (3, 1), (8, 0), (8, 1), (8, 2)]);
        assert!(keys.is_sorted());
    }
}
