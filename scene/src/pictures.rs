//! Pictures that others have made: linear EXR, and display-referred PNG and JPEG where someone has
//! asked for them.

use crate::color::linear_from_srgb;
use crate::error::{Result, SceneError};
use crate::image::Image;
use crate::{exr, files};
use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits, Rgba};
use std::io::{BufReader, Cursor};
use std::path::Path;
use std::sync::LazyLock;

/// Longest edge of a picture, pixels.
const MAX_EDGE: u32 = 65_535;
/// Most bytes of a decoded picture: 16-bit RGBA of 2²⁸ pixels.
const MAX_BYTES: u64 = 1 << 31;

/// Most bytes of a decoded picture for each byte of its file: deflate makes at most 1,032 of one,
/// JPEG 1,024, with a bit for each block.
const MAX_GROWTH: u64 = 2048;

/// Linear light of every sRGB value of 16 bits; those of 8 bits are among them, 257 apart.
static LINEAR: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let unit = |value: u16| f32::from(value) / 65_535.0;
    (0..=u16::MAX)
        .map(|value| linear_from_srgb(unit(value)))
        .collect()
});

/// Whether a file is one of linear light, by its extension.
pub fn is_exr(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| extension.eq_ignore_ascii_case("exr"))
}

/// Width and height from the header alone.
///
/// # Errors
/// [`SceneError`] naming the file: unreadable, or neither EXR nor PNG nor JPEG.
pub fn size(path: &Path) -> Result<(u32, u32)> {
    if is_exr(path) {
        return exr::read_size(path);
    }
    let file = files::open(path)?;
    let reader = ImageReader::new(BufReader::new(file))
        .with_guessed_format()
        .map_err(|e| SceneError::io(path, "read", e))?;
    let (width, height) = reader
        .into_dimensions()
        .map_err(|e| SceneError::invalid(path, "image", e.to_string()))?;
    if ![width, height].iter().all(|n| (1..=MAX_EDGE).contains(n)) {
        let problem = format!("{width}x{height}, not 1 to {MAX_EDGE} each");
        return Err(SceneError::invalid(path, "size", problem));
    }
    Ok((width, height))
}

/// A picture as linear light, and its opacity if it has one that is not 1 everywhere.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Linear light, premultiplied by opacity: of Rec.709 where an EXR states its primaries, then
    /// negative outside of it; else of the picture's own.
    pub radiance: Image<3>,
    /// Opacity, 0 to 1.
    pub alpha: Option<Image<1>>,
    /// 1 in channels at the largest value that the file can hold, else 0; for EXR, and where there
    /// are none, `None`.
    pub clipped: Option<Image<3>>,
}

/// Reads linear light: EXR by its primaries, PNG and JPEG decoded as sRGB (IEC 61966-2-1), 8 or 16
/// bits.
///
/// # Errors
/// [`SceneError`] naming the file.
pub fn read_light(path: &Path) -> Result<Light> {
    if is_exr(path) {
        return Ok(Light {
            radiance: exr::read_rgb_unclipped(path)?,
            alpha: None,
            clipped: None,
        });
    }
    let picture = decode(path)?;
    let (width, height) = (picture.width(), picture.height());
    let has_alpha = picture.color().has_alpha();
    let rgba = picture.into_rgba16();
    let unit = |value: u16| f32::from(value) / 65_535.0;
    let pixels = rgba.pixels().map(|pixel| {
        let [r, g, b, a] = pixel.0;
        [r, g, b].map(|value| unit(a) * LINEAR[usize::from(value)])
    });
    let radiance = Image::from_pixels(width, height, pixels.collect());
    let opacities = rgba.pixels().map(|pixel| [unit(pixel.0[3])]);
    let is_opaque = !has_alpha || rgba.pixels().all(|pixel| pixel.0[3] == u16::MAX);
    let alpha = (!is_opaque).then(|| Image::from_pixels(width, height, opacities.collect()));
    let at_most = |pixel: &Rgba<u16>| {
        let [r, g, b, a] = pixel.0;
        [r, g, b].map(|value| value == u16::MAX && a > 0)
    };
    let is_any = rgba.pixels().any(|pixel| at_most(pixel) != [false; 3]);
    let clipped = is_any.then(|| {
        let flags = rgba.pixels().map(at_most);
        let pixels = flags.map(|flags| flags.map(|flag| f32::from(u8::from(flag))));
        Image::from_pixels(width, height, pixels.collect())
    });
    Ok(Light {
        radiance: whole(path, radiance)?,
        alpha: alpha.map(|alpha| whole(path, alpha)).transpose()?,
        clipped: clipped.map(|clipped| whole(path, clipped)).transpose()?,
    })
}

