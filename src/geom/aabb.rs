use glam::Vec3;

/// A closed axis-aligned box. Empty when a component of `min` exceeds that of `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that contains nothing: the neutral element of [`Aabb::union`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The least box around `points`. NaN components are ignored.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::grown)
    }

    /// This box grown to contain `point`. NaN components are ignored.
    #[inline(always)]
    #[must_use]
    pub fn grown(self, point: Vec3) -> Self {
        Self { min: point.min(self.min), max: point.max(self.max) }
    }

    /// The least box around both.
    #[inline(always)]
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// True when no point lies inside.
    #[inline(always)]
    pub fn is_empty(self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// `max - min`; negative or infinite for an empty box.
    #[inline(always)]
    pub fn extent(self) -> Vec3 {
        self.max - self.min
    }

    /// Midpoint; NaN for an empty box.
    #[inline(always)]
    pub fn center(self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Half the surface area; 0 for an empty box.
    #[inline(always)]
    pub fn half_area(self) -> f32 {
        let e = self.extent().max(Vec3::ZERO);
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    /// Greatest absolute coordinate; 0 for an empty box.
    #[inline(always)]
    pub fn reach(self) -> f32 {
        if self.is_empty() { 0.0 } else { self.min.abs().max(self.max.abs()).max_element() }
    }

    /// Length of the space diagonal; 0 for an empty box.
    pub fn diagonal(self) -> f32 {
        if self.is_empty() { 0.0 } else { self.extent().length() }
    }

    /// True when `other` lies inside this box (an empty `other` always does).
    pub fn contains(self, other: Self) -> bool {
        other.is_empty() || (self.min.cmple(other.min).all() && self.max.cmpge(other.max).all())
    }
}
