use std::{collections::HashMap, sync::Arc};

use glam::DAffine3;
use rayon::prelude::*;

use super::{
    FrameError, Playing,
    actor::Actor,
    deform::deform_chunks,
    group::{Group, MemberKey, Work},
    grouping::{ActorParts, GroupPlan, Grouping, plan},
    layout::{Member, Shape, check, lay_out},
    phases::{self, LEAST, Phases, Sample},
    rigid::{Rigid, RigidPart},
};
use crate::{
    accel::AccelSpec,
    anim::{ActiveClip, Pose},
    geom::{InstanceId, Precision},
    scene::{ClipId, Scene},
    world::{ActorFrame, Place, TopKind, World, WorldInstance},
};

/// The actors and the groups that their parts form.
#[derive(Debug)]
pub(super) struct Stage {
    actors: Vec<Actor>,
    /// Changes when an actor's scene or what of it is static does.
    generations: Vec<u64>,
    next_generation: u64,
    pub(super) groups: Vec<Group>,
    next_epoch: u64,
    instances: Arc<[WorldInstance]>,
    places: Arc<[Place]>,
    /// The groups are those of the actors.
    settled: bool,
    grouping: Grouping,
    /// Changes whenever a box of a group may have.
    boxes_version: u64,
}

impl Stage {
    pub(super) fn new(grouping: Grouping) -> Self {
        Self {
            actors: Vec::new(),
            generations: Vec::new(),
            next_generation: 0,
            groups: Vec::new(),
            next_epoch: 1,
            instances: Arc::default(),
            places: Arc::default(),
            settled: false,
            grouping,
            boxes_version: 1,
        }
    }

    pub(super) fn add(&mut self, scene: Arc<Scene>, world_from_scene: DAffine3) -> usize {
        let number = self.actors.len();
        self.actors.push(Actor::new(scene, world_from_scene));
        self.generations.push(0);
        self.renew(number);
        number
    }

    pub(super) fn replace(&mut self, actor: usize, scene: Arc<Scene>, world_from_scene: DAffine3) {
        self.actors[actor] = Actor::new(scene, world_from_scene);
        self.renew(actor);
    }

    pub(super) fn place(&mut self, actor: usize, world_from_scene: DAffine3) {
        if self.actors[actor].place(world_from_scene) {
            self.renew(actor);
        }
    }

    fn renew(&mut self, actor: usize) {
        self.generations[actor] = self.next_generation;
        self.next_generation += 1;
        self.settled = false;
    }

    /// True when the groups are those of the actors.
    pub(super) fn is_settled(&self) -> bool {
        self.settled
    }

    /// Forms the groups anew when actors have changed; groups whose parts are the same stay as they are.
    pub(super) fn settle(&mut self) -> Result<(), FrameError> {
        if self.settled {
            return Ok(());
        }
        let total: u64 = self.actors.iter().map(|a| a.scene.instances.len() as u64).sum();
        check("instances", total, u64::from(u32::MAX))?;
        let instances = self.number_instances();
        let plans = plan(&self.actor_parts(), self.grouping);
        let mut old: HashMap<Vec<MemberKey>, Group> =
            std::mem::take(&mut self.groups).into_iter().map(|group| (group.key.clone(), group)).collect();
        let mut places = vec![Place { group: 0, first_vertex: 0, vertex_count: 0 }; instances.len()];
        let firsts = self.first_instances();
        let mut parts: HashMap<_, Arc<RigidPart>> =
            old.values().filter_map(Group::rigid_part).map(|part| (part.own_number(), part.clone())).collect();
        for (number, plan) in (0..).zip(&plans) {
            let member = |id: InstanceId| {
                let WorldInstance { actor, part } = instances[id.0 as usize];
                Member { id, actor: actor as usize, scene: &self.actors[actor as usize].scene, part }
            };
            let key = self.key(plan, &firsts, &instances);
            let group = if let Some(mut group) = old.remove(&key) {
                group.shape.renumber(&plan.members);
                group
            } else {
                self.next_epoch += 1;
                let rigid = self.rigid(plan, &instances, &mut parts)?;
                Group::new(lay_out(plan, self.next_epoch, member)?, key, plan.actor, rigid)
            };
            group.shape.note_places(number, member, &mut places);
            self.groups.push(group);
        }
        self.instances = instances.into();
        self.places = places.into();
        self.settled = true;
        self.boxes_version += 1;
        Ok(())
    }

