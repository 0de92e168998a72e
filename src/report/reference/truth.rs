use crate::geom::PrimId;

/// The right answer to "what does this ray meet first".
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// The least t, within a relative error of 2^-40.
    pub t: f64,
    /// The least t rounded to the nearest f32.
    pub t_rounded: f32,
    /// Every triangle met at that t, by ascending number; at least one.
    pub accepted: Vec<Accepted>,
}

/// One of the triangles that a ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accepted {
    /// The triangle.
    pub prim: PrimId,
    /// The weight of its second corner, within 2^-40.
    pub u: f64,
    /// The weight of its third corner, within 2^-40.
    pub v: f64,
    /// Both, rounded to the nearest f32.
    pub rounded: [f32; 2],
}

impl Truth {
    /// The triangle `prim`, if it is among those met first.
    pub fn find(&self, prim: PrimId) -> Option<&Accepted> {
        self.accepted.iter().find(|a| a.prim == prim)
    }
}
