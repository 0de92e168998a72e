use std::ops::AddAssign;

use crate::accel::Counter;

/// What traversals did, summed over rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Rays cast.
    pub rays: u64,
    /// Nodes tested.
    pub nodes: u64,
    /// Primitives tested by themselves.
    pub prims: u64,
    /// Blocks of primitives tested at once.
    pub blocks: u64,
    /// Grid cells entered.
    pub steps: u64,
    /// Events of sorted lists handled.
    pub events: u64,
    /// Events passed over when a volume was opened.
    pub skips: u64,
}

impl Counter for Counts {
    #[inline(always)]
    fn node(&mut self) {
        self.nodes += 1;
    }

    #[inline(always)]
    fn prim(&mut self) {
        self.prims += 1;
    }

    #[inline(always)]
    fn block(&mut self) {
        self.blocks += 1;
    }

    #[inline(always)]
    fn step(&mut self) {
        self.steps += 1;
    }

    #[inline(always)]
    fn event(&mut self) {
        self.events += 1;
    }

    #[inline(always)]
    fn skip(&mut self) {
        self.skips += 1;
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.nodes += other.nodes;
        self.prims += other.prims;
        self.blocks += other.blocks;
        self.steps += other.steps;
        self.events += other.events;
        self.skips += other.skips;
    }
}

impl Counts {
    /// A measure of the time that all this takes, the same on every machine.
    pub fn work(&self) -> u64 {
        self.rays + self.nodes + 2 * (self.prims + self.blocks + self.events) + self.steps + self.skips
    }

    /// One of the counts a ray; 0 without rays.
    pub fn per_ray(&self, count: u64) -> f64 {
        if self.rays == 0 { 0.0 } else { count as f64 / self.rays as f64 }
    }
}
