//! Pictures for display: a camera's JPEG, and PNG or TIFF of 8 bits. Their codes are samples, their
//! primaries those of the ICC profile or of EXIF, sRGB's where neither says so.

use super::{Header, MAX_PIXELS, Metadata, RawFrame, Samples, Want, exif};
use crate::error::{IngestError, Result};
use eagpt_scene::color::Chromaticities;
use glam::{DMat3, DVec2, DVec3};
use image::codecs::jpeg::JpegDecoder;
use image::{DynamicImage, ImageDecoder};
use serde::{Deserialize, Serialize};
use std::io::Cursor;
use std::path::Path;

/// Colours of a picture for display. Which light a code stands for is not known.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Display {
    /// Name of the primaries, and who says so.
    pub primaries: String,
    /// Linear Rec.709 from light of these primaries, row by row.
    pub rec709_from_rgb: [[f32; 3]; 3],
}

/// White of the profile connection space (ICC.1), XYZ.
const D50: DVec3 = DVec3::new(0.9642, 1.0, 0.8249);
/// Adobe RGB (1998).
const ADOBE_RGB: Chromaticities = Chromaticities {
    primaries: [
        DVec2::new(0.64, 0.33),
        DVec2::new(0.21, 0.71),
        DVec2::new(0.15, 0.06),
    ],
    white: DVec2::new(0.3127, 0.3290),
};
/// Largest difference of a matrix from 1 that rounded colorants of sRGB make.
const SAME: f64 = 3e-3;

/// Reads a JPEG.
pub(super) fn read_jpeg(path: &Path, bytes: &[u8], want: Want) -> Result<RawFrame> {
    let failed = |problem: String| IngestError::photograph(path, "JPEG", problem);
    let mut metadata = Metadata {
        decoder: "display".to_owned(),
        ..Metadata::default()
    };
    exif::fill(&mut metadata, bytes);
    let mut decoder =
        JpegDecoder::new(Cursor::new(bytes)).map_err(|error| failed(error.to_string()))?;
    let size = decoder.dimensions();
    if u64::from(size.0) * u64::from(size.1) > MAX_PIXELS {
        return Err(failed(format!("{}x{} pixels", size.0, size.1)));
    }
    let profile = decoder
        .icc_profile()
        .map_err(|error| failed(error.to_string()))?;
    let display = Display::of(path, profile.as_deref(), bytes)?;
    let samples = match want {
        Want::Header => Vec::new(),
        Want::Samples => DynamicImage::from_decoder(decoder)
            .map_err(|error| failed(error.to_string()))?
            .into_rgb8()
            .into_raw(),
    };
    Ok(frame(size, samples, metadata, display))
}

/// A frame of codes.
pub(super) fn frame(
    size: (u32, u32),
    codes: Vec<u8>,
    metadata: Metadata,
    display: Display,
) -> RawFrame {
    RawFrame {
        header: Header {
            display: Some(display),
            ..Header::rgb(size, 255.0, metadata)
        },
        samples: Samples::Integer(codes.into_iter().map(u16::from).collect()),
    }
}

impl Display {
    /// By a profile, else by the EXIF in `bytes`.
    ///
    /// # Errors
    /// [`IngestError::Photograph`] if the profile has no primaries.
    pub(super) fn of(path: &Path, profile: Option<&[u8]>, bytes: &[u8]) -> Result<Self> {
        let (primaries, matrix) = match profile {
            Some(profile) => {
                let matrix = of_profile(profile).ok_or_else(|| {
                    IngestError::photograph(path, "ICC profile", "states no primaries of RGB")
                })?;
                let off = (matrix - DMat3::IDENTITY).to_cols_array();
                if off.iter().all(|v| v.abs() < SAME) {
                    ("sRGB's (ICC profile)", DMat3::IDENTITY)
                } else {
                    ("those of the ICC profile", matrix)
                }
            }
            None if exif::is_adobe_rgb(bytes) => (
                "Adobe RGB's (EXIF)",
                ADOBE_RGB.rec709_from_rgb().unwrap_or(DMat3::IDENTITY),
            ),
            None => ("sRGB's (no profile)", DMat3::IDENTITY),
        };
        let rows = [matrix.row(0), matrix.row(1), matrix.row(2)];
        Ok(Self {
            primaries: primaries.to_owned(),
            rec709_from_rgb: rows.map(|row| row.to_array().map(|v| v as f32)),
        })
    }
}

