//! Which scene stands for which model of a paper.

use crate::{
    report::{ReportError, Subject, View, meshes},
    scene::spd::{SpdKind, SpdView},
};

/// Where a scene comes from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Source<'a> {
    /// Given by the caller.
    Given(&'a Subject),
    /// A dented ball of about so many triangles.
    Sphere(usize),
    /// As `Sphere`, seen from inside: a room.
    Cave(usize),
    /// So many triangles without order.
    Soup(usize),
    /// So many boxes of twelve triangles.
    Boxes(usize),
    /// A database at a size factor, in at most so many triangles.
    Spd(SpdKind, u32, usize),
}

/// A scene and the model that it stands for or is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case<'a> {
    /// The paper's name of the model; absent for scenes of ours.
    pub(super) model: Option<&'static str>,
    /// Triangles of the model.
    pub(super) triangles: usize,
    /// What is measured.
    pub(super) source: Source<'a>,
}

impl Source<'_> {
    /// The triangles.
    ///
    /// # Errors
    /// When a database has no such size.
    pub(super) fn subject(&self) -> Result<Subject, ReportError> {
        Ok(match *self {
            Self::Given(subject) => subject.clone(),
            Self::Sphere(triangles) => meshes::dented_sphere(triangles),
            Self::Cave(triangles) => meshes::cave(triangles),
            Self::Soup(triangles) => meshes::soup(triangles),
            Self::Boxes(count) => meshes::boxes(count),
            Self::Spd(kind, size, triangles) => {
                let name = format!("spd-{}:{size}", kind.name());
                let scene = kind
                    .generate(size)
                    .map_err(|e| ReportError::Scene { scene: name.clone(), reason: e.to_string() })?;
                let mut subject = Subject::from_scene(name, &scene.tessellate_within(triangles));
                let SpdView { from, at, up, angle_deg } = scene.view;
                subject.view = Some(View {
                    eye: scene.to_y_up(from),
                    at: scene.to_y_up(at),
                    up: scene.to_y_up(up),
                    half: libm::tan(angle_deg.to_radians() / 2.0),
                });
                subject
            }
        })
    }
}

impl Case<'_> {
    /// `as in the paper`, `substituted` or nothing for a scene of ours.
    pub(super) fn standing(&self, triangles: usize) -> Option<&'static str> {
        let is_model = matches!(self.source, Source::Given(_)) && triangles == self.triangles;
        self.model.map(|_| if is_model { "as in the paper" } else { "substituted" })
    }
}

/// The given scene that is a model or resembles it most: one of its number of triangles, else the largest that has the beginning of
/// its name.
pub(super) fn given<'a>(models: &'a [Subject], name: &str, triangles: usize) -> Option<&'a Subject> {
    let exact = models.iter().find(|m| m.indices.len() == triangles);
    let stem = name.to_ascii_lowercase();
    let stem = &stem[..stem.len().min(3)];
    let file = |m: &Subject| m.name.rsplit(['/', '\\', ':']).next().unwrap_or_default().to_ascii_lowercase();
    let named = models.iter().filter(|m| file(m).contains(stem));
    exact.or_else(|| named.max_by_key(|m| m.indices.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_found_by_its_triangles_or_its_name() {
        let mut bunny = meshes::soup(10);
        bunny.name = "a/bun_zipper.ply".into();
        let mut dragon = meshes::soup(20);
        dragon.name = "dragon_res2.glb".into();
        let models = [bunny, dragon];
        let found = |name, triangles| given(&models, name, triangles).map(|m| m.indices.len());
        assert_eq!(found("Bunny", 69_451), Some(10));
        assert_eq!(found("Dragon", 871_414), Some(20));
        assert_eq!(found("Toys", 20), Some(20));
        assert_eq!(found("Toys", 11_141), None);
        let case = Case { model: Some("Toys"), triangles: 20, source: Source::Given(&models[1]) };
        assert_eq!((case.standing(20), case.standing(21)), (Some("as in the paper"), Some("substituted")));
        let made = Case { source: Source::Soup(20), ..case };
        assert_eq!((made.standing(20), Case { model: None, ..made }.standing(20)), (Some("substituted"), None));
    }

    #[test]
    fn sources_make_triangles_and_unknown_sizes_are_errors() {
        assert_eq!(Source::Soup(7).subject().unwrap().indices.len(), 7);
        let tetra = Source::Spd(SpdKind::Tetra, 2, 1000).subject().unwrap();
        assert!(tetra.indices.len() >= 16 && tetra.view.is_some());
        assert_eq!(Source::Boxes(41).subject().unwrap().indices.len(), 492);
        assert!(Source::Spd(SpdKind::Tetra, 99, 1000).subject().is_err());
    }
}
