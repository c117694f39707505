//! DNG files: the mosaic of a sensor with what a camera notes beside it.
//!
//! Uncompressed, 16 bits a sample, one strip, the raw image in the first directory and EXIF in its
//! own: what every reader takes (Adobe, Digital Negative Specification 1.4; EXIF 2.3). Samples are
//! written as they are, black level included.

use eagpt_scene::{Result, SceneError, clock, files};
use std::io::Cursor;
use std::path::Path;
use tiff::encoder::{
    DirectoryEncoder, Rational, SRational, TiffEncoder, TiffKindStandard, TiffValue,
};
use tiff::tags::{Tag, Type};

/// CIE standard illuminants by their EXIF numbers.
const ILLUMINANT_D65: u16 = 21;

/// Colour of a filter of the mosaic, by its number in the tag `CFAPattern`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[repr(u8)]
pub enum CfaColor {
    /// Red.
    R = 0,
    /// Green.
    G = 1,
    /// Blue.
    B = 2,
}

/// The filters of a 2×2 cell, row by row: the pixel in column x and row y has `CFA[2·(y mod 2) + x
/// mod 2]`.
pub type Cfa = [CfaColor; 4];

/// Red and green above green and blue.
pub const RGGB: Cfa = [CfaColor::R, CfaColor::G, CfaColor::G, CfaColor::B];

/// The samples of a sensor, `[height, width]`, row by row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mosaic {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Samples as digitised, black level included.
    pub samples: Vec<u16>,
}

/// Metadata of a shot.
#[derive(Debug, Clone, PartialEq)]
pub struct DngInfo {
    /// Make of the camera; ASCII.
    pub make: String,
    /// Model of the camera; ASCII.
    pub model: String,
    /// Filters.
    pub cfa: Cfa,
    /// Sample of no light, for each filter of the 2×2 cell.
    pub black: [u16; 4],
    /// Sample at which the sensor clips.
    pub white: u16,
    /// Camera's R, G, B of a neutral surface under the light of the shot, green 1; all above 0.
    pub as_shot_neutral: [f64; 3],
    /// Camera's R, G, B of CIE XYZ under D65, row by row.
    pub camera_from_xyz: [[f64; 3]; 3],
    /// Exposure time, seconds, above 0; left out if `None`, as by lenses and cameras that do not
    /// tell.
    pub exposure_s: Option<f64>,
    /// ISO speed.
    pub iso: u16,
    /// Aperture, focal length over diameter.
    pub f_number: f64,
    /// Focal length, millimetres.
    pub focal_length_mm: f64,
    /// When the shot was taken: milliseconds since 1970-01-01 by the camera's clock, which knows no
    /// time zone.
    pub taken_ms: u64,
}

/// Writes a DNG file, atomic.
///
/// # Errors
/// [`SceneError::Invalid`] naming file and field if the mosaic is empty, not of the size it says or
/// its size odd, or a number cannot be told as a fraction; [`SceneError::Io`].
pub fn write(path: &Path, mosaic: &Mosaic, info: &DngInfo) -> Result<()> {
    let num_wanted = u64::from(mosaic.width) * u64::from(mosaic.height);
    let is_even = mosaic.width.is_multiple_of(2) && mosaic.height.is_multiple_of(2);
    if num_wanted == 0 || mosaic.samples.len() as u64 != num_wanted || !is_even {
        let (num, width, height) = (mosaic.samples.len(), mosaic.width, mosaic.height);
        return Err(SceneError::invalid(
            path,
            "size",
            format!("{num} samples for a mosaic of {width}x{height}, which has to be even"),
        ));
    }
    let mut bytes = Cursor::new(Vec::with_capacity(2 * mosaic.samples.len() + 4096));
    encode(&mut bytes, mosaic, &Fractions::new(path, info)?, info)
        .map_err(|error| SceneError::invalid(path, "TIFF", error.to_string()))?;
    files::write_bytes_atomic(path, bytes.get_ref())
}

