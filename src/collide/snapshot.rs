//! An immutable picture of a world, which answers queries from any number of threads.

use std::{
    fmt,
    sync::{Arc, OnceLock},
};

use glam::Vec3;

use super::{
    BroadPhase, CollideError, Layers, ObjectId, PartId, boxes_meet,
    tree::Tree,
    world::{Asked, PartFrame},
};
use crate::{
    accel::AccelSpec,
    anim::{MotionClass, Pose},
    geom::{Aabb, Forms},
    scene::{NodeId, Scene},
    world::{GroupFrame, Place, Top, TopKind, World, WorldInstance},
};

/// What a snapshot is made of.
#[derive(Debug)]
pub(super) struct Frame {
    pub(super) parts: Vec<Arc<PartFrame>>,
    /// Scene and pose, and whether its vertices were set.
    pub(super) objects: Vec<(Arc<Scene>, Arc<Pose>, bool)>,
    pub(super) spec: Arc<AccelSpec>,
    pub(super) top: TopKind,
    pub(super) forms: Forms,
    pub(super) asked: Arc<Asked>,
}

/// A picture of a [`super::CollisionWorld`]: vertices, and the structures over them that queries need.
///
/// Cheap to clone; queries are safe from any number of threads and block each other only while something is made for the first time.
/// Every answer is in a fixed order, whatever the threads.
#[derive(Clone)]
pub struct Snapshot {
    inner: Arc<Inner>,
}

struct Inner {
    frame: Frame,
    /// Whether a part is on no layer, so that no query finds it.
    hides_parts: bool,
    /// Over the boxes of the parts.
    tree: OnceLock<Tree>,
    rays: OnceLock<World>,
    /// Parts whose boxes meet, each pair once, ascending.
    pairs: OnceLock<Vec<[u32; 2]>>,
}

impl fmt::Debug for Snapshot {
    /// Sizes only: the contents fill pages.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Snapshot")
            .field("parts", &self.part_count())
            .field("triangles", &self.triangle_count())
            .field("bounds", &self.bounds())
            .finish_non_exhaustive()
    }
}

impl Snapshot {
    pub(super) fn new(frame: Frame, broad: Option<&mut BroadPhase>, rays: bool) -> Result<Self, CollideError> {
        let hides_parts = frame.parts.iter().any(|part| part.len() > 0 && part.layers.on == 0);
        let inner = Inner { frame, hides_parts, tree: OnceLock::new(), rays: OnceLock::new(), pairs: OnceLock::new() };
        let snapshot = Self { inner: Arc::new(inner) };
        if let Some(broad) = broad {
            let boxes: Vec<Aabb> = snapshot.frames().iter().map(|p| p.bounds).collect();
            snapshot.inner.pairs.get_or_init(|| broad.update(&boxes).to_vec());
        }
        if rays {
            snapshot.rays()?;
        }
        Ok(snapshot)
    }

    /// Number of parts, removed ones included.
    pub fn part_count(&self) -> usize {
        self.inner.frame.parts.len()
    }

