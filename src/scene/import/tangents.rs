//! Tangents where the file has none and a normal map needs them.
//!
//! Follows MikkTSpace (Morten S. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008, and the
//! reference code that glTF names): every corner gives its triangle's direction of growing u, projected onto
//! the plane of the vertex normal and weighted by the corner's angle; corners of equal position,
//! normal and texture coordinate are averaged together, mirrored ones apart. It departs where a vertex has
//! corners of both orientations: vertices stay as the file has them, so the heavier orientation wins
//! instead of splitting the vertex. O(vertices + triangles).

use std::collections::HashMap;

use glam::{DVec2, DVec3, Vec2, Vec4};

use super::{
    super::{Material, Mesh, MeshPart, TextureRef, Topology},
    context::Context,
    error::Step,
};

/// Bytes that generating takes for each vertex, the result included.
const VERTEX_BYTES: usize = 256;

/// Fills in tangents of every part whose material has a normal map.
pub(super) fn fill(cx: &Context<'_>, meshes: &mut [Mesh], materials: &[Material]) -> Step<()> {
    for (m, mesh) in meshes.iter_mut().enumerate() {
        for (p, part) in mesh.parts.iter_mut().enumerate() {
            let map = part.material.and_then(|m| materials[m.index()].normal_texture);
            let Some(map) = map.filter(|_| part.tangents.is_empty() && !part.normals.is_empty()) else { continue };
            let Some(set) = part.tex_coords.get(map.tex_coord as usize) else { continue };
            if part.topology == Topology::Triangles {
                let place = format_args!("meshes[{m}].primitives[{p}]");
                cx.budget.take(part.positions.len(), VERTEX_BYTES, place)?;
                part.tangents = generate(part, set, &map);
            }
        }
    }
    Ok(())
}

/// Sum of one vertex's corners of one orientation.
#[derive(Clone, Copy, Default)]
struct Sum {
    tangent: DVec3,
    angle: f64,
}

/// One tangent a vertex; `w` is the sign of the bitangent, which points along falling v.
fn generate(part: &MeshPart, set: &[Vec2], map: &TextureRef) -> Vec<Vec4> {
    let welded = weld(part, set);
    let groups = welded.iter().max().map_or(0, |&g| g as usize + 1);
    // [u and v right-handed (v upwards), mirrored]
    let mut by_group = vec![[Sum::default(); 2]; groups];
    let mut by_vertex = vec![[0.0_f64; 2]; set.len()];
    let turned = turned(set, map);
    for triangle in &part.triangles {
        let [a, b, c] = triangle.map(|i| i as usize);
        let Some((direction, orientation)) = direction(part, &turned, [a, b, c]) else { continue };
        for [at, next, previous] in [[a, b, c], [b, c, a], [c, a, b]] {
            let normal = part.normals[at].as_dvec3().normalize_or_zero();
            let tangent = (direction - normal * normal.dot(direction)).normalize_or_zero();
            let angle = corner_angle(part, normal, [at, next, previous]);
            let sum = &mut by_group[welded[at] as usize][orientation];
            sum.tangent += tangent * angle;
            sum.angle += angle;
            by_vertex[at][orientation] += angle;
        }
    }
    (0..set.len()).map(|i| finish(part, i, &by_group[welded[i] as usize], by_vertex[i])).collect()
}

/// Number of each vertex's group: equal position, normal and texture coordinate, bit for bit.
fn weld(part: &MeshPart, set: &[Vec2]) -> Vec<u32> {
    let mut known: HashMap<[u32; 8], u32> = HashMap::with_capacity(set.len());
    let mut groups = Vec::with_capacity(set.len());
    for ((p, n), t) in part.positions.iter().zip(&part.normals).zip(set) {
        let key = [p.x, p.y, p.z, n.x, n.y, n.z, t.x, t.y].map(|v| (v + 0.0).to_bits());
        let next = u32::try_from(known.len()).unwrap_or(u32::MAX);
        groups.push(*known.entry(key).or_insert(next));
    }
    groups
}

/// Texture coordinates as the map reads them, without the offset.
fn turned(set: &[Vec2], map: &TextureRef) -> Vec<DVec2> {
    let (sin, cos) = (libm::sin(map.rotation.into()), libm::cos(map.rotation.into()));
    let turn = |t: &Vec2| {
        let t = (*t * map.scale).as_dvec2();
        DVec2::new(cos * t.x + sin * t.y, cos * t.y - sin * t.x)
    };
    set.iter().map(turn).collect()
}