/// The numbers of a [`DngInfo`] that TIFF stores as fractions.
struct Fractions {
    neutral: Vec<Rational>,
    matrix: Vec<SRational>,
    exposure: Option<Rational>,
    aperture: Rational,
    focal_length: Rational,
}

impl Fractions {
    fn new(path: &Path, info: &DngInfo) -> Result<Self> {
        let positive = |field: &str, value: f64| {
            fraction(value)
                .filter(|f| f.n > 0)
                .ok_or_else(|| no_fraction(path, field, value))
        };
        let neutral = info.as_shot_neutral.iter();
        let matrix = info.camera_from_xyz.as_flattened().iter();
        Ok(Self {
            neutral: neutral
                .map(|&value| positive("AsShotNeutral", value))
                .collect::<Result<_>>()?,
            matrix: matrix
                .map(|&value| {
                    signed_fraction(value).ok_or_else(|| no_fraction(path, "ColorMatrix1", value))
                })
                .collect::<Result<_>>()?,
            exposure: match info.exposure_s {
                Some(seconds) => Some(positive("ExposureTime", seconds)?),
                None => None,
            },
            aperture: positive("FNumber", info.f_number)?,
            focal_length: positive("FocalLength", info.focal_length_mm)?,
        })
    }
}

fn no_fraction(path: &Path, field: &str, value: f64) -> SceneError {
    SceneError::invalid(path, field, format!("{value} cannot be stored"))
}

type Directory<'a, 'b> = DirectoryEncoder<'a, &'b mut Cursor<Vec<u8>>, TiffKindStandard>;

/// Tags that the `tiff` crate has no names for (DNG 1.4, TIFF/EP, EXIF 2.3).
mod tag {
    pub(super) const CFA_REPEAT_PATTERN_DIM: u16 = 33421;
    pub(super) const CFA_PATTERN: u16 = 33422;
    pub(super) const EXPOSURE_TIME: u16 = 33434;
    pub(super) const F_NUMBER: u16 = 33437;
    pub(super) const ISO_SPEED: u16 = 34855;
    pub(super) const EXIF_VERSION: u16 = 36864;
    pub(super) const DATE_TIME_ORIGINAL: u16 = 36867;
    pub(super) const SUB_SEC_TIME_ORIGINAL: u16 = 37521;
    pub(super) const FOCAL_LENGTH: u16 = 37386;
    pub(super) const DNG_VERSION: u16 = 50706;
    pub(super) const DNG_BACKWARD_VERSION: u16 = 50707;
    pub(super) const UNIQUE_CAMERA_MODEL: u16 = 50708;
    pub(super) const BLACK_LEVEL_REPEAT_DIM: u16 = 50713;
    pub(super) const BLACK_LEVEL: u16 = 50714;
    pub(super) const WHITE_LEVEL: u16 = 50717;
    pub(super) const COLOR_MATRIX_1: u16 = 50721;
    pub(super) const AS_SHOT_NEUTRAL: u16 = 50728;
    pub(super) const CALIBRATION_ILLUMINANT_1: u16 = 50778;
}

/// `PhotometricInterpretation` of a mosaic, for which the `tiff` crate has no name.
const PHOTOMETRIC_CFA: u16 = 32803;
/// `NewSubfileType` of the full image.
const FULL_IMAGE: u32 = 0;

