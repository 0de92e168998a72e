//! The free camera: it turns round a point, with +Y up.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DAffine3, DMat3, DVec3};

use crate::{geom::Aabb, render::CameraView, scene::Projection};

/// Pitch stops this far short of the poles, in radians.
const POLE_MARGIN: f64 = 1e-3;
/// Factor of the distance for one notch of the wheel towards the scene.
const ZOOM_NOTCH: f64 = 0.88;
/// Notches that one call may zoom by, so that distances stay finite.
const MOST_NOTCHES: f64 = 50.0;

/// A camera on a sphere round `target`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Orbit {
    target: DVec3,
    distance: f64,
    /// Angle of the camera's place round +Y, radians; 0 looks from +Z.
    yaw: f64,
    /// Height angle of the camera's place, radians, positive above the target.
    pitch: f64,
    projection: Projection,
}

impl Orbit {
    /// The orbit that sees what `view` sees, round the point of its axis nearest to the middle of `bounds`.
    ///
    /// A roll of the view is dropped. With the middle behind the camera, or empty bounds, the point lies one
    /// diagonal (at least a metre) ahead.
    pub(super) fn from_view(view: &CameraView, bounds: Aabb) -> Self {
        let eye = view.world_from_camera.translation;
        let back = view.world_from_camera.matrix3.z_axis.normalize_or(DVec3::Z);
        let diagonal = f64::from(bounds.diagonal());
        let ahead = (eye - bounds.center().as_dvec3()).dot(back);
        let distance = if ahead.is_finite() && ahead > 1e-3 * diagonal {
            ahead
        } else if diagonal.is_finite() && diagonal > 0.0 {
            diagonal
        } else {
            1.0
        };
        Self {
            target: eye - back * distance,
            distance,
            yaw: libm::atan2(back.x, back.z),
            pitch: clamp_pitch(libm::asin(back.y.clamp(-1.0, 1.0))),
            projection: open_near(view.projection),
        }
    }

    fn axes(&self) -> DMat3 {
        let (sin_yaw, cos_yaw) = (libm::sin(self.yaw), libm::cos(self.yaw));
        let (sin_pitch, cos_pitch) = (libm::sin(self.pitch), libm::cos(self.pitch));
        let back = DVec3::new(sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch);
        let right = DVec3::new(cos_yaw, 0.0, -sin_yaw);
        DMat3::from_cols(right, back.cross(right), back)
    }

    /// The view from the orbit.
    pub(super) fn view(&self) -> CameraView {
        let axes = self.axes();
        CameraView {
            world_from_camera: DAffine3 { matrix3: axes, translation: self.target + axes.z_axis * self.distance },
            projection: self.projection,
        }
    }

    /// Turns for a pointer motion in units of the window's height: to the right brings the left side into view.
    pub(super) fn turn(&mut self, dx: f64, dy: f64) {
        self.yaw = libm::remainder(self.yaw - dx * PI, 2.0 * PI);
        self.pitch = clamp_pitch(self.pitch + dy * PI);
    }

    /// Moves so that the target's plane follows a pointer motion in units of the window's height.
    pub(super) fn pan(&mut self, dx: f64, dy: f64) {
        let axes = self.axes();
        self.target += (axes.y_axis * dy - axes.x_axis * dx) * self.height_at_target();
    }

    fn height_at_target(&self) -> f64 {
        match self.projection {
            Projection::Perspective { y_fov, .. } => 2.0 * self.distance * libm::tan(f64::from(y_fov) * 0.5),
            Projection::Orthographic { y_mag, .. } => 2.0 * f64::from(y_mag).abs(),
        }
    }

    /// Goes closer by `notches` of the wheel (away when negative); an orthographic view shrinks its extent.
    pub(super) fn zoom(&mut self, notches: f64) {
        let factor = libm::pow(ZOOM_NOTCH, notches.clamp(-MOST_NOTCHES, MOST_NOTCHES));
        match &mut self.projection {
            Projection::Perspective { .. } => {
                let distance = self.distance * factor;
                if (1e-9..1e12).contains(&distance) {
                    self.distance = distance;
                }
            }
            Projection::Orthographic { x_mag, y_mag, .. } => {
                #[expect(clippy::cast_possible_truncation, reason = "a factor near 1")]
                let factor = factor as f32;
                let (x, y) = (*x_mag * factor, *y_mag * factor);
                if [x, y].iter().all(|m| (1e-9..1e12).contains(&m.abs())) {
                    (*x_mag, *y_mag) = (x, y);
                }
            }
        }
    }
}

