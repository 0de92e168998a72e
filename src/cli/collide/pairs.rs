//! `--pairs A,B`: which nodes' contacts are asked for.

use std::collections::HashSet;

use kinora::scene::{NodeId, Scene};

use crate::cli::error::CliError;

/// Nodes at or below those named, for each pair; all nodes without pairs.
#[derive(Debug)]
pub(super) struct Pairs(Vec<[HashSet<NodeId>; 2]>);

impl Pairs {
    /// Finds the names.
    ///
    /// # Errors
    /// A usage error when there is no comma between two nodes' names.
    pub(super) fn new(texts: &[String], scene: &Scene) -> Result<Self, CliError> {
        texts.iter().map(|text| find(text, scene)).collect::<Result<_, _>>().map(Self)
    }

    /// Whether contacts of parts at two nodes are asked for, in whichever order.
    pub(super) fn accept(&self, a: NodeId, b: NodeId) -> bool {
        let either =
            |[x, y]: &[HashSet<NodeId>; 2]| (x.contains(&a) && y.contains(&b)) || (x.contains(&b) && y.contains(&a));
        self.0.is_empty() || self.0.iter().any(either)
    }
}

/// Names may have commas themselves, so every comma is tried.
fn find(text: &str, scene: &Scene) -> Result<[HashSet<NodeId>; 2], CliError> {
    let mut unknown = None;
    for (at, _) in text.match_indices(',') {
        let names = [text[..at].trim(), text[at + 1..].trim()];
        let nodes = names.map(|name| below(name, scene));
        match nodes.iter().position(HashSet::is_empty) {
            None => return Ok(nodes),
            Some(missing) => unknown = unknown.or(Some(names[missing])),
        }
    }
    Err(CliError::usage(match unknown {
        Some(name) => format!("{}: --pairs {text}: there is no node `{name}`; {}", scene.file, known(scene)),
        None => format!("--pairs {text}: expected the names of two nodes with a comma between them"),
    }))
}

/// Names of nodes with triangles, the first of many.
fn known(scene: &Scene) -> String {
    const SHOWN: usize = 12;
    let mut names: Vec<&str> = Vec::new();
    for node in scene.instances.iter().map(|instance| scene.nodes[instance.node.index()].name.as_str()) {
        if !node.is_empty() && !names.contains(&node) {
            names.push(node);
            if names.len() > SHOWN {
                break;
            }
        }
    }
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    let quoted: Vec<_> = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect();
    if quoted.is_empty() {
        "no node with triangles has a name".to_owned()
    } else {
        format!("there are {}{more}", quoted.join(", "))
    }
}

/// The nodes with a name and all below them.
fn below(name: &str, scene: &Scene) -> HashSet<NodeId> {
    let mut found = HashSet::new();
    // Parents come first.
    for &id in &scene.eval_order {
        let node = &scene.nodes[id.index()];
        if (!name.is_empty() && node.name == name) || node.parent.is_some_and(|parent| found.contains(&parent)) {
            found.insert(id);
        }
    }
    found
}
