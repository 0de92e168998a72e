//! The node graph: parents, orders, cycles. No recursion: chains may be as long as the file.

use super::{
    super::{NodeId, SceneNode},
    context::{Context, check_index},
    error::{Problem, Step},
};

/// Parent of every node.
pub(super) fn parents(cx: &Context<'_>) -> Step<Vec<Option<NodeId>>> {
    let nodes = &cx.doc.nodes;
    let mut parents: Vec<Option<NodeId>> = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for (c, child) in node.children.iter().flatten().enumerate() {
            let place = || format!("nodes[{i}].children[{c}]");
            check_index(child.index(), nodes.len(), place(), "node")?;
            if child.index() == i {
                return Err(Problem::at(place(), format!("node {i} is its own child")));
            }
            if let Some(other) = parents[child.index()] {
                let reason = format!("node {} has two parents, {} and {i}", child.0, other.0);
                return Err(Problem::at(place(), reason));
            }
            parents[child.index()] = Some(node_id(i));
        }
    }
    Ok(parents)
}

/// The index as an id; nodes were counted when children were read as 32-bit numbers.
pub(super) fn node_id(index: usize) -> NodeId {
    NodeId(u32::try_from(index).unwrap_or(u32::MAX))
}

/// All nodes, each after its parent.
///
/// # Errors
/// Names a node of a cycle.
pub(super) fn eval_order(nodes: &[SceneNode]) -> Step<Vec<NodeId>> {
    let roots = (0..nodes.len()).filter(|&i| nodes[i].parent.is_none()).map(node_id);
    let order = depth_first(nodes, roots);
    if order.len() == nodes.len() {
        return Ok(order);
    }
    let mut reached = vec![false; nodes.len()];
    for node in &order {
        reached[node.index()] = true;
    }
    let lost = reached.iter().position(|&r| !r).unwrap_or(0);
    // Every node that no root reaches has a parent, and walking up from it ends in the cycle.
    let mut seen = vec![false; nodes.len()];
    let mut at = lost;
    while !std::mem::replace(&mut seen[at], true) {
        at = nodes[at].parent.map_or(at, NodeId::index);
    }
    Err(Problem::at(format_args!("nodes[{at}]"), "is its own ancestor: the nodes form a cycle"))
}

/// `roots` and all below, a parent before its children, children in file order; each node once.
fn depth_first(nodes: &[SceneNode], roots: impl Iterator<Item = NodeId>) -> Vec<NodeId> {
    let mut order = Vec::with_capacity(nodes.len());
    let mut seen = vec![false; nodes.len()];
    let mut stack = Vec::new();
    for root in roots {
        stack.push(root);
        while let Some(node) = stack.pop() {
            if !std::mem::replace(&mut seen[node.index()], true) {
                order.push(node);
                stack.extend(nodes[node.index()].children.iter().rev());
            }
        }
    }
    order
}

/// Nodes of the default scene: `scene`, else scene 0, else every node that is nobody's child.
pub(super) fn draw_order(cx: &Context<'_>, nodes: &[SceneNode]) -> Step<Vec<NodeId>> {
    let scenes = &cx.doc.scenes;
    let index = cx.doc.scene.map(|scene| check_index(scene.index(), scenes.len(), "scene", "scene")).transpose()?;
    for (s, scene) in scenes.iter().enumerate() {
        for (i, root) in scene.nodes.iter().flatten().enumerate() {
            check_index(root.index(), nodes.len(), format_args!("scenes[{s}].nodes[{i}]"), "node")?;
        }
    }
    let Some(scene) = scenes.get(index.unwrap_or(0)) else {
        return Ok(depth_first(nodes, (0..nodes.len()).filter(|&i| nodes[i].parent.is_none()).map(node_id)));
    };
    let roots = scene.nodes.as_deref().unwrap_or_default();
    for (i, root) in roots.iter().enumerate() {
        if let Some(parent) = nodes[root.index()].parent {
            let place = format!("scenes[{}].nodes[{i}]", index.unwrap_or(0));
            cx.warnings.add(place, format_args!("node {} is no root but a child of node {}", root.0, parent.0));
        }
    }
    Ok(depth_first(nodes, roots.iter().map(|r| NodeId(r.0))))
}
