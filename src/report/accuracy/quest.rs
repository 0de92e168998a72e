use rayon::prelude::*;

use super::Source;
use crate::{
    geom::{Aabb, PrimId, Ray, Triangles},
    glam::Vec3,
    report::{
        RayClass,
        closed::{Aim, BATCH},
        measure::{Answer, Ask},
        random::Random,
        rays::{self, Sphere, View},
        reference::{Reference, Tally, Truth},
    },
};

/// Where rays come from and what they are asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// One of the classes of `structures`.
    Common(RayClass),
    /// From the camera at points of edges and at corners.
    Edges,
    /// Inside a closed mesh.
    Inside(Aim),
}

impl Class {
    pub(super) fn name(self) -> String {
        match self {
            Self::Common(class) => class.name().to_owned(),
            Self::Edges => "edges".to_owned(),
            Self::Inside(aim) => format!("inside, {}", aim.name()),
        }
    }

    pub(super) fn ask(self) -> Ask {
        match self {
            Self::Common(class) => class.ask(),
            Self::Edges | Self::Inside(_) => Ask::Closest,
        }
    }

    /// True when 16 consecutive rays go well together.
    pub(super) fn comes_in_packets(self) -> bool {
        matches!(self, Self::Common(RayClass::Primary | RayClass::Shadow) | Self::Inside(Aim::Packets))
    }

    /// True when a ray that meets nothing has left a closed mesh.
    pub(super) fn may_leak(self) -> bool {
        matches!(self, Self::Inside(_))
    }
}

/// What is right.
#[derive(Clone, Debug)]
enum Due {
    Closest(Vec<Option<Truth>>),
    Blocked(Vec<bool>),
}

/// Rays of one class with the right answers.
#[derive(Clone, Debug)]
pub(super) struct Quest {
    pub(super) class: Class,
    pub(super) rays: Vec<Ray>,
    due: Due,
}

impl Quest {
    fn new(class: Class, rays: Vec<Ray>, reference: &Reference) -> Self {
        let due = match class.ask() {
            Ask::Closest => Due::Closest(reference.all_closest(&rays)),
            Ask::Blocked => Due::Blocked(rays.par_iter().map(|r| reference.blocked(r)).collect()),
        };
        Self { class, rays, due }
    }

    /// Compares the answers to the first rays with the right ones.
    pub(super) fn judge(&self, answers: &[Answer]) -> Tally {
        let mut tally = Tally::default();
        match &self.due {
            Due::Closest(due) => {
                due.iter().zip(answers).for_each(|(due, found)| tally.add(due.as_ref(), found.found().as_ref()));
            }
            Due::Blocked(due) => {
                due.iter().zip(answers).for_each(|(&due, found)| tally.add_blocked(due, found.hit().is_some()));
            }
        }
        tally
    }

    /// About `count` rays, whole packets spread over all, with their answers.
    pub(super) fn part(&self, count: usize) -> Self {
        let due = match &self.due {
            Due::Closest(due) => {
                let places: Vec<usize> = (0..due.len()).collect();
                Due::Closest(rays::spread(&places, count).into_iter().map(|i| due[i].clone()).collect())
            }
            Due::Blocked(due) => Due::Blocked(rays::spread(due, count)),
        };
        Self { class: self.class, rays: rays::spread(&self.rays, count), due }
    }
}

/// The rays of all classes: about `count` of each, with the right answers.
pub(super) fn quests(source: &Source, count: usize) -> Vec<Quest> {
    let prims = source.prims();
    let finite = prims.positions.iter().copied().filter(|p| p.is_finite());
    let Some(sphere) = Sphere::around(Aabb::from_points(finite)) else { return Vec::new() };
    let reference = Reference::new(&prims);
    let view = View::whole(sphere);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a picture's side")]
    let side = (count as f64).sqrt() as usize;
    let primary = Quest::new(Class::Common(RayClass::Primary), rays::primary(view, [side; 2]), &reference);
    let hits = primary.hits();
    let mut quests = vec![primary];
    for class in [RayClass::Shadow, RayClass::Diffuse] {
        let rays = rays::secondary(class, sphere, &prims, &quests[0].rays, &hits);
        quests.push(Quest::new(Class::Common(class), rays, &reference));
    }
    quests.push(Quest::new(Class::Edges, edges(view.eye.as_vec3(), &prims, count), &reference));
    if let Some(mesh) = &source.closed {
        for aim in [Aim::Anywhere, Aim::Packets, Aim::Corners, Aim::Middles, Aim::Edges] {
            let batches = count.div_ceil(BATCH) as u64;
            let mut rays: Vec<Ray> = (0..batches).flat_map(|b| mesh.rays(aim, false, b)).collect();
            rays.truncate(count);
            quests.push(Quest::new(Class::Inside(aim), rays, &reference));
        }
    }
    quests.retain(|q| !q.rays.is_empty());
    quests
}

impl Quest {
    /// The right answers as a structure gives them.
    fn hits(&self) -> Vec<Answer> {
        let Due::Closest(due) = &self.due else { return Vec::new() };
        let answer = |truth: &Option<Truth>| {
            truth.as_ref().map_or(Answer::MISS, |t| {
                let first = &t.accepted[0];
                Answer::at(first.prim, t.t_rounded, first.rounded)
            })
        };
        due.iter().map(answer).collect()
    }
}

/// Rays from `eye` at random points of edges, a quarter of them at corners, as closely as f32 can.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a random triangle")]
fn edges(eye: Vec3, prims: &Triangles<'_>, count: usize) -> Vec<Ray> {
    let aim = |i: usize| {
        let mut random = Random::new(0xed6e, i as u64);
        let prim = PrimId((random.unit() * prims.len() as f64) as u32);
        let corners = prims.corners(prim).map(Vec3::as_dvec3);
        let side = (random.unit() * 3.0) as usize % 3;
        let share = if i.is_multiple_of(4) { 0.0 } else { random.unit() };
        let at = corners[side] + (corners[(side + 1) % 3] - corners[side]) * share;
        Ray::new(eye, (at - eye.as_dvec3()).as_vec3())
    };
    let rays: Vec<Ray> = (0..count).map(aim).collect();
    rays.into_iter().filter(|r| r.dir.is_finite() && r.dir != Vec3::ZERO).collect()
}
