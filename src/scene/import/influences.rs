//! Joints and weights of a primitive, all sets together.

use std::collections::BTreeMap;

use super::{
    super::Influences,
    accessor::Component,
    context::Context,
    error::{Problem, Step},
    json::{AccessorType, Idx},
    meshes::check_count,
};

/// All `JOINTS_n` / `WEIGHTS_n` sets, and the largest joint number that has weight.
pub(super) fn import(
    cx: &Context<'_>,
    attributes: &BTreeMap<String, Idx>,
    count: usize,
    place: &str,
) -> Step<(Option<Influences>, Option<u16>)> {
    let sets = (0..attributes.len()).take_while(|n| attributes.contains_key(&format!("JOINTS_{n}"))).count();
    for name in attributes.keys().filter(|n| n.starts_with("WEIGHTS_")) {
        if !attributes.contains_key(&name.replace("WEIGHTS", "JOINTS")) {
            cx.warnings.add(format_args!("{place}.attributes.{name}"), "has no joints beside it; ignored");
        }
    }
    if sets == 0 || !attributes.contains_key("POSITION") {
        return Ok((None, None));
    }
    let per_vertex = 4 * sets;
    cx.budget.take(count, per_vertex * 6, place)?;
    let mut all =
        Influences { per_vertex, joints: vec![0; count * per_vertex], weights: vec![0.0; count * per_vertex] };
    let mut max_joint = None;
    let mut first_joints = Vec::new();
    for set in 0..sets {
        let (joints, weights) = read_set(cx, attributes, set, count, place)?;
        for vertex in 0..count {
            for lane in 0..4 {
                let (from, to) = (vertex * 4 + lane, vertex * per_vertex + set * 4 + lane);
                let weight = weights[from];
                all.weights[to] = weight;
                // A joint without weight may be any number; readers rely on it being in range.
                if weight != 0.0 {
                    let joint = u16::try_from(joints[from]).unwrap_or(u16::MAX);
                    all.joints[to] = joint;
                    max_joint = max_joint.max(Some(joint));
                }
            }
        }
        if set == 0 {
            first_joints = joints;
        }
    }
    keep_weightless(&mut all, &first_joints);
    check_weights(cx, &all, place);
    Ok((Some(all), max_joint))
}

/// Gives vertices without any weight their first joint back, which is what they follow; it may be out of range.
fn keep_weightless(all: &mut Influences, first_joints: &[u32]) {
    let vertices = all.weights.chunks_exact(all.per_vertex).zip(all.joints.chunks_exact_mut(all.per_vertex));
    for ((weights, joints), first) in vertices.zip(first_joints.iter().step_by(4)) {
        if weights.iter().all(|&w| w == 0.0) {
            joints[0] = u16::try_from(*first).unwrap_or(u16::MAX);
        }
    }
}

fn read_set(
    cx: &Context<'_>,
    attributes: &BTreeMap<String, Idx>,
    set: usize,
    count: usize,
    place: &str,
) -> Step<(Vec<u32>, Vec<f32>)> {
    let joints_place = format!("{place}.attributes.JOINTS_{set}");
    let joints = attributes[&format!("JOINTS_{set}")];
    check_count(cx, joints, count, &joints_place)?;
    let layout = cx.layout(joints.index())?;
    if layout.kind != AccessorType::Vec4 || !matches!(layout.component, Component::U8 | Component::U16) {
        let reason = format!("accessors[{}] is not VEC4 of unsigned bytes or shorts", joints.0);
        return Err(Problem::at(joints_place, reason));
    }
    let joints = cx.unsigned(joints.index(), &joints_place)?;

    let weights_place = format!("{place}.attributes.WEIGHTS_{set}");
    let Some(&weights) = attributes.get(&format!("WEIGHTS_{set}")) else {
        return Err(Problem::at(joints_place, format!("has no WEIGHTS_{set} beside it")));
    };
    check_count(cx, weights, count, &weights_place)?;
    if cx.layout(weights.index())?.kind != AccessorType::Vec4 {
        return Err(Problem::at(weights_place, format!("accessors[{}] is not VEC4", weights.0)));
    }
    let weights = cx.numbers(weights.index())?;
    if let Some(i) = weights.iter().position(|w| !w.is_finite()) {
        return Err(Problem::at(weights_place, format!("weight of vertex {} is not finite", i / 4)));
    }
    Ok((joints, weights))
}

fn check_weights(cx: &Context<'_>, all: &Influences, place: &str) {
    let place = format!("{place}.attributes.WEIGHTS_0");
    let negative = all.weights.chunks_exact(all.per_vertex).position(|w| w.iter().any(|&w| w < 0.0));
    if let Some(vertex) = negative {
        cx.warnings.add(&place, format_args!("vertex {vertex} has a negative weight"));
    }
    let sum = |w: &[f32]| w.iter().map(|&w| f64::from(w)).sum::<f64>();
    let mut unequal =
        all.weights.chunks_exact(all.per_vertex).map(sum).enumerate().filter(|(_, s)| (s - 1.0).abs() > 0.02);
    if let Some((vertex, sum)) = unequal.next() {
        let others = unequal.count();
        let text = format!("weights of vertex {vertex} and {others} others do not sum to 1 (the first to {sum})");
        cx.warnings.add(&place, text);
    }
}
