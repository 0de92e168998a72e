//! One object: a scene with its player, or a mesh.

use std::sync::Arc;

use glam::{DAffine3, Vec3};

use super::{CollideError, ObjectId};
use crate::{
    anim::{ActiveClip, MotionClass, Pose, classify},
    dynamics::Pool,
    geom::Aabb,
    scene::{LocalTransform, Mesh, MeshId, MeshPart, NodeId, PartInstance, Scene, SceneNode, Topology, Trs},
};

/// What moves an object's vertices.
#[derive(Debug)]
enum Source {
    /// Clips of its scene.
    Clips(Vec<ActiveClip>),
    /// A pose that the caller evaluated.
    Given,
    /// Vertices of a mesh, in its own space.
    Vertices(Vec<Vec3>),
}

/// What of an object's parts is to be computed anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Change {
    /// Nothing.
    None,
    /// What clips move.
    Posed,
    /// Everything.
    Placed,
}

#[derive(Debug)]
pub(super) struct Object {
    pub(super) scene: Arc<Scene>,
    pub(super) pose: Arc<Pose>,
    pub(super) classes: Vec<MotionClass>,
    pub(super) first_part: u32,
    pub(super) removed: bool,
    pub(super) change: Change,
    source: Source,
    place: DAffine3,
    /// Must be evaluated before the next snapshot.
    stale: bool,
    poses: Pool<Pose>,
}

impl Object {
    pub(super) fn scene(scene: Arc<Scene>, world_from_scene: DAffine3, first_part: u32) -> Self {
        Self {
            pose: Arc::new(Pose::rest(&scene)),
            classes: classify(&scene),
            scene,
            first_part,
            removed: false,
            change: Change::Placed,
            source: Source::Clips(Vec::new()),
            place: world_from_scene,
            stale: true,
            poses: Pool::default(),
        }
    }

    pub(super) fn mesh(
        name: &str,
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        world_from_mesh: DAffine3,
        first_part: u32,
    ) -> Self {
        let scene = mesh_scene(name, positions.clone(), triangles);
        let mut object = Self::scene(Arc::new(scene), world_from_mesh, first_part);
        object.source = Source::Vertices(positions);
        object
    }

    pub(super) fn set_clips(&mut self, id: ObjectId, clips: &[ActiveClip]) -> Result<(), CollideError> {
        let count = self.scene.clips.len();
        for clip in clips {
            if clip.clip.index() >= count {
                return Err(CollideError::NoSuchClip { object: id, clip: clip.clip.0, count });
            }
            if !clip.time_s.is_finite() {
                return Err(CollideError::NotFinite { what: "time" });
            }
        }
        match &mut self.source {
            Source::Vertices(_) => return Err(CollideError::NotAScene(id)),
            Source::Clips(old) => {
                let same =
                    |(a, b): (&ActiveClip, &ActiveClip)| a.clip == b.clip && a.time_s.to_bits() == b.time_s.to_bits();
                if old.len() == clips.len() && old.iter().zip(clips).all(same) {
                    return Ok(());
                }
                old.clear();
                old.extend_from_slice(clips);
                self.change = self.change.max(Change::Posed);
            }
            Source::Given => {
                self.source = Source::Clips(clips.to_vec());
                self.change = Change::Placed;
            }
        }
        self.stale = true;
        Ok(())
    }

    pub(super) fn set_pose(&mut self, id: ObjectId, pose: Arc<Pose>) -> Result<(), CollideError> {
        if matches!(self.source, Source::Vertices(_)) {
            return Err(CollideError::NotAScene(id));
        }
        if !pose.is_like(&self.pose) {
            return Err(CollideError::PoseOfAnotherScene(id));
        }
        self.source = Source::Given;
        self.pose = pose;
        self.stale = false;
        self.change = Change::Placed;
        Ok(())
    }

    pub(super) fn set_transform(&mut self, world_from_object: DAffine3) -> Result<(), CollideError> {
        finite(&world_from_object)?;
        let bits = |m: &DAffine3| m.to_cols_array().map(f64::to_bits);
        if bits(&self.place) != bits(&world_from_object) {
            self.place = world_from_object;
            self.stale = !matches!(self.source, Source::Given);
            if self.stale {
                self.change = Change::Placed;
            }
        }
        Ok(())
    }

    pub(super) fn set_vertices(&mut self, id: ObjectId, vertices: &[Vec3]) -> Result<(), CollideError> {
        let Source::Vertices(own) = &mut self.source else { return Err(CollideError::NotAMesh(id)) };
        let (actual, expected) = (vertices.len(), own.len());
        if actual != expected {
            return Err(CollideError::Count { what: "vertices", actual, expected });
        }
        // 0 for numbers, NaN for all else.
        let nothing = vertices.iter().fold(Vec3::ZERO, |sum, v| sum + *v * 0.0);
        if nothing != Vec3::ZERO {
            return Err(CollideError::NotFinite { what: "vertices" });
        }
        own.copy_from_slice(vertices);
        self.change = Change::Placed;
        Ok(())
    }

    /// Brings the pose up to date.
    pub(super) fn settle(&mut self) {
        if !std::mem::take(&mut self.stale) {
            return;
        }
        let mut next = self.poses.take(|| Pose::clone(&self.pose));
        let pose = Arc::get_mut(&mut next).expect("a taken buffer has one owner");
        let clips = if let Source::Clips(clips) = &self.source { &clips[..] } else { &[] };
        pose.evaluate(&self.scene, clips, &self.place);
        self.poses.keep(next.clone());
        self.pose = next;
    }

    /// Vertices that were set, and where they are placed; `None` where they follow from the pose.
    pub(super) fn own_vertices(&self) -> Option<(&[Vec3], &DAffine3)> {
        match &self.source {
            Source::Vertices(vertices) => Some((vertices, &self.place)),
            _ => None,
        }
    }
}

/// An error unless every entry is finite.
pub(super) fn finite(transform: &DAffine3) -> Result<(), CollideError> {
    if transform.is_finite() { Ok(()) } else { Err(CollideError::NotFinite { what: "transform" }) }
}

/// A part with nothing but its triangles.
pub(super) fn bare_part(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> MeshPart {
    MeshPart {
        topology: Topology::Triangles,
        positions,
        triangles,
        normals: Vec::new(),
        tangents: Vec::new(),
        tex_coords: Vec::new(),
        colors: Vec::new(),
        influences: None,
        targets: Vec::new(),
        material: None,
    }
}

/// A scene of one node with one mesh.
fn mesh_scene(name: &str, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Scene {
    let part = bare_part(positions, triangles);
    let node = SceneNode {
        name: name.to_owned(),
        parent: None,
        children: Vec::new(),
        local: LocalTransform::Trs(Trs::IDENTITY),
        mesh: Some(MeshId(0)),
        skin: None,
        camera: None,
        light: None,
        weights: None,
        copies: None,
    };
    Scene {
        file: name.to_owned(),
        scene_count: 1,
        nodes: vec![node],
        eval_order: vec![NodeId(0)],
        draw_order: vec![NodeId(0)],
        instances: vec![PartInstance { node: NodeId(0), mesh: MeshId(0), part: 0, copy: None }],
        meshes: vec![Mesh { name: name.to_owned(), parts: vec![part], weights: Vec::new() }],
        ..Scene::default()
    }
}

/// Corners and triangles of a box, wound counter-clockwise seen from outside.
pub(super) fn box_mesh(aabb: &Aabb) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { aabb.min[axis] } else { aabb.max[axis] };
    let corners = (0..8).map(|i| Vec3::new(pick(i, 0), pick(i, 1), pick(i, 2))).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    (corners, quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}
