//! Meshes: attributes, triangles and morph targets of every primitive.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3, Vec4};

use super::{
    super::{MaterialId, Mesh, MeshPart, MorphTarget, Topology},
    accessor::Component,
    context::{Context, check_index, to_f32},
    error::{Problem, Step},
    influences,
    json::{self, AccessorType, Idx},
    topology,
};

/// A mesh and what nodes that use it must be checked against.
#[derive(Debug)]
pub(super) struct ImportedMesh {
    pub(super) mesh: Mesh,
    /// For each part, the largest joint number that any vertex gives weight to.
    pub(super) max_joint: Vec<Option<u16>>,
}

/// All meshes.
pub(super) fn import(cx: &Context<'_>) -> Step<Vec<ImportedMesh>> {
    let meshes: Step<Vec<_>> = cx.doc.meshes.iter().enumerate().map(|(i, mesh)| import_mesh(cx, i, mesh)).collect();
    let meshes = meshes?;
    let parts = || meshes.iter().flat_map(|m| &m.mesh.parts);
    let untraced = parts().filter(|p| p.topology != Topology::Triangles).count();
    if untraced > 0 {
        cx.warnings.add("meshes", format_args!("{untraced} primitives of points or lines are posed but not drawn"));
    }
    Ok(meshes)
}

fn import_mesh(cx: &Context<'_>, index: usize, source: &json::Mesh) -> Step<ImportedMesh> {
    let place = format!("meshes[{index}]");
    cx.budget.take(source.primitives.len(), size_of::<MeshPart>(), &place)?;
    let mut mesh = Mesh { name: source.name.as_deref().unwrap_or_default().to_owned(), ..Mesh::default() };
    let mut max_joint = Vec::new();
    for (i, primitive) in source.primitives.iter().enumerate() {
        let (part, joint) = import_part(cx, primitive, &format!("{place}.primitives[{i}]"))?;
        mesh.parts.push(part);
        max_joint.push(joint);
    }
    let targets = mesh.parts.iter().map(|p| p.targets.len()).max().unwrap_or(0);
    if mesh.parts.iter().any(|p| p.targets.len() != targets) {
        cx.warnings.add(&place, "primitives have different numbers of morph targets; missing ones do not move");
    }
    mesh.weights = morph_weights(cx, source.weights.as_deref(), targets, &place)?.unwrap_or_else(|| vec![0.0; targets]);
    Ok(ImportedMesh { mesh, max_joint })
}

/// Default weights fitted to the number of targets; `None` when the file gives none.
pub(super) fn morph_weights(
    cx: &Context<'_>,
    weights: Option<&[f64]>,
    targets: usize,
    place: &str,
) -> Step<Option<Vec<f32>>> {
    let Some(weights) = weights else { return Ok(None) };
    if weights.len() != targets {
        let reason = format!("{} weights for {targets} morph targets; missing ones are 0", weights.len());
        cx.warnings.add(format_args!("{place}.weights"), reason);
    }
    cx.budget.take(targets, 4, place)?;
    let mut fitted: Vec<f32> = weights.iter().take(targets).map(|&w| to_f32(w)).collect();
    fitted.resize(targets, 0.0);
    Ok(Some(fitted))
}

fn import_part(cx: &Context<'_>, source: &json::Primitive, place: &str) -> Step<(MeshPart, Option<u16>)> {
    let mode = source.mode.map_or(4, |m| m.0);
    let topology = topology::of_mode(mode)
        .ok_or_else(|| Problem::at(format_args!("{place}.mode"), format!("{mode} is unknown; 0 to 6 exist")))?;
    let material = match source.material {
        Some(m) => {
            check_index(m.index(), cx.doc.materials.len(), format_args!("{place}.material"), "material")?;
            Some(MaterialId(m.0))
        }
        None => None,
    };
    let positions = positions(cx, source, place)?;
    let count = positions.len();
    let attributes = Attributes { cx, map: &source.attributes, place, count };
    let (influences, max_joint) = influences::import(cx, &source.attributes, count, place)?;
    let part = MeshPart {
        topology,
        triangles: triangles(cx, source, mode, count, place)?,
        normals: attributes.optional("NORMAL", &[AccessorType::Vec3])?.map_or_else(Vec::new, |v| to_vec3(&v)),
        tangents: attributes.optional("TANGENT", &[AccessorType::Vec4])?.map_or_else(Vec::new, |v| to_vec4(&v)),
        tex_coords: attributes.tex_coords()?,
        colors: attributes.colors()?,
        influences,
        targets: targets(cx, source, count, place)?,
        material,
        positions,
    };
    Ok((part, max_joint))
}

