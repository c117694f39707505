//! Mean distances D̃ against the points of the cloud that a view sees.

use crate::points::PixelPoint;
use eagpt_eval::KnownPixels;
use eagpt_trace::features::{Features, GBuffer, lane};

/// Pixels less opaque than this have no distance worth comparing.
pub(crate) const MIN_DEPTH_ALPHA: f32 = 0.5;
/// An error beyond this share of the distance tells of a point that the view does not see: it is
/// no larger, and moves nothing.
pub(crate) const MAX_DEPTH_ERROR: f32 = 0.1;

/// `mean |D̃ − d| / d` over known pixels that show a point, d far.
pub(super) fn add(
    features: &GBuffer,
    points: &[PixelPoint],
    weight: f64,
    known: Option<&KnownPixels>,
    d_features: &mut [Features],
) -> f64 {
    let share = 1.0 / points.len().max(1) as f64;
    let d_share = (weight * share) as f32;
    let mut sum = 0.0;
    for point in points {
        let (pixel, wanted) = (point.pixel as usize, point.distance);
        let seen = &features.pixels[pixel];
        let alpha = seen.alpha();
        if alpha <= MIN_DEPTH_ALPHA || known.is_some_and(|known| !known.has(pixel)) {
            continue;
        }
        let distance = seen.mean_distance();
        let error = (distance - wanted) / wanted;
        sum += f64::from(error.abs().min(MAX_DEPTH_ERROR));
        if error != 0.0 && error.abs() < MAX_DEPTH_ERROR {
            // D̃ = D / A
            let d_mean = d_share.copysign(error) / (wanted * alpha);
            let d = &mut d_features[pixel].0;
            d[lane::DISTANCE] += d_mean;
            d[lane::ALPHA] -= d_mean * distance;
        }
    }
    sum * share
}
