//! One solid's way through the fountain, from the foot of the pipe round to the foot of the pipe.

use glam::{DQuat, DVec3};

use super::{DEPTH, DURATION, PIPE_HEIGHT, between, direction};
use crate::scenes::{
    maths::{about, unit},
    shape::Shape,
};

/// Gentle gravity makes small things look larger.
const GRAVITY: f64 = 5.0;
/// Speed in the pipe.
const LAUNCH: f64 = 3.4;
/// How much of its upward speed a bounce keeps.
const BOUNCE: f64 = 0.56;
/// Distances from the middle at which it meets the table, and where it falls past the edge.
const LANDINGS: [f64; 4] = [0.60, 1.00, 1.27, 1.43];
const FALL_TO: f64 = 1.69;

/// A stretch of constant acceleration and spin.
struct Stretch {
    /// Age at its beginning and its length, in seconds.
    start: f64,
    length: f64,
    place: DVec3,
    velocity: DVec3,
    /// Downward acceleration.
    gravity: f64,
    turn: DQuat,
    axis: DVec3,
    /// Radians a second about `axis`.
    spin: f64,
}

impl Stretch {
    fn place_at(&self, s: f64) -> DVec3 {
        self.place + self.velocity * s - DVec3::Y * (0.5 * self.gravity * s * s)
    }

    fn velocity_at(&self, s: f64) -> DVec3 {
        self.velocity - DVec3::Y * (self.gravity * s)
    }

    fn turn_at(&self, s: f64) -> DQuat {
        about(self.axis, self.spin * s) * self.turn
    }
}

/// All stretches of a life, in order of age; the last leads back to the first.
pub struct Life {
    stretches: Vec<Stretch>,
}

/// Keys of one node: translations as triples of in-tangent, value, out-tangent.
pub struct Tracks {
    /// Times of the translation keys.
    pub place_times: Vec<f64>,
    /// In-tangent, value and out-tangent of each.
    pub places: Vec<DVec3>,
    /// Times of the rotation keys.
    pub turn_times: Vec<f64>,
    /// Their values.
    pub turns: Vec<DQuat>,
}

impl Life {
    /// The life of a solid that flies in the direction `heading` (in turns).
    pub fn new(shape: &Shape, heading: f64, seed: u64) -> Self {
        let out = direction(heading);
        let across = DVec3::Y.cross(out);
        let first_turn = about(direction(between(0.0, 1.0, seed)), between(0.0, 6.0, seed + 1));
        let spin_axis = |k: u64| {
            let stray = DVec3::new(
                between(-0.5, 0.5, seed + 10 * k + 2),
                between(-0.5, 0.5, seed + 10 * k + 3),
                between(-0.5, 0.5, seed + 10 * k + 4),
            );
            (across + 0.8 * stray).normalize()
        };
        let rise = (PIPE_HEIGHT + DEPTH) / LAUNCH;
        let mut life = Self { stretches: Vec::new() };
        life.push(Stretch {
            start: 0.0,
            length: rise,
            place: DVec3::Y * -DEPTH,
            velocity: DVec3::Y * LAUNCH,
            gravity: 0.0,
            turn: first_turn,
            axis: spin_axis(0),
            spin: between(1.0, 2.0, seed + 5),
        });
        let mut upward = LAUNCH;
        let mut radius = 0.0;
        for (k, &landing) in LANDINGS.iter().enumerate() {
            let spin = between(3.0, 6.0, seed + 10 * k as u64 + 6);
            life.fly(shape, out * (landing - radius), upward, (spin_axis(k as u64 + 1), spin));
            upward = -BOUNCE * life.last_velocity().y;
            radius = landing;
        }
        life.fall(out * (FALL_TO - radius), upward, (spin_axis(7), 5.0));
        life.come_back(first_turn);
        life
    }

    fn push(&mut self, stretch: Stretch) {
        self.stretches.push(stretch);
    }

    fn last(&self) -> &Stretch {
        &self.stretches[self.stretches.len() - 1]
    }

    fn last_velocity(&self) -> DVec3 {
        self.last().velocity_at(self.last().length)
    }

    /// A stretch that begins where the last one ends.
    fn next(&self, velocity: DVec3, gravity: f64, (axis, spin): (DVec3, f64), length: f64) -> Stretch {
        let last = self.last();
        Stretch {
            start: last.start + last.length,
            length,
            place: last.place_at(last.length),
            velocity,
            gravity,
            turn: unit(last.turn_at(last.length)),
            axis,
            spin,
        }
    }

