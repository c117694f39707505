//! Normal maps on disk: their views and the encoding of their values.

use super::Encoding;
use crate::error::{ConvertError, Result};
use eagpt_scene::lens::remap;
use eagpt_scene::pictures::{self, is_exr};
use eagpt_scene::{Dataset, Image};
use glam::{DVec2, Vec3};
use std::path::{Path, PathBuf};

/// Vectors of a map from 0 to 1 whose length is further from 1 than this are no normals: a
/// background of one colour.
const MAX_LENGTH_ERROR: f32 = 0.3;
/// Vectors shorter than this are unknown.
const MIN_LENGTH: f32 = 0.1;
/// Means of unit vectors shorter than this after resizing lie across an edge; nothing is known
/// there.
const MIN_MEAN_LENGTH: f32 = 0.5;
/// Values below this count as negative beyond rounding.
const NEGATIVE: f32 = -0.01;

/// For each view of a dataset its map, if there is one: `<view><suffix>.exr`, or `.png`.
pub(super) fn find(folder: &Path, dataset: &Dataset, suffix: &str) -> Result<Vec<Option<PathBuf>>> {
    let frames = dataset.frames();
    let maps: Vec<Option<PathBuf>> = frames
        .iter()
        .map(|frame| {
            let candidates = ["exr", "png"]
                .map(|extension| folder.join(format!("{}{suffix}.{extension}", frame.name)));
            candidates.into_iter().find(|path| path.is_file())
        })
        .collect();
    if maps.iter().any(Option::is_some) {
        return Ok(maps);
    }
    let problem = format!(
        "no map is named like a view: the {} views are named like `{}`, their maps `{}{suffix}.exr` or .png",
        frames.len(),
        frames[0].name,
        frames[0].name
    );
    Err(ConvertError::invalid(folder, "maps", problem))
}

/// Detects the encoding of a map: signed values are components; others are from 0 to 1 if that
/// makes them unit vectors.
pub(super) fn encoding(path: &Path, stored: &Image<3>) -> Encoding {
    if !is_exr(path) {
        return Encoding::ZeroToOne;
    }
    if stored.values().iter().any(|value| *value < NEGATIVE) {
        return Encoding::Unit;
    }
    let error = |read: &dyn Fn(Vec3) -> Vec3| {
        let mut errors: Vec<f32> = stored
            .pixels()
            .iter()
            .map(|pixel| (read(Vec3::from(*pixel)).length() - 1.0).abs())
            .filter(|error| error.is_finite())
            .collect();
        errors.sort_unstable_by(f32::total_cmp);
        errors
            .get(errors.len() / 2)
            .copied()
            .unwrap_or(f32::INFINITY)
    };
    if error(&|v| 2.0 * v - 1.0) < error(&|v| v) {
        Encoding::ZeroToOne
    } else {
        Encoding::Unit
    }
}

/// Reads a map for a view of `size`: unit vectors by the map's own axes, zero where unknown.
///
/// # Errors
/// [`ConvertError::Scene`] naming the file: unreadable, or without one known vector.
pub(super) fn read(path: &Path, encoding: Option<Encoding>, size: (u32, u32)) -> Result<Image<3>> {
    let stored = pictures::read_vectors(path)?;
    let encoding = encoding.unwrap_or_else(|| self::encoding(path, &stored));
    let vectors = stored.map(|pixel| decode(Vec3::from(*pixel), encoding).to_array());
    let scale = DVec2::new(
        f64::from(vectors.width()) / f64::from(size.0),
        f64::from(vectors.height()) / f64::from(size.1),
    );
    let resized = if vectors.size() == size {
        vectors
    } else {
        remap::remap(&vectors, size, |pixel| Some(pixel * scale)).image
    };
    let unit = resized.map(|pixel| {
        let vector = Vec3::from(*pixel);
        let length = vector.length();
        let known = length >= MIN_MEAN_LENGTH;
        if known { vector / length } else { Vec3::ZERO }.to_array()
    });
    if unit.pixels().iter().all(|pixel| *pixel == [0.0; 3]) {
        return Err(ConvertError::invalid(
            path,
            "map",
            "holds no normal: no vector has unit length",
        ));
    }
    Ok(unit)
}

fn decode(stored: Vec3, encoding: Encoding) -> Vec3 {
    let vector = match encoding {
        Encoding::Unit => stored,
        Encoding::ZeroToOne => 2.0 * stored - 1.0,
    };
    let length = vector.length();
    let known = match encoding {
        Encoding::Unit => length >= MIN_LENGTH,
        Encoding::ZeroToOne => (length - 1.0).abs() <= MAX_LENGTH_ERROR,
    };
    if known && length.is_finite() {
        vector / length
    } else {
        Vec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::exr::{self, Precision};

    #[test]
    fn encodings_are_told_apart() {
        let normal = Vec3::new(0.48, 0.6, 0.64);
        let (exr, png) = (Path::new("a.exr"), Path::new("a.png"));
        let signed = Image::filled(2, 2, (-normal).to_array());
        let positive = Image::filled(2, 2, normal.to_array());
        let packed = Image::filled(2, 2, (0.5 * normal + 0.5).to_array());
        assert_eq!(encoding(exr, &signed), Encoding::Unit);
        assert_eq!(encoding(exr, &positive), Encoding::Unit);
        assert_eq!(encoding(exr, &packed), Encoding::ZeroToOne);
        assert_eq!(encoding(png, &packed), Encoding::ZeroToOne);
        // Black in a packed map is not a vector.
        assert_eq!(decode(Vec3::ZERO, Encoding::ZeroToOne), Vec3::ZERO);
        assert_eq!(decode(2.0 * normal, Encoding::Unit), normal);
    }

    #[test]
    fn a_resized_map_has_unit_vectors_and_nothing_across_an_edge() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let mut map = Image::filled(4, 4, [0.0, 0.0, -1.0]);
        for (index, pixel) in map.pixels_mut().iter_mut().enumerate() {
            if index % 4 == 3 {
                *pixel = [0.0, 0.0, 1.0];
            }
        }
        exr::write_rgb(&path, &map, Precision::Float).unwrap();
        let half = read(&path, None, (2, 2)).unwrap();
        assert_eq!(
            (half.get(0, 1), half.get(1, 1)),
            ([0.0, 0.0, -1.0], [0.0; 3])
        );
        exr::write_rgb(&path, &Image::filled(2, 2, [0.0; 3]), Precision::Float).unwrap();
        assert!(
            read(&path, None, (2, 2))
                .unwrap_err()
                .to_string()
                .contains("no normal")
        );
    }
}
