/// A glTF camera; it looks along the node's -Z with +Y up.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name, empty when the file has none.
    pub name: String,
    /// Kind and field of view.
    pub projection: Projection,
}

/// Kind and field of view of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Perspective with a vertical field of view in radians.
    Perspective {
        /// Vertical field of view in radians.
        y_fov: f32,
        /// Width over height in the file, if given.
        aspect: Option<f32>,
        /// Near plane distance.
        z_near: f32,
        /// Far plane distance; `None` is infinite.
        z_far: Option<f32>,
    },
    /// Orthographic with half extents in metres.
    Orthographic {
        /// Half the width.
        x_mag: f32,
        /// Half the height.
        y_mag: f32,
        /// Near plane distance.
        z_near: f32,
        /// Far plane distance.
        z_far: f32,
    },
}