    /// What moves a group of one part as a whole, with the tree that its copies share.
    fn rigid(
        &self,
        plan: &GroupPlan,
        instances: &[WorldInstance],
        parts: &mut HashMap<(usize, u32, u32), Arc<RigidPart>>,
    ) -> Result<Option<Rigid>, FrameError> {
        let (true, [id]) = (plan.is_rigid, &plan.members[..]) else { return Ok(None) };
        let WorldInstance { actor, part } = instances[id.0 as usize];
        let scene = &self.actors[actor as usize].scene;
        let number = RigidPart::number(scene, part);
        let shared = match parts.get(&number).filter(|known| known.is_of(scene, part)) {
            Some(known) => known.clone(),
            None => Arc::new(RigidPart::new(scene, part)?),
        };
        parts.insert(number, shared.clone());
        Ok(Some(Rigid::new(shared)))
    }

    #[expect(clippy::cast_possible_truncation, reason = "there are at most as many actors as fit in memory")]
    fn number_instances(&self) -> Vec<WorldInstance> {
        let actors = self.actors.iter().enumerate();
        actors
            .flat_map(|(n, a)| a.scene.instances.iter().map(move |&part| WorldInstance { actor: n as u32, part }))
            .collect()
    }

    /// The world's number of each actor's first instance; the total was checked.
    #[expect(clippy::cast_possible_truncation, reason = "the total fits in 32 bits")]
    fn first_instances(&self) -> Vec<u32> {
        let counts = self.actors.iter().map(|a| a.scene.instances.len() as u32);
        counts.scan(0, |next, count| Some(std::mem::replace(next, *next + count))).collect()
    }

