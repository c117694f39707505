//! Metadata of TIFF-like files, some of which keep it in IFD0, some in the EXIF directory; that of
//! CRW files is elsewhere.

use super::{Metadata, ciff};
use exif::{Context, Exif, In, Reader, Tag, Value};
use std::io::Cursor;

/// DNG's DefaultScale: factors for width and height that make pixels square.
const DEFAULT_SCALE: Tag = Tag(Context::Tiff, 50718);
/// DNG's NoiseProfile.
const NOISE_PROFILE: Tag = Tag(Context::Tiff, 51041);

/// The EXIF of a file, as far as it can be read.
fn read(bytes: &[u8]) -> Option<Exif> {
    let mut reader = Reader::new();
    reader.continue_on_error(true);
    let read = reader.read_from_container(&mut Cursor::new(bytes));
    read.or_else(|error| error.distill_partial_result(|_| ()))
        .ok()
}

/// Whether EXIF says that colours are Adobe RGB: as cameras do (DCF 2.0, "R03"), or as some
/// programs.
pub(super) fn is_adobe_rgb(bytes: &[u8]) -> bool {
    let Some(found) = read(bytes) else {
        return false;
    };
    let index = text(&found, Tag::InteroperabilityIndex);
    index.is_some_and(|index| index == "R03") || number(&found, Tag::ColorSpace) == Some(2.0)
}

/// Adds what a file states to the metadata.
pub(super) fn fill(metadata: &mut Metadata, bytes: &[u8]) {
    // A file without EXIF adds nothing; missing values are reported where they are needed.
    let Some(found) = read(bytes) else {
        return ciff::fill(metadata, bytes);
    };
    let text = |tag| text(&found, tag).unwrap_or_default();
    if metadata.make.is_empty() {
        metadata.make = text(Tag::Make);
    }
    if metadata.model.is_empty() {
        metadata.model = text(Tag::Model);
    }
    let number = |tag| number(&found, tag);
    metadata.exposure_s = metadata.exposure_s.or_else(|| number(Tag::ExposureTime));
    metadata.iso = metadata.iso.or_else(|| {
        let tags = [
            Tag::PhotographicSensitivity,
            Tag::ISOSpeed,
            Tag::RecommendedExposureIndex,
        ];
        // 65535 means that the number is elsewhere.
        tags.into_iter()
            .filter_map(number)
            .find(|iso| *iso > 0.0 && *iso < 65535.0)
    });
    metadata.f_number = metadata.f_number.or_else(|| number(Tag::FNumber));
    // Cameras write 0 for an unknown lens.
    metadata.f_number = metadata.f_number.filter(|value| *value > 0.0);
    metadata.focal_mm = metadata.focal_mm.or_else(|| number(Tag::FocalLength));
    metadata.focal_mm = metadata.focal_mm.filter(|value| *value > 0.0);
    metadata.orientation = metadata
        .orientation
        .or_else(|| number(Tag::Orientation).map(|value| value as u16));
    metadata.time_s = metadata.time_s.or_else(|| {
        let date = [Tag::DateTimeOriginal, Tag::DateTime]
            .into_iter()
            .find_map(|tag| seconds(&text(tag)))?;
        let fraction = text(Tag::SubSecTimeOriginal);
        Some(date + format!("0.{}", fraction.trim()).parse().unwrap_or(0.0))
    });
    metadata.noise = metadata.noise.or_else(|| noise(&found));
    metadata.pixel_aspect = metadata.pixel_aspect.or_else(|| pixel_aspect(&found));
}

fn field(exif: &Exif, tag: Tag) -> Option<&Value> {
    // The same tag in either directory.
    let elsewhere = Tag(
        if tag.context() == Context::Exif {
            Context::Tiff
        } else {
            Context::Exif
        },
        tag.number(),
    );
    exif.get_field(tag, In::PRIMARY)
        .or_else(|| exif.get_field(elsewhere, In::PRIMARY))
        .map(|field| &field.value)
}

fn number(exif: &Exif, tag: Tag) -> Option<f64> {
    let value = match field(exif, tag)? {
        Value::Rational(values) => values.first()?.to_f64(),
        Value::SRational(values) => values.first()?.to_f64(),
        Value::Float(values) => f64::from(*values.first()?),
        Value::Double(values) => *values.first()?,
        other => f64::from(other.get_uint(0)?),
    };
    value.is_finite().then_some(value)
}

fn text(exif: &Exif, tag: Tag) -> Option<String> {
    match field(exif, tag)? {
        Value::Ascii(parts) => {
            let text = String::from_utf8_lossy(parts.first()?);
            Some(text.trim_matches(['\0', ' ']).to_owned())
        }
        _ => None,
    }
}

fn pixel_aspect(exif: &Exif) -> Option<f64> {
    let Value::Rational(scales) = field(exif, DEFAULT_SCALE)? else {
        return None;
    };
    let scales = [scales.first()?, scales.get(1)?];
    let [horizontal, vertical] = scales.map(exif::Rational::to_f64);
    let aspect = horizontal / vertical;
    aspect.is_finite().then_some(aspect)
}

fn noise(exif: &Exif) -> Option<[f64; 2]> {
    let Value::Double(values) = field(exif, NOISE_PROFILE)? else {
        return None;
    };
    let planes = values.chunks_exact(2);
    // Red, green, blue, or one for all.
    let green = if planes.len() >= 3 { 1 } else { 0 };
    let plane = values.chunks_exact(2).nth(green)?;
    let valid = plane.iter().all(|v| v.is_finite() && *v >= 0.0) && plane[0] > 0.0;
    valid.then(|| [plane[0], plane[1]])
}

/// Seconds since 1970 of `2026:11:03 14:05:09`.
pub(super) fn seconds(text: &str) -> Option<f64> {
    let mut parts = text
        .trim()
        .split([':', ' ', 'T', '-'])
        .map(str::parse::<i64>);
    let mut next = || parts.next()?.ok();
    let [year, month, day] = [next()?, next()?, next()?];
    let [hour, minute, second] = [next()?, next()?, next()?];
    let valid = (1970..10_000).contains(&year)
        && (1..=12).contains(&month)
        && (1..=31).contains(&day)
        && (0..24).contains(&hour)
        && (0..60).contains(&minute)
        && (0..=60).contains(&second);
    if !valid {
        return None;
    }
    // Days from the civil calendar: years begin in March, so that the leap day is the last.
    let (year, month) = if month > 2 {
        (year, month - 3)
    } else {
        (year - 1, month + 9)
    };
    let days = 365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day - 1;
    let days = days - 719_468;
    Some((days * 86_400 + hour * 3600 + minute * 60 + second) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_moments() {
        assert_eq!(seconds("1970:01:01 00:00:00"), Some(0.0));
        assert_eq!(seconds("2000:02:29 00:00:00"), Some(951_782_400.0));
        assert_eq!(seconds("2009:02:13 23:31:30"), Some(1_234_567_890.0));
        for bad in [
            "",
            "0000:00:00 00:00:00",
            "2009:13:01 00:00:00",
            "2009:02:13",
        ] {
            assert_eq!(seconds(bad), None, "{bad}");
        }
    }

    #[test]
    fn what_is_no_exif_adds_nothing() {
        let mut metadata = Metadata::default();
        fill(&mut metadata, b"no TIFF");
        assert_eq!(metadata, Metadata::default());
    }
}