fn encode(
    out: &mut Cursor<Vec<u8>>,
    mosaic: &Mosaic,
    fractions: &Fractions,
    info: &DngInfo,
) -> tiff::TiffResult<()> {
    let mut encoder = TiffEncoder::new(out)?;
    let mut exif = encoder.extra_directory()?;
    write_exif(&mut exif, fractions, info)?;
    let exif = exif.finish_with_offsets()?.offset;

    let mut main = encoder.image_directory()?;
    // One strip: some readers look at the first only.
    let offset = u32::try_from(main.write_data(mosaic.samples.as_slice())?)?;
    main.write_tag(Tag::NewSubfileType, FULL_IMAGE)?;
    main.write_tag(Tag::ImageWidth, mosaic.width)?;
    main.write_tag(Tag::ImageLength, mosaic.height)?;
    main.write_tag(Tag::BitsPerSample, 16_u16)?;
    main.write_tag(Tag::Compression, 1_u16)?;
    main.write_tag(Tag::PhotometricInterpretation, PHOTOMETRIC_CFA)?;
    main.write_tag(Tag::Make, info.make.as_str())?;
    main.write_tag(Tag::Model, info.model.as_str())?;
    main.write_tag(Tag::StripOffsets, offset)?;
    main.write_tag(Tag::Orientation, 1_u16)?;
    main.write_tag(Tag::SamplesPerPixel, 1_u16)?;
    main.write_tag(Tag::RowsPerStrip, mosaic.height)?;
    let num_bytes = u32::try_from(2 * mosaic.samples.len())?;
    main.write_tag(Tag::StripByteCounts, num_bytes)?;
    main.write_tag(Tag::PlanarConfiguration, 1_u16)?;
    main.write_tag(Tag::Software, concat!("eagpt ", env!("CARGO_PKG_VERSION")))?;
    main.write_tag(Tag::DateTime, taken(info).as_str())?;
    main.write_tag(Tag::ExifDirectory, exif)?;
    let cells = [2_u16, 2];
    let cfa = info.cfa.map(|color| color as u8);
    put(&mut main, tag::CFA_REPEAT_PATTERN_DIM, cells)?;
    put(&mut main, tag::CFA_PATTERN, cfa)?;
    put(&mut main, tag::DNG_VERSION, [1_u8, 4, 0, 0])?;
    put(&mut main, tag::DNG_BACKWARD_VERSION, [1_u8, 1, 0, 0])?;
    let camera = format!("{} {}", info.make, info.model);
    put(&mut main, tag::UNIQUE_CAMERA_MODEL, camera.as_str())?;
    put(&mut main, tag::BLACK_LEVEL_REPEAT_DIM, cells)?;
    put(&mut main, tag::BLACK_LEVEL, info.black)?;
    put(&mut main, tag::WHITE_LEVEL, info.white)?;
    put(&mut main, tag::COLOR_MATRIX_1, &fractions.matrix[..])?;
    put(&mut main, tag::AS_SHOT_NEUTRAL, &fractions.neutral[..])?;
    put(&mut main, tag::CALIBRATION_ILLUMINANT_1, ILLUMINANT_D65)?;
    main.finish()
}

fn write_exif(
    exif: &mut Directory<'_, '_>,
    fractions: &Fractions,
    info: &DngInfo,
) -> tiff::TiffResult<()> {
    if let Some(exposure) = &fractions.exposure {
        put(exif, tag::EXPOSURE_TIME, exposure)?;
    }
    put(exif, tag::F_NUMBER, &fractions.aperture)?;
    put(exif, tag::ISO_SPEED, info.iso)?;
    let version = exif.write_entry_bytes(Type::UNDEFINED, b"0230")?;
    let mut entries = tiff::Directory::empty();
    entries.extend([(Tag::from_u16_exhaustive(tag::EXIF_VERSION), version)]);
    exif.extend_from(&entries);
    put(exif, tag::DATE_TIME_ORIGINAL, taken(info).as_str())?;
    let milliseconds = format!("{:03}", info.taken_ms % 1000);
    put(exif, tag::SUB_SEC_TIME_ORIGINAL, milliseconds.as_str())?;
    put(exif, tag::FOCAL_LENGTH, &fractions.focal_length)
}

fn put<T: TiffValue>(
    directory: &mut Directory<'_, '_>,
    tag: u16,
    value: T,
) -> tiff::TiffResult<()> {
    directory.write_tag(Tag::from_u16_exhaustive(tag), value)
}

