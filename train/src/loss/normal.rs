//! Normals against a normal map.

use super::sum_over_pixels;
use eagpt_eval::KnownPixels;
use eagpt_scene::Image;
use eagpt_trace::features::{Features, GBuffer, lane};
use glam::Vec3;
use rayon::prelude::*;

/// Pixels less opaque than this have no normal worth comparing.
pub(crate) const MIN_NORMAL_ALPHA: f32 = 0.5;

/// `mean(1 − Ñ·N_mono)` over the pixels where the map knows a normal.
pub(super) fn normal_map_loss(
    features: &GBuffer,
    map: &Image<3>,
    weight: f64,
    known: Option<&KnownPixels>,
    d_features: &mut [Features],
) -> f64 {
    let pair = |i: usize| {
        let (seen, wanted) = (&features.pixels[i], Vec3::from(map.pixels()[i]));
        let counts = wanted != Vec3::ZERO
            && known.is_none_or(|known| known.has(i))
            && seen.alpha() > MIN_NORMAL_ALPHA
            && seen.normal().length_squared() > 0.0;
        counts.then(|| (seen.normal(), wanted))
    };
    let pixels = (0..features.pixels.len()).into_par_iter();
    let num = pixels.filter(|i| pair(*i).is_some()).count();
    if num == 0 {
        return 0.0;
    }
    let d_share = (weight / num as f64) as f32;
    let sum = sum_over_pixels(d_features, features.width, |i, d| {
        let Some((seen, wanted)) = pair(i) else {
            return 0.0;
        };
        let (value, d_normal) = one_minus_cosine(seen, wanted);
        for k in 0..3 {
            d.0[lane::NORMAL + k] += d_share * d_normal[k];
        }
        f64::from(value)
    });
    sum / num as f64
}

/// `1 − (n/|n|)·m` for unit `m`, and its gradient with respect to `n`.
pub(super) fn one_minus_cosine(n: Vec3, m: Vec3) -> (f32, Vec3) {
    let length = n.length();
    let unit = n / length;
    let cosine = unit.dot(m);
    (1.0 - cosine, (unit * cosine - m) / length)
}