fn to_vec3(numbers: &[f32]) -> Vec<Vec3> {
    numbers.chunks_exact(3).map(Vec3::from_slice).collect()
}

fn to_vec4(numbers: &[f32]) -> Vec<Vec4> {
    numbers.chunks_exact(4).map(Vec4::from_slice).collect()
}

fn positions(cx: &Context<'_>, source: &json::Primitive, place: &str) -> Step<Vec<Vec3>> {
    let Some(index) = source.attributes.get("POSITION") else {
        if source.has_draco() {
            let advice = "export the file again without Draco compression";
            let reason = format!("has only KHR_draco_mesh_compression data, which is not supported: {advice}");
            return Err(Problem::at(place, reason));
        }
        cx.warnings.add(place, "has no POSITION and is not drawn");
        return Ok(Vec::new());
    };
    let place = format!("{place}.attributes.POSITION");
    let accessor = cx.accessor(index.index(), &place)?;
    if source.has_draco() && accessor.buffer_view.is_none() && accessor.sparse.is_none() {
        let advice = "export the file again without Draco compression";
        let reason = format!("has only KHR_draco_mesh_compression data, which is not supported: {advice}");
        return Err(Problem::at(place, reason));
    }
    finite_vectors(cx, *index, &place)
}

/// Three finite numbers an element.
fn finite_vectors(cx: &Context<'_>, index: Idx, place: &str) -> Step<Vec<Vec3>> {
    cx.accessor(index.index(), place)?;
    let layout = cx.layout(index.index())?;
    if layout.kind != AccessorType::Vec3 || layout.component == Component::U32 {
        let reason = format!("accessors[{}] is not of VEC3 numbers of a legal type", index.0);
        return Err(Problem::at(place, reason));
    }
    let vectors = to_vec3(&cx.numbers(index.index())?);
    match vectors.iter().position(|v| !v.is_finite()) {
        Some(i) => Err(Problem::at(place, format!("element {i} of accessors[{}] is not finite", index.0))),
        None => Ok(vectors),
    }
}

fn triangles(cx: &Context<'_>, source: &json::Primitive, mode: u32, count: usize, place: &str) -> Step<Vec<[u32; 3]>> {
    let corners = if let Some(index) = source.indices {
        corners(cx, index, count, &format!("{place}.indices"))?
    } else {
        cx.budget.take(count, 4, place)?;
        (0..u32::try_from(count).map_err(|_| Problem::at(place, "has more than 2^32 vertices"))?).collect()
    };
    let whole = match mode {
        4 => corners.len() % 3 == 0,
        5 | 6 => corners.is_empty() || corners.len() >= 3,
        _ => true,
    };
    if !whole {
        cx.warnings.add(place, format_args!("{} corners do not make whole triangles", corners.len()));
    }
    cx.budget.take(corners.len(), if mode == 4 { 4 } else { 12 }, place)?;
    Ok(topology::triangles(mode, &corners))
}

/// The indices of a primitive, each below `count`.
fn corners(cx: &Context<'_>, index: Idx, count: usize, place: &str) -> Step<Vec<u32>> {
    cx.accessor(index.index(), place)?;
    if cx.layout(index.index())?.kind != AccessorType::Scalar {
        return Err(Problem::at(place, format!("accessors[{}] is not of SCALAR numbers", index.0)));
    }
    let corners = cx.unsigned(index.index(), place)?;
    match corners.iter().position(|&c| c as usize >= count) {
        Some(i) => {
            let reason = format!("index number {i} is vertex {}, but there are {count} vertices", corners[i]);
            Err(Problem::at(place, reason))
        }
        None => Ok(corners),
    }
}

