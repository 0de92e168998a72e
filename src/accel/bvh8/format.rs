use std::{fmt::Debug, ops::Range};

use arrayvec::ArrayVec;

use super::{
    node::{EightNode, Link},
    tree::Tree8,
};
use crate::{
    accel::{
        block::TriBlock,
        run,
        sah::BLOCK,
        wide::refit::{Item, Store},
    },
    geom::{Forms, Hit, PrimId, Ray, Triangles},
    simd::Simd,
};

/// How a tree keeps its boxes and triangles.
pub(in crate::accel) trait Format: Sized + Clone + Debug + Send + Sync + 'static {
    /// A node.
    type Node: EightNode;
    /// What leaves are made of: runs of these.
    type Item: Item<Self::Node> + Clone + Debug + Sync + 'static;
    /// Takes boxes into nodes.
    type Store: Store<Self::Node>;

    /// See [`Accel::NODE_FORMAT`](crate::accel::Accel::NODE_FORMAT).
    const NODE_FORMAT: &'static str;
    /// Most triangles.
    const MOST: usize;
    const STORE: Self::Store;

    /// Most triangles of an item.
    const RUN: usize;

    /// An item of these triangles, at least one.
    fn item(own: &[u32], prims: &Triangles<'_>) -> Self::Item;
    /// A leaf of so many triangles whose items begin there.
    fn leaf(first: usize, triangles: usize) -> Link;
    /// The items of a leaf that has some.
    fn own(link: Link) -> Range<usize>;
    /// How many blocks a leaf has that has some.
    fn span(link: Link) -> usize;
    /// One of them; `room` is for it where it is made of the triangles given.
    fn block<'a>(
        items: &'a [Self::Item],
        place: (Link, usize),
        prims: &Triangles<'_>,
        room: &'a mut TriBlock,
    ) -> &'a TriBlock;
    /// The triangles of an item, and whether it holds of them what it should.
    fn triangles(item: &Self::Item, prims: &Triangles<'_>) -> ArrayVec<(PrimId, bool), BLOCK>;

    /// As [`Accel::closest_all`](crate::accel::Accel::closest_all).
    #[inline(always)]
    fn closest_all<S: Simd>(
        tree: &Tree8<Self>,
        prims: &Triangles<'_>,
        (rays, packet): (&[Ray], usize),
        forms: Forms,
        out: &mut [Option<Hit>],
    ) {
        run::closest_all::<S, _>(tree, prims, rays, packet, forms, out);
    }

    /// As [`Accel::occluded_all`](crate::accel::Accel::occluded_all).
    #[inline(always)]
    fn occluded_all<S: Simd>(
        tree: &Tree8<Self>,
        prims: &Triangles<'_>,
        (rays, packet): (&[Ray], usize),
        forms: Forms,
        out: &mut [bool],
    ) {
        run::occluded_all::<S, _>(tree, prims, rays, packet, forms, out);
    }
}
