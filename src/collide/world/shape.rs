//! What of a part stays the same however it moves.

use std::{
    collections::{HashMap, HashSet},
    sync::{Arc, OnceLock},
};

use glam::Vec3;

use crate::{
    geom::{Aabb, InstanceId, PrimId},
    scene::MeshPart,
    world::GroupLayout,
};

/// An edge that keeps a part from being closed, by vertex numbers, and why.
pub(in crate::collide) type OpenEdge = ([u32; 2], &'static str);

/// Topology of a part, and what follows from it when asked for.
#[derive(Debug)]
pub(in crate::collide) struct PartShape {
    /// The part as a group of its own.
    pub(in crate::collide) layout: Arc<GroupLayout>,
    /// Vertices in the rest pose.
    rest: Vec<Vec3>,
    /// Whether every vertex is a corner of a triangle.
    all_used: bool,
    first_there: OnceLock<Vec<u32>>,
    welded: OnceLock<Vec<[u32; 3]>>,
    owned: OnceLock<Vec<u8>>,
    closed: OnceLock<Result<(), OpenEdge>>,
}

impl PartShape {
    pub(super) fn new(part: &MeshPart, number: u32) -> Self {
        let layout = GroupLayout {
            indices: part.triangles.clone(),
            topology_epoch: u64::from(number) + 1,
            vertex_count: part.positions.len(),
            instances: vec![InstanceId(number)],
            first_prims: vec![0],
        };
        Self {
            layout: Arc::new(layout),
            rest: part.positions.clone(),
            all_used: all_used(part),
            first_there: OnceLock::new(),
            welded: OnceLock::new(),
            owned: OnceLock::new(),
            closed: OnceLock::new(),
        }
    }

    /// Corners of each triangle by vertex.
    pub(in crate::collide) fn triangles(&self) -> &[[u32; 3]] {
        &self.layout.indices
    }

    /// For each vertex the first one at its place of the rest pose.
    ///
    /// glTF splits vertices where normals or texture coordinates differ; the surface goes on there.
    fn first_there(&self) -> &[u32] {
        self.first_there.get_or_init(|| {
            let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(self.rest.len());
            // Adding 0 makes -0 a 0.
            let place = |p: &Vec3| (*p + Vec3::ZERO).to_array().map(f32::to_bits);
            (0..).zip(&self.rest).map(|(i, p)| *first.entry(place(p)).or_insert(i)).collect()
        })
    }

    /// The first vertex at a vertex' place of the rest pose.
    #[inline(always)]
    pub(in crate::collide) fn welded_vertex(&self, vertex: u32) -> u32 {
        self.first_there()[vertex as usize]
    }

    /// Corners of each triangle by vertex, where all vertices at one place of the rest pose count as the first of them.
    pub(in crate::collide) fn welded(&self) -> &[[u32; 3]] {
        let corner = |c: u32| self.welded_vertex(c);
        self.welded.get_or_init(|| self.triangles().iter().map(|corners| corners.map(corner)).collect())
    }

    /// Which of its vertices (bits 0 to 2) and edges (3 to 5, from each corner to the next) each triangle is the lowest with.
    pub(in crate::collide) fn owned(&self) -> &[u8] {
        self.owned.get_or_init(|| {
            let mut vertices = vec![false; self.rest.len()];
            let mut edges = HashSet::with_capacity(self.len() * 3 / 2);
            let mut owned = |corners: &[u32; 3]| {
                let mut bits = 0;
                for i in 0..3 {
                    let (v, w) = (corners[i], corners[(i + 1) % 3]);
                    if !std::mem::replace(&mut vertices[v as usize], true) {
                        bits |= 1 << i;
                    }
                    if edges.insert([v.min(w), v.max(w)]) {
                        bits |= 8 << i;
                    }
                }
                bits
            };
            self.triangles().iter().map(&mut owned).collect()
        })
    }

    /// Whether every edge is shared by two triangles that run along it in opposite directions, once welded; triangles
    /// with two corners in one do not count.
    pub(in crate::collide) fn closed(&self) -> Result<(), OpenEdge> {
        *self.closed.get_or_init(|| {
            let mut edges = HashSet::new();
            let solid = |t: &&[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
            for [a, b, c] in self.welded().iter().filter(solid) {
                for edge in [[*a, *b], [*b, *c], [*c, *a]] {
                    if !edges.insert(edge) {
                        return Err((edge, "is run along twice in one direction"));
                    }
                }
            }
            // In order of the triangles, so that the answer is always the same.
            for [a, b, c] in self.welded().iter().filter(solid) {
                for [from, to] in [[*a, *b], [*b, *c], [*c, *a]] {
                    if !edges.contains(&[to, from]) {
                        return Err(([from, to], "has a triangle on one side only"));
                    }
                }
            }
            Ok(())
        })
    }

    /// Number of triangles.
    pub(in crate::collide) fn len(&self) -> usize {
        self.layout.indices.len()
    }

    /// The least box around all triangles, of that around all vertices; without negative zeros.
    pub(in crate::collide) fn bounds(&self, positions: &[Vec3], of_vertices: Aabb) -> Aabb {
        let corners = || self.triangles().iter().flatten().map(|&i| positions[i as usize]);
        let all = if self.all_used { of_vertices } else { Aabb::from_points(corners()) };
        Aabb { min: all.min + Vec3::ZERO, max: all.max + Vec3::ZERO }
    }

    /// Corners of a triangle.
    #[inline(always)]
    pub(in crate::collide) fn corners(&self, positions: &[Vec3], triangle: PrimId) -> [Vec3; 3] {
        // Not by `map`, whose closure would stay a call in kernels.
        let [a, b, c] = self.layout.indices[triangle.0 as usize];
        [positions[a as usize], positions[b as usize], positions[c as usize]]
    }
}

fn all_used(part: &MeshPart) -> bool {
    let mut used = vec![false; part.positions.len()];
    part.triangles.iter().flatten().for_each(|&i| used[i as usize] = true);
    used.into_iter().all(|used| used)
}