fn targets(cx: &Context<'_>, source: &json::Primitive, count: usize, place: &str) -> Step<Vec<MorphTarget>> {
    let sources = source.targets.as_deref().unwrap_or_default();
    cx.budget.take(sources.len(), size_of::<MorphTarget>(), place)?;
    let mut targets = Vec::with_capacity(sources.len());
    for (i, target) in sources.iter().enumerate() {
        let read = |name: &str| -> Step<Vec<Vec3>> {
            let Some(&index) = target.get(name) else { return Ok(Vec::new()) };
            let place = format!("{place}.targets[{i}].{name}");
            if !source.attributes.contains_key(name) {
                cx.warnings.add(&place, format_args!("the primitive has no {name}; ignored"));
                return Ok(Vec::new());
            }
            check_count(cx, index, count, &place)?;
            finite_vectors(cx, index, &place)
        };
        targets.push(MorphTarget {
            positions: read("POSITION")?,
            normals: read("NORMAL")?,
            tangents: read("TANGENT")?,
        });
    }
    Ok(targets)
}

/// Checks that an attribute has one element a vertex, before it is decoded.
pub(super) fn check_count(cx: &Context<'_>, index: Idx, count: usize, place: &str) -> Step<()> {
    let actual = cx.accessor(index.index(), place)?.count.get();
    if actual == count {
        return Ok(());
    }
    Err(Problem::at(place, format!("accessors[{}] has {actual} elements for {count} vertices", index.0)))
}

/// Attributes that a picture can do without.
struct Attributes<'c> {
    cx: &'c Context<'c>,
    map: &'c BTreeMap<String, Idx>,
    place: &'c str,
    count: usize,
}

impl Attributes<'_> {
    /// The numbers of an attribute; `None` when it is absent, or ignored with a warning for its format.
    fn optional(&self, name: &str, kinds: &[AccessorType]) -> Step<Option<Vec<f32>>> {
        let Some(&index) = self.map.get(name) else { return Ok(None) };
        let place = format!("{}.attributes.{name}", self.place);
        if !self.map.contains_key("POSITION") {
            self.cx.accessor(index.index(), &place)?;
            return Ok(None);
        }
        check_count(self.cx, index, self.count, &place)?;
        let layout = self.cx.layout(index.index())?;
        if !kinds.contains(&layout.kind) || layout.component == Component::U32 {
            self.cx.warnings.add(place, format_args!("accessors[{}] has no legal format; ignored", index.0));
            return Ok(None);
        }
        let numbers = self.cx.numbers(index.index())?;
        if let Some(i) = numbers.iter().position(|v| !v.is_finite()) {
            let element = i / layout.kind.lanes();
            let reason = format!("element {element} of accessors[{}] is not finite; ignored", index.0);
            self.cx.warnings.add(place, reason);
            return Ok(None);
        }
        Ok(Some(numbers))
    }

    fn tex_coords(&self) -> Step<Vec<Vec<Vec2>>> {
        let mut sets = Vec::new();
        while self.map.contains_key(&format!("TEXCOORD_{}", sets.len())) {
            let name = format!("TEXCOORD_{}", sets.len());
            let numbers = self.optional(&name, &[AccessorType::Vec2])?;
            sets.push(match numbers {
                Some(numbers) => numbers.chunks_exact(2).map(Vec2::from_slice).collect(),
                None => vec![Vec2::ZERO; self.count],
            });
        }
        Ok(sets)
    }

    fn colors(&self) -> Step<Vec<Vec4>> {
        let Some(numbers) = self.optional("COLOR_0", &[AccessorType::Vec3, AccessorType::Vec4])? else {
            return Ok(Vec::new());
        };
        let clamped = |v: f32| v.clamp(0.0, 1.0);
        let place = format!("{}.attributes.COLOR_0", self.place);
        if numbers.iter().any(|&v| clamped(v).to_bits() != v.to_bits() && v != 0.0) {
            self.cx.warnings.add(&place, "colours outside [0, 1] are clamped");
        }
        self.cx.budget.take(self.count, size_of::<Vec4>(), place)?;
        let lanes = numbers.len() / self.count.max(1);
        let color = |c: &[f32]| Vec4::new(c[0], c[1], c[2], c.get(3).copied().unwrap_or(1.0));
        Ok(numbers.chunks_exact(lanes.max(3)).map(|c| color(c).clamp(Vec4::ZERO, Vec4::ONE)).collect())
    }
}
