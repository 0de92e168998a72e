//! `EXT_mesh_gpu_instancing`: the copies of a node's mesh.

use glam::{DQuat, DVec3, DVec4};

use super::{
    super::Trs,
    context::Context,
    error::{Problem, Step},
    json::{Idx, Instancing},
};

/// Transforms of all copies; components that the file leaves out are the identity's.
pub(super) fn import(cx: &Context<'_>, source: &Instancing, node: &str) -> Step<Vec<Trs>> {
    let place = format!("{node}.extensions.EXT_mesh_gpu_instancing.attributes");
    let attributes = &source.attributes;
    let named =
        [("TRANSLATION", attributes.translation), ("ROTATION", attributes.rotation), ("SCALE", attributes.scale)];
    let mut count = None;
    for (name, index) in named.iter().filter_map(|(name, index)| index.map(|i| (name, i))) {
        let place = format!("{place}.{name}");
        let own = cx.accessor(index.index(), &place)?.count.get();
        if *count.get_or_insert(own) != own {
            return Err(Problem::at(place, format!("{own} copies, but another attribute has {}", count.unwrap_or(0))));
        }
    }
    let Some(count) = count else {
        cx.warnings.add(place, "names no transform; the mesh is drawn once");
        return Ok(vec![Trs::IDENTITY]);
    };
    cx.budget.take(count, size_of::<Trs>(), &place)?;
    let translations = read::<3>(cx, attributes.translation, &format!("{place}.TRANSLATION"))?;
    let rotations = read::<4>(cx, attributes.rotation, &format!("{place}.ROTATION"))?;
    let scales = read::<3>(cx, attributes.scale, &format!("{place}.SCALE"))?;
    let copy = |i: usize| Trs {
        translation: translations.as_ref().map_or(DVec3::ZERO, |v| DVec3::from_array(v[i].map(f64::from))),
        rotation: rotations
            .as_ref()
            .map_or(DQuat::IDENTITY, |v| DQuat::from_vec4(DVec4::from_array(v[i].map(f64::from)))),
        scale: scales.as_ref().map_or(DVec3::ONE, |v| DVec3::from_array(v[i].map(f64::from))),
    };
    Ok((0..count).map(copy).collect())
}

fn read<const N: usize>(cx: &Context<'_>, index: Option<Idx>, place: &str) -> Step<Option<Vec<[f32; N]>>> {
    let Some(index) = index else { return Ok(None) };
    let vectors = cx.vectors::<N>(index.index(), place)?;
    match vectors.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
        Some(i) => Err(Problem::at(place, format!("copy {i} is not finite"))),
        None => Ok(Some(vectors)),
    }
}
