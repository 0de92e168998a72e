//! What `fast` may differ in from `exact`, and what not.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small numbers; results are compared bit for bit"
)]

#[path = "common/trace.rs"]
mod trace;

use kinora::{
    accel::{AccelKind, AccelSpec, AnyAccel, Forms, PACKET, Precision},
    anim::{ActiveClip, Pose, deform_range, deform_range_as},
    dynamics::{FrameConfig, FrameLoop, RebuildPolicy},
    geom::{Hit, Ray},
    glam::{DAffine3, Vec3},
    scene::{ClipId, builtin},
    simd::SimdLevel,
};
use proptest::prelude::*;
use std::sync::Arc;
use trace::{Mesh, Random};

const FAST: Forms = Forms::all(Precision::Fast);

fn build(kind: AccelKind, mesh: &Mesh) -> AnyAccel {
    AccelSpec::new(kind).build(&mesh.prims()).expect("the mesh builds")
}

fn hits(
    accel: &AnyAccel,
    mesh: &Mesh,
    rays: &[Ray],
    packet: usize,
    level: SimdLevel,
    forms: Forms,
) -> Vec<Option<Hit>> {
    let mut out = vec![None; rays.len()];
    accel.closest_hits_as(&mesh.prims(), rays, packet, level, forms, &mut out).expect("no other mode");
    out
}

fn blocked(accel: &AnyAccel, mesh: &Mesh, rays: &[Ray], packet: usize, level: SimdLevel, forms: Forms) -> Vec<bool> {
    let mut out = vec![false; rays.len()];
    accel.blocked_as(&mesh.prims(), rays, packet, level, forms, &mut out).expect("no other mode");
    out
}

fn soup(count: usize, size: f32, seed: u64) -> Mesh {
    let mut random = Random(seed);
    let triangle = |_| {
        let center = random.vec3();
        [center, center + random.vec3() * size, center + random.vec3() * size]
    };
    Mesh::soup(&(0..count).map(triangle).collect::<Vec<_>>())
}

/// Rays in bundles of a packet from common and from different origins, some along axes.
fn rays(count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    let bundle = |b: usize| {
        let (origin, towards) = (random.vec3() * 3.0, random.vec3() * 0.7);
        (0..PACKET)
            .map(|_| {
                let origin = if b.is_multiple_of(2) { origin } else { origin + random.vec3() * 0.1 };
                let mut dir = towards + random.vec3() * 0.2 - origin;
                if b % 5 == 4 {
                    dir[b / 5 % 3] = 0.0;
                }
                Ray::new(origin, dir)
            })
            .collect::<Vec<_>>()
    };
    (0..count / PACKET).flat_map(bundle).collect()
}

/// Every structure over a mesh.
fn all(mesh: &Mesh) -> Vec<AnyAccel> {
    AccelKind::ALL.iter().map(|&kind| build(kind, mesh)).collect()
}