    /// A parabola over `way` to the table, met by the lowest point of the solid as it is turned on landing.
    fn fly(&mut self, shape: &Shape, way: DVec3, upward: f64, spin: (DVec3, f64)) {
        let mut flight = self.next(DVec3::ZERO, GRAVITY, spin, 0.0);
        let mut height = 0.05;
        for _ in 0..30 {
            let drop = flight.place.y - height;
            flight.length = (upward + (upward * upward + 2.0 * GRAVITY * drop).max(0.0).sqrt()) / GRAVITY;
            height = 0.5 * (height + support(shape, flight.turn_at(flight.length)));
        }
        flight.velocity = way / flight.length + DVec3::Y * upward;
        self.push(flight);
    }

    /// A parabola over the edge to the depth at which solids come back.
    fn fall(&mut self, way: DVec3, upward: f64, spin: (DVec3, f64)) {
        let mut flight = self.next(DVec3::ZERO, GRAVITY, spin, 0.0);
        let drop = flight.place.y + DEPTH;
        flight.length = (upward + (upward * upward + 2.0 * GRAVITY * drop).sqrt()) / GRAVITY;
        flight.velocity = way / flight.length + DVec3::Y * upward;
        self.push(flight);
    }

    /// Out of sight under the table: straight to the middle, turning to the first orientation.
    fn come_back(&mut self, first_turn: DQuat) {
        let last = self.last();
        let length = DURATION - last.start - last.length;
        assert!(length > 0.3, "a solid's way takes longer than the clip");
        let from = last.place_at(last.length);
        let mut back = self.next((DVec3::Y * -DEPTH - from) / length, 0.0, (DVec3::Y, 0.0), length);
        let mut rest = first_turn * back.turn.conjugate();
        if rest.w < 0.0 {
            rest = -rest;
        }
        let half = libm::acos(rest.w.min(1.0));
        back.axis = DVec3::new(rest.x, rest.y, rest.z).normalize_or(DVec3::Y);
        back.spin = 2.0 * half / length;
        self.push(back);
    }

    /// Keys of the clip for a solid that is `age` seconds old at its beginning.
    pub fn tracks(&self, age: f64) -> Tracks {
        let mut tracks = Tracks { place_times: vec![], places: vec![], turn_times: vec![], turns: vec![] };
        let count = self.stretches.len();
        let first = self.stretches.iter().rposition(|s| s.start <= age).unwrap_or(0);
        let mut time = 0.0;
        let mut into = age - self.stretches[first].start;
        let mut arrive = self.stretches[first].velocity_at(into);
        let begin = (self.stretches[first].place_at(into), self.stretches[first].turn_at(into), arrive);
        for step in 0..=count {
            let s = &self.stretches[(first + step) % count];
            let until = if step == count { age - s.start } else { s.length };
            tracks.place(time, [arrive, s.place_at(into), s.velocity_at(into)]);
            let length = until - into;
            // Short enough that the shorter way between keys is the way it turns.
            let parts = (s.spin * length / 1.2).ceil().max(1.0) as usize;
            for part in 0..parts {
                let along = length * part as f64 / parts as f64;
                tracks.turn(time + along, s.turn_at(into + along));
            }
            arrive = s.velocity_at(until);
            time += length;
            into = 0.0;
        }
        // The last key is the first one again, to the last bit.
        tracks.place(DURATION, [arrive, begin.0, begin.2]);
        tracks.turn(DURATION, begin.1);
        tracks
    }
}

impl Tracks {
    fn place(&mut self, time: f64, key: [DVec3; 3]) {
        // Keys that would round to the same time add nothing.
        if self.place_times.last().is_none_or(|&last| time - last > 1e-5) {
            self.place_times.push(time);
            self.places.extend(key);
        }
    }

    fn turn(&mut self, time: f64, turn: DQuat) {
        if self.turn_times.last().is_none_or(|&last| time - last > 1e-5) {
            self.turn_times.push(time);
            self.turns.push(unit(turn));
        }
    }
}

/// Distance from the middle of the turned shape down to its lowest point.
fn support(shape: &Shape, turn: DQuat) -> f64 {
    shape.positions.iter().map(|&p| -(turn * p).y).fold(0.0, f64::max)
}