/// A triangle's unit direction of growing u and its orientation: 0 where v grows downwards when seen from
/// the front with u to the right, as in an unmirrored texture, else 1.
fn direction(part: &MeshPart, coords: &[DVec2], [a, b, c]: [usize; 3]) -> Option<(DVec3, usize)> {
    let origin = part.positions[a].as_dvec3();
    let (e1, e2) = (part.positions[b].as_dvec3() - origin, part.positions[c].as_dvec3() - origin);
    let (t1, t2) = (coords[b] - coords[a], coords[c] - coords[a]);
    let area = t1.perp_dot(t2);
    let along = (e1 * t2.y - e2 * t1.y) * if area < 0.0 { -1.0 } else { 1.0 };
    let along = along.normalize_or_zero();
    (area != 0.0 && area.is_finite() && along != DVec3::ZERO).then_some((along, usize::from(area > 0.0)))
}

/// Angle between the two edges at a corner, seen along the normal.
fn corner_angle(part: &MeshPart, normal: DVec3, [at, next, previous]: [usize; 3]) -> f64 {
    let origin = part.positions[at].as_dvec3();
    let edge = |to: usize| {
        let edge = part.positions[to].as_dvec3() - origin;
        (edge - normal * normal.dot(edge)).normalize_or_zero()
    };
    libm::acos(edge(next).dot(edge(previous)).clamp(-1.0, 1.0))
}

fn finish(part: &MeshPart, vertex: usize, group: &[Sum; 2], own: [f64; 2]) -> Vec4 {
    let mirrored = usize::from(own[1] > own[0]);
    let normal = part.normals[vertex].as_dvec3().normalize_or_zero();
    let mut tangent = group[mirrored].tangent.normalize_or_zero();
    if tangent == DVec3::ZERO {
        // No triangle says: any direction in the plane.
        tangent = normal.any_orthogonal_vector().normalize_or(DVec3::X);
    }
    tangent.as_vec3().extend(if mirrored == 1 { -1.0 } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, Vec4};

    use super::*;
    use crate::scene::TextureId;

    fn map() -> TextureRef {
        TextureRef { texture: TextureId(0), tex_coord: 0, offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE }
    }

    /// A unit square in the xy plane facing +Z; `coords` for (0,0), (1,0), (1,1), (0,1).
    fn square(coords: [[f32; 2]; 4]) -> (MeshPart, Vec<Vec2>) {
        let part = MeshPart {
            topology: Topology::Triangles,
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            normals: vec![Vec3::Z; 4],
            tangents: Vec::new(),
            tex_coords: Vec::new(),
            colors: Vec::new(),
            influences: None,
            targets: Vec::new(),
            material: None,
        };
        (part, coords.map(Vec2::from_array).to_vec())
    }

    #[test]
    fn an_upright_texture_has_its_bitangent_upwards() {
        let (part, set) = square([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        assert_eq!(generate(&part, &set, &map()), [Vec4::new(1.0, 0.0, 0.0, 1.0); 4]);
    }

    #[test]
    fn a_mirrored_texture_turns_tangent_and_sign() {
        let (part, set) = square([[1.0, 1.0], [0.0, 1.0], [0.0, 0.0], [1.0, 0.0]]);
        assert_eq!(generate(&part, &set, &map()), [Vec4::new(-1.0, 0.0, 0.0, -1.0); 4]);
    }

    #[test]
    fn a_quarter_turn_of_the_map_turns_the_tangent() {
        let (part, set) = square([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        let map = TextureRef { rotation: std::f32::consts::FRAC_PI_2, ..map() };
        for tangent in generate(&part, &set, &map) {
            assert!((tangent - Vec4::new(0.0, -1.0, 0.0, 1.0)).length() < 1e-6, "{tangent}");
        }
    }

    #[test]
    fn degenerate_coordinates_still_give_unit_tangents_in_the_plane() {
        let (part, set) = square([[0.5, 0.5]; 4]);
        for tangent in generate(&part, &set, &map()) {
            let t = tangent.truncate();
            assert!((t.length() - 1.0).abs() < 1e-6 && t.z.abs() < 1e-6);
        }
    }
}