fn taken(info: &DngInfo) -> String {
    clock::exif_from_unix(info.taken_ms / 1000)
}

/// The nearest fraction with a denominator of at most a million, by continued fractions; `None` for
/// what 32 bits do not hold.
fn fraction(value: f64) -> Option<Rational> {
    const MAX_DENOMINATOR: f64 = 1e6;
    // Beyond this the remainder is rounding error of the division.
    const MIN_REMAINDER: f64 = 1e-9;
    if !(0.0..=f64::from(u32::MAX)).contains(&value) {
        return None;
    }
    let (mut before, mut last) = ([0.0, 1.0], [1.0, 0.0]);
    let mut rest = value;
    loop {
        let whole = rest.floor();
        let next = [whole * last[0] + before[0], whole * last[1] + before[1]];
        if next[1] > MAX_DENOMINATOR || next[0] > f64::from(u32::MAX) {
            break;
        }
        (before, last) = (last, next);
        let remainder = rest - whole;
        if remainder < MIN_REMAINDER {
            break;
        }
        rest = 1.0 / remainder;
    }
    Some(Rational {
        n: last[0] as u32,
        d: last[1] as u32,
    })
}

fn signed_fraction(value: f64) -> Option<SRational> {
    let Rational { n, d } = fraction(value.abs())?;
    let n = i32::try_from(n).ok()?;
    Some(SRational {
        n: if value < 0.0 { -n } else { n },
        d: d.try_into().ok()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(value: f64) -> Option<(u32, u32)> {
        fraction(value).map(|f| (f.n, f.d))
    }

    #[test]
    fn numbers_become_the_fractions_people_write() {
        assert_eq!(parts(0.0025), Some((1, 400)));
        assert_eq!(parts(0.64), Some((16, 25)));
        assert_eq!(parts(8.0), Some((8, 1)));
        assert_eq!(parts(0.0), Some((0, 1)));
        // 333/106 and 355/113 are convergents of pi.
        let (n, d) = parts(std::f64::consts::PI).unwrap();
        assert!((f64::from(n) / f64::from(d) - std::f64::consts::PI).abs() < 1e-11);
        assert_eq!(
            signed_fraction(-0.1866).map(|f| (f.n, f.d)),
            Some((-933, 5000))
        );
        for bad in [-1.0, 5e9, f64::NAN, f64::INFINITY] {
            assert_eq!(parts(bad), None, "{bad}");
        }
    }

    #[test]
    fn what_cannot_be_a_mosaic_is_named() {
        let info = some_info();
        let path = Path::new("a.dng");
        let mosaic = |width, height, num| Mosaic {
            width,
            height,
            samples: vec![0; num],
        };
        for bad in [mosaic(4, 2, 7), mosaic(0, 0, 0), mosaic(3, 2, 6)] {
            let message = write(path, &bad, &info).unwrap_err().to_string();
            assert!(message.starts_with("a.dng: size: "), "{message}");
        }
        let dark = DngInfo {
            as_shot_neutral: [0.5, 1.0, 0.0],
            ..some_info()
        };
        let message = write(path, &mosaic(2, 2, 4), &dark)
            .unwrap_err()
            .to_string();
        assert_eq!(message, "a.dng: AsShotNeutral: 0 cannot be stored");
    }

    fn some_info() -> DngInfo {
        DngInfo {
            make: "eagpt".to_owned(),
            model: "Virtual".to_owned(),
            cfa: RGGB,
            black: [512; 4],
            white: 16_383,
            as_shot_neutral: [0.47, 1.0, 0.62],
            camera_from_xyz: [[0.7, -0.2, -0.07], [-0.4, 1.2, 0.2], [-0.06, 0.14, 0.58]],
            exposure_s: Some(0.0025),
            iso: 100,
            f_number: 8.0,
            focal_length_mm: 24.0,
            taken_ms: 1_772_359_200_250,
        }
    }
}