/// Every way to ask: forms, structure, packet, level.
fn ways<'a>(
    forms: &'a [Forms],
    accels: &'a [AnyAccel],
) -> impl Iterator<Item = (Forms, &'a AnyAccel, usize, SimdLevel)> + 'a {
    forms.iter().flat_map(move |&forms| {
        accels.iter().flat_map(move |accel| {
            [1, PACKET]
                .into_iter()
                .flat_map(move |packet| SimdLevel::available().map(move |level| (forms, accel, packet, level)))
        })
    })
}

const MIXED: [Forms; 3] =
    [FAST, Forms { nodes: Precision::Fast, ..Forms::EXACT }, Forms { leaves: Precision::Fast, ..Forms::EXACT }];

/// Where the fast answer is another triangle or none, the exact one lies near an edge, or both are about as far.
fn is_excusable(mesh: &Mesh, exact: Option<Hit>, fast: Option<Hit>) -> bool {
    let near_edge = |h: Hit| h.u.min(h.v).min(1.0 - h.u - h.v) < 1e-3;
    let slanted = |h: Hit, ray_independent: f32| {
        let [a, b, c] = mesh.corners(h.prim.0 as usize);
        (b - a).cross(c - a).length() < ray_independent
    };
    match (exact, fast) {
        (Some(e), Some(f)) if e.prim == f.prim => {
            (e.t - f.t).abs() <= 1e-4 * e.t && (e.u - f.u).abs() < 1e-2 && (e.v - f.v).abs() < 1e-2 || slanted(e, 1e-4)
        }
        (Some(e), Some(f)) => (e.t - f.t).abs() <= 1e-4 * e.t || near_edge(e) || near_edge(f),
        (Some(e), None) => near_edge(e),
        (None, Some(f)) => near_edge(f),
        (None, None) => true,
    }
}

#[test]
fn fast_hits_agree_with_exact_ones_where_triangles_are_well_shaped() {
    let mesh = soup(150, 0.5, 11);
    let rays = rays(400, 12);
    let due = hits(&build(AccelKind::List, &mesh), &mesh, &rays, 1, SimdLevel::best(), Forms::EXACT);
    for (forms, accel, packet, level) in ways(&MIXED, &all(&mesh)) {
        let (kind, found) = (accel.kind(), hits(accel, &mesh, &rays, packet, level, forms));
        let wrong: Vec<_> =
            (0..rays.len()).filter(|&i| !is_excusable(&mesh, due[i], found[i])).map(|i| (due[i], found[i])).collect();
        assert!(wrong.len() <= 2, "{forms:?} {kind} {packet} {level}: {wrong:?}");
        let same = (0..rays.len()).filter(|&i| due[i].map(|h| h.prim) == found[i].map(|h| h.prim)).count();
        assert!(same * 1000 >= rays.len() * 995, "{forms:?} {kind} {packet} {level}: {same} of {}", rays.len());
    }
    assert!(due.iter().flatten().count() > 100);
}

#[test]
fn a_form_that_a_structure_does_not_have_stays_exact() {
    let mesh = soup(150, 0.4, 3);
    let rays = rays(320, 4);
    let nodes = Forms { nodes: Precision::Fast, ..Forms::EXACT };
    for &kind in AccelKind::ALL.iter().filter(|&&k| k != AccelKind::Bvh2) {
        let accel = build(kind, &mesh);
        for packet in [1, PACKET] {
            let found = hits(&accel, &mesh, &rays, packet, SimdLevel::best(), nodes);
            assert_eq!(found, hits(&accel, &mesh, &rays, packet, SimdLevel::best(), Forms::EXACT), "{kind}");
        }
    }
}

#[test]
fn fast_answers_do_differ() {
    // A fan of slivers seen from its rim: if fast never erred here, it would not be what it says.
    let fan: Vec<_> = (0..2000_u16)
        .map(|i| {
            let at = |i: u16| {
                let x = f32::from(i) / 2000.0;
                Vec3::new(x, x * x * 1e-3, 1.0 + x)
            };
            [Vec3::new(0.0, 40.0, 3.0), at(i), at(i + 1)]
        })
        .collect();
    let mesh = Mesh::soup(&fan);
    let rays: Vec<_> = (0..2000_u16)
        .map(|i| {
            let to = fan[usize::from(i)][1].lerp(fan[usize::from(i)][0], 0.3);
            Ray::new(Vec3::new(3.0, 2.0, -900.0), to - Vec3::new(3.0, 2.0, -900.0))
        })
        .collect();
    let accel = build(AccelKind::Bvh2, &mesh);
    let exact = hits(&accel, &mesh, &rays, 1, SimdLevel::best(), Forms::EXACT);
    for forms in [FAST, Forms { leaves: Precision::Fast, ..Forms::EXACT }] {
        let fast = hits(&accel, &mesh, &rays, 1, SimdLevel::best(), forms);
        assert!((0..rays.len()).any(|i| exact[i] != fast[i]), "{forms:?}");
    }
    // Boxes without thickness in a plane far from the origin for their size.
    let far = 4000.0;
    let flat: Vec<_> = (0..400_u16)
        .map(|i| {
            let at = Vec3::new(f32::from(i % 20), f32::from(i / 20), far);
            [at, at + Vec3::X, at + Vec3::Y]
        })
        .collect();
    let mesh = Mesh::soup(&flat);
    let rays: Vec<_> = (0..400_u16)
        .map(|i| {
            let from = Vec3::new(11.3, 7.7, far - 1.0 - f32::from(i % 7) * 0.37);
            let to = flat[usize::from(i)][0] + Vec3::new(0.2, 0.3, 0.0);
            Ray { t_far: 1.0, ..Ray::new(from, (to - from) * 1.000_001) }
        })
        .collect();
    let accel = build(AccelKind::Bvh2, &mesh);
    let nodes = Forms { nodes: Precision::Fast, ..Forms::EXACT };
    let (exact, fast) = (
        hits(&accel, &mesh, &rays, 1, SimdLevel::best(), Forms::EXACT),
        hits(&accel, &mesh, &rays, 1, SimdLevel::best(), nodes),
    );
    assert!(exact.iter().flatten().count() > 300);
    println!("{} of 400 rays differ by the fast node test", (0..400).filter(|&i| exact[i] != fast[i]).count());
}

#[test]
fn equal_t_goes_to_the_lower_triangle() {
    let mesh = soup(40, 1.0, 8);
    let once: Vec<_> = (0..mesh.indices.len()).map(|i| mesh.corners(i)).collect();
    let many = Mesh::soup(&once.iter().cycle().take(once.len() * 8).copied().collect::<Vec<_>>());
    let rays = rays(240, 9);
    for (forms, accel, packet, level) in ways(&[FAST], &all(&many)) {
        let (kind, found) = (accel.kind(), hits(accel, &many, &rays, packet, level, forms));
        assert!(found.iter().flatten().all(|h| (h.prim.0 as usize) < once.len()), "{kind} {packet} {level}");
        assert!(found.iter().flatten().count() > 50);
    }
}

#[test]
fn occlusion_agrees_with_the_closest_hit() {
    let mesh = soup(150, 0.4, 21);
    let rays = rays(320, 22);
    for (forms, accel, packet, level) in ways(&MIXED, &all(&mesh)) {
        let kind = accel.kind();
        let found = hits(accel, &mesh, &rays, packet, level, forms);
        let any = blocked(accel, &mesh, &rays, packet, level, forms);
        let differing = (0..rays.len()).filter(|&i| found[i].is_some() != any[i]).count();
        // Packets thin out as rays are blocked, and few rays are tested one by one.
        assert!(differing <= 1, "{forms:?} {kind} {packet} {level}: {differing}");
    }
}

#[test]
fn levels_with_fused_products_give_the_same_fast_bits() {
    let mesh = soup(200, 0.4, 31);
    let rays = rays(320, 32);
    let fused: Vec<_> = SimdLevel::available().filter(|&l| l != SimdLevel::Scalar).collect();
    for &kind in AccelKind::ALL {
        let accel = build(kind, &mesh);
        for pair in fused.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|level| hits(&accel, &mesh, &rays, 1, level, FAST));
            assert_eq!(a, b, "{kind} {pair:?}");
        }
    }
}

