//! Hierarchy of boxes with eight children a node, tested at once.
//!
//! A node holds its children's boxes in structure-of-arrays form and where they are, in 224 bytes. Leaves are runs of blocks of four triangles.
//! Nodes and leaves stand in depth-first order, so that a subtree owns a contiguous run of each: a refit takes new positions into both in one sweep
//! from the leaves upward, and subtrees are refitted in parallel without sharing. With `layout=compact` a node takes 96 bytes and leaves name vertices
//! instead of holding them.
//!
//! # Source
//! Wald, Benthin and Boulos, "Getting Rid of Packets", 2008, for nodes of many children against one ray; Ylitie, Karras and Laine, "Efficient Incoherent
//! Ray Traversal on GPUs Through Compressed Wide BVHs", 2017, for the choice of the nodes and the boxes of the compact layout. Departure: rays that lie close together go in
//! packets, packets of rays that point apart share the top of the tree (`crown.rs`), and of many single rays several are in flight (`stream.rs`), in the full layout;
//! steps are read as planes before rays are tested, so that the proof is the one of full boxes.
//!
//! Cost: build O(n log n) and refit O(n) on the current rayon pool; a block takes 160 bytes. Choose it for rays, and the compact layout where memory or refits count more.

mod compact;
mod crown;
mod format;
mod full;
mod kernel;
mod node;
mod packet;
mod stream;
mod tree;
mod validate;

use super::{
    Accel, AccelConfig, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation, sah,
    topology::{self, Cut},
};
use crate::{
    geom::{Aabb, Forms, Hit, Ray, Triangles},
    simd::Simd,
};
use compact::Compact;
pub(super) use full::Full;
pub(super) use tree::Tree8;

/// A built hierarchy.
#[derive(Debug)]
pub struct Bvh8(Form);

/// The trees of the layouts.
#[derive(Debug)]
enum Form {
    Full(Tree8<Full>),
    Compact(Tree8<Compact>),
}

/// One expression for the tree of any layout.
macro_rules! of_form {
    ($form:expr, $tree:ident => $value:expr) => {
        match $form {
            Form::Full($tree) => $value,
            Form::Compact($tree) => $value,
        }
    };
}

impl Clone for Bvh8 {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }

    fn clone_from(&mut self, source: &Self) {
        self.0.clone_from(&source.0);
    }
}

impl Clone for Form {
    fn clone(&self) -> Self {
        match self {
            Self::Full(tree) => Self::Full(tree.clone()),
            Self::Compact(tree) => Self::Compact(tree.clone()),
        }
    }

    fn clone_from(&mut self, source: &Self) {
        match (&mut *self, source) {
            (Self::Full(tree), Self::Full(source)) => tree.clone_from(source),
            (Self::Compact(tree), Self::Compact(source)) => tree.clone_from(source),
            _ => *self = source.clone(),
        }
    }
}

impl Bvh8 {
    /// The tree whose blocks hold corners, if it is one.
    #[inline(always)]
    pub(super) fn full(&self) -> Option<&Tree8<Full>> {
        match &self.0 {
            Form::Full(tree) => Some(tree),
            Form::Compact(_) => None,
        }
    }
}

/// How boxes and triangles are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layout {
    /// Boxes as they are, triangles by their corners.
    #[default]
    Full,
    /// Boxes in steps of 8 bits, triangles by the numbers of their vertices: less than half the memory and much faster refits, slower rays.
    Compact,
}

impl Layout {
    fn parse(value: &str) -> Result<Self, String> {
        match value {
            "full" => Ok(Self::Full),
            "compact" => Ok(Self::Compact),
            _ => Err(format!("`{value}` is not one of full, compact")),
        }
    }
}

/// Build settings of `bvh8`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bvh8Config {
    /// How nodes are cut.
    pub build: Cut,
    /// Bins an axis, 2 to 64.
    pub bins: usize,
    /// Most triangles in a leaf, 1 to 32; leaves take whole blocks of four.
    pub leaf: usize,
    /// How boxes and triangles are kept.
    pub layout: Layout,
}