fn clamp_pitch(pitch: f64) -> f64 {
    pitch.clamp(POLE_MARGIN - FRAC_PI_2, FRAC_PI_2 - POLE_MARGIN)
}

/// The projection without the file's clip distances and aspect, which belong to the file's place of the camera.
fn open_near(projection: Projection) -> Projection {
    match projection {
        Projection::Perspective { y_fov, .. } => {
            Projection::Perspective { y_fov, aspect: None, z_near: 0.0, z_far: None }
        }
        orthographic @ Projection::Orthographic { .. } => orthographic,
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;

    fn looking_from(eye: DVec3) -> CameraView {
        let back = eye.normalize();
        let right = DVec3::Y.cross(back).normalize();
        CameraView {
            world_from_camera: DAffine3 { matrix3: DMat3::from_cols(right, back.cross(right), back), translation: eye },
            projection: Projection::Perspective { y_fov: 0.7, aspect: None, z_near: 0.0, z_far: None },
        }
    }

    fn unit_box() -> Aabb {
        Aabb { min: Vec3::NEG_ONE, max: Vec3::ONE }
    }

    proptest! {
        #[test]
        fn orbit_starts_with_the_view_it_came_from(x in -9.0..9.0f64, y in -3.0..3.0f64, z in 1.0..9.0f64) {
            let view = looking_from(DVec3::new(x, y, z));
            let orbit = Orbit::from_view(&view, unit_box()).view();
            let (a, b) = (orbit.world_from_camera, view.world_from_camera);
            prop_assert!(a.translation.distance(b.translation) < 1e-9);
            for axis in 0..3 {
                prop_assert!(a.matrix3.col(axis).distance(b.matrix3.col(axis)) < 1e-9);
            }
        }

        #[test]
        fn turning_keeps_the_distance_and_an_upright_rigid_frame(
            turns in prop::collection::vec((-2.0..2.0f64, -2.0..2.0f64), 1..9)
        ) {
            let mut orbit = Orbit::from_view(&looking_from(DVec3::new(1.0, 2.0, 5.0)), unit_box());
            for (dx, dy) in turns {
                orbit.turn(dx, dy);
            }
            let placed = orbit.view().world_from_camera;
            prop_assert!((placed.translation.length() - 30.0f64.sqrt()).abs() < 1e-9);
            prop_assert!((placed.matrix3.determinant() - 1.0).abs() < 1e-9);
            prop_assert!(placed.matrix3.y_axis.y > 0.0, "never upside down");
        }
    }

    #[test]
    fn dragging_right_moves_the_camera_to_the_left() {
        let mut orbit = Orbit::from_view(&looking_from(DVec3::Z * 5.0), unit_box());
        orbit.turn(0.1, 0.0);
        assert!(orbit.view().world_from_camera.translation.x < 0.0);
        orbit.turn(0.0, 0.1);
        assert!(orbit.view().world_from_camera.translation.y > 0.0, "dragging down raises it");
    }

    #[test]
    fn panning_by_the_window_height_moves_by_what_the_window_shows() {
        let mut orbit = Orbit::from_view(&looking_from(DVec3::Z * 5.0), unit_box());
        orbit.pan(0.0, 1.0);
        let eye = orbit.view().world_from_camera.translation;
        assert!((eye.y - 10.0 * libm::tan(0.35)).abs() < 1e-6 && eye.x.abs() < 1e-9);
    }

    #[test]
    fn zoom_out_undoes_zoom_in_and_extremes_stay_finite() {
        let mut orbit = Orbit::from_view(&looking_from(DVec3::Z * 5.0), unit_box());
        orbit.zoom(3.0);
        assert!(orbit.view().world_from_camera.translation.z < 5.0);
        orbit.zoom(-3.0);
        assert!((orbit.view().world_from_camera.translation.z - 5.0).abs() < 1e-9);
        for _ in 0..100 {
            orbit.zoom(f64::MAX);
        }
        for _ in 0..300 {
            orbit.zoom(f64::MIN);
        }
        assert!(orbit.view().world_from_camera.translation.is_finite());
    }

    #[test]
    fn view_away_from_empty_bounds_still_gives_an_orbit() {
        let view = looking_from(DVec3::Z * 5.0);
        for bounds in [Aabb::EMPTY, Aabb { min: Vec3::splat(99.0), max: Vec3::splat(100.0) }] {
            let orbit = Orbit::from_view(&view, bounds);
            assert!(orbit.view().world_from_camera.translation.distance(DVec3::Z * 5.0) < 1e-9);
        }
    }
}
