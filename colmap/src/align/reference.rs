//! Alignment to known cameras, as of an earlier capture of the same room.

use super::{Alignment, Evidence, Mode, numeric};
use crate::error::{ColmapError, Result};
use crate::model::{Model, Similarity};
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::Path;

/// A camera with a known position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownCamera {
    /// Name of its image, without extension.
    pub name: String,
    /// Its centre.
    pub centre: [f64; 3],
}

/// Fit of the model to the known cameras.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ReferenceReport {
    /// Cameras that both have.
    pub num_cameras: usize,
    /// Known units for one unit of the model.
    pub scale: f64,
    /// Median distance between a camera and its known position, known units.
    pub median_error: f64,
    /// Largest distance.
    pub largest_error: f64,
}

/// Fewest cameras that determine a world.
const MIN_CAMERAS: usize = 3;
/// Largest median error, relative to the spread of the cameras: beyond it, the cameras are not the
/// same.
const MAX_ERROR: f64 = 0.1;

/// The transform that brings the model's cameras nearest to the known ones.
pub(super) fn align(
    model: &Model,
    evidence: &Evidence,
    known: &[KnownCamera],
) -> Result<Alignment> {
    let known: HashMap<&str, DVec3> = known
        .iter()
        .map(|camera| (camera.name.as_str(), DVec3::from_array(camera.centre)))
        .collect();
    let (mut own, mut expected) = (Vec::new(), Vec::new());
    for (image, centre) in model.images.iter().zip(&evidence.centres) {
        let stem = Path::new(&image.name).with_extension("");
        if let Some(place) = stem.to_str().and_then(|stem| known.get(stem)) {
            own.push(*centre);
            expected.push(*place);
        }
    }
    let found = (own.len() >= MIN_CAMERAS).then(|| similarity(&own, &expected));
    let Some(aligned_from_model) = found.flatten() else {
        return Err(ColmapError::Align(format!(
            "{} images of the model are named like known cameras; {MIN_CAMERAS} that are not in one line are needed",
            own.len()
        )));
    };
    let errors: Vec<f64> = own
        .iter()
        .zip(&expected)
        .map(|(own, expected)| (aligned_from_model.apply(*own) - *expected).length())
        .collect();
    let report = ReferenceReport {
        num_cameras: own.len(),
        scale: aligned_from_model.scale,
        largest_error: errors.iter().copied().fold(0.0, f64::max),
        median_error: numeric::median(errors),
    };
    let spread = numeric::size(&expected);
    if report.median_error > MAX_ERROR * spread {
        return Err(ColmapError::Align(format!(
            "cameras of the model lie {:.3} from where cameras of their names are known to be, which are {spread:.3} apart: \
             they are not the same",
            report.median_error
        )));
    }
    Ok(Alignment {
        mode: Mode::Reference,
        aligned_from_model,
        gravity: None,
        floor: None,
        walls: None,
        reference: Some(report),
        confidence: None,
        is_metric: false,
        camera_height: None,
        warnings: Vec::new(),
    })
}

/// The similarity with the least squares of distances (Umeyama, PAMI 1991); `None` if the points
/// lie in one line.
pub fn similarity(from: &[DVec3], to: &[DVec3]) -> Option<Similarity> {
    let mean = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
    let (from_mean, to_mean) = (mean(from), mean(to));
    let mut covariance = Matrix3::<f64>::zeros();
    let mut square = 0.0;
    for (a, b) in from.iter().zip(to) {
        let (a, b) = (*a - from_mean, *b - to_mean);
        square += a.length_squared();
        covariance += Vector3::from(b.to_array()) * Vector3::from(a.to_array()).transpose();
    }
    let svd = covariance.svd(true, true);
    let (u, vt) = (svd.u?, svd.v_t?);
    // Singular values come in descending order: without the second the points lie in a line and the
    // rotation is undetermined.
    if svd.singular_values[1] <= 1e-9 * svd.singular_values[0] {
        return None;
    }
    let mut sign = Matrix3::identity();
    sign[(2, 2)] = (u * vt).determinant().signum();
    let rotation = u * sign * vt;
    let scale = (0..3)
        .map(|i| svd.singular_values[i] * sign[(i, i)])
        .sum::<f64>()
        / square;
    let column = |c| DVec3::new(rotation[(0, c)], rotation[(1, c)], rotation[(2, c)]);
    let matrix = DMat3::from_cols(column(0), column(1), column(2));
    Some(Similarity {
        scale,
        rotation: DQuat::from_mat3(&matrix),
        translation: to_mean - scale * (matrix * from_mean),
    })
}