/// Linear Rec.709 from a profile's light: its colorants are XYZ under D50 (ICC.1, 9.2).
fn of_profile(profile: &[u8]) -> Option<DMat3> {
    const HEADER: usize = 128;
    let number = |at: usize| -> Option<u32> {
        let bytes = profile.get(at..at.checked_add(4)?)?;
        Some(u32::from_be_bytes(bytes.try_into().ok()?))
    };
    if profile.get(16..20)? != b"RGB " {
        return None;
    }
    let num_tags = number(HEADER)?.min(1000) as usize;
    let colorant = |name: &[u8; 4]| -> Option<DVec3> {
        let mut entries = (0..num_tags).map(|index| HEADER + 4 + 12 * index);
        let entry = entries.find(|&at| profile.get(at..at + 4) == Some(name))?;
        let at = number(entry + 4)? as usize;
        // After the type and four reserved bytes, numbers with 16 bits of fraction.
        let value =
            |index: usize| Some(f64::from(number(at + 8 + 4 * index)?.cast_signed()) / 65_536.0);
        Some(DVec3::new(value(0)?, value(1)?, value(2)?))
    };
    let xyz_from_rgb = DMat3::from_cols(colorant(b"rXYZ")?, colorant(b"gXYZ")?, colorant(b"bXYZ")?);
    // XYZ is a space of primaries as well, the white being that of its (1, 1, 1).
    let white = D50.truncate() / D50.element_sum();
    let xyz = Chromaticities {
        primaries: [DVec2::X, DVec2::Y, DVec2::ZERO],
        white,
    };
    let matrix = xyz.rec709_from_rgb()? * DMat3::from_diagonal(1.0 / D50) * xyz_from_rgb;
    (matrix.is_finite() && matrix.determinant().abs() > 1e-6).then_some(matrix)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A profile of three colorants.
    fn profile(colorants: [[f64; 3]; 3]) -> Vec<u8> {
        let mut bytes = vec![0; 128];
        bytes[16..20].copy_from_slice(b"RGB ");
        bytes.extend(3_u32.to_be_bytes());
        for (index, name) in [b"rXYZ", b"gXYZ", b"bXYZ"].into_iter().enumerate() {
            let at = 128 + 4 + 3 * 12 + 20 * index as u32;
            bytes.extend(name);
            bytes.extend([at, 20].map(u32::to_be_bytes).concat());
        }
        for colorant in colorants {
            bytes.extend(b"XYZ \0\0\0\0");
            let fixed = colorant.map(|v| ((v * 65_536.0).round() as i32).to_be_bytes());
            bytes.extend(fixed.concat());
        }
        bytes
    }

    #[test]
    fn primaries_are_those_of_the_profile() {
        // Colorants of the ICC's sRGB2014.icc and of Apple's Display P3.icc.
        let srgb = profile([
            [0.436_07, 0.222_49, 0.013_92],
            [0.385_15, 0.716_87, 0.097_08],
            [0.143_07, 0.060_61, 0.714_10],
        ]);
        let path = Path::new("a.jpg");
        let display = Display::of(path, Some(&srgb), b"").unwrap();
        assert_eq!(display.primaries, "sRGB's (ICC profile)");
        assert_eq!(display.rec709_from_rgb[0], [1.0, 0.0, 0.0]);
        let p3 = profile([
            [0.515_12, 0.241_20, -0.001_05],
            [0.291_98, 0.692_25, 0.041_89],
            [0.157_10, 0.066_57, 0.784_07],
        ]);
        let display = Display::of(path, Some(&p3), b"").unwrap();
        let expected = Chromaticities::P3_D65.rec709_from_rgb().unwrap();
        for (row, values) in display.rec709_from_rgb.iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                let expected = expected.col(column)[row] as f32;
                assert!((value - expected).abs() < 2e-3, "{row} {column}: {value}");
            }
        }
        for bad in [&b"short"[..], &srgb[..140]] {
            let error = Display::of(path, Some(bad), b"").unwrap_err();
            assert!(error.to_string().contains("ICC profile"), "{error}");
        }
        let plain = Display::of(path, None, b"").unwrap();
        assert_eq!(plain.primaries, "sRGB's (no profile)");
    }
}
