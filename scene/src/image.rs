//! Float images in memory.

/// A row-major image of `C` interleaved f32 channels; the first pixel is the top left one.
///
/// `Image<3>` holds linear Rec.709 colour or world-space normals, `Image<1>` a mask, opacity or
/// depth.
#[derive(Debug, Clone, PartialEq)]
pub struct Image<const C: usize> {
    width: u32,
    height: u32,
    pixels: Vec<[f32; C]>,
}

impl<const C: usize> Image<C> {
    /// An image of one value.
    pub fn filled(width: u32, height: u32, value: [f32; C]) -> Self {
        Self {
            width,
            height,
            pixels: vec![value; width as usize * height as usize],
        }
    }

    /// An image from its pixels, row by row; `None` if their number is not `width · height`.
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<[f32; C]>) -> Option<Self> {
        (pixels.len() == width as usize * height as usize).then_some(Self {
            width,
            height,
            pixels,
        })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// `(width, height)`.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> &[[f32; C]] {
        &self.pixels
    }

    /// All pixels, row by row, to change.
    pub fn pixels_mut(&mut self) -> &mut [[f32; C]] {
        &mut self.pixels
    }

    /// All values, channels interleaved: `[height, width, C]`.
    pub fn values(&self) -> &[f32] {
        self.pixels.as_flattened()
    }

    /// The pixel in column `x` and row `y`.
    ///
    /// # Panics
    /// If the position is outside the image.
    pub fn get(&self, x: u32, y: u32) -> [f32; C] {
        assert!(
            x < self.width && y < self.height,
            "pixel ({x}, {y}) outside {}x{}",
            self.width,
            self.height
        );
        self.pixels[y as usize * self.width as usize + x as usize]
    }

    /// A new image of the same size with `f` applied to every pixel.
    pub fn map<const D: usize>(&self, f: impl FnMut(&[f32; C]) -> [f32; D]) -> Image<D> {
        Image {
            width: self.width,
            height: self.height,
            pixels: self.pixels.iter().map(f).collect(),
        }
    }

    /// Means over squares of `factor` × `factor` pixels, of which the image has a whole number.
    ///
    /// # Panics
    /// If `factor` is 0.
    pub fn averaged(&self, factor: u32) -> Self {
        let (width, height) = (self.width / factor, self.height / factor);
        let share = 1.0 / (factor * factor) as f32;
        let mut averaged = Self::filled(width, height, [0.0; C]);
        for y in 0..height * factor {
            for x in 0..width * factor {
                let mean = &mut averaged.pixels[(y / factor * width + x / factor) as usize];
                for (mean, value) in mean.iter_mut().zip(self.get(x, y)) {
                    *mean += share * value;
                }
            }
        }
        averaged
    }

    /// Bytes held by the pixels.
    pub fn num_bytes(&self) -> usize {
        size_of_val(self.pixels.as_slice())
    }
}
