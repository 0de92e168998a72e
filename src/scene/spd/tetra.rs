//! `tetra`: a tetrahedron of four tetrahedra of half the size, and so on.

use glam::DVec3;

use super::object::{SpdScene, SpdSurface};

/// Corners of a cube of half size 1 that make a tetrahedron.
const CORNERS: [DVec3; 4] =
    [DVec3::new(-1.0, -1.0, 1.0), DVec3::new(-1.0, 1.0, -1.0), DVec3::new(1.0, -1.0, -1.0), DVec3::new(1.0, 1.0, 1.0)];
/// Its faces, seen from outside counter-clockwise.
const FACES: [[usize; 3]; 4] = [[0, 1, 2], [3, 2, 1], [2, 3, 0], [1, 0, 3]];

pub(super) fn make(scene: &mut SpdScene) {
    let up = [-0.816_497, -0.816_497, 0.816_497];
    scene.look([1.022_846, -3.177_154, -2.174_512], [-0.004_103, -0.004_103, 0.216_539], up);
    scene.light(&[[2.0, -18.0, -5.0]]);
    let red = scene.surface(SpdSurface { color: DVec3::new(1.0, 0.2, 0.2), ..SpdSurface::MATT });
    grow(scene, red, scene.size, DVec3::ZERO, 1.0);
}

fn grow(scene: &mut SpdScene, surface: u32, depth: u32, center: DVec3, half: f64) {
    if depth > 1 {
        for corner in CORNERS {
            grow(scene, surface, depth - 1, center + corner * (half / 2.0), half / 2.0);
        }
    } else {
        let corners = CORNERS.map(|corner| center + corner * half);
        for face in FACES {
            scene.add_polygon(surface, face.map(|i| corners[i]));
        }
    }
}
