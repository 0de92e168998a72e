//! What a traced picture counts.

use std::ops::AddAssign;

use crate::accel::Counter;

/// Rays of one kind and those that met an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayTally {
    /// Rays cast.
    pub rays: u64,
    /// Rays that met an object.
    pub hits: u64,
}

impl AddAssign for RayTally {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.hits += other.hits;
    }
}

/// What does not depend on the structure: rays of a picture after the databases' rules.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// Rays from the eye.
    pub primary: RayTally,
    /// Rays towards lights.
    pub shadow: RayTally,
    /// Reflected and refracted rays.
    pub secondary: RayTally,
}

impl RayCounts {
    /// All kinds together.
    pub fn all(&self) -> RayTally {
        let mut sum = self.primary;
        sum += self.shadow;
        sum += self.secondary;
        sum
    }
}

impl AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.shadow += other.shadow;
        self.secondary += other.secondary;
    }
}

/// A [`Counter`] that parallel rows of a picture may have one each of.
pub trait Recorder: Counter + Default + Send {
    /// Adds what another one counted.
    fn merge(&mut self, other: Self);
    /// An object was tested.
    fn test(&mut self) {}
}

/// Counts nothing, for timed runs.
impl Recorder for () {
    fn merge(&mut self, (): Self) {}
}

/// What a structure does for a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WalkCounts {
    /// Objects tested.
    pub tests: u64,
    /// Nodes whose boxes were tested.
    pub nodes: u64,
    /// Grid cells entered.
    pub steps: u64,
    /// Events of sorted lists handled.
    pub events: u64,
    /// Events passed over when volumes were opened.
    pub skips: u64,
}

impl Counter for WalkCounts {
    fn node(&mut self) {
        self.nodes += 1;
    }

    fn step(&mut self) {
        self.steps += 1;
    }

    fn event(&mut self) {
        self.events += 1;
    }

    fn skip(&mut self) {
        self.skips += 1;
    }
}

impl Recorder for WalkCounts {
    fn merge(&mut self, other: Self) {
        self.tests += other.tests;
        self.nodes += other.nodes;
        self.steps += other.steps;
        self.events += other.events;
        self.skips += other.skips;
    }

    fn test(&mut self) {
        self.tests += 1;
    }
}
