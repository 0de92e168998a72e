use std::{fmt, str::FromStr};

/// How exact answers are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// Every answer is that of exact arithmetic, rounded once.
    #[default]
    Exact,
    /// The cheapest form of each step: see [`Forms`] for what is left out.
    Fast,
}

impl Precision {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Exact, Self::Fast];

    /// `exact` or `fast`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Fast => "fast",
        }
    }
}

impl fmt::Display for Precision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Precision {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|p| p.name() == name).ok_or_else(|| format!("unknown precision `{name}`"))
    }
}

/// Which steps take the form that [`Precision::Fast`] stands for, each by itself.
///
/// All exact by default; [`From<Precision>`] sets all alike.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Forms {
    /// Boxes and slabs that a ray may meet. Fast: `plane * (1/d) - origin * (1/d)` in one fused operation of `f32`, neither end
    /// widened, so a box that a ray touches at an edge, or that lies far from the origin for its size, may be lost. In `bvh2`, `bvh8` and
    /// `ssh` with three or four planes a child; the other structures have the exact form only.
    pub nodes: Precision,
    /// Triangles that a ray may hit. Fast: Möller and Trumbore's test in `f32` without bounds, so a ray may slip through a shared edge,
    /// hit a triangle that it passes by, or find the wrong one first; t, u and v are off by more than a rounding, and products of three coordinates
    /// above some 10^12 overflow, which is a miss. In every structure over triangles.
    pub leaves: Precision,
    /// Vertices. Fast: morphed and skinned in `f32`, the joint matrices rounded.
    pub deform: Precision,
    /// Where secondary rays start. Fast: a fixed number of roundings off the surface, not the bound of the hit's own error.
    pub offset: Precision,
}

impl Forms {
    /// Every step exact.
    pub const EXACT: Self = Self::all(Precision::Exact);

    /// Every step alike.
    pub const fn all(precision: Precision) -> Self {
        Self { nodes: precision, leaves: precision, deform: precision, offset: precision }
    }
}

impl From<Precision> for Forms {
    fn from(precision: Precision) -> Self {
        Self::all(precision)
    }
}