impl Default for Bvh8Config {
    fn default() -> Self {
        Self { build: Cut::Sah, bins: 32, leaf: sah::BLOCK, layout: Layout::Full }
    }
}

impl AccelConfig for Bvh8Config {
    const KEYS: &'static [&'static str] = &["build", "bins", "leaf", "layout"];

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "build" => self.build = topology::parse_cut(value)?,
            "bins" => self.bins = topology::parse_bins(value)?,
            "leaf" => self.leaf = topology::parse_leaf(value)?,
            _ => self.layout = Layout::parse(value)?,
        }
        Ok(())
    }
}

impl Accel for Bvh8 {
    const NAME: &'static str = "bvh8";
    type Config = Bvh8Config;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &Bvh8Config) -> Result<Self, BuildError> {
        Ok(Self(match config.layout {
            Layout::Full => Form::Full(Tree8::build(prims, config)?),
            Layout::Compact => Form::Compact(Tree8::build(prims, config)?),
        }))
    }

    fn refit_into(&self, out: &mut Self, prims: &Triangles<'_>) -> Refit {
        match (&self.0, &mut out.0) {
            (Form::Full(tree), Form::Full(out)) => tree.refit_into(out, prims),
            (Form::Compact(tree), Form::Compact(out)) => tree.refit_into(out, prims),
            (form, other) => {
                other.clone_from(form);
                self.refit_into(out, prims)
            }
        }
    }

    fn node_format(&self) -> &'static str {
        of_form!(&self.0, tree => tree.node_format())
    }

    #[inline(always)]
    fn closest<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        best: &mut Closest,
        sink: &K,
        count: &mut C,
    ) {
        of_form!(&self.0, tree => tree.closest::<S, C, K>(prims, ray, best, sink, count));
    }

    #[inline(always)]
    fn occluded<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        ray: &TravRay,
        sink: &K,
        count: &mut C,
    ) -> bool {
        of_form!(&self.0, tree => tree.occluded::<S, C, K>(prims, ray, sink, count))
    }

    #[inline(always)]
    fn closest_all<S: Simd>(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        forms: Forms,
        out: &mut [Option<Hit>],
    ) {
        of_form!(&self.0, tree => tree.closest_all::<S>(prims, rays, packet, forms, out));
    }

    #[inline(always)]
    fn occluded_all<S: Simd>(
        &self,
        prims: &Triangles<'_>,
        rays: &[Ray],
        packet: usize,
        forms: Forms,
        out: &mut [bool],
    ) {
        of_form!(&self.0, tree => tree.occluded_all::<S>(prims, rays, packet, forms, out));
    }

    #[inline(always)]
    fn closest_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        best: &mut [Closest],
        sinks: &[K],
        count: &mut C,
    ) {
        of_form!(&self.0, tree => tree.closest_packet::<S, C, K>(prims, rays, active, best, sinks, count));
    }

    #[inline(always)]
    fn occluded_packet<S: Simd, C: Counter, K: HitSink>(
        &self,
        prims: &Triangles<'_>,
        rays: &[TravRay],
        active: u32,
        sinks: &[K],
        count: &mut C,
    ) -> u32 {
        of_form!(&self.0, tree => tree.occluded_packet::<S, C, K>(prims, rays, active, sinks, count))
    }

    fn validate(&self, prims: &Triangles<'_>) -> Result<(), Violation> {
        of_form!(&self.0, tree => tree.validate(prims))
    }

    fn stats(&self) -> AccelStats {
        of_form!(&self.0, tree => tree.stats())
    }

    fn bounds(&self) -> Aabb {
        of_form!(&self.0, tree => tree.bounds())
    }

    fn decay(&self) -> f64 {
        of_form!(&self.0, tree => tree.decay())
    }
}

#[cfg(test)]
mod tests;