/// Reads a mask: the first channel, 0 to 1.
///
/// # Errors
/// [`SceneError`] naming the file.
pub fn read_mask(path: &Path) -> Result<Image<1>> {
    if is_exr(path) {
        return exr::read_single(path);
    }
    single(path, 65_535.0)
}

/// Reads depth in the file's own unit: an EXR, or whole numbers in a 16-bit PNG.
///
/// # Errors
/// [`SceneError`] naming the file; depth in 8 bits is refused.
pub fn read_depth(path: &Path) -> Result<Image<1>> {
    if is_exr(path) {
        return exr::read_single(path);
    }
    single(path, 1.0)
}

/// Reads vectors as stored: EXR values, or those of a PNG from 0 to 1.
///
/// # Errors
/// [`SceneError`] naming the file.
pub fn read_vectors(path: &Path) -> Result<Image<3>> {
    if is_exr(path) {
        return exr::read_vectors(path);
    }
    let picture = decode(path)?.into_rgb16();
    let (width, height) = picture.dimensions();
    let pixels = picture
        .pixels()
        .map(|p| p.0.map(|v| f32::from(v) / 65_535.0));
    whole(path, Image::from_pixels(width, height, pixels.collect()))
}

fn single(path: &Path, full: f32) -> Result<Image<1>> {
    let picture = decode(path)?;
    let is_wide = picture.color().bytes_per_pixel() / picture.color().channel_count() >= 2;
    if full == 1.0 && !is_wide {
        let problem = "8 bits, too few for depth";
        return Err(SceneError::unsupported(path, "depth", problem));
    }
    let (width, height) = (picture.width(), picture.height());
    // Not `into_luma`, which would weigh the channels of a colour picture.
    let rgb = picture.into_rgb16();
    let pixels = rgb.pixels().map(|pixel| [f32::from(pixel.0[0]) / full]);
    whole(path, Image::from_pixels(width, height, pixels.collect()))
}

fn whole<const C: usize>(path: &Path, image: Option<Image<C>>) -> Result<Image<C>> {
    image.ok_or_else(|| SceneError::invalid(path, "image", "pixels are missing"))
}

