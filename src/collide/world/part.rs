//! One part of an object: its vertices and structures of this snapshot, and buffers for the next.

use std::sync::{Arc, OnceLock};

use glam::{DAffine3, Vec3, Vec4};

use super::{
    CollideError, ObjectId, PartId,
    object::{Change, Object, bare_part},
    shape::PartShape,
};
use crate::{
    accel::{AccelSpec, AnyAccel, Refit},
    anim::{MotionClass, deform_parallel},
    collide::{Layers, tree::Tree},
    dynamics::Pool,
    geom::{Aabb, PrimId, Triangles},
    scene::PartInstance,
    simd::SimdLevel,
};

/// A structure whose boxes have grown by this much is built anew.
const DECAYED: f64 = 1.5;

/// One part in one snapshot.
#[derive(Debug)]
pub(in crate::collide) struct PartFrame {
    pub(in crate::collide) object: ObjectId,
    pub(in crate::collide) instance: PartInstance,
    pub(in crate::collide) class: MotionClass,
    pub(in crate::collide) layers: Layers,
    pub(in crate::collide) shape: Arc<PartShape>,
    pub(in crate::collide) positions: Arc<Vec<Vec3>>,
    /// Around all triangles.
    pub(in crate::collide) bounds: Aabb,
    /// Over the triangles of an earlier pose.
    old_tree: Option<Arc<Tree>>,
    tree: OnceLock<Arc<Tree>>,
    /// The structure for rays, and whether it is of this pose.
    accel: Option<(Arc<AnyAccel>, bool)>,
}

impl PartFrame {
    /// Number of triangles.
    pub(in crate::collide) fn len(&self) -> usize {
        self.shape.len()
    }

    pub(in crate::collide) fn triangles(&self) -> Triangles<'_> {
        self.shape.layout.triangles(&self.positions)
    }

    #[inline(always)]
    pub(in crate::collide) fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.shape.corners(&self.positions, PrimId(triangle))
    }

    /// The tree over the triangles, made at the first call.
    pub(in crate::collide) fn tree(&self) -> &Arc<Tree> {
        self.tree.get_or_init(|| {
            let triangles = self.triangles();
            Arc::new(match &self.old_tree {
                Some(old) => {
                    let mut tree = Tree::clone(old);
                    tree.refit(&triangles);
                    tree
                }
                None => Tree::build(triangles.len(), |i| triangles.aabb(PrimId(i))),
            })
        })
    }

    /// The structure for rays, brought to this pose.
    pub(in crate::collide) fn accel(&self, spec: &AccelSpec) -> Result<Arc<AnyAccel>, CollideError> {
        match &self.accel {
            Some((accel, true)) => Ok(accel.clone()),
            Some((accel, false)) if accel.refits() => {
                let mut next = AnyAccel::clone(accel);
                match accel.refit_into(&mut next, &self.triangles()) {
                    Refit::Done => Ok(Arc::new(next)),
                    Refit::NeedsRebuild => Ok(Arc::new(spec.build(&self.triangles())?)),
                }
            }
            _ => Ok(Arc::new(spec.build(&self.triangles())?)),
        }
    }
}

/// What the next snapshot is to have ready.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wants<'a> {
    pub(super) rays: Option<&'a AccelSpec>,
    pub(super) trees: bool,
}

#[derive(Debug)]
pub(super) struct Part {
    pub(super) object: usize,
    /// Number within the object.
    pub(super) number: usize,
    pub(super) layers: Layers,
    pub(super) id: PartId,
    shape: Arc<PartShape>,
    positions: Arc<Vec<Vec3>>,
    bounds: Aabb,
    accel: Option<Arc<AnyAccel>>,
    accel_is_current: bool,
    tree: Option<Arc<Tree>>,
    tree_is_current: bool,
    position_pool: Pool<Vec<Vec3>>,
    accel_pool: Pool<AnyAccel>,
    tree_pool: Pool<Tree>,
    /// The last snapshot's, to take over what queries made.
    pub(super) frame: Option<Arc<PartFrame>>,
    pub(super) outcome: Result<(), CollideError>,
}

impl Part {
    pub(super) fn new(object: usize, number: usize, id: PartId, scene: &crate::scene::Scene) -> Self {
        let part = scene.part(scene.instances[number]);
        Self {
            object,
            number,
            layers: Layers::default(),
            id,
            shape: Arc::new(PartShape::new(part, id.0)),
            positions: Arc::default(),
            bounds: Aabb::EMPTY,
            accel: None,
            accel_is_current: false,
            tree: None,
            tree_is_current: false,
            position_pool: Pool::default(),
            accel_pool: Pool::default(),
            tree_pool: Pool::default(),
            frame: None,
            outcome: Ok(()),
        }
    }

    /// Forgets all triangles.
    pub(super) fn remove(&mut self) {
        self.shape = Arc::new(PartShape::new(&bare_part(Vec::new(), Vec::new()), self.id.0));
        self.positions = Arc::default();
        self.bounds = Aabb::EMPTY;
        (self.accel, self.tree, self.frame) = (None, None, None);
        (self.accel_is_current, self.tree_is_current) = (false, false);
        (self.accel_pool, self.tree_pool) = (Pool::default(), Pool::default());
    }

    /// Brings vertices and what is wanted of structures to the object's pose.
    pub(super) fn update(&mut self, object: &Object, wants: Wants<'_>) {
        self.outcome = self.try_update(object, wants);
    }

