use std::sync::Arc;

use crate::{
    anim::ActiveClip,
    geom::Triangles,
    glam::Vec3,
    report::{
        ReportError, Subject,
        closed::{self, Closed},
        meshes,
        subject::{middle, posed_at},
    },
    scene::{Scene, builtin},
};

/// Time between two poses, in seconds.
pub(super) const FRAME_S: f64 = 1.0 / 30.0;

/// What is measured: triangles as they are traced, where they were before, and the scene that they come from.
#[derive(Clone, Debug)]
pub struct Source {
    /// Its name in the rows.
    pub name: String,
    /// Vertices as they are traced.
    pub positions: Vec<Vec3>,
    /// The same vertices a frame earlier.
    pub before: Vec<Vec3>,
    /// The same vertices when the motion began.
    pub first: Vec<Vec3>,
    /// Corners of each triangle.
    pub indices: Vec<[u32; 3]>,
    /// The scene; absent for a mesh.
    pub scene: Option<Arc<Scene>>,
    /// The same mesh, if it is known to be closed.
    pub(super) closed: Option<Closed>,
}

impl Source {
    /// A mesh, moved by a wave of a thousandth of its size a frame, and by thirty of them since the motion began.
    pub fn mesh(subject: Subject) -> Self {
        let far = |(&p, &q): (&Vec3, &Vec3)| p + (q - p) * 30.0;
        let first = subject.positions.iter().zip(&subject.moved).map(far).collect();
        Self {
            name: subject.name,
            positions: subject.positions,
            before: subject.moved,
            first,
            indices: subject.indices,
            scene: None,
            closed: None,
        }
    }

    /// A scene in the middle of its first clip; without one, its rest pose as [`Source::mesh`].
    pub fn scene(name: impl Into<String>, scene: Arc<Scene>) -> Self {
        let name = name.into();
        let Some(clip) = first_clip(&scene) else {
            let (positions, indices) = posed_at(&scene, None);
            let mesh = Self::mesh(Subject::still(name, positions, indices));
            return Self { scene: Some(scene), ..mesh };
        };
        let at = |active: ActiveClip| posed_at(&scene, Some(active));
        let (positions, indices) = at(middle(&scene, clip, 0.0));
        let (before, _) = at(middle(&scene, clip, -FRAME_S));
        let (first, _) = at(ActiveClip { time_s: 0.0, ..middle(&scene, clip, 0.0) });
        Self { name, positions, before, first, indices, scene: Some(scene), closed: None }
    }

    fn closed(mesh: Closed) -> Self {
        Self { closed: Some(mesh.clone()), ..Self::mesh(mesh.subject) }
    }

    /// The triangles as they are traced.
    pub(super) fn prims(&self) -> Triangles<'_> {
        Triangles { positions: &self.positions, indices: &self.indices, topology_epoch: 1 }
    }
}

/// The first clip that can be played.
pub(super) fn first_clip(scene: &Scene) -> Option<usize> {
    scene.clips.iter().position(|c| c.disabled.is_none())
}

/// What is measured when nothing is asked for: the built-in scenes, closed meshes, triangles without order, and a ball far from the origin.
///
/// # Errors
/// When a built-in scene does not load.
pub(super) fn defaults(quick: bool) -> Result<Vec<Source>, ReportError> {
    let scenes = if quick { &builtin::names()[..1] } else { builtin::names() };
    let mut sources = Vec::new();
    for name in scenes {
        sources.push(Source::scene(format!("builtin:{name}"), Arc::new(builtin::load(name)?)));
    }
    if quick {
        sources.push(Source::closed(closed::dented(5_000)));
        return Ok(sources);
    }
    sources.push(Source::closed(closed::dented(80_000)));
    sources.push(Source::closed(closed::cube(12_000)));
    sources.push(Source::mesh(meshes::soup(50_000)));
    sources.push(Source::mesh(far_away(closed::dented(20_000).subject)));
    Ok(sources)
}

/// The mesh moved along all axes by 4096 times its size, where f32 has twelve bits fewer for its shape.
fn far_away(mut subject: Subject) -> Subject {
    for p in subject.positions.iter_mut().chain(&mut subject.moved) {
        *p += Vec3::splat(4096.0);
    }
    subject.name += "-far";
    subject
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_move_and_keep_their_vertices() {
        for source in defaults(true).unwrap() {
            let n = source.positions.len();
            assert!(n > 0 && source.before.len() == n && source.first.len() == n, "{}", source.name);
            assert!(source.positions != source.before && source.before != source.first, "{}", source.name);
            assert!(source.indices.iter().flatten().all(|&i| (i as usize) < n));
        }
    }
}
