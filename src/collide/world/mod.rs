//! The world that collisions are asked of: scenes and meshes at places, and snapshots of them.

mod error;
mod object;
mod part;
mod shape;

use std::{
    fmt,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use glam::{DAffine3, Vec3};
use rayon::prelude::*;

use super::{BroadPhase, Snapshot, snapshot::Frame};
use crate::{
    accel::{AccelSpec, BuildError},
    anim::{ActiveClip, Pose},
    geom::{Aabb, Forms},
    scene::Scene,
    simd::check_float_mode,
    world::TopKind,
};

pub use error::CollideError;
use object::{Change, Object, box_mesh, finite};
pub(super) use part::PartFrame;
use part::{Part, Wants};

/// Number of an object, in order of addition; never used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectId(pub u32);

/// Number of a part of a world: a part instance of a scene, a mesh or a box, in order of addition.
///
/// In hits of rays it is the number of the instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartId(pub u32);

impl PartId {
    /// As an array index.
    #[inline(always)]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Which layers a part is on, and which it touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layers {
    /// Layers that the part is on, a bit each; a query finds it when it asks for one of them, and never on none.
    pub on: u32,
    /// Layers of other parts that it can touch.
    pub sees: u32,
}

impl Default for Layers {
    /// On the first layer, touching all.
    fn default() -> Self {
        Self { on: 1, sees: u32::MAX }
    }
}

impl Layers {
    /// Every layer.
    pub const ALL: u32 = u32::MAX;

    /// Whether two parts can touch: each is on a layer that the other sees.
    pub fn meet(self, other: Self) -> bool {
        self.on & other.sees != 0 && other.on & self.sees != 0
    }
}

/// Settings of a world.
#[derive(Clone, Debug)]
pub struct CollisionConfig {
    /// Structure for rays, as `bvh8` or `bvh2:leaf=4`.
    pub accel: String,
    /// Structure over parts for rays: `bvh2`, `events` or `list`.
    pub top: String,
    /// Whether the first snapshot already has what rays need; else it is made at the first ray.
    pub rays: bool,
    /// Whether the first snapshot already has what all other queries need; else it is made at the first of them, part by part.
    pub contacts: bool,
}

impl Default for CollisionConfig {
    fn default() -> Self {
        Self { accel: "bvh8".to_owned(), top: "bvh2".to_owned(), rays: false, contacts: false }
    }
}

/// What snapshots were asked for, so that later ones have it ready.
#[derive(Debug, Default)]
pub(super) struct Asked {
    pub(super) rays: AtomicBool,
    pub(super) trees: AtomicBool,
    pub(super) pairs: AtomicBool,
}

impl Asked {
    pub(super) fn note(flag: &AtomicBool) {
        if !flag.load(Ordering::Relaxed) {
            flag.store(true, Ordering::Relaxed);
        }
    }
}

/// Scenes, meshes and boxes at places, of which [`CollisionWorld::snapshot`] takes an immutable picture that answers queries.
///
/// What is hit, touched and measured are the world-space `f32` vertices of the exact pose: for scenes the very ones that `kinora pose`
/// prints. Structures are kept from snapshot to snapshot and refitted to what moved, or built anew where that pays; only what
/// queries ask for is kept. Every answer is that of the vertices alone: it does not depend on structures, threads or earlier snapshots.
pub struct CollisionWorld {
    spec: Arc<AccelSpec>,
    top: TopKind,
    asked: Arc<Asked>,
    objects: Vec<Object>,
    parts: Vec<Part>,
    broad: BroadPhase,
    last: Option<Snapshot>,
    changed: bool,
}

impl fmt::Debug for CollisionWorld {
    /// Sizes only: the contents fill pages.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CollisionWorld")
            .field("objects", &self.objects.len())
            .field("parts", &self.parts.len())
            .finish_non_exhaustive()
    }
}

/// Most parts, and triangles or vertices of one: structures number up to four of them in 32 bits.
const LIMIT: usize = u32::MAX as usize / 16;

impl CollisionWorld {
    /// An empty world.
    ///
    /// # Errors
    /// When a structure's name or setting is unknown.
    pub fn new(config: &CollisionConfig) -> Result<Self, CollideError> {
        let spec: AccelSpec = config.accel.parse().map_err(BuildError::from)?;
        let asked = Asked {
            rays: AtomicBool::new(config.rays),
            trees: AtomicBool::new(config.contacts),
            pairs: AtomicBool::new(config.contacts),
        };
        Ok(Self {
            spec: Arc::new(spec),
            top: config.top.parse().map_err(BuildError::from)?,
            asked: Arc::new(asked),
            objects: Vec::new(),
            parts: Vec::new(),
            broad: BroadPhase::default(),
            last: None,
            changed: true,
        })
    }

