//! A surface of a signed distance field as an even triangle mesh.
//!
//! Surface nets: one vertex in every grid cell that the surface crosses, one quadrilateral about every grid
//! edge that it cuts (S. F. Gibson, "Constrained elastic surface nets", 1998), then tangential relaxation with
//! projection back onto the surface. Grid lines may be spaced unevenly, so detail goes where it is wanted.

use std::collections::HashMap;

use glam::DVec3;

use super::sdf;

/// An indexed triangle mesh without attributes.
#[derive(Clone, Default)]
pub struct Surface {
    /// Vertices.
    pub positions: Vec<DVec3>,
    /// Corners, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// Grid lines along one axis from `start` to `end` with a spacing that `step` gives at each place.
pub fn grid_lines(start: f64, end: f64, step: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut lines = vec![start];
    let mut at = start;
    while at < end {
        at += step(at);
        lines.push(at);
    }
    lines
}

/// Extracts the zero surface of `field` on a grid.
pub fn extract(field: &impl Fn(DVec3) -> f64, axes: &[Vec<f64>; 3]) -> Surface {
    let size = [axes[0].len(), axes[1].len(), axes[2].len()];
    let at = |c: [usize; 3]| DVec3::new(axes[0][c[0]], axes[1][c[1]], axes[2][c[2]]);
    let index = |c: [usize; 3]| (c[2] * size[1] + c[1]) * size[0] + c[0];
    let cells = |f: &mut dyn FnMut([usize; 3])| {
        for z in 0..size[2] - 1 {
            for y in 0..size[1] - 1 {
                for x in 0..size[0] - 1 {
                    f([x, y, z]);
                }
            }
        }
    };
    let mut values = Vec::with_capacity(size.iter().product());
    for &z in &axes[2] {
        for &y in &axes[1] {
            values.extend(axes[0].iter().map(|&x| field(DVec3::new(x, y, z))));
        }
    }
    let mut surface = Surface::default();
    let mut vertex_of_cell = HashMap::new();
    cells(&mut |c| {
        if let Some(p) = cell_vertex(c, &|corner| (at(corner), values[index(corner)])) {
            vertex_of_cell.insert(c, surface.positions.len() as u32);
            surface.positions.push(p);
        }
    });
    cells(&mut |c| {
        for axis in 0..3 {
            let mut next = c;
            next[axis] += 1;
            let (here, there) = (values[index(c)] < 0.0, values[index(next)] < 0.0);
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            if here == there || c[u] == 0 || c[v] == 0 {
                continue;
            }
            let around = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
                let mut cell = c;
                cell[u] -= du;
                cell[v] -= dv;
                vertex_of_cell[&cell]
            });
            let [a, b, c, d] = if here { around } else { [around[3], around[2], around[1], around[0]] };
            let p = |i: u32| surface.positions[i as usize];
            if p(a).distance_squared(p(c)) <= p(b).distance_squared(p(d)) {
                surface.triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                surface.triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    });
    surface
}

/// The mean of the places where the surface cuts the cell's edges; `None` when it cuts none.
fn cell_vertex(cell: [usize; 3], corner: &impl Fn([usize; 3]) -> (DVec3, f64)) -> Option<DVec3> {
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for low in 0..8usize {
        for axis in (0..3).filter(|axis| low >> axis & 1 == 0) {
            let offset = |bits: usize| std::array::from_fn(|i| cell[i] + (bits >> i & 1));
            let ((p, a), (q, b)) = (corner(offset(low)), corner(offset(low | 1 << axis)));
            if (a < 0.0) != (b < 0.0) {
                sum += p + (q - p) * (a / (a - b));
                count += 1.0;
            }
        }
    }
    (count > 0.0).then(|| sum / count)
}

impl Surface {
    /// Vertices that share an edge with each vertex, in order of number.
    pub fn neighbours(&self) -> Vec<Vec<u32>> {
        let mut lists = vec![Vec::new(); self.positions.len()];
        for t in &self.triangles {
            for i in 0..3 {
                lists[t[i] as usize].extend([t[(i + 1) % 3], t[(i + 2) % 3]]);
            }
        }
        for list in &mut lists {
            list.sort_unstable();
            list.dedup();
        }
        lists
    }

    /// Evens out the mesh: each round moves vertices half way to the mean of their neighbours, then back onto
    /// the surface.
    pub fn relax(&mut self, field: &impl Fn(DVec3) -> f64, rounds: usize) {
        let neighbours = self.neighbours();
        for _ in 0..rounds {
            let moved = |(i, list): (usize, &Vec<u32>)| {
                let here = self.positions[i];
                let sum: DVec3 = list.iter().fold(DVec3::ZERO, |sum, &j| sum + self.positions[j as usize]);
                let pull = sum / list.len() as f64 - here;
                let n = sdf::normal(field, here, 5e-4);
                sdf::project(field, here + 0.5 * (pull - n * pull.dot(n)), 2)
            };
            self.positions = neighbours.iter().enumerate().map(moved).collect();
        }
    }
}
