//! Simple meshes with normals and texture coordinates.

use glam::{DVec2, DVec3};

use super::{
    glb::Glb,
    maths::{cos_turns, sin_turns},
};

/// A triangle mesh with one normal and texture coordinate a vertex.
#[derive(Clone, Default)]
pub struct Shape {
    /// Vertices.
    pub positions: Vec<DVec3>,
    /// Unit normals.
    pub normals: Vec<DVec3>,
    /// Texture coordinates.
    pub tex_coords: Vec<DVec2>,
    /// Corners, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// Adds a vertex; returns its number.
    pub fn vertex(&mut self, position: DVec3, normal: DVec3, tex_coord: DVec2) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.tex_coords.push(tex_coord);
        self.positions.len() as u32 - 1
    }

    /// Adds two triangles over four vertices, counter-clockwise from outside.
    pub fn quad(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// Adds a flat quadrilateral, counter-clockwise from outside, textured by its place in `map`.
    pub fn face(&mut self, corners: [DVec3; 4], map: impl Fn(DVec3) -> DVec2) {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(DVec3::Y);
        let numbers = corners.map(|p| self.vertex(p, normal, map(p)));
        self.quad(numbers);
    }

    /// Adds a grid of `columns` by `rows` quadrilaterals over the surface `at(u, v)`, u and v in [0, 1], which
    /// gives place and unit normal; `at_u x at_v` must point outside.
    pub fn sheet(&mut self, columns: usize, rows: usize, at: impl Fn(f64, f64) -> (DVec3, DVec3)) {
        let first = self.positions.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                let (u, v) = (column as f64 / columns as f64, row as f64 / rows as f64);
                let (position, normal) = at(u, v);
                self.vertex(position, normal, DVec2::new(u, v));
            }
        }
        let stride = columns as u32 + 1;
        for row in 0..rows as u32 {
            for column in 0..columns as u32 {
                let a = first + row * stride + column;
                self.quad([a, a + 1, a + 1 + stride, a + stride]);
            }
        }
    }

    /// A surface of revolution about y: `profile` lists radius, height and normal (radial, upward), from the
    /// outside's bottom to its top.
    pub fn turned(&mut self, sides: usize, profile: &[(f64, f64, DVec2)]) {
        let first = self.positions.len() as u32;
        for (k, &(radius, height, normal)) in profile.iter().enumerate() {
            for side in 0..=sides {
                let u = side as f64 / sides as f64;
                let (s, c) = (sin_turns(u), cos_turns(u));
                let position = DVec3::new(radius * s, height, radius * c);
                let normal = DVec3::new(normal.x * s, normal.y, normal.x * c);
                self.vertex(position, normal, DVec2::new(u, k as f64));
            }
        }
        let stride = sides as u32 + 1;
        for row in 0..profile.len() as u32 - 1 {
            for side in 0..sides as u32 {
                let a = first + row * stride + side;
                self.quad([a, a + 1, a + 1 + stride, a + stride]);
            }
        }
    }

    /// Adds another mesh.
    pub fn append(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.tex_coords.extend(&other.tex_coords);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
    }

    /// Writes one mesh for each material over the same vertices, without texture coordinates.
    pub fn write_each(&self, glb: &mut Glb, name: &str, materials: &[usize]) -> Vec<usize> {
        let attributes = [("POSITION", glb.positions(&self.positions)), ("NORMAL", glb.vectors(&self.normals))];
        let indices = glb.triangles(&self.triangles);
        materials.iter().map(|&material| glb.mesh(name, &attributes, indices, material)).collect()
    }

    /// Writes the mesh; returns its number.
    pub fn write(&self, glb: &mut Glb, name: &str, material: usize) -> usize {
        let attributes = [
            ("POSITION", glb.positions(&self.positions)),
            ("NORMAL", glb.vectors(&self.normals)),
            ("TEXCOORD_0", glb.tex_coords(&self.tex_coords)),
        ];
        let indices = glb.triangles(&self.triangles);
        glb.mesh(name, &attributes, indices, material)
    }
}

/// A box with half sides `half`, whose edges are cut off by `bevel`.
pub fn beveled_box(half: DVec3, bevel: f64) -> Shape {
    let mut shape = Shape::default();
    let flat = half - DVec3::splat(bevel);
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let signs = [-1.0, 1.0];
    // Moves the corner with the given signs out to the face along `axis`.
    let corner = |sign: DVec3, axis: usize| sign * (flat + axes[axis] * bevel);
    let map = |axis: usize, scale: DVec3| {
        move |p: DVec3| {
            let q = p / scale * 0.5 + DVec3::splat(0.5);
            match axis {
                0 => DVec2::new(q.z, 1.0 - q.y),
                1 => DVec2::new(q.x, q.z),
                _ => DVec2::new(q.x, 1.0 - q.y),
            }
        }
    };
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for s in signs {
            let at = |a: f64, b: f64| corner(axes[axis] * s + axes[u] * (a * s) + axes[v] * b, axis);
            shape.face([at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)], map(axis, half));
        }
        // The four edges along this axis join the faces across u and v.
        for (su, sv) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let at = |along: f64, face: usize| corner(axes[axis] * along + axes[u] * su + axes[v] * sv, face);
            let ring = [at(-1.0, u), at(1.0, u), at(1.0, v), at(-1.0, v)];
            let outward = (ring[1] - ring[0]).cross(ring[2] - ring[0]).dot(axes[u] * su + axes[v] * sv) > 0.0;
            let ring = if outward { ring } else { [ring[3], ring[2], ring[1], ring[0]] };
            shape.face(ring, map(u, half));
        }
    }
    for bits in 0..8u32 {
        let sign = |i: u32| signs[(bits >> i & 1) as usize];
        let s = DVec3::new(sign(0), sign(1), sign(2));
        let mut points = [corner(s, 0), corner(s, 1), corner(s, 2)];
        if s.x * s.y * s.z < 0.0 {
            points.swap(1, 2);
        }
        let numbers = points.map(|p| shape.vertex(p, s.normalize(), map(1, half)(p)));
        shape.triangles.push(numbers);
    }
    shape
}
