//! Textures: pyramids of linear texels and the filtered look-up in them.
//!
//! The finest level is the scene's own 8-bit image, shared, decoded by table at each fetch (exact sRGB before
//! any filtering). Coarser levels are made once, averaged in linear space, in 16 bits a channel: 2.7 bytes a
//! texel of the image on top of its own 4.

mod pyramid;
mod sample;

pub(crate) use pyramid::{Encoding, Pyramid};
pub(crate) use sample::{Footprint, Source, sample, sample_one};