fn hostile() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -2.0_f32..2.0,
        2 => prop::sample::select(vec![
            0.0, -0.0, 1e-45, -1e-45, 1e-38, 1e-20, 1e20, -1e20, 1e38, f32::MAX, f32::MIN, f32::MIN_POSITIVE,
            f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.0, 1.000_000_1,
        ]),
        1 => any::<u32>().prop_map(f32::from_bits),
    ]
}

fn hostile3() -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(hostile()).prop_map(Vec3::from)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn hostile_numbers_give_hits_that_are_numbers(
        corners in prop::collection::vec(prop::array::uniform3(hostile3()), 1..20),
        lines in prop::collection::vec((hostile3(), hostile3(), hostile(), hostile()), PACKET),
    ) {
        let mesh = Mesh::soup(&corners);
        let rays: Vec<_> = lines.into_iter().map(|(origin, dir, t_near, t_far)| Ray { origin, dir, t_near, t_far }).collect();
        for (forms, accel, packet, level) in ways(&MIXED, &all(&mesh)) {
            for (hit, ray) in hits(accel, &mesh, &rays, packet, level, forms).iter().zip(&rays) {
                let Some(hit) = hit else { continue };
                prop_assert!(ray.origin.is_finite() && ray.dir.is_finite(), "{ray:?}");
                prop_assert!(hit.t.is_finite() && hit.t >= ray.t_near.max(0.0) && hit.t <= ray.t_far, "{hit:?} {ray:?}");
                prop_assert!((0.0..=1.0).contains(&hit.u) && (0.0..=1.0).contains(&hit.v), "{hit:?}");
                prop_assert!(mesh.corners(hit.prim.0 as usize).iter().all(|c| c.is_finite()), "{hit:?}");
            }
            blocked(accel, &mesh, &rays, packet, level, forms);
        }
    }
}