    fn try_update(&mut self, object: &Object, wants: Wants<'_>) -> Result<(), CollideError> {
        if object.removed {
            self.refresh_frame(object, false);
            return Ok(());
        }
        let class = object.classes[self.number];
        let moved = match object.change {
            Change::None => false,
            Change::Posed => class != MotionClass::Static,
            Change::Placed => true,
        };
        if let Some(made) = self.frame.as_ref().and_then(|frame| frame.tree.get()) {
            self.adopt(made.clone());
        }
        if moved {
            self.deform(object)?;
            self.accel_is_current = false;
            self.tree_is_current = false;
        }
        let mut changed = moved;
        if let Some(spec) = wants.rays
            && !self.accel_is_current
        {
            self.update_accel(spec)?;
            changed = true;
        }
        if wants.trees && !self.tree_is_current {
            self.update_tree();
            changed = true;
        }
        self.refresh_frame(object, changed);
        Ok(())
    }

    /// Keeps a tree that a query made.
    fn adopt(&mut self, tree: Arc<Tree>) {
        if !self.tree_is_current {
            self.tree_pool.keep(tree.clone());
            self.tree = Some(tree);
            self.tree_is_current = true;
        }
    }

    fn deform(&mut self, object: &Object) -> Result<(), CollideError> {
        let instance = object.scene.instances[self.number];
        let count = object.scene.part(instance).positions.len();
        let mut next = self.position_pool.take(|| vec![Vec3::ZERO; count]);
        let out = Arc::get_mut(&mut next).expect("a taken buffer has one owner");
        match object.own_vertices() {
            Some((vertices, transform)) => place(vertices, transform, out),
            None => deform_parallel(SimdLevel::best(), &object.scene, &object.pose, instance, out),
        }
        let Some(around) = around(out) else {
            return Err(CollideError::BeyondF32 { object: ObjectId(narrow(self.object)), part: self.id });
        };
        self.bounds = self.shape.bounds(out, around);
        self.position_pool.keep(next.clone());
        self.positions = next;
        Ok(())
    }

    fn update_accel(&mut self, spec: &AccelSpec) -> Result<(), CollideError> {
        let triangles = self.shape.layout.triangles(&self.positions);
        let old = self.accel.take().filter(|accel| accel.refits() && accel.decay() < DECAYED);
        if let Some(old) = old {
            let mut next = self.accel_pool.take(|| AnyAccel::clone(&old));
            let out = Arc::get_mut(&mut next).expect("a taken buffer has one owner");
            if old.refit_into(out, &triangles) == Refit::Done {
                self.accel_pool.keep(next.clone());
                self.accel = Some(next);
                self.accel_is_current = true;
                return Ok(());
            }
        }
        let built = Arc::new(spec.build(&triangles)?);
        self.accel_pool = Pool::default();
        self.accel_pool.keep(built.clone());
        self.accel = Some(built);
        self.accel_is_current = true;
        Ok(())
    }

    fn update_tree(&mut self) {
        let triangles = self.shape.layout.triangles(&self.positions);
        let old = self.tree.take();
        let kept = old.as_ref().filter(|tree| tree.decay() < DECAYED);
        let mut next = self.tree_pool.take(|| kept.map_or_else(Tree::default, |tree| Tree::clone(tree)));
        let out = Arc::get_mut(&mut next).expect("a taken buffer has one owner");
        match kept {
            // Buffers in the pool may be of an earlier build.
            Some(tree) => out.refit_from(tree, &triangles),
            None => out.rebuild(triangles.len(), |i| triangles.aabb(PrimId(i))),
        }
        if let Some(old) = old {
            self.tree_pool.keep(old);
        }
        self.tree = Some(next);
        self.tree_is_current = true;
    }

    fn refresh_frame(&mut self, object: &Object, changed: bool) {
        let same_layers = self.frame.as_ref().is_some_and(|frame| frame.layers == self.layers);
        if !changed && same_layers {
            return;
        }
        let tree = OnceLock::new();
        if let (Some(current), true) = (&self.tree, self.tree_is_current) {
            tree.get_or_init(|| current.clone());
        }
        self.frame = Some(Arc::new(PartFrame {
            object: ObjectId(narrow(self.object)),
            instance: object.scene.instances[self.number],
            class: object.classes[self.number],
            layers: self.layers,
            shape: self.shape.clone(),
            positions: self.positions.clone(),
            bounds: self.bounds,
            old_tree: self.tree.clone(),
            tree,
            accel: self.accel.clone().map(|accel| (accel, self.accel_is_current)),
        }));
    }
}

#[expect(clippy::cast_possible_truncation, reason = "objects are counted in 32 bits")]
fn narrow(number: usize) -> u32 {
    number as u32
}

/// Vertices of a mesh in the world: in f64, rounded once; beyond f32 the largest number.
#[expect(clippy::cast_possible_truncation, reason = "clamped first")]
fn place(vertices: &[Vec3], world_from_mesh: &DAffine3, out: &mut [Vec3]) {
    if *world_from_mesh == DAffine3::IDENTITY {
        out.copy_from_slice(vertices);
        return;
    }
    let rounded = |x: f64| x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32;
    for (to, from) in out.iter_mut().zip(vertices) {
        let p = world_from_mesh.transform_point3(from.as_dvec3());
        *to = Vec3::new(rounded(p.x), rounded(p.y), rounded(p.z));
    }
}

/// The least box around points, empty without any; `None` where one is NaN or lies at the end of f32 or beyond.
fn around(points: &[Vec3]) -> Option<Aabb> {
    let (mut low, mut high) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
    // NaN is lost in a minimum, so all sizes are compared as well.
    let mut sound = Vec4::ZERO.cmpeq(Vec4::ZERO);
    for p in points {
        let p = p.extend(0.0);
        (low, high) = (low.min(p), high.max(p));
        sound &= p.abs().cmplt(Vec4::MAX);
    }
    sound.all().then(|| Aabb { min: low.truncate(), max: high.truncate() })
}
