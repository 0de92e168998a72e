//! Contacts across frames: what began, what goes on, what ended.

use std::cmp::Ordering;

use glam::DVec3;

use super::{Contact, PartId, TrianglePair};

/// What is followed from frame to frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ContactLevel {
    /// Pairs of parts.
    #[default]
    Part,
    /// Pairs of triangles.
    Triangle,
}

/// What became of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactPhase {
    /// It was not there in the frame before.
    Begin,
    /// It was there already.
    Persist,
    /// It is no longer there.
    End,
}

/// A change, or the lack of one, in a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactEvent {
    /// What became of it.
    pub phase: ContactPhase,
    /// The parts.
    pub parts: [PartId; 2],
    /// The triangles; `None` at the level of parts.
    pub triangles: Option<[u32; 2]>,
    /// Pairs of triangles that meet; 0 at the end.
    pub count: usize,
    /// Where the deepest of them meet; at the end, where they were last.
    pub point: DVec3,
    /// [`Contact::normal`] there.
    pub normal: DVec3,
    /// [`Contact::depth`] there; 0 at the end.
    pub depth: f64,
}

/// What is followed: parts, and triangles at their level.
type Key = ([PartId; 2], Option<[u32; 2]>);

/// Follows contacts from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct ContactTracker {
    level: ContactLevel,
    /// Of the last frame, ascending.
    last: Vec<ContactEvent>,
}

impl ContactTracker {
    /// Nothing is in contact yet.
    pub fn new(level: ContactLevel) -> Self {
        Self { level, last: Vec::new() }
    }

    /// Takes the contacts of the next frame, in any order, each pair once; what they are compared to the last frame's, in ascending order of
    /// parts and triangles.
    ///
    /// O(n log n). A first frame only begins contacts.
    pub fn update(&mut self, contacts: &[Contact]) -> Vec<ContactEvent> {
        let next = self.merged(contacts);
        let mut events = Vec::with_capacity(next.len() + self.last.len());
        let (mut old, mut new) = (self.last.iter().peekable(), next.iter().peekable());
        loop {
            let order = match (old.peek(), new.peek()) {
                (None, None) => break,
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (Some(a), Some(b)) => key(a).cmp(&key(b)),
            };
            if order == Ordering::Less {
                events.extend(old.next().map(|e| ContactEvent {
                    phase: ContactPhase::End,
                    count: 0,
                    depth: 0.0,
                    ..*e
                }));
                continue;
            }
            let phase = if order == Ordering::Equal { ContactPhase::Persist } else { ContactPhase::Begin };
            if order == Ordering::Equal {
                old.next();
            }
            events.extend(new.next().map(|e| ContactEvent { phase, ..*e }));
        }
        self.last = next;
        events
    }

    /// One entry for each thing that is followed, ascending.
    fn merged(&self, contacts: &[Contact]) -> Vec<ContactEvent> {
        let mut sorted: Vec<&Contact> = contacts.iter().collect();
        sorted.sort_by_key(|c| c.pair);
        let mut merged: Vec<ContactEvent> = Vec::new();
        for contact in sorted {
            let next = self.event(contact);
            match merged.last_mut().filter(|last| key(last) == key(&next)) {
                // The first of the deepest stands for all.
                Some(last) if next.depth > last.depth => *last = ContactEvent { count: last.count + 1, ..next },
                Some(last) => last.count += 1,
                None => merged.push(next),
            }
        }
        merged
    }

    fn event(&self, contact: &Contact) -> ContactEvent {
        let Contact { pair: TrianglePair { parts, triangles }, point, normal, depth, .. } = *contact;
        let triangles = (self.level == ContactLevel::Triangle).then_some(triangles);
        ContactEvent { phase: ContactPhase::Begin, parts, triangles, count: 1, point, normal, depth }
    }
}

fn key(event: &ContactEvent) -> Key {
    (event.parts, event.triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(parts: [u32; 2], triangles: [u32; 2], depth: f64) -> Contact {
        let pair = TrianglePair { parts: parts.map(PartId), triangles };
        let point = DVec3::splat(depth);
        Contact { pair, dim: 0, segment: [point; 2], point, normal: DVec3::X, depth }
    }

    /// Phase, parts, triangles, count and depth.
    type Told = (ContactPhase, [u32; 2], Option<[u32; 2]>, usize, f64);

    fn told(events: &[ContactEvent]) -> Vec<Told> {
        events.iter().map(|e| (e.phase, e.parts.map(|p| p.0), e.triangles, e.count, e.depth)).collect()
    }

    #[test]
    fn parts_begin_persist_and_end_with_their_deepest_pair() {
        use ContactPhase::{Begin, End, Persist};
        let mut tracker = ContactTracker::new(ContactLevel::Part);
        let first = [contact([1, 2], [0, 0], 1.0), contact([0, 1], [5, 5], 0.5), contact([0, 1], [4, 4], 0.75)];
        let events = tracker.update(&first);
        assert_eq!(told(&events), [(Begin, [0, 1], None, 2, 0.75), (Begin, [1, 2], None, 1, 1.0)]);
        let events = tracker.update(&[contact([0, 1], [9, 9], 0.25), contact([0, 3], [1, 1], 0.0)]);
        let due = [(Persist, [0, 1], None, 1, 0.25), (Begin, [0, 3], None, 1, 0.0), (End, [1, 2], None, 0, 0.0)];
        assert_eq!(told(&events), due);
        assert_eq!(events[2].point, DVec3::ONE, "where it was last");
        assert_eq!(tracker.update(&[]).len(), 2);
        assert_eq!(tracker.update(&[]), []);
    }

    #[test]
    fn triangles_are_followed_by_themselves() {
        use ContactPhase::{Begin, End, Persist};
        let mut tracker = ContactTracker::new(ContactLevel::Triangle);
        tracker.update(&[contact([0, 1], [1, 1], 0.0), contact([0, 1], [2, 1], 0.0)]);
        let events = tracker.update(&[contact([0, 1], [2, 1], 0.0), contact([0, 1], [2, 3], 0.0)]);
        let phases: Vec<_> = events.iter().map(|e| (e.phase, e.triangles)).collect();
        assert_eq!(phases, [(End, Some([1, 1])), (Persist, Some([2, 1])), (Begin, Some([2, 3]))]);
    }
}
