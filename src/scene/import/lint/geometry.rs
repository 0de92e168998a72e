//! Primitives: attribute names, formats without bounds, texture coordinates that materials miss.

use super::super::{accessor::Component, context::Context, json};

pub(super) fn check(cx: &Context<'_>) {
    for (m, mesh) in cx.doc.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            check_primitive(cx, primitive, &format!("meshes[{m}].primitives[{p}]"));
        }
    }
}

fn check_primitive(cx: &Context<'_>, primitive: &json::Primitive, place: &str) {
    for (name, index) in &primitive.attributes {
        let place = format!("{place}.attributes.{}", name.escape_debug());
        if !is_semantic(name) && !name.starts_with('_') {
            cx.warnings.add(&place, "is no attribute of glTF; names of one's own start with an underscore");
        }
        if index.index() >= cx.doc.accessors.len() {
            cx.warnings.add(place, format_args!("accessor {} does not exist; nothing reads it", index.0));
        } else if cx.layout(index.index()).is_ok_and(|l| l.component == Component::U32) {
            cx.warnings
                .add(place, format_args!("accessors[{}] is of 32-bit integers, which attributes must not be", index.0));
        }
    }
    check_bounds(cx, primitive, place);
    check_tex_coords(cx, primitive, place);
}

fn is_semantic(name: &str) -> bool {
    let Some((kind, number)) = name.rsplit_once('_') else { return matches!(name, "POSITION" | "NORMAL" | "TANGENT") };
    let is_number = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
    is_number && matches!(kind, "TEXCOORD" | "COLOR" | "JOINTS" | "WEIGHTS")
}

fn check_bounds(cx: &Context<'_>, primitive: &json::Primitive, place: &str) {
    let targets = primitive.targets.iter().flatten().enumerate();
    let of_targets = targets.filter_map(|(i, t)| t.get("POSITION").map(|a| (format!("targets[{i}]"), a)));
    let of_base = primitive.attributes.get("POSITION").map(|a| ("attributes".to_owned(), a));
    for (member, index) in of_base.into_iter().chain(of_targets) {
        let Some(accessor) = cx.doc.accessors.get(index.index()) else { continue };
        if accessor.min.is_none() || accessor.max.is_none() {
            cx.warnings.add(
                format_args!("{place}.{member}.POSITION"),
                format_args!("accessors[{}] has no min and max", index.0),
            );
        }
    }
    let position = primitive.attributes.get("POSITION").and_then(|a| cx.layout(a.index()).ok());
    if position.is_some_and(|l| l.component != Component::F32) && !cx.doc.requires("KHR_mesh_quantization") {
        let text = "is quantised, but the file does not require KHR_mesh_quantization";
        cx.warnings.add(format_args!("{place}.attributes.POSITION"), text);
    }
}

fn check_tex_coords(cx: &Context<'_>, primitive: &json::Primitive, place: &str) {
    let Some(material) = primitive.material.and_then(|m| cx.doc.materials.get(m.index())) else { return };
    let sets = material.tex_coords();
    let missing = sets.filter(|set| !primitive.attributes.contains_key(&format!("TEXCOORD_{set}"))).min();
    if let Some(set) = missing {
        cx.warnings
            .add(format_args!("{place}.material"), format_args!("reads TEXCOORD_{set}, which the primitive lacks"));
    }
}
