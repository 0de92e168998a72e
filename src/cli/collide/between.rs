//! `--continuous`: contacts between the last frame and this one, and when they came about.

use std::collections::{BTreeMap, HashMap, btree_map::Entry};

use kinora::{
    collide::{
        Contact, ContactEvent, ContactLevel, ContactOptions, Continuous, Features, MovingContact, PartId, Snapshot,
        TrianglePair,
    },
    glam::DVec3,
};

use super::{CliError, Step, is_end};

/// What contacts are told apart by.
type Key = ([PartId; 2], Option<[u32; 2]>);

/// The earliest time of every contact of a frame, in seconds.
pub(super) struct Between {
    toi_s: BTreeMap<Key, f64>,
}

impl Between {
    /// Finds the contacts that came about since `last`; adds to `contacts` those that are over by now.
    pub(super) fn new(
        last: Option<&Step>,
        snapshot: &Snapshot,
        time_s: f64,
        options: &ContactOptions<'_>,
        settings: &Continuous,
        level: ContactLevel,
        contacts: &mut Vec<Contact>,
    ) -> Result<Self, CliError> {
        let key = |pair: &TrianglePair| (pair.parts, (level == ContactLevel::Triangle).then_some(pair.triangles));
        let mut toi_s: BTreeMap<Key, f64> = BTreeMap::new();
        let mut note = |key: Key, time: f64| {
            let known = toi_s.entry(key).or_insert(time);
            *known = known.min(time);
        };
        if let Some(last) = last {
            // What touched at the start of the step did so then.
            last.met.iter().for_each(|pair| note(key(pair), last.time_s));
            let mut touched: BTreeMap<TrianglePair, Contact> = contacts.iter().map(|c| (c.pair, *c)).collect();
            let moving = last.snapshot.moving_contacts(snapshot, options, settings)?;
            let mut around = Around::default();
            for contact in &moving {
                let time = last.time_s + (time_s - last.time_s) * contact.impact.time;
                for triangles in around.triangles(snapshot, contact, level)? {
                    let pair = TrianglePair { parts: contact.parts, triangles };
                    note(key(&pair), time);
                    touched.entry(pair).or_insert_with(|| passing(pair, contact));
                }
            }
            // A pair that meets now and did not at the start touched in between; where no feature of its own was asked, it is asked now.
            for contact in contacts.iter() {
                if let Entry::Vacant(place) = toi_s.entry(key(&contact.pair)) {
                    let impact = last.snapshot.first_impact(snapshot, contact.pair, settings)?;
                    let share = impact.map_or(1.0, |impact| impact.time);
                    place.insert(last.time_s + (time_s - last.time_s) * share);
                }
            }
            *contacts = touched.into_values().collect();
        } else {
            for contact in contacts.iter() {
                note(key(&contact.pair), time_s);
            }
        }
        Ok(Self { toi_s })
    }

    /// When the contact of an event was first there in this step; `None` for its end.
    pub(super) fn toi_s(&self, event: &ContactEvent) -> Option<f64> {
        if is_end(event) { None } else { self.toi_s.get(&(event.parts, event.triangles)).copied() }
    }
}

/// A contact that is over by the end of the step.
fn passing(pair: TrianglePair, contact: &MovingContact) -> Contact {
    let (point, normal) = (contact.point, contact.normal.unwrap_or(DVec3::Y));
    Contact { pair, dim: 0, segment: [point; 2], point, normal, depth: 0.0 }
}

/// The triangles at each vertex of the parts asked about so far.
#[derive(Default)]
struct Around(HashMap<PartId, Vec<Vec<u32>>>);

impl Around {
    /// Every pair of triangles that share the features of a contact; at the level of parts one of them.
    fn triangles(
        &mut self,
        snapshot: &Snapshot,
        contact: &MovingContact,
        level: ContactLevel,
    ) -> Result<Vec<[u32; 2]>, CliError> {
        if level == ContactLevel::Part {
            return Ok(vec![contact.triangles]);
        }
        let [a, b] = contact.parts;
        let [first, second] = match contact.features {
            Features::VertexFace { vertex, triangle } => [self.with(snapshot, a, &[vertex])?, vec![triangle]],
            Features::FaceVertex { triangle, vertex } => [vec![triangle], self.with(snapshot, b, &[vertex])?],
            Features::EdgeEdge { first, second } => [self.with(snapshot, a, &first)?, self.with(snapshot, b, &second)?],
        };
        let mut pairs = Vec::new();
        for &x in &first {
            for &y in &second {
                let pair = if a == b { [x.min(y), x.max(y)] } else { [x, y] };
                if a != b || !snapshot.are_neighbours(a, pair)? {
                    pairs.push(pair);
                }
            }
        }
        Ok(pairs)
    }

    /// Triangles that have all of some vertices.
    fn with(&mut self, snapshot: &Snapshot, part: PartId, vertices: &[u32]) -> Result<Vec<u32>, CliError> {
        let view = snapshot.part(part)?;
        let at = self.0.entry(part).or_insert_with(|| {
            let mut at = vec![Vec::new(); view.vertices().len()];
            for (triangle, corners) in (0..).zip(view.triangles()) {
                for &corner in corners {
                    at[corner as usize].push(triangle);
                }
            }
            at
        });
        let has = |t: &u32| vertices.iter().all(|v| view.triangles()[*t as usize].contains(v));
        let mut found: Vec<u32> = at[vertices[0] as usize].iter().copied().filter(has).collect();
        found.dedup();
        Ok(found)
    }
}