    fn actor_parts(&self) -> Vec<ActorParts<'_>> {
        let actors = self.actors.iter().zip(self.first_instances());
        actors
            .map(|(actor, first_instance)| ActorParts { scene: &actor.scene, classes: &actor.classes, first_instance })
            .collect()
    }

    fn key(&self, plan: &GroupPlan, firsts: &[u32], instances: &[WorldInstance]) -> Vec<MemberKey> {
        let member = |id: &InstanceId| {
            let actor = instances[id.0 as usize].actor as usize;
            MemberKey { actor, generation: self.generations[actor], instance: id.0 - firsts[actor] }
        };
        plan.members.iter().map(member).collect()
    }

    /// Poses every actor whose clips changed; their number.
    pub(super) fn pose<'a>(&mut self, playing: &(impl Fn(usize) -> Playing<'a> + Sync)) -> u64 {
        let pose = |(number, actor): (usize, &mut Actor)| u64::from(actor.pose(playing(number)));
        match &mut self.actors[..] {
            [only] => pose((0, only)),
            actors => actors.par_iter_mut().enumerate().map(pose).sum(),
        }
    }

    /// Computes the vertices of every group that moved; the number of groups. `foresees` keeps those of the frame before.
    pub(super) fn deform(&mut self, precision: Precision, foresees: bool) -> u64 {
        let actors = &self.actors;
        match &mut self.groups[..] {
            [only] => only.deform(precision, actors, foresees),
            groups => groups.par_iter_mut().for_each(|group| group.deform(precision, actors, foresees)),
        }
        self.groups.iter().map(|group| u64::from(group.deformed())).sum()
    }

    /// Chooses trees for a clip of an actor, in the current rayon pool; how many there are.
    pub(super) fn learn(
        &mut self,
        number: usize,
        clip: ClipId,
        spec: &AccelSpec,
        precision: Precision,
    ) -> Result<usize, FrameError> {
        let actor = &self.actors[number];
        let Some(duration_s) = actor.scene.clips.get(clip.index()).map(|clip| clip.duration_s) else { return Ok(0) };
        let kept = actor.pose.clone();
        let mut trees = 0;
        for group in self.groups.iter_mut().filter(|group| group.actor() == Some(number)) {
            if group.triangle_count() < LEAST {
                continue;
            }
            let mut samples = Vec::new();
            for time_s in phases::times(&group.shape.layout, duration_s) {
                let actor = &mut self.actors[number];
                let mut pose = Pose::clone(&kept);
                pose.evaluate(&actor.scene, &[ActiveClip { clip, time_s }], &actor.world_from_scene);
                actor.pose = Arc::new(pose);
                let mut positions = vec![glam::Vec3::ZERO; group.shape.layout.vertex_count];
                deform_chunks(precision, &group.shape.chunks, &self.actors, &mut positions);
                samples.push(Sample { time_s, positions });
            }
            let chosen = Phases::choose(clip, &group.shape.layout, &samples, spec);
            self.actors[number].pose = kept.clone();
            let chosen = chosen?;
            trees += chosen.len();
            group.learn(chosen);
        }
        Ok(trees)
    }

    /// Triangles of the groups that moved.
    pub(super) fn deformed_triangles(&self) -> usize {
        self.groups.iter().filter(|group| group.deformed()).map(Group::triangle_count).sum()
    }

    /// Brings every structure to its group's vertices.
    pub(super) fn update(&mut self, spec: &AccelSpec, rebuild_always: bool, frame: u64) -> Result<Work, FrameError> {
        match &mut self.groups[..] {
            [only] => only.update(spec, rebuild_always, frame),
            groups => groups.par_iter_mut().for_each(|group| group.update(spec, rebuild_always, frame)),
        }
        let mut sum = Work::default();
        for group in &mut self.groups {
            let work = std::mem::replace(&mut group.outcome, Ok(Work::default()))?;
            sum.refits += work.refits;
            sum.leaf_refits += work.leaf_refits;
            sum.moves += work.moves;
            sum.builds += work.builds;
            sum.swaps += work.swaps;
            sum.dropped += work.dropped;
        }
        if self.groups.iter().any(Group::deformed) || sum.swaps + sum.builds > 0 {
            self.boxes_version += 1;
        }
        Ok(sum)
    }

    /// The greatest age of a tree, as [`Group::tree_age`].
    pub(super) fn tree_age(&self, frame: u64) -> u64 {
        self.groups.iter().map(|group| group.tree_age(frame)).max().unwrap_or(0)
    }

    /// The worst decay of any group.
    pub(super) fn quality(&self) -> f64 {
        self.groups.iter().map(Group::quality).fold(1.0, f64::max)
    }

    /// The group with the worst decay above `limit` that can be rebuilt, by the time that it would be; the earliest of equals.
    pub(super) fn most_decayed(&self, limit: f64, frame: u64) -> Option<usize> {
        let mut worst = (limit, None);
        for (number, group) in self.groups.iter().enumerate() {
            let excess = group.excess_to_come(frame);
            if excess > worst.0 && group.wants_rebuild() {
                worst = (excess, Some(number));
            }
        }
        worst.1
    }

    /// Triangles of the groups that are being rebuilt.
    pub(super) fn rebuilding_triangles(&self) -> usize {
        self.groups.iter().filter(|group| group.is_rebuilding()).map(Group::triangle_count).sum()
    }

    /// The group with this topology epoch.
    pub(super) fn group(&mut self, epoch: u64) -> Option<&mut Group> {
        self.groups.iter_mut().find(|group| group.shape.layout.topology_epoch == epoch)
    }

    /// Makes `world` this frame's; it must have been cleared. What became of the level over groups is left to [`Stage::cover`].
    pub(super) fn fill(&mut self, world: &mut World) {
        if !Arc::ptr_eq(&world.instances, &self.instances) {
            world.instances = self.instances.clone();
            world.places = self.places.clone();
        }
        let frames = |actor: &Actor| ActorFrame { scene: actor.scene.clone(), pose: actor.pose.clone() };
        world.actors.extend(self.actors.iter().map(frames));
        world.groups.extend(self.groups.iter().filter_map(Group::frame));
        for actor in &mut self.actors {
            actor.previous = None;
        }
    }
}

impl Stage {
    /// Makes the level over the groups of `world`, unless it is that of these very boxes; true when it did.
    pub(super) fn cover(&self, world: &mut World, top: TopKind) -> bool {
        world.top.follow(top, &world.groups, self.boxes_version)
    }
}

impl Shape {
    /// Gives the members other numbers in the world.
    fn renumber(&mut self, members: &[InstanceId]) {
        if self.layout.instances != members {
            let layout = Arc::make_mut(&mut self.layout);
            layout.instances.clear();
            layout.instances.extend_from_slice(members);
        }
    }

    /// Notes where the members' vertices lie.
    fn note_places<'a>(&self, group: u32, member: impl Fn(InstanceId) -> Member<'a>, places: &mut [Place]) {
        let mut first_vertex = 0;
        for &id in &self.layout.instances {
            let vertex_count = member(id).vertex_count();
            places[id.0 as usize] = Place { group, first_vertex, vertex_count };
            first_vertex += vertex_count;
        }
    }
}
