//! Normals against a normal map.

use eagpt_eval::KnownPixels;
use eagpt_scene::Image;
use eagpt_trace::features::{Features, GBuffer, lane};
use glam::Vec3;

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
    let counts = |seen: &Features, wanted: Vec3| {
        wanted != Vec3::ZERO
            && seen.alpha() > MIN_NORMAL_ALPHA
            && seen.normal().length_squared() > 0.0
    };
    let pairs = || {
        features
            .pixels
            .iter()
            .zip(map.pixels())
            .enumerate()
            .map(|(i, (s, n))| match known {
                Some(known) if !known.has(i) => (s, Vec3::ZERO),
                _ => (s, Vec3::from(*n)),
            })
    };
    let num = pairs().filter(|(s, n)| counts(s, *n)).count();
    if num == 0 {
        return 0.0;
    }
    let d_share = (weight / num as f64) as f32;
    let mut total = 0.0;
    for (d, (seen, wanted)) in d_features
        .iter_mut()
        .zip(pairs())
        .filter(|(_, (s, n))| counts(s, *n))
    {
        let (value, d_normal) = one_minus_cosine(seen.normal(), wanted);
        total += f64::from(value);
        for k in 0..3 {
            d.0[lane::NORMAL + k] += d_share * d_normal[k];
        }
    }
    total / num as f64
}

/// `1 − (n/|n|)·m` for unit `m`, and its gradient with respect to `n`.
pub(super) fn one_minus_cosine(n: Vec3, m: Vec3) -> (f32, Vec3) {
    let length = n.length();
    let unit = n / length;
    let cosine = unit.dot(m);
    (1.0 - cosine, (unit * cosine - m) / length)
}