    /// Adds a scene in its rest pose. Its part instances become parts, in pose order.
    ///
    /// # Errors
    /// When the transform is not finite, or there are more parts or triangles than fit.
    pub fn add_scene(&mut self, scene: Arc<Scene>, world_from_scene: DAffine3) -> Result<ObjectId, CollideError> {
        finite(&world_from_scene)?;
        self.room(&scene)?;
        let first = self.next_part();
        self.add(Object::scene(scene, world_from_scene, first))
    }

    /// Adds a mesh of its own: vertices N x 3 in the mesh's space, corners of triangles M x 3. It becomes one part.
    ///
    /// # Errors
    /// When a vertex or the transform is not finite, an index is out of range, or there is more than fits.
    pub fn add_mesh(
        &mut self,
        name: &str,
        vertices: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        world_from_mesh: DAffine3,
    ) -> Result<ObjectId, CollideError> {
        finite(&world_from_mesh)?;
        if !vertices.iter().all(|v| v.is_finite()) {
            return Err(CollideError::NotFinite { what: "vertices" });
        }
        check("vertices", vertices.len())?;
        check("triangles", triangles.len())?;
        check("parts", self.parts.len() + 1)?;
        let count = vertices.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&i| i as usize >= count) {
                return Err(CollideError::IndexOutOfRange { triangle, vertex, count });
            }
        }
        let first = self.next_part();
        self.add(Object::mesh(name, vertices, triangles, world_from_mesh, first))
    }

    /// Adds a box as a mesh of twelve triangles, wound counter-clockwise seen from outside. Its vertices are numbered by bits: 1 for the upper
    /// end on x, 2 on y, 4 on z.
    ///
    /// # Errors
    /// When the box is empty, or a number of it or of the transform is not finite.
    pub fn add_box(&mut self, name: &str, aabb: Aabb, world_from_box: DAffine3) -> Result<ObjectId, CollideError> {
        if aabb.is_empty() {
            return Err(CollideError::EmptyBox { what: "box" });
        }
        let (vertices, triangles) = box_mesh(&aabb);
        self.add_mesh(name, vertices, triangles, world_from_box)
    }

    /// Takes an object away. Its parts keep their numbers and have no triangles from then on.
    ///
    /// # Errors
    /// When there is no such object.
    pub fn remove(&mut self, object: ObjectId) -> Result<(), CollideError> {
        let parts = self.part_range(object)?;
        self.objects[object.0 as usize].removed = true;
        self.parts[parts].iter_mut().for_each(Part::remove);
        self.changed = true;
        Ok(())
    }

    /// Plays clips together at their times, a later one winning where two drive the same target; none for the rest pose.
    ///
    /// # Errors
    /// When there is no such object or clip, a time is not finite, or the object is a mesh.
    pub fn set_time(&mut self, object: ObjectId, clips: &[ActiveClip]) -> Result<(), CollideError> {
        self.object(object)?.set_clips(object, clips)
    }

    /// Takes a pose that the caller evaluated, with its own `world_from_scene`; [`CollisionWorld::set_transform`] does nothing to it.
    ///
    /// # Errors
    /// When there is no such object, the object is a mesh, or the pose was made for another scene.
    pub fn set_pose(&mut self, object: ObjectId, pose: Arc<Pose>) -> Result<(), CollideError> {
        self.object(object)?.set_pose(object, pose)
    }

    /// Moves an object as a whole.
    ///
    /// # Errors
    /// When there is no such object, or the transform is not finite.
    pub fn set_transform(&mut self, object: ObjectId, world_from_object: DAffine3) -> Result<(), CollideError> {
        self.object(object)?.set_transform(world_from_object)
    }

    /// Gives a mesh or a box other vertices, as many as before, in its own space.
    ///
    /// # Errors
    /// When there is no such object, it is a scene, the number differs, or one is not finite. The vertices are then as before.
    pub fn set_vertices(&mut self, object: ObjectId, vertices: &[Vec3]) -> Result<(), CollideError> {
        self.object(object)?.set_vertices(object, vertices)
    }

    /// The parts of an object, in pose order.
    ///
    /// # Errors
    /// When there is no such object.
    pub fn parts(&self, object: ObjectId) -> Result<impl ExactSizeIterator<Item = PartId> + use<>, CollideError> {
        let range = self.part_range(object)?;
        #[expect(clippy::cast_possible_truncation, reason = "parts are counted in 32 bits")]
        let narrow = |i: usize| PartId(i as u32);
        Ok(range.map(narrow))
    }

    /// Puts a part on layers; from the next snapshot on.
    ///
    /// # Errors
    /// When there is no such part.
    pub fn set_layers(&mut self, part: PartId, layers: Layers) -> Result<(), CollideError> {
        let count = self.parts.len();
        let state = self.parts.get_mut(part.index()).ok_or(CollideError::NoSuchPart { part, count })?;
        self.changed |= state.layers != layers;
        state.layers = layers;
        Ok(())
    }

    /// The world as it stands, for any number of threads and as long as anyone likes.
    ///
    /// Poses, deforms and refits what moved, in the current rayon pool; in steady state nothing is allocated for vertices and
    /// structures. When nothing changed it is the last snapshot again.
    ///
    /// # Errors
    /// When a vertex lies at the end of f32, a structure cannot be built, or foreign code changed how this thread computes. The next
    /// call tries again.
    pub fn snapshot(&mut self) -> Result<Snapshot, CollideError> {
        check_float_mode()?;
        let asked = |flag: &AtomicBool| flag.load(Ordering::Relaxed);
        let moved = self.objects.iter().any(|o| o.change != Change::None);
        if let (false, false, Some(last)) = (moved, self.changed, &self.last) {
            return Ok(last.clone());
        }
        self.changed = true;
        self.objects.iter_mut().for_each(Object::settle);
        let rays = asked(&self.asked.rays).then(|| Arc::clone(&self.spec));
        let wants = Wants { rays: rays.as_deref(), trees: asked(&self.asked.trees) };
        let objects = &self.objects;
        match &mut self.parts[..] {
            [only] => only.update(&objects[only.object], wants),
            parts => parts.par_iter_mut().for_each(|part| part.update(&objects[part.object], wants)),
        }
        for part in &mut self.parts {
            std::mem::replace(&mut part.outcome, Ok(()))?;
        }
        for object in &mut self.objects {
            object.change = Change::None;
        }
        debug_assert!(self.parts.iter().all(|p| p.frame.is_some()), "every part was updated");
        let frame = Frame {
            parts: self.parts.iter().filter_map(|p| p.frame.clone()).collect(),
            objects: self
                .objects
                .iter()
                .map(|o| (o.scene.clone(), o.pose.clone(), o.own_vertices().is_some()))
                .collect(),
            spec: self.spec.clone(),
            top: self.top,
            forms: Forms::default(),
            asked: self.asked.clone(),
        };
        let broad = asked(&self.asked.pairs).then_some(&mut self.broad);
        let snapshot = Snapshot::new(frame, broad, wants.rays.is_some())?;
        self.last = Some(snapshot.clone());
        self.changed = false;
        Ok(snapshot)
    }

    /// How the level over parts was kept so far.
    pub fn broad_phase(&self) -> &BroadPhase {
        &self.broad
    }

    fn add(&mut self, object: Object) -> Result<ObjectId, CollideError> {
        check("objects", self.objects.len() + 1)?;
        let number = self.objects.len();
        for (i, id) in (0..object.scene.instances.len()).zip(object.first_part..) {
            self.parts.push(Part::new(number, i, PartId(id), &object.scene));
        }
        self.objects.push(object);
        self.changed = true;
        #[expect(clippy::cast_possible_truncation, reason = "checked")]
        Ok(ObjectId(number as u32))
    }

    #[expect(clippy::cast_possible_truncation, reason = "checked before parts are added")]
    fn next_part(&self) -> u32 {
        self.parts.len() as u32
    }

    fn room(&self, scene: &Scene) -> Result<(), CollideError> {
        check("parts", self.parts.len().saturating_add(scene.instances.len()))?;
        for &instance in &scene.instances {
            let part = scene.part(instance);
            check("triangles", part.triangles.len())?;
            check("vertices", part.positions.len())?;
        }
        Ok(())
    }

    fn object(&mut self, id: ObjectId) -> Result<&mut Object, CollideError> {
        let object = self.objects.get_mut(id.0 as usize).filter(|o| !o.removed);
        object.ok_or(CollideError::NoSuchObject(id))
    }

    fn part_range(&self, id: ObjectId) -> Result<std::ops::Range<usize>, CollideError> {
        let object = self.objects.get(id.0 as usize).filter(|o| !o.removed).ok_or(CollideError::NoSuchObject(id))?;
        let first = object.first_part as usize;
        Ok(first..first + object.scene.instances.len())
    }
}

fn check(what: &'static str, actual: usize) -> Result<(), CollideError> {
    if actual > LIMIT { Err(CollideError::TooMany { what, actual, limit: LIMIT }) } else { Ok(()) }
}
