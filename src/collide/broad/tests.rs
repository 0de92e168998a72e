use glam::Vec3;
use proptest::{collection::vec, prelude::*};

use super::*;
use crate::collide::box_pairs;

fn boxes() -> impl Strategy<Value = Vec<Aabb>> {
    let one =
        ([-20_i8..20, -20_i8..20, -20_i8..20], [0_u8..9, 0_u8..9, 0_u8..9], 0_u8..30).prop_map(|(min, size, kind)| {
            let min = Vec3::from(min.map(f32::from)) * 0.5;
            match kind {
                0 => Aabb::EMPTY,
                1 => Aabb { min, max: Vec3::splat(f32::NAN) },
                2 => Aabb { min: Vec3::new(min.x, f32::NEG_INFINITY, min.z), max: min + 1.0 },
                _ => Aabb { min, max: min + Vec3::from(size.map(f32::from)) * 0.25 },
            }
        });
    vec(one, 0..200)
}

fn moved(boxes: &mut [Aabb], step: &[[i8; 3]], scale: f32) {
    for (aabb, step) in boxes.iter_mut().zip(step.iter().cycle()) {
        let by = Vec3::from(step.map(f32::from)) * scale;
        *aabb = Aabb { min: aabb.min + by, max: aabb.max + by };
    }
}

proptest! {
    #[test]
    fn pairs_are_the_exact_ones_whatever_the_motion(
        mut boxes in boxes(),
        steps in vec((vec([-4_i8..4, -4_i8..4, -4_i8..4], 1..40), prop::sample::select(vec![0.0, 0.0005, 0.01, 0.3, 3.0])), 1..12),
    ) {
        let mut broad = BroadPhase::default();
        prop_assert_eq!(broad.update(&boxes), box_pairs(&boxes));
        for (step, scale) in steps {
            moved(&mut boxes, &step, scale);
            broad.update(&boxes);
            prop_assert_eq!(broad.pairs(), box_pairs(&boxes), "by {}", broad.last_method().name());
        }
    }

    #[test]
    fn every_way_to_collect_finds_the_same(mut boxes in boxes(), wild: bool, step in vec([-4_i8..4, -4_i8..4, -4_i8..4], 1..40)) {
        let mut broad = BroadPhase::default();
        broad.update(&boxes);
        for method in [BroadMethod::Resort, BroadMethod::Refit, BroadMethod::Resort, BroadMethod::Rebuild, BroadMethod::Resort] {
            moved(&mut boxes, &step, 0.4);
            broad.fatten(&boxes, 0.0);
            broad.collect(method, &boxes, wild);
            prop_assert_eq!(broad.pairs(), box_pairs(&boxes), "by {}", method.name());
        }
    }

    #[test]
    fn merged_lists_are_sorted(a in vec([0_u32..50, 0_u32..50], 0..200), b in vec([0_u32..50, 0_u32..50], 0..60)) {
        let mut due = [&a[..], &b[..]].concat();
        due.sort_unstable();
        let (mut merged, mut other) = (a, b);
        sort_pairs(&mut merged, 50, &mut Vec::new(), &mut Vec::new());
        prop_assert!(merged.is_sorted());
        other.sort_unstable();
        merge(&mut merged, &other);
        prop_assert_eq!(merged, due);
    }
}

fn crowd(count: u32) -> Vec<Aabb> {
    let place = |i: u32, by: u32| (i.wrapping_mul(by) >> 16) as f32 / 65536.0 * 12.0;
    let corner = |i: u32| Vec3::new(place(i, 2_654_435_761), place(i, 2_246_822_519), place(i, 3_266_489_917));
    (0..count).map(|i| Aabb { min: corner(i), max: corner(i) + 0.8 }).collect()
}

#[test]
fn calm_boxes_are_kept_and_a_few_strays_do_not_change_that() {
    let mut boxes = crowd(2000);
    let mut broad = BroadPhase::default();
    for frame in 0..60_u8 {
        for (i, aabb) in boxes.iter_mut().enumerate() {
            let by = if i == 7 { 0.3 } else { 0.002 };
            let by = if (i + usize::from(frame) / 20) % 2 == 0 { by } else { -by };
            *aabb = Aabb { min: aabb.min + by, max: aabb.max + by };
        }
        assert_eq!(broad.update(&boxes), box_pairs(&boxes), "frame {frame}");
    }
    let kept = broad.frames_by(BroadMethod::Keep);
    assert!(kept > 20, "{kept} of 60 frames kept");
    assert_eq!(BroadMethod::ALL.map(|m| broad.frames_by(m)).iter().sum::<u64>(), 60);
}
