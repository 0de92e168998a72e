//! Single slab hierarchy: a binary tree whose nodes keep one plane of their box, in 8 bytes.
//!
//! # Source
//! Eisemann, Woizischke and Magnor, "Ray Tracing with the Single Slab Hierarchy", 2008. A ray keeps the segment that lies within all planes passed so
//! far; a node cuts it at one end. Departures: the cases of the paper's figure 4 stand the other way round, as its text and the geometry demand; a
//! leaf tells itself by its order axis, so that it can have a plane; indices count pairs, which doubles what 27 bits reach; rays are cut with
//! the root's box first, and the root has no node.
//!
//! The topology is that of `bvh2` with the same settings, so nodes take exactly a quarter of its bytes. Leaves are runs of blocks of four triangles
//! as there; with one triangle a leaf, four leaves share a block. Pairs and blocks stand in depth-first order: a subtree owns a contiguous run of
//! each, and subtrees are refitted in parallel without sharing.
//!
//! Before the exact test of a leaf's triangles their own boxes are tested, taken from the corners in the block: planes alone lead rays to three times
//! the leaves.
//!
//! With `planes=3` or `planes=4` a node has eight children, tested at once, with so many planes of each child's box; the rest is inherited as in the
//! paper's form. Three planes take 128 bytes a node, 1.6 times the nodes' bytes of the paper's form for the same triangles; four take 192, 2.4 times, and were
//! 1.1 to 2.5 times as fast where that was measured.
//!
//! Cost: build O(n log n), refit O(n) on the current rayon pool. A ray visits two to three times the nodes of `bvh2` and takes 1.1 to 2.3 times as long
//! (`benches/records/2026-11-22-ssh.md`). Choose it where the memory of nodes counts.

mod build;
mod choose;
mod narrow;
mod node;
mod packet;
mod refit;
mod traverse;
mod validate;
mod wide;

use super::{
    Accel, AccelConfig, AccelStats, BuildError, Closest, Counter, HitSink, Refit, TravRay, Violation, sah,
    topology::{self, Cut},
};
use crate::{
    geom::{Aabb, Triangles},
    simd::Simd,
};
use narrow::Narrow;
use wide::Wide;

/// A built hierarchy.
#[derive(Clone, Debug)]
pub struct Ssh(Form);

/// The forms of nodes.
#[derive(Debug)]
enum Form {
    One(Narrow),
    Three(Wide<3>),
    Four(Wide<4>),
}

impl Clone for Form {
    fn clone(&self) -> Self {
        match self {
            Self::One(tree) => Self::One(tree.clone()),
            Self::Three(tree) => Self::Three(tree.clone()),
            Self::Four(tree) => Self::Four(tree.clone()),
        }
    }

    fn clone_from(&mut self, source: &Self) {
        match (&mut *self, source) {
            (Self::One(tree), Self::One(source)) => tree.clone_from(source),
            (Self::Three(tree), Self::Three(source)) => tree.clone_from(source),
            (Self::Four(tree), Self::Four(source)) => tree.clone_from(source),
            _ => *self = source.clone(),
        }
    }
}

/// One expression for the tree of any form.
macro_rules! of_form {
    ($form:expr, $tree:ident => $value:expr) => {
        match $form {
            Form::One($tree) => $value,
            Form::Three($tree) => $value,
            Form::Four($tree) => $value,
        }
    };
}

/// What a refit does with the sides that nodes keep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sides {
    /// They stay; planes move.
    #[default]
    Keep,
    /// They are chosen anew, in a second pass from the top. Takes 48 bytes a pair of nodes beside the structure.
    Rechoose,
}

/// Build settings of `ssh`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SshConfig {
    /// Planes a node: 1 in a binary tree, 3 or 4 a child in a tree of eight children a node.
    pub planes: usize,
    /// How nodes are cut.
    pub build: Cut,
    /// Bins an axis, 2 to 64.
    pub bins: usize,
    /// Most triangles in a leaf, 1 to 32.
    pub leaf: usize,
    /// Leaves have planes, not only inner nodes.
    pub leaf_planes: bool,
    /// What a refit does with the sides.
    pub refit: Sides,
}

impl Default for SshConfig {
    fn default() -> Self {
        Self { planes: 1, build: Cut::Sah, bins: 32, leaf: sah::BLOCK, leaf_planes: true, refit: Sides::Keep }
    }
}

impl AccelConfig for SshConfig {
    const KEYS: &'static [&'static str] = &["planes", "build", "bins", "leaf", "leaf_planes", "refit"];

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "planes" => self.planes = planes(value)?,
            "build" => self.build = topology::parse_cut(value)?,
            "bins" => self.bins = topology::parse_bins(value)?,
            "leaf" => self.leaf = topology::parse_leaf(value)?,
            "leaf_planes" => self.leaf_planes = named(value, [("on", true), ("off", false)])?,
            _ => self.refit = named(value, [("keep", Sides::Keep), ("rechoose", Sides::Rechoose)])?,
        }
        Ok(())
    }
}

/// The value of a `planes` setting.
fn planes(value: &str) -> Result<usize, String> {
    let number = value.parse().ok().filter(|n| [1, 3, 4].contains(n));
    number.ok_or_else(|| format!("`{value}` is not one of 1, 3, 4"))
}

/// The value of one of two names.
fn named<T: Copy>(value: &str, names: [(&str, T); 2]) -> Result<T, String> {
    let found = names.iter().find(|(name, _)| *name == value);
    found.map(|(_, value)| *value).ok_or_else(|| format!("`{value}` is not one of {}, {}", names[0].0, names[1].0))
}

impl Ssh {
    /// Planes that take nothing off the box inherited from above: they cost a test and cull nothing.
    pub fn useless_planes(&self) -> usize {
        of_form!(&self.0, tree => tree.useless_planes())
    }
}

impl Accel for Ssh {
    const NAME: &'static str = "ssh";
    const NODE_FORMAT: &'static str = "slabs";
    type Config = SshConfig;
    type RayState = ();

    fn build(prims: &Triangles<'_>, config: &SshConfig) -> Result<Self, BuildError> {
        Ok(Self(match config.planes {
            3 => Form::Three(Wide::build(prims, config)?),
            4 => Form::Four(Wide::build(prims, config)?),
            _ => Form::One(Narrow::build(prims, config)?),
        }))
    }

    fn refit_into(&self, out: &mut Self, prims: &Triangles<'_>) -> Refit {
        match (&self.0, &mut out.0) {
            (Form::One(tree), Form::One(out)) => tree.refit_into(out, prims),
            (Form::Three(tree), Form::Three(out)) => tree.refit_into(out, prims),
            (Form::Four(tree), Form::Four(out)) => tree.refit_into(out, prims),
            (form, other) => {
                other.clone_from(form);
                self.refit_into(out, prims)
            }
        }
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
