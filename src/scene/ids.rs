macro_rules! ids {
    ($($(#[$doc:meta])* $name:ident;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);

        impl $name {
            /// As an array index.
            #[inline(always)]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }
    )*};
}

ids! {
    /// A node's glTF index.
    NodeId;
    /// A mesh's glTF index.
    MeshId;
    /// A skin's glTF index.
    SkinId;
    /// A clip's (glTF animation's) index.
    ClipId;
    /// A material's glTF index.
    MaterialId;
    /// A texture's glTF index.
    TextureId;
    /// An image's glTF index.
    ImageId;
    /// A camera's glTF index.
    CameraId;
    /// A light's index in `KHR_lights_punctual`.
    LightId;
}
