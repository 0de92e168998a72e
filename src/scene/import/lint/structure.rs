//! Empty arrays, properties that depend on others, skins and the scenes they lie in.

use super::super::{
    context::{Context, check_index},
    json::Idx,
};

const EMPTY: &str = "is an empty array; it should be left out";

pub(super) fn check(cx: &Context<'_>) {
    empty_arrays(cx);
    buffer_views(cx);
    for (i, node) in cx.doc.nodes.iter().enumerate() {
        if node.mesh.is_none() && node.weights.is_some() {
            cx.warnings.add(format_args!("nodes[{i}].weights"), "has no mesh to morph");
        }
        if node.mesh.is_none() && node.skin.is_some() {
            cx.warnings.add(format_args!("nodes[{i}].skin"), "has no mesh to deform");
        }
    }
    skins(cx);
}

fn empty_arrays(cx: &Context<'_>) {
    let doc = cx.doc;
    let lists = [
        ("accessors", doc.accessors.present && doc.accessors.is_empty()),
        ("animations", doc.animations.as_ref().is_some_and(Vec::is_empty)),
        ("bufferViews", doc.buffer_views.present && doc.buffer_views.is_empty()),
        ("buffers", doc.buffers.present && doc.buffers.is_empty()),
        ("cameras", doc.cameras.present && doc.cameras.is_empty()),
        ("images", doc.images.present && doc.images.is_empty()),
        ("materials", doc.materials.present && doc.materials.is_empty()),
        ("meshes", doc.meshes.present && doc.meshes.is_empty()),
        ("nodes", doc.nodes.present && doc.nodes.is_empty()),
        ("samplers", doc.samplers.present && doc.samplers.is_empty()),
        ("scenes", doc.scenes.present && doc.scenes.is_empty()),
        ("skins", doc.skins.present && doc.skins.is_empty()),
        ("textures", doc.textures.present && doc.textures.is_empty()),
    ];
    for (name, _) in lists.iter().filter(|(_, empty)| *empty) {
        cx.warnings.add(name, EMPTY);
    }
    let is_empty = |list: &Option<Box<[Idx]>>| list.as_ref().is_some_and(|l| l.is_empty());
    for (i, _) in doc.scenes.iter().enumerate().filter(|(_, s)| is_empty(&s.nodes)) {
        cx.warnings.add(format_args!("scenes[{i}].nodes"), EMPTY);
    }
    for (i, _) in doc.nodes.iter().enumerate().filter(|(_, n)| is_empty(&n.children)) {
        cx.warnings.add(format_args!("nodes[{i}].children"), EMPTY);
    }
    for (i, _) in doc.meshes.iter().enumerate().filter(|(_, m)| m.primitives.is_empty()) {
        cx.warnings.add(format_args!("meshes[{i}].primitives"), EMPTY);
    }
}

fn buffer_views(cx: &Context<'_>) {
    for (i, view) in cx.doc.buffer_views.iter().enumerate() {
        let place = format!("bufferViews[{i}]");
        if view.byte_length.0 == 0 {
            cx.warnings.add(format_args!("{place}.byteLength"), "is 0");
        }
        if let Some(stride) = view.byte_stride.filter(|s| s.0 % 4 != 0 || !(4..=252).contains(&s.0)) {
            let text = format!("{} is not a multiple of 4 from 4 to 252", stride.0);
            cx.warnings.add(format_args!("{place}.byteStride"), text);
        } else if let Some(stride) = view.byte_stride.filter(|s| s.0 > view.byte_length.0) {
            let text = format!("{} is more than the view's {} bytes", stride.0, view.byte_length.0);
            cx.warnings.add(format_args!("{place}.byteStride"), text);
        }
        let buffer = check_index(view.buffer.index(), cx.doc.buffers.len(), format_args!("{place}.buffer"), "buffer");
        if let Err(problem) = buffer {
            cx.warnings.add_problem(&problem, "nothing reads it");
        }
    }
}

/// Warns about skins whose joints have no common root.
fn skins(cx: &Context<'_>) {
    let nodes = &cx.doc.nodes;
    let mut parents = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        node.children.iter().flatten().for_each(|c| parents[c.index()] = Some(i));
    }
    let roots = roots(&parents);
    for (i, skin) in cx.doc.skins.iter().enumerate() {
        let mut of_joints = skin.joints.iter().map(|j| roots[j.index()]);
        let first = of_joints.next();
        if of_joints.any(|root| Some(root) != first) {
            cx.warnings.add(format_args!("skins[{i}].joints"), "have no common root");
        }
    }
    for (i, node) in nodes.iter().enumerate() {
        let (Some(skin), Some(_)) = (node.skin, node.mesh) else { continue };
        let joint = cx.doc.skins[skin.index()].joints.first().map(|j| roots[j.index()]);
        let in_scene_of = |root: usize| {
            let lists = |root: &usize, list: &[Idx]| list.iter().any(|n| n.index() == *root);
            cx.doc.scenes.iter().take(16).position(|s| lists(&root, s.nodes.as_deref().unwrap_or_default()))
        };
        // Only small files are asked: the lists of roots may be long.
        if let Some(joint) = joint.filter(|_| nodes.len() < 1000)
            && let Some(scene) = in_scene_of(roots[i])
            && in_scene_of(joint).is_none()
        {
            let text = format!("joints of skins[{}] are not in scenes[{scene}] with the mesh", skin.0);
            cx.warnings.add(format_args!("nodes[{i}].skin"), text);
        }
    }
}

/// Topmost ancestor of every node; the graph is known to be a forest.
fn roots(parents: &[Option<usize>]) -> Vec<usize> {
    let mut roots: Vec<Option<usize>> = vec![None; parents.len()];
    let mut path = Vec::new();
    for start in 0..parents.len() {
        let mut at = start;
        while roots[at].is_none() {
            path.push(at);
            match parents[at] {
                Some(parent) => at = parent,
                None => roots[at] = Some(at),
            }
        }
        let root = roots[at];
        path.drain(..).for_each(|n| roots[n] = root);
    }
    roots.into_iter().enumerate().map(|(i, root)| root.unwrap_or(i)).collect()
}
