//! Which camera the window shows.

use super::{orbit::Orbit, request::ViewSpec};
use crate::{geom::Aabb, render::CameraView, scene::NodeId};

/// The camera in use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum View {
    /// A camera of the file, by its number among those placed in the scene.
    File(usize),
    /// Framed on the whole animation; becomes free as soon as it is moved.
    Framed,
    /// Moved by hand.
    Free(Orbit),
}

impl View {
    /// What the render thread is asked for; `cameras` are those of the file.
    pub(super) fn spec(&self, cameras: &[NodeId]) -> ViewSpec {
        match self {
            Self::File(camera) => cameras.get(*camera).map_or(ViewSpec::Framed, |&node| ViewSpec::Node(node)),
            Self::Framed => ViewSpec::Framed,
            Self::Free(orbit) => ViewSpec::Fixed(orbit.view()),
        }
    }

    /// The free camera, begun where the picture was seen from.
    pub(super) fn free(&mut self, shown: &CameraView, bounds: Aabb) -> &mut Orbit {
        if !matches!(self, Self::Free(_)) {
            *self = Self::Free(Orbit::from_view(shown, bounds));
        }
        match self {
            Self::Free(orbit) => orbit,
            Self::File(_) | Self::Framed => unreachable!("made free above"),
        }
    }

    /// The next of `cameras` file cameras, after the last the free camera where it was left (`parked`).
    #[must_use]
    pub(super) fn next(&self, cameras: usize, parked: Option<Orbit>) -> Self {
        let free = parked.map_or(Self::Framed, Self::Free);
        match self {
            Self::File(camera) if camera + 1 < cameras => Self::File(camera + 1),
            Self::File(_) => free,
            Self::Framed | Self::Free(_) if cameras > 0 => Self::File(0),
            Self::Framed | Self::Free(_) => *self,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn view() -> CameraView {
        CameraView::look_at(Vec3::new(0.0, 1.0, 5.0), Vec3::ZERO, Vec3::Y, 0.7)
    }

    #[test]
    fn cameras_cycle_through_the_free_one_where_it_was_left() {
        let orbit = Orbit::from_view(&view(), Aabb::EMPTY);
        let mut at = View::Framed;
        let mut seen = vec![];
        for _ in 0..4 {
            at = at.next(2, Some(orbit));
            seen.push(at);
        }
        assert_eq!(seen, [View::File(0), View::File(1), View::Free(orbit), View::File(0)]);
        assert_eq!(View::File(1).next(2, None), View::Framed);
    }

    #[test]
    fn file_without_cameras_keeps_its_view() {
        assert_eq!(View::Framed.next(0, None), View::Framed);
    }

    #[test]
    fn moving_a_file_camera_begins_the_free_one_there() {
        let mut at = View::File(0);
        at.free(&view(), Aabb::EMPTY);
        let ViewSpec::Fixed(fixed) = at.spec(&[]) else { panic!("{at:?}") };
        assert!(fixed.world_from_camera.translation.distance(view().world_from_camera.translation) < 1e-6);
    }
}
