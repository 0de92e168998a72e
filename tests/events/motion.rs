//! Boxes that move: order, ranks and inversions.

use kinora::{
    accel::{
        Accel, Refit,
        events::{EventBoxes, Events},
    },
    geom::Aabb,
};

use crate::{
    FORMS, aabb, config, lists, pierced, random_boxes, random_rays, shifted, sorted,
    trace::{Mesh, Random},
    walked,
};

#[test]
fn after_hundreds_of_motions_the_lists_are_sorted_and_meet_what_fresh_ones_do() {
    let mut random = Random(51);
    for form in FORMS {
        let mut boxes = random_boxes(&mut random, 300, 0.1);
        let mut moving = lists(&boxes, form);
        for step in 0..300 {
            boxes = shifted(&boxes, &mut random, 0.01);
            if step % 50 == 0 {
                // Gone, and back at a later step.
                boxes[step] = if step % 100 == 0 { Aabb::EMPTY } else { aabb([0.1; 3], [0.2; 3]) };
            }
            moving.refit(|i| boxes[i as usize]);
            if step % 20 == 19 {
                moving.validate(|i| boxes[i as usize]).unwrap_or_else(|v| panic!("{form} step {step}: {v:?}"));
                for ray in random_rays(&mut random, 5, &boxes) {
                    let far = f64::from(f32::MAX);
                    assert_eq!(sorted(walked(&moving, &ray)), pierced(&boxes, &ray, far), "{form} step {step}");
                }
            }
        }
    }
}

#[test]
fn inversions_measure_how_far_boxes_moved_past_each_other() {
    let row = |order: &[u8]| -> Vec<Aabb> {
        order.iter().map(|&i| aabb([f32::from(i) * 2.0, 0.0, 0.0], [f32::from(i) * 2.0 + 1.0, 1.0, 1.0])).collect()
    };
    let mut lists = lists(&row(&[0, 1, 2, 3]), "form=flat");
    let mut refit = |order: &[u8]| {
        let boxes = row(order);
        lists.refit(|i| boxes[i as usize]);
        lists.validate(|i| boxes[i as usize]).expect("sorted");
        (lists.last_inversions().swaps, lists.last_inversions().whole)
    };
    assert_eq!(refit(&[0, 1, 2, 3]), (0, 0));
    // Two neighbours: both ends of one pass both ends of the other, and the ends that were level stay in order of number.
    assert_eq!(refit(&[0, 2, 1, 3]), (4, 0));
    assert_eq!(refit(&[0, 1, 2, 3]), (4, 0));
    // All the other way round: 6 pairs of 4 ends each, more than 8 log 8.
    let (swaps, whole) = refit(&[3, 2, 1, 0]);
    assert_eq!((swaps, whole), (24, 0), "24 is not above 8 * 3");
    let mut long = EventBoxes::build(64, |i| row(&[i as u8])[0], &config("form=flat")).expect("few");
    long.refit(|i| row(&[63 - i as u8])[0]);
    assert_eq!(long.last_inversions().whole, 1, "a reversed list is sorted as a whole");
    long.validate(|i| row(&[63 - i as u8])[0]).expect("sorted");
}

#[test]
fn a_refit_tells_its_inversions_and_leaves_the_original_as_it_was() {
    let mut random = Random(61);
    let mesh = Mesh::soup(&(0..400).map(|_| [random.vec3(), random.vec3(), random.vec3()]).collect::<Vec<_>>());
    let step = |by: f32, random: &mut Random| Mesh {
        positions: mesh.positions.iter().map(|&p| p + random.vec3() * by).collect(),
        indices: mesh.indices.clone(),
    };
    for form in FORMS {
        let accel = Events::build(&mesh.prims(), &config(form)).expect("a mesh");
        let mut out = accel.clone();
        let mut swaps = [0.0_f32, 1e-4, 1e-2].map(|by| {
            out.clone_from(&accel);
            assert_eq!(accel.refit_into(&mut out, &step(by, &mut random).prims()), Refit::Done);
            out.last_inversions().swaps
        });
        assert_eq!(swaps[0], 0, "{form}");
        assert!(swaps.is_sorted() && swaps[2] > 0, "{form}: {swaps:?}");
        swaps[0] = accel.last_inversions().swaps;
        assert_eq!(swaps[0], 0);
        accel.validate(&mesh.prims()).expect("the original is as it was");
    }
}