fn decode(path: &Path) -> Result<DynamicImage> {
    let bytes = files::read(path)?;
    let num_bytes = bytes.len() as u64;
    let invalid = |problem: String| SceneError::invalid(path, "image", problem);
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| SceneError::io(path, "read", e))?;
    if !matches!(reader.format(), Some(ImageFormat::Png | ImageFormat::Jpeg)) {
        return Err(invalid("neither PNG nor JPEG".to_owned()));
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_EDGE);
    limits.max_image_height = Some(MAX_EDGE);
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder();
    let decoder = decoder.map_err(|error| invalid(error.to_string()))?;
    // A file of a few bytes may state any size: no memory is taken for what cannot be in it.
    if decoder.total_bytes() > MAX_GROWTH * num_bytes {
        let (width, height) = decoder.dimensions();
        return Err(invalid(format!(
            "{num_bytes} bytes cannot hold {width}x{height} pixels"
        )));
    }
    DynamicImage::from_decoder(decoder).map_err(|error| invalid(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::assert_error;
    use ::image::{ImageBuffer, Luma, Rgb, RgbImage, RgbaImage};
    use eagpt_testkit::damage::for_each_truncation;

    #[test]
    fn display_values_become_light() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        RgbImage::from_pixel(2, 1, Rgb([0, 128, 255]))
            .save(&path)
            .unwrap();
        let light = read_light(&path).unwrap();
        let [r, g, b] = light.radiance.get(1, 0);
        // ((128/255 + 0.055) / 1.055)^2.4 = 0.215861.
        assert!(r == 0.0 && (g - 0.215_861).abs() < 1e-6 && b == 1.0, "{g}");
        assert_eq!((light.alpha, size(&path).unwrap()), (None, (2, 1)));
        assert_eq!(light.clipped.unwrap().get(1, 0), [0.0, 0.0, 1.0]);
        RgbImage::from_pixel(2, 1, Rgb([254, 128, 0]))
            .save(&path)
            .unwrap();
        assert_eq!(read_light(&path).unwrap().clipped, None);
        RgbaImage::from_pixel(1, 1, Rgba([255, 254, 0, 51]))
            .save(&path)
            .unwrap();
        let light = read_light(&path).unwrap();
        assert_eq!(light.clipped.unwrap().get(0, 0), [1.0, 0.0, 0.0]);
        assert!((light.radiance.get(0, 0)[0] - 0.2).abs() < 1e-6);
        assert!((light.alpha.unwrap().get(0, 0)[0] - 0.2).abs() < 1e-6);
    }

    #[test]
    fn sizes_that_a_file_cannot_hold_take_no_memory() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.jpg");
        RgbImage::new(8, 8).save(&path).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        // Height and width follow the frame header's marker, its length and its depth.
        let frame = bytes.windows(2).position(|pair| pair == [0xff, 0xc0]);
        let at = frame.unwrap() + 5;
        bytes[at..at + 4].copy_from_slice(&[0x1f, 0x00, 0x89, 0x50]);
        std::fs::write(&path, &bytes).unwrap();
        assert_error(read_light(&path), &["a.jpg: ", "cannot hold 35152x7936"]);
        // The emptiest picture that there is compresses as far as it can.
        for format in [ImageFormat::Jpeg, ImageFormat::Png] {
            RgbImage::new(4096, 2048)
                .save_with_format(&path, format)
                .unwrap();
            read_light(&path).unwrap();
        }
    }

    #[test]
    fn truncated_pictures_are_told_of_in_one_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.jpg");
        let color = RgbImage::from_fn(9, 7, |x, y| Rgb([x as u8 * 20, y as u8 * 30, 7]));
        for format in [ImageFormat::Jpeg, ImageFormat::Png] {
            color.save_with_format(&path, format).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            for_each_truncation(&bytes, 400, |prefix| {
                std::fs::write(&path, prefix).unwrap();
                // Some decoders make do with what is there.
                if let Err(error) = read_light(&path) {
                    assert_error::<()>(Err(error), &["a.jpg: "]);
                }
                if let Err(error) = size(&path) {
                    assert_error::<()>(Err(error), &["a.jpg: "]);
                }
            });
        }
    }

    #[test]
    fn depth_needs_sixteen_bits() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let depth: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_pixel(1, 1, Luma([1234]));
        depth.save(&path).unwrap();
        assert_eq!(read_depth(&path).unwrap().get(0, 0), [1234.0]);
        RgbImage::new(1, 1).save(&path).unwrap();
        assert!(
            read_depth(&path)
                .unwrap_err()
                .to_string()
                .contains("8 bits")
        );
        std::fs::write(&path, b"GIF89a").unwrap();
        assert!(
            read_light(&path)
                .unwrap_err()
                .to_string()
                .contains("a.png: image: ")
        );
    }
}