#[test]
fn fast_vertices_are_near_the_exact_ones_on_every_level() {
    for name in builtin::names() {
        let scene = builtin::load(name).unwrap();
        let mut pose = Pose::rest(&scene);
        let clips: Vec<_> =
            (0..scene.clips.len() as u32).map(|i| ActiveClip { clip: ClipId(i), time_s: 0.7 }).collect();
        pose.evaluate(&scene, &clips[..clips.len().min(1)], &DAffine3::IDENTITY);
        for &instance in &scene.instances {
            let count = scene.part(instance).positions.len();
            let (mut exact, mut fast) = (vec![Vec3::ZERO; count], vec![Vec3::ZERO; count]);
            deform_range(&scene, &pose, instance, 0, &mut exact);
            deform_range_as(Precision::Fast, SimdLevel::Scalar, &scene, &pose, instance, 0, &mut fast);
            let size = exact.iter().fold(0.0, |size: f32, p| size.max(p.length()));
            let worst = exact.iter().zip(&fast).fold(0.0, |worst: f32, (a, b)| worst.max(a.distance(*b)));
            assert!(worst <= 2e-6 * size, "{name}: {worst} of {size}");
            for level in SimdLevel::available() {
                let mut again = vec![Vec3::ZERO; count];
                let (front, back) = again.split_at_mut(count / 3);
                deform_range_as(Precision::Fast, level, &scene, &pose, instance, 0, front);
                deform_range_as(Precision::Fast, level, &scene, &pose, instance, count / 3, back);
                assert_eq!(again, fast, "{name} at {level}");
            }
        }
    }
}

#[test]
fn the_frame_loop_works_in_the_precision_that_it_is_told() {
    let name = builtin::names()[0];
    let vertices = |forms: Forms| {
        let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap());
        let config =
            FrameConfig { accel: "bvh2".into(), top: "bvh2".into(), policy: RebuildPolicy::Refit, forms, pool };
        let mut frames = FrameLoop::new(config).unwrap();
        frames.add(Arc::new(builtin::load(name).unwrap()), DAffine3::IDENTITY);
        let (world, _) = frames.advance(&[&[ActiveClip { clip: ClipId(0), time_s: 0.4 }]]).unwrap();
        assert_eq!(world.forms(), forms);
        let ids = (0..world.instances().len() as u32).map(kinora::geom::InstanceId);
        ids.flat_map(|id| world.positions(id).to_vec()).collect::<Vec<_>>()
    };
    let exact = vertices(Forms::EXACT);
    let deform = Forms { deform: Precision::Fast, ..Forms::EXACT };
    assert_eq!(vertices(Forms { deform: Precision::Exact, ..FAST }), exact, "rays do not touch vertices");
    assert_ne!(vertices(deform), exact);
    assert_eq!(vertices(deform), vertices(FAST));
}
