use super::*;

/// Object counts that the package's documentation and the papers state.
const COUNTS: [(SpdKind, &[(u32, usize)]); 9] = [
    (SpdKind::Balls, &[(1, 11), (2, 92), (3, 821), (4, 7382), (5, 66_431)]),
    (SpdKind::Gears, &[(1, 147), (2, 1169), (3, 3943), (4, 9345), (5, 18_251), (6, 31_537)]),
    (SpdKind::Mount, &[(3, 132), (6, 8196), (8, 131_076)]),
    (SpdKind::Rings, &[(1, 61), (3, 841), (7, 8401)]),
    (SpdKind::Tetra, &[(1, 4), (2, 16), (3, 64), (4, 256), (5, 1024), (6, 4096), (8, 65_536)]),
    (SpdKind::Tree, &[(1, 7), (11, 8191), (14, 65_535)]),
    (SpdKind::Teapot, &[(1, 57), (2, 244), (3, 561), (6, 2292), (12, 9264)]),
    (SpdKind::Lattice, &[(1, 20), (5, 756), (12, 8281)]),
    (SpdKind::Jacks, &[(1, 9), (2, 81), (3, 657)]),
];

#[test]
fn object_counts_are_the_published_ones() {
    for (kind, sizes) in COUNTS {
        for &(size, count) in sizes {
            let scene = kind.generate(size).expect("a valid size");
            assert_eq!(scene.objects.len(), count, "{} {size}", kind.name());
            assert_eq!(kind.object_count(size), count as u64, "{} {size}", kind.name());
        }
    }
}

#[test]
fn kinds_of_primitives_are_as_the_recipes_say() {
    let count = |kind: SpdKind, size, wanted: fn(&SpdShape) -> bool| {
        kind.generate(size).expect("a valid size").objects.iter().filter(|o| wanted(&o.shape)).count()
    };
    let is_sphere: fn(&SpdShape) -> bool = |s| matches!(s, SpdShape::Sphere { .. });
    let is_cone: fn(&SpdShape) -> bool = |s| matches!(s, SpdShape::Cone { .. });
    let is_polygon: fn(&SpdShape) -> bool = |s| matches!(s, SpdShape::Polygon(_));
    assert_eq!((count(SpdKind::Lattice, 5, is_sphere), count(SpdKind::Lattice, 5, is_cone)), (216, 540));
    assert_eq!((count(SpdKind::Jacks, 2, is_sphere), count(SpdKind::Jacks, 2, is_cone)), (54, 27));
    assert_eq!((count(SpdKind::Teapot, 12, is_polygon), count(SpdKind::Mount, 6, is_sphere)), (144, 4));
    assert_eq!((count(SpdKind::Tree, 11, is_cone), count(SpdKind::Tree, 11, is_polygon)), (4095, 1));
}

#[test]
fn sizes_out_of_range_are_refused_with_the_limit() {
    for kind in SpdKind::ALL {
        let max = kind.max_size();
        for size in [0, max + 1, u32::MAX] {
            assert_eq!(kind.generate(size).err(), Some(SpdSizeError { size, max }));
        }
        assert!(kind.object_count(max) <= 1_100_000, "{}", kind.name());
        assert!(kind.object_count(kind.default_size()) < 10_000 && kind.default_size() <= max, "{}", kind.name());
        assert_eq!(SpdKind::from_name(kind.name()), Some(kind));
    }
}

#[test]
fn gear_faces_are_concave_and_turn_outwards() {
    let scene = SpdKind::Gears.generate(1).expect("a valid size");
    let faces: Vec<_> = scene
        .objects
        .iter()
        .filter_map(|o| match &o.shape {
            SpdShape::Polygon(corners) if corners.len() == 144 => Some(mesh::polygon_normal(corners)),
            _ => None,
        })
        .collect();
    assert_eq!(faces.len(), 2);
    assert!(faces[0].distance(DVec3::Z) < 1e-12 && faces[1].distance(DVec3::NEG_Z) < 1e-12, "{faces:?}");
}

#[test]
fn closed_solids_have_outward_normals() {
    // A point inside the solid that a polygon belongs to: the mean of its group of polygons.
    for (kind, skip, group) in [(SpdKind::Gears, 1, 146), (SpdKind::Tetra, 0, 4)] {
        let scene = kind.generate(2).expect("a valid size");
        for solid in scene.objects[skip..].chunks(group) {
            let corners: Vec<&[DVec3]> = solid
                .iter()
                .map(|o| match &o.shape {
                    SpdShape::Polygon(corners) => &corners[..],
                    other => panic!("{other:?}"),
                })
                .collect();
            let all = || corners.iter().flat_map(|c| c.iter().copied());
            let middle = all().sum::<DVec3>() / all().count() as f64;
            for polygon in corners {
                let out = mesh::polygon_normal(polygon).dot(polygon[0] - middle);
                // The flanks of teeth are the least steep.
                assert!(out > 0.0, "{} {polygon:?}", kind.name());
            }
        }
    }
}

#[test]
fn flake_spheres_touch_their_parents_and_no_other_sphere() {
    let scene = SpdKind::Balls.generate(2).expect("a valid size");
    let spheres: Vec<(DVec3, f64)> = scene
        .objects
        .iter()
        .filter_map(|o| match o.shape {
            SpdShape::Sphere { center, radius } => Some((center, radius)),
            _ => None,
        })
        .collect();
    for (i, &(center, radius)) in spheres.iter().enumerate() {
        let gaps =
            spheres.iter().enumerate().filter(|&(j, _)| j != i).map(|(_, &(c, r))| c.distance(center) - r - radius);
        let least = gaps.clone().fold(f64::INFINITY, f64::min);
        assert!(least > -1e-9, "sphere {i} overlaps by {}", -least);
        assert!(least < 1e-9, "sphere {i} floats {least} away");
    }
}

#[test]
fn mountain_cells_meet_without_cracks() {
    let scene = SpdKind::Mount.generate(4).expect("a valid size");
    let mut heights = std::collections::HashMap::new();
    for object in &scene.objects {
        if let SpdShape::Polygon(corners) = &object.shape {
            for p in corners {
                let known = heights.insert((p.x.to_bits(), p.y.to_bits()), p.z);
                assert!(known.is_none_or(|z| z.to_bits() == p.z.to_bits()), "{p}");
            }
        }
    }
    assert_eq!(heights.len(), 17 * 17);
    assert!(heights.values().any(|z| z.abs() > 0.05));
}

#[test]
fn teapot_normals_point_away_from_its_axis_on_the_body() {
    let scene = SpdKind::Teapot.generate(6).expect("a valid size");
    for object in &scene.objects {
        let SpdShape::Patch { corners, normals } = &object.shape else { continue };
        let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        assert!(face.length() > 0.0);
        for (p, n) in corners.iter().zip(normals) {
            assert!((n.length() - 1.0).abs() < 1e-12, "{n}");
            assert!(n.dot(face) > -0.3 * face.length(), "a normal leans away from its triangle at {p}");
            // The body between handle and spout.
            if p.z > 0.5 && p.z < 2.2 && p.y.abs() > 0.8 {
                assert!(n.x * p.x + n.y * p.y > 0.0, "{p} {n}");
            }
        }
    }
}