    /// All parts, in order.
    pub fn parts(&self) -> impl ExactSizeIterator<Item = PartView<'_>> {
        let ids = 0..self.inner.frame.parts.len();
        #[expect(clippy::cast_possible_truncation, reason = "parts are counted in 32 bits")]
        ids.map(|i| PartView { snapshot: self, frame: &self.inner.frame.parts[i], id: PartId(i as u32) })
    }

    /// One part.
    ///
    /// # Errors
    /// When there is no such part.
    pub fn part(&self, id: PartId) -> Result<PartView<'_>, CollideError> {
        Ok(PartView { snapshot: self, frame: self.frame(id)?, id })
    }

    /// Number of triangles, over all parts.
    pub fn triangle_count(&self) -> usize {
        self.frames().iter().map(|p| p.len()).sum()
    }

    /// The least box around all triangles.
    pub fn bounds(&self) -> Aabb {
        self.frames().iter().fold(Aabb::EMPTY, |all, part| all.union(part.bounds))
    }

    pub(super) fn hides_parts(&self) -> bool {
        self.inner.hides_parts
    }

    pub(super) fn frames(&self) -> &[Arc<PartFrame>] {
        &self.inner.frame.parts
    }

    pub(super) fn frame(&self, part: PartId) -> Result<&PartFrame, CollideError> {
        let count = self.part_count();
        self.inner.frame.parts.get(part.index()).map(|p| &**p).ok_or(CollideError::NoSuchPart { part, count })
    }

    /// Scene, pose, and whether the vertices were set.
    pub(super) fn object(&self, part: &PartFrame) -> &(Arc<Scene>, Arc<Pose>, bool) {
        &self.inner.frame.objects[part.object.0 as usize]
    }

    /// The tree over the triangles of a part.
    pub(super) fn tree_of<'a>(&self, part: &'a PartFrame) -> &'a Tree {
        Asked::note(&self.inner.frame.asked.trees);
        part.tree()
    }

    /// The tree over the boxes of all parts.
    pub(super) fn part_tree(&self) -> &Tree {
        self.inner.tree.get_or_init(|| {
            let parts = self.frames();
            Tree::build(parts.len(), |i| parts[i as usize].bounds)
        })
    }

    /// Pairs of different parts whose boxes meet, the lower number first, ascending; layers are not looked at.
    pub(super) fn part_pairs(&self) -> &[[u32; 2]] {
        Asked::note(&self.inner.frame.asked.pairs);
        self.inner.pairs.get_or_init(|| {
            let mut pairs = Vec::new();
            self.part_tree().own_pairs(&mut |a: u32, b: u32| {
                pairs.push([a.min(b), a.max(b)]);
                std::ops::ControlFlow::Continue(())
            });
            pairs.sort_unstable();
            pairs
        })
    }

    /// The world that rays are shot at.
    pub(super) fn rays(&self) -> Result<&World, CollideError> {
        if let Some(world) = self.inner.rays.get() {
            return Ok(world);
        }
        Asked::note(&self.inner.frame.asked.rays);
        let world = self.make_rays()?;
        Ok(self.inner.rays.get_or_init(|| world))
    }

    fn make_rays(&self) -> Result<World, CollideError> {
        let Frame { parts, spec, top, forms, .. } = &self.inner.frame;
        let mut world = World { forms: *forms, ..World::default() };
        world.instances = parts.iter().map(|p| WorldInstance { actor: p.object.0, part: p.instance }).collect();
        world.places = parts.iter().map(|_| Place { group: 0, first_vertex: 0, vertex_count: 0 }).collect();
        for part in parts.iter().filter(|p| p.len() > 0) {
            let (layout, positions) = (part.shape.layout.clone(), part.positions.clone());
            world.groups.push(GroupFrame {
                layout,
                positions,
                accel: part.accel(spec)?,
                rigid: None,
                bounds: part.bounds,
            });
        }
        world.top = Top::default();
        world.top.rebuild(*top, &world.groups);
        Ok(world)
    }

    /// Parts on one of `layers` whose boxes meet `aabb`, ascending.
    pub(super) fn parts_meeting(&self, aabb: &Aabb, layers: u32) -> Vec<u32> {
        let wanted = |i: &u32| self.frames()[*i as usize].layers.on & layers != 0;
        if self.part_count() <= FEW {
            let meets = |p: &Arc<PartFrame>| boxes_meet(&p.bounds, aabb);
            return (0..).zip(self.frames()).filter(|(_, p)| meets(p)).map(|(i, _)| i).filter(wanted).collect();
        }
        let mut found = Vec::new();
        // The visitor never breaks.
        let _ = self.part_tree().meeting::<crate::simd::Scalar>(aabb, &mut Vec::new(), &mut |i| {
            found.push(i);
            std::ops::ControlFlow::Continue(())
        });
        found.retain(wanted);
        found.sort_unstable();
        found
    }
}

/// Up to this many parts are looked at one by one.
const FEW: usize = 8;

/// One part of a snapshot.
#[derive(Clone, Copy, Debug)]
pub struct PartView<'a> {
    snapshot: &'a Snapshot,
    frame: &'a PartFrame,
    id: PartId,
}

impl<'a> PartView<'a> {
    /// Its number.
    pub fn id(&self) -> PartId {
        self.id
    }

    /// The object that it belongs to.
    pub fn object(&self) -> ObjectId {
        self.frame.object
    }

    /// The node that places it.
    pub fn node(&self) -> NodeId {
        self.frame.instance.node
    }

    /// Number of the part (glTF primitive) within the node's mesh.
    pub fn mesh_part(&self) -> u32 {
        self.frame.instance.part
    }

    /// The copy's number under `EXT_mesh_gpu_instancing`, else `None`.
    pub fn copy(&self) -> Option<u32> {
        self.frame.instance.copy
    }

    /// Scene that it is a part of; for a mesh one of its own.
    pub fn scene(&self) -> &'a Arc<Scene> {
        &self.snapshot.object(self.frame).0
    }

    /// Names of the nodes from the root down to its own, separated by `/`; a node without a name counts as `#` and its number.
    pub fn path(&self) -> String {
        node_path(self.scene(), self.node())
    }

    /// How it can move: meshes are `Deforming`.
    pub fn class(&self) -> MotionClass {
        if self.snapshot.object(self.frame).2 { MotionClass::Deforming } else { self.frame.class }
    }

    /// Its layers.
    pub fn layers(&self) -> Layers {
        self.frame.layers
    }

    /// World-space vertices, in the file's order.
    pub fn vertices(&self) -> &'a [Vec3] {
        &self.frame.positions
    }

    /// Corners of each triangle, as indices of vertices.
    pub fn triangles(&self) -> &'a [[u32; 3]] {
        self.frame.shape.triangles()
    }

    /// The least box around its triangles.
    pub fn bounds(&self) -> Aabb {
        self.frame.bounds
    }
}

/// See [`PartView::path`].
fn node_path(scene: &Scene, node: NodeId) -> String {
    let mut names = Vec::new();
    let mut next = Some(node);
    while let Some(id) = next {
        let node = &scene.nodes[id.index()];
        names.push(if node.name.is_empty() { format!("#{}", id.0) } else { node.name.clone() });
        next = node.parent;
    }
    names.reverse();
    names.join("/")
}
