use glam::Vec3;
use proptest::prelude::*;

use super::*;

fn build(boxes: &[Aabb]) -> TopTree {
    let mut tree = TopTree::default();
    tree.build(boxes.iter().copied());
    tree
}

fn refit(tree: &mut TopTree, boxes: &[Aabb]) -> bool {
    tree.refit(boxes.iter().copied(), |group| boxes[group as usize])
}

fn depth(tree: &TopTree, node: u32) -> usize {
    let node = &tree.nodes[node as usize];
    if node.leaf { 1 } else { 1 + depth(tree, node.link).max(depth(tree, node.link + 1)) }
}

/// Boxes in a square, scattered, `spread` apart.
fn field(count: u16, spread: f32) -> Vec<Aabb> {
    let place =
        |i: u16| Vec3::new(f32::from(i % 61 * 37 % 61), f32::from(i % 5) * 0.1, f32::from(i % 59 * 53 % 59)) * spread;
    (0..count).map(|i| Aabb { min: place(i), max: place(i) + 0.7 }).collect()
}

fn moved(boxes: &[Aabb], by: impl Fn(usize) -> Vec3) -> Vec<Aabb> {
    boxes.iter().enumerate().map(|(i, b)| Aabb { min: b.min + by(i), max: b.max + by(i) }).collect()
}

/// Every group once, each node's box that of what is below it, children behind their parents.
fn assert_sound(tree: &TopTree, boxes: &[Aabb]) {
    let mut groups: Vec<u32> = tree.nodes.iter().filter(|node| node.leaf).map(|node| node.link).collect();
    groups.sort_unstable();
    let filled: Vec<u32> = (0..).zip(boxes).filter(|(_, b)| !b.is_empty()).map(|(group, _)| group).collect();
    assert_eq!(groups, filled);
    for (number, node) in tree.nodes.iter().enumerate() {
        let link = node.link as usize;
        if node.leaf {
            assert_eq!(node.aabb, boxes[link]);
        } else {
            assert!(link > number);
            assert_eq!(node.aabb, tree.nodes[link].aabb.union(tree.nodes[link + 1].aabb));
        }
    }
}

#[test]
fn equal_and_geometric_boxes_stay_within_the_depth_of_the_stack() {
    let equal = vec![Aabb { min: Vec3::ZERO, max: Vec3::ONE }; 5000];
    let far: Vec<_> = (0..120_u8)
        .map(|i| {
            let at = Vec3::splat(2.0_f32.powi(i32::from(i)));
            Aabb { min: at, max: at * 1.25 }
        })
        .collect();
    for boxes in [equal, far] {
        let tree = build(&boxes);
        assert!(depth(&tree, 0) < STACK, "{}", depth(&tree, 0));
        assert_sound(&tree, &boxes);
    }
}

#[test]
fn threads_do_not_change_the_tree() {
    let boxes = field(5000, 3.0);
    let trees = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let tree = pool.install(|| build(&boxes));
        tree.nodes.iter().map(|node| (node.aabb, node.link, node.leaf)).collect::<Vec<_>>()
    });
    assert_eq!(trees[0], trees[1]);
    assert_sound(&build(&boxes), &boxes);
}

#[test]
fn a_motion_of_all_together_is_refitted_until_frames_run_out() {
    let boxes = field(300, 2.0);
    let mut tree = build(&boxes);
    for frame in 1_u16..=30 {
        let boxes = moved(&boxes, |_| Vec3::X * f32::from(frame));
        assert!(refit(&mut tree, &boxes), "{frame}");
        assert_sound(&tree, &boxes);
    }
    assert!(!refit(&mut tree, &boxes));
}

#[test]
fn a_tree_whose_boxes_mix_is_not_refitted() {
    let boxes = field(300, 2.0);
    let mut tree = build(&boxes);
    let mixed: Vec<_> = (0..300).map(|i| boxes[i * 7 % 300]).collect();
    assert!(!refit(&mut tree, &mixed));
}

#[test]
fn other_boxes_are_not_refitted() {
    let boxes = field(40, 2.0);
    let mut emptied = boxes.clone();
    emptied[7] = Aabb::EMPTY;
    let mut exchanged = emptied.clone();
    exchanged.swap(7, 8);
    for (built, asked) in [(&boxes, &emptied), (&emptied, &boxes), (&emptied, &exchanged)] {
        assert!(!refit(&mut build(built), asked));
        assert!(refit(&mut build(built), built));
    }
    assert!(!refit(&mut build(&boxes), &boxes[1..]));
    for none in [&[][..], &[Aabb::EMPTY; 3]] {
        assert!(!refit(&mut build(none), none));
        assert!(!refit(&mut build(none), &boxes));
    }
}

proptest! {
    #[test]
    fn wide_nodes_take_the_boxes_of_a_refit(count in 1_u16..200, seed in 0_usize..1000) {
        let boxes = field(count, 2.0);
        let mut tree = build(&boxes);
        let mut wide = WideTree::default();
        wide.make(&tree);
        let boxes = moved(&boxes, |i| Vec3::Y * ((i * seed) % 7) as f32 * 0.1);
        refit(&mut tree, &boxes);
        wide.refit(&tree);
        let mut groups = Vec::new();
        let mut due = vec![(0, tree.nodes[0].aabb)];
        while let Some((number, around)) = due.pop() {
            let node = &wide.nodes()[number as usize];
            let mut all = Aabb::EMPTY;
            for slot in (0..8).filter(|slot| node.present() >> slot & 1 == 1) {
                let corner = |side: usize| Vec3::from([0, 1, 2].map(|axis| node.planes(axis)[side][slot]));
                let aabb = Aabb { min: corner(0), max: corner(1) };
                all = all.union(aabb);
                let word = node.word(slot);
                if word & crate::accel::LEAF == 0 {
                    due.push((word, aabb));
                } else {
                    let group = word & !crate::accel::LEAF;
                    prop_assert_eq!(aabb, boxes[group as usize]);
                    groups.push(group);
                }
            }
            prop_assert_eq!(all, around);
        }
        groups.sort_unstable();
        prop_assert_eq!(groups, (0..u32::from(count)).collect::<Vec<_>>());
    }
}
