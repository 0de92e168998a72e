//! Which part instances share a structure. Changes no byte of any answer, only the cost.
//!
//! - Static parts of all actors form one group: its tree is built once, over everything, and never touched again.
//! - What moves is grouped by actor, since an actor that holds its pose then costs nothing.
//! - Where all that moves of an actor are rigid parts, each is alone, with a tree in its own space that all its copies share (`accel::RigidTree`): its
//!   motion costs a matrix and a box, however many triangles it has.
//! - Within another actor, parts that move as one (the same nearest moving ancestor, or the same skin) and have
//!   many triangles form a group of their own: their tree keeps its quality however the rest moves. Small
//!   movers go together, because a ray that enters a group pays about as much as for a few nodes, and boxes of
//!   attached parts overlap: one tree over a figure and what it carries beats ten.

use std::collections::BTreeMap;

use crate::{
    anim::MotionClass,
    geom::InstanceId,
    scene::{ChannelTarget, NodeId, PartInstance, Scene, SkinId},
};

/// Movers with at least this many triangles form a group of their own.
const OWN_GROUP: usize = 2048;

/// The instances of one group, ascending.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct GroupPlan {
    /// The actor that moves it; `None` for the static group.
    pub(super) actor: Option<usize>,
    pub(super) members: Vec<InstanceId>,
    /// One part that moves as a whole: it keeps a tree in its own space.
    pub(super) is_rigid: bool,
}

/// What of an actor decides on its groups.
#[derive(Debug)]
pub(super) struct ActorParts<'a> {
    pub(super) scene: &'a Scene,
    pub(super) classes: &'a [MotionClass],
    /// The world's number of the actor's first instance.
    pub(super) first_instance: u32,
}

/// How instances are grouped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Grouping {
    /// As the module says.
    #[default]
    ByMotion,
    /// Every instance alone.
    #[cfg(test)]
    Single,
    /// Everything of an actor together, static or not.
    #[cfg(test)]
    ByActor,
}

/// The groups of `actors`: static first, then in order of actor and first member. Every instance is in one.
pub(super) fn plan(actors: &[ActorParts<'_>], grouping: Grouping) -> Vec<GroupPlan> {
    let mut fixed = GroupPlan { actor: None, members: Vec::new(), is_rigid: false };
    let mut moving = Vec::new();
    for (number, actor) in actors.iter().enumerate() {
        let parts = || (actor.first_instance..).map(InstanceId).zip(&actor.scene.instances).zip(actor.classes);
        match grouping {
            Grouping::ByMotion => {
                fixed.members.extend(parts().filter(|&(_, &c)| c == MotionClass::Static).map(|((id, _), _)| id));
                let apart = moves_as_wholes(actor);
                let movers = parts().filter(|&(_, &c)| c != MotionClass::Static).map(|((id, &part), _)| (id, part));
                let group = |members, is_rigid| GroupPlan { actor: Some(number), members, is_rigid };
                if apart {
                    moving.extend(movers.map(|(id, _)| group(vec![id], true)));
                } else {
                    moving.extend(by_mover(actor.scene, movers).map(|members| group(members, false)));
                }
            }
            #[cfg(test)]
            Grouping::Single => {
                moving.extend(parts().map(|((id, _), _)| GroupPlan {
                    actor: Some(number),
                    members: vec![id],
                    is_rigid: false,
                }));
            }
            #[cfg(test)]
            Grouping::ByActor => {
                let members = parts().map(|((id, _), _)| id).collect();
                moving.push(GroupPlan { actor: Some(number), members, is_rigid: false });
            }
        }
    }
    let groups = std::iter::once(fixed).chain(moving);
    groups.filter(|group| !group.members.is_empty()).collect()
}

/// True when all that moves of an actor are parts that one matrix each places.
///
/// What an actor carries beside deforming parts goes with these instead, as the module says.
fn moves_as_wholes(actor: &ActorParts<'_>) -> bool {
    let mut moving =
        actor.scene.instances.iter().zip(actor.classes).filter(|&(_, &class)| class != MotionClass::Static);
    moving.all(|(&instance, &class)| {
        let part = actor.scene.part(instance);
        let skinned = actor.scene.nodes[instance.node.index()].skin.is_some() && part.influences.is_some();
        class == MotionClass::Rigid && part.targets.is_empty() && !skinned
    })
}

/// What a moving part moves with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Mover {
    /// The nearest node at or above it that a clip drives; `None` when only the actor as a whole moves it.
    Node(Option<NodeId>),
    /// Its skin.
    Skin(SkinId),
}

/// The moving parts of an actor by what moves them, small movers together.
fn by_mover(
    scene: &Scene,
    parts: impl Iterator<Item = (InstanceId, PartInstance)>,
) -> impl Iterator<Item = Vec<InstanceId>> {
    let nearest = nearest_driven(scene);
    let mut movers: BTreeMap<Mover, (usize, Vec<InstanceId>)> = BTreeMap::new();
    for (id, part) in parts {
        let mover = match scene.nodes[part.node.index()].skin {
            Some(skin) => Mover::Skin(skin),
            None => Mover::Node(nearest[part.node.index()]),
        };
        let (triangles, members) = movers.entry(mover).or_default();
        *triangles = triangles.saturating_add(scene.part(part).triangles.len());
        members.push(id);
    }
    let mut groups = Vec::new();
    let mut small = Vec::new();
    for (triangles, members) in movers.into_values() {
        if triangles >= OWN_GROUP { groups.push(members) } else { small.extend(members) }
    }
    small.sort_unstable();
    groups.push(small);
    groups.retain(|members| !members.is_empty());
    groups.sort_unstable_by_key(|members| members[0]);
    groups.into_iter()
}

/// For each node the nearest node at or above it whose translation, rotation or scale a clip drives.
fn nearest_driven(scene: &Scene) -> Vec<Option<NodeId>> {
    let mut nearest = vec![None; scene.nodes.len()];
    for channel in scene.clips.iter().flat_map(|clip| &clip.channels) {
        if let ChannelTarget::Translation(node) | ChannelTarget::Rotation(node) | ChannelTarget::Scale(node) =
            channel.target
        {
            nearest[node.index()] = Some(node);
        }
    }
    for node in &scene.eval_order {
        let parent = scene.nodes[node.index()].parent;
        nearest[node.index()] = nearest[node.index()].or_else(|| parent.and_then(|p| nearest[p.index()]));
    }
    nearest
}
