#![expect(clippy::cast_possible_truncation, reason = "small numbers")]

use glam::Vec3;
use proptest::prelude::*;

use super::*;
use crate::{
    accel::topology::{self, Cut},
    geom::Triangles,
};

const FAST: Settings = Settings { cut: Cut::Fast, bins: 16, leaf: 4 };

/// Small triangles at these places.
fn mesh(places: &[Vec3]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corners = places.iter().flat_map(|&place| {
        let size = (place.length() * 1e-3).clamp(f32::MIN_POSITIVE, 1e30);
        [place, place + Vec3::X * size, place + Vec3::Y * size]
    });
    (corners.collect(), (0..places.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

fn build_over(places: &[Vec3], settings: &Settings) -> Topology {
    let (positions, indices) = mesh(places);
    topology::build(&Triangles { positions: &positions, indices: &indices, topology_epoch: 0 }, settings)
}

/// Walks a subtree, which must own contiguous runs of pairs and places; its depth.
fn walk(tree: &Topology, child: Child, next: &mut (usize, usize), leaf: usize) -> usize {
    match child {
        Child::None => 0,
        Child::Leaf { first, count } => {
            assert_eq!(first as usize, next.1, "leaves follow each other");
            assert!((1..=leaf.min(BLOCK)).contains(&(count as usize)));
            let prims = &tree.prims[next.1..][..count as usize];
            assert!(prims.is_sorted_by(|a, b| a < b));
            next.1 += prims.len();
            0
        }
        Child::Inner(pair) => {
            assert_eq!(pair as usize, next.0, "pairs are depth first");
            next.0 += 1;
            let [first, second] = tree.pairs[pair as usize].children;
            1 + walk(tree, first, next, leaf).max(walk(tree, second, next, leaf))
        }
    }
}

fn check(places: &[Vec3], settings: &Settings) {
    let tree = build_over(places, settings);
    let mut next = (0, 0);
    assert!(walk(&tree, Child::Inner(0), &mut next, settings.leaf) <= MAX_DEPTH);
    assert_eq!(next, (tree.pairs.len(), places.len()));
    let mut prims = tree.prims;
    prims.sort_unstable();
    assert!(prims.iter().enumerate().all(|(i, &prim)| prim as usize == i));
}

fn random(count: usize, mut seed: u64) -> Vec<Vec3> {
    let mut next = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 40) as f32 / (1 << 24) as f32
    };
    (0..count).map(|_| Vec3::new(next(), next(), next())).collect()
}

proptest! {
    #[test]
    fn subtrees_own_contiguous_runs(count in 0_usize..700, seed in any::<u64>(), leaf in 1_usize..=32) {
        check(&random(count, seed), &Settings { leaf, ..FAST });
    }
}

#[test]
fn several_tasks_make_one_tree() {
    check(&random(5 * TASK / 2 + 77, 3), &FAST);
}

#[test]
fn odd_places_make_valid_trees() {
    let growing = |ratio: f32| (0..3000).map(move |i| Vec3::X * 1e-38 * ratio.powi(i)).take_while(|p| p.is_finite());
    let mut places = random(1000, 5);
    places.push(Vec3::splat(1e38));
    places.push(Vec3::splat(-1e38));
    places.extend([Vec3::NAN; 50]);
    check(&places, &FAST);
    for ratio in [1.01, 1.06, 1.3, 2.0, 3.9] {
        check(&growing(ratio).collect::<Vec<_>>(), &FAST);
        check(&growing(ratio).collect::<Vec<_>>(), &Settings { leaf: 1, ..FAST });
    }
    for count in [0, 1, 2, 16, 17, 64, 65, 129] {
        check(&vec![Vec3::ONE; count], &FAST);
        check(&vec![Vec3::NAN; count], &FAST);
    }
    check(&random(500, 7).into_iter().map(|p| p * 1e-40).collect::<Vec<_>>(), &FAST);
}

#[test]
fn equal_boxes_make_a_balanced_tree() {
    let tree = build_over(&vec![Vec3::ONE; 1 << 14], &FAST);
    assert_eq!(tree.pairs.len(), (1 << 12) - 1, "whole blocks");
    assert!(walk(&tree, Child::Inner(0), &mut (0, 0), 4) <= 16);
}

#[test]
fn threads_do_not_change_the_tree() {
    let places = random(3 * TASK, 9);
    let trees = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        let tree = pool.install(|| build_over(&places, &FAST));
        format!("{tree:?}")
    });
    assert!(trees[0] == trees[1]);
}
