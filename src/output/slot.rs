use crate::render::Film;

/// A frame on its way to a file. Its buffers are handed back and used again.
#[derive(Debug, Default)]
pub struct FrameSlot {
    /// The picture.
    pub film: Film,
    /// The frame's number.
    pub frame: u64,
    /// Its place among the frames of this run, from 0.
    pub ordinal: u64,
    pub(super) rgba: Vec<u8>,
    pub(super) scratch: Vec<u8>,
    pub(super) bytes: Vec<u8>,
}

impl FrameSlot {
    /// A slot for pictures of the given size.
    pub fn new(width: u32, height: u32) -> Self {
        Self { film: Film::new(width, height), ..Self::default() }
    }

    /// What the encoder made of the picture.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}
