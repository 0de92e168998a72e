use glam::Vec3;
use proptest::{collection::vec, prelude::*};

use super::*;
use crate::collide::boxes_meet;

fn boxes() -> impl Strategy<Value = Vec<Aabb>> {
    let one =
        ([-20_i8..20, -20_i8..20, -20_i8..20], [0_u8..5, 0_u8..5, 0_u8..5], 0_u8..40).prop_map(|(min, size, kind)| {
            let min = Vec3::from(min.map(f32::from));
            match kind {
                0 => Aabb::EMPTY,
                1 => Aabb { min, max: Vec3::splat(f32::NAN) },
                2 => Aabb {
                    min: Vec3::new(f32::NEG_INFINITY, min.y, min.z),
                    max: Vec3::new(f32::INFINITY, min.y, min.z),
                },
                _ => Aabb { min, max: min + Vec3::from(size.map(f32::from)) },
            }
        });
    vec(one, 0..150)
}

fn pairs(a: &[Aabb], b: &[Aabb]) -> Vec<(u32, u32)> {
    let all = (0..).zip(a).flat_map(|(i, x)| (0..).zip(b).map(move |(j, y)| (i, j, boxes_meet(x, y))));
    all.filter(|p| p.2).map(|p| (p.0, p.1)).collect()
}

fn sorted<T: Ord>(mut items: Vec<T>) -> Vec<T> {
    items.sort_unstable();
    items
}

fn check(tree: &Tree, now: &[Aabb], other: &Tree, others: &[Aabb]) -> Result<(), TestCaseError> {
    let mut found = Vec::new();
    tree.pairs_with(other, &mut |a, b| {
        found.push((a, b));
        ControlFlow::Continue(())
    });
    prop_assert_eq!(sorted(found), pairs(now, others));
    let mut own = Vec::new();
    tree.own_pairs(&mut |a: u32, b: u32| {
        own.push((a.min(b), a.max(b)));
        ControlFlow::Continue(())
    });
    let due: Vec<_> = pairs(now, now).into_iter().filter(|p| p.0 < p.1).collect();
    prop_assert_eq!(sorted(own), due);
    Ok(())
}

proptest! {
    #[test]
    fn built_and_refitted_trees_find_every_pair_of_boxes_once(a in boxes(), b in boxes(), moved in boxes()) {
        let mut tree = Tree::build(a.len(), |i| a[i as usize]);
        let other = Tree::build(b.len(), |i| b[i as usize]);
        check(&tree, &a, &other, &b)?;
        let a: Vec<_> = a.iter().zip(moved.iter().chain(std::iter::repeat(&Aabb::EMPTY))).map(|(_, m)| *m).collect();
        tree.refit(&|i: u32| a[i as usize]);
        check(&tree, &a, &other, &b)?;
    }

    #[test]
    fn no_item_near_a_point_is_left_out(a in boxes(), point in [-25_i8..25, -25_i8..25, -25_i8..25], most in 0_u8..30) {
        struct All(f64, Vec<u32>);
        impl Near for All {
            fn limit(&self) -> f64 {
                self.0
            }
            fn visit(&mut self, item: u32) {
                self.1.push(item);
            }
        }
        let point = Vec3::from(point.map(f32::from));
        let tree = Tree::build(a.len(), |i| a[i as usize]);
        let limit = f64::from(most) * f64::from(most);
        let mut all = All(limit, Vec::new());
        tree.near::<crate::simd::Scalar, _>(point, &mut Vec::new(), &mut all);
        let here = Aabb { min: point, max: point };
        let near = |aabb: &Aabb| !aabb.is_empty() && near::square_between(aabb, &here) <= limit;
        let due: Vec<u32> = (0..).zip(&a).filter(|(_, b)| near(b)).map(|(i, _)| i).collect();
        prop_assert_eq!(sorted(all.1), due);
    }
}

#[test]
fn leaves_are_nearly_full_and_fresh_trees_have_not_decayed() {
    let boxes: Vec<_> = (0..4000_u64)
        .map(|i| {
            let min = Vec3::new((i * 7919 % 977) as f32, (i * 104_729 % 983) as f32, (i * 1_299_709 % 991) as f32);
            Aabb { min, max: min + 3.0 }
        })
        .collect();
    let tree = Tree::build(boxes.len(), |i| boxes[i as usize]);
    let leaves = tree.nodes.iter().filter(|n| n.is_leaf).count();
    assert!(leaves <= 4000 / 8 * 11 / 10, "{leaves} leaves");
    let mut again = tree.clone();
    again.refit(&|i: u32| boxes[i as usize]);
    assert!((again.decay() - 1.0).abs() < 1e-9, "{}", again.decay());
    again.refit(&|i: u32| boxes[(i as usize * 31) % boxes.len()]);
    assert!(again.decay() > 3.0, "{}", again.decay());
}
