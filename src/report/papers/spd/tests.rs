use super::*;
use crate::{
    accel::{
        events::{EventBoxes, EventsConfig, Form},
        grid::{BoxGrid, GridConfig},
    },
    scene::spd::SpdKind,
};

/// Small pictures of small scenes.
fn scenes() -> impl Iterator<Item = SpdScene> {
    let size = |kind| match kind {
        SpdKind::Mount | SpdKind::Tetra | SpdKind::Teapot | SpdKind::Lattice => 3,
        SpdKind::Tree => 5,
        _ => 2,
    };
    SpdKind::ALL.into_iter().map(move |kind| kind.generate(size(kind)).expect("a valid size"))
}

fn trace<W: Walker>(scene: &SpdScene, solids: &Solids, walker: &W, rays: RaySet) -> (RayCounts, WalkCounts) {
    Tracer::new(scene, solids, walker, Rules::Readme, (24, rays)).trace()
}

fn events(solids: &Solids, form: Form) -> EventBoxes {
    let boxes = solids.boxes();
    let config = EventsConfig { form, ..EventsConfig::default() };
    EventBoxes::build(boxes.len(), |i| boxes[i as usize], &config).expect("few boxes")
}

#[test]
fn counts_do_not_depend_on_the_structure() {
    for scene in scenes() {
        let solids = Solids::new(&scene);
        let (due, naive) = trace(&scene, &solids, &Naive::new(solids.boxes()), RaySet::All);
        let (found, tree) = trace(&scene, &solids, &BoxTree::new(solids.boxes()), RaySet::All);
        assert_eq!(found, due, "{}", scene.kind.name());
        assert_eq!(due.primary.rays, 25 * 25);
        assert!(due.primary.hits > 0 && due.shadow.rays > 0, "{} {due:?}", scene.kind.name());
        assert!(naive.tests > 2 * tree.tests && tree.tests > 0, "{}: {tree:?}", scene.kind.name());
        let grid = BoxGrid::build(solids.boxes(), &GridConfig::default()).expect("few boxes");
        let (found, grid) = trace(&scene, &solids, &grid, RaySet::All);
        assert_eq!(found, due, "{}", scene.kind.name());
        assert!(grid.steps > 0 && grid.tests > 0, "{}: {grid:?}", scene.kind.name());
        for form in [Form::Flat, Form::Tree] {
            let (found, walk) = trace(&scene, &solids, &events(&solids, form), RaySet::All);
            assert_eq!(found, due, "{}, {form:?}", scene.kind.name());
            assert!(walk.events > 0, "{}: {walk:?}", scene.kind.name());
        }
    }
}

#[test]
fn no_structure_needs_fewer_tests_than_the_least() {
    for scene in scenes() {
        let solids = Solids::new(&scene);
        let (_, least) = trace(&scene, &solids, &LeastTests::new(solids.boxes()), RaySet::All);
        let (counts, tree) = trace(&scene, &solids, &BoxTree::new(solids.boxes()), RaySet::All);
        assert!(counts.all().hits <= least.nodes, "{}", scene.kind.name());
        assert!(least.nodes <= tree.tests, "{}: {least:?} {tree:?}", scene.kind.name());
    }
}

#[test]
fn event_lists_make_the_least_tests() {
    for mut scene in scenes() {
        // Rays to lights stop at any hit, so the least for them depends on luck.
        scene.lights.clear();
        let solids = Solids::new(&scene);
        let (_, least) = trace(&scene, &solids, &LeastTests::new(solids.boxes()), RaySet::All);
        for form in [Form::Flat, Form::Tree] {
            let (_, walk) = trace(&scene, &solids, &events(&solids, form), RaySet::All);
            assert_eq!(walk.tests, least.nodes, "{}, {form:?}", scene.kind.name());
        }
    }
}

#[test]
fn only_rays_that_the_surfaces_call_for_are_cast() {
    for scene in scenes() {
        let solids = Solids::new(&scene);
        let tree = BoxTree::new(solids.boxes());
        let (primary, _) = trace(&scene, &solids, &tree, RaySet::Primary);
        let (all, _) = trace(&scene, &solids, &tree, RaySet::All);
        assert_eq!(primary.primary, all.primary);
        assert_eq!((primary.shadow.rays, primary.secondary.rays), (0, 0));
        let mirrors = scene.surfaces.iter().any(|s| s.specular > 0.0 || s.transmittance > 0.0);
        assert_eq!(all.secondary.rays > 0, mirrors, "{}", scene.kind.name());
        let most = all.primary.hits + all.secondary.hits;
        assert!(all.shadow.rays <= most * scene.lights.len() as u64, "{}", scene.kind.name());
    }
}
