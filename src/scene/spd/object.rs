//! What a database consists of.

use glam::DVec3;

use super::{SKY, SpdKind};

/// A primitive and what it is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct SpdObject {
    /// Its shape.
    pub shape: SpdShape,
    /// Index into [`SpdScene::surfaces`].
    pub surface: u32,
}

/// A primitive's shape.
#[derive(Clone, Debug, PartialEq)]
pub enum SpdShape {
    /// A sphere.
    Sphere {
        /// Centre.
        center: DVec3,
        /// Radius, positive.
        radius: f64,
    },
    /// The mantle of a cone frustum without end caps; a cylinder when the radii agree.
    Cone {
        /// Centre of one end.
        base: DVec3,
        /// Radius there, positive.
        base_radius: f64,
        /// Centre of the other end.
        apex: DVec3,
        /// Radius there, positive, at most `base_radius`.
        apex_radius: f64,
    },
    /// A plane polygon, counter-clockwise seen from its front; it may be concave, but its corners are in angular order
    /// around their mean.
    Polygon(Box<[DVec3]>),
    /// A triangle with unit normals to interpolate, counter-clockwise seen from its front.
    Patch {
        /// Corners.
        corners: [DVec3; 3],
        /// Unit normals at the corners.
        normals: [DVec3; 3],
    },
}

/// Material after the package's neutral file format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpdSurface {
    /// Colour as pictures show it: sRGB.
    pub color: DVec3,
    /// Diffuse part.
    pub diffuse: f64,
    /// Mirrored part; above 0 the surface spawns reflected rays.
    pub specular: f64,
    /// Phong exponent of highlights; 0 for none.
    pub shine: f64,
    /// Part let through; above 0 the surface spawns reflected and refracted rays.
    pub transmittance: f64,
    /// Refractive index behind the surface.
    pub ior: f64,
    /// Both sides are drawn. Those of other opaque surfaces are seen from the front only.
    pub two_sided: bool,
}

impl SpdSurface {
    /// Matt, opaque, one-sided.
    pub const MATT: Self = Self {
        color: DVec3::ONE,
        diffuse: 1.0,
        specular: 0.0,
        shine: 0.0,
        transmittance: 0.0,
        ior: 1.0,
        two_sided: false,
    };
}

/// The camera of a database; the picture is square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpdView {
    /// Eye point.
    pub from: DVec3,
    /// Point in the middle of the picture.
    pub at: DVec3,
    /// Upwards, roughly.
    pub up: DVec3,
    /// Angle in degrees from the centre of the first pixel row to that of the last.
    pub angle_deg: f64,
}

/// A database at a size factor.
#[derive(Clone, Debug)]
pub struct SpdScene {
    /// Which one.
    pub kind: SpdKind,
    /// Size factor.
    pub size: u32,
    /// Primitives in the package's order.
    pub objects: Vec<SpdObject>,
    /// Materials.
    pub surfaces: Vec<SpdSurface>,
    /// Camera.
    pub view: SpdView,
    /// Point lights without falloff; each has the intensity `sqrt(L) / (2 L)` of L lights, and so has the ambient light.
    pub lights: Vec<DVec3>,
    /// Colour of rays that hit nothing, sRGB.
    pub background: DVec3,
}

impl SpdScene {
    pub(super) fn empty(kind: SpdKind, size: u32) -> Self {
        let view = SpdView { from: DVec3::Z, at: DVec3::ZERO, up: DVec3::Y, angle_deg: 45.0 };
        let count = usize::try_from(kind.object_count(size)).unwrap_or(0);
        Self {
            kind,
            size,
            objects: Vec::with_capacity(count),
            surfaces: Vec::new(),
            view,
            lights: Vec::new(),
            background: SKY,
        }
    }

    /// Number of the surface, which is added when no equal one is there.
    #[expect(clippy::cast_possible_truncation, reason = "a scene has some ten surfaces")]
    pub(super) fn surface(&mut self, surface: SpdSurface) -> u32 {
        let known = self.surfaces.iter().position(|s| *s == surface);
        known.unwrap_or_else(|| {
            self.surfaces.push(surface);
            self.surfaces.len() - 1
        }) as u32
    }

    pub(super) fn add(&mut self, surface: u32, shape: SpdShape) {
        self.objects.push(SpdObject { shape, surface });
    }

    pub(super) fn add_sphere(&mut self, surface: u32, center: DVec3, radius: f64) {
        self.add(surface, SpdShape::Sphere { center, radius });
    }

    pub(super) fn add_cylinder(&mut self, surface: u32, base: DVec3, apex: DVec3, radius: f64) {
        self.add(surface, SpdShape::Cone { base, base_radius: radius, apex, apex_radius: radius });
    }

    pub(super) fn add_polygon(&mut self, surface: u32, corners: impl Into<Box<[DVec3]>>) {
        self.add(surface, SpdShape::Polygon(corners.into()));
    }

    /// Looks from `from` at `at`.
    pub(super) fn look(&mut self, from: [f64; 3], at: [f64; 3], up: [f64; 3]) {
        let [from, at, up] = [from, at, up].map(DVec3::from_array);
        self.view = SpdView { from, at, up, ..self.view };
    }

    pub(super) fn light(&mut self, positions: &[[f64; 3]]) {
        self.lights.extend(positions.iter().map(|&p| DVec3::from_array(p)));
    }
}
