/// A triangle's number in the order of the primitives a structure was built over.
///
/// In an answer about a world it counts within the instance's mesh part, in the file's triangle order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PrimId(pub u32);

/// Number of an instance (node, part, copy) in a world, in pose order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstanceId(pub u32);

/// Where a ray meets a triangle.
///
/// `t`, `u` and `v` are the exact values correctly rounded; `u` and `v` weight the triangle's second and
/// third vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter: the point is `origin + t * dir`.
    pub t: f32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
    /// The triangle.
    pub prim: PrimId,
    /// The instance it belongs to; 0 when a structure is asked directly.
    pub instance: InstanceId,
}
