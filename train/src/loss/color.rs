//! The colour term: L1 and SSIM in PQ space, over known pixels and over windows of them.

use super::sum_over_pixels;
use eagpt_eval::KnownPixels;
use eagpt_eval::ssim::ssim_with_gradient;
use eagpt_scene::Image;
use eagpt_scene::color::{pq_from_linear, pq_from_linear_with_slope};
use rayon::prelude::*;

/// `(1 − s)·L1 + s·(1 − SSIM)` of PQ images.
#[derive(Debug, Clone)]
pub(crate) struct ColorLoss {
    /// The loss.
    pub value: f64,
    /// Mean absolute error over pixels and channels.
    pub l1: f64,
    /// SSIM, at most 1.
    pub ssim: f64,
    /// Gradient with respect to the linear radiance.
    pub d_radiance: Image<3>,
}

/// PQ encoding of a linear image.
pub fn pq_image(linear: &Image<3>) -> Image<3> {
    let pixels = linear
        .pixels()
        .par_iter()
        .with_min_len(2048)
        .map(|p| p.map(pq_from_linear))
        .collect();
    Image::from_pixels(linear.width(), linear.height(), pixels).expect("as many pixels as before")
}

impl ColorLoss {
    /// Compares linear `radiance` with a target that is PQ-encoded already, where that is `known`:
    /// everywhere if nothing is said. Radiance beyond the target of a channel that is `clipped`
    /// (not 0) counts as the target. The images have the same size.
    pub(crate) fn new(
        radiance: &Image<3>,
        target_pq: &Image<3>,
        ssim_share: f64,
        known: Option<&KnownPixels>,
        clipped: Option<&Image<3>>,
    ) -> Self {
        let (width, height) = radiance.size();
        let mut encoded: Vec<[(f32, f32); 3]> = radiance
            .pixels()
            .par_iter()
            .with_min_len(2048)
            .map(|p| p.map(pq_from_linear_with_slope))
            .collect();
        if let Some(clipped) = clipped {
            let bounds = clipped.pixels().iter().zip(target_pq.pixels());
            for (shown, (clipped, wanted)) in encoded.iter_mut().zip(bounds) {
                for c in 0..3 {
                    if clipped[c] > 0.0 && shown[c].0 > wanted[c] {
                        shown[c] = (wanted[c], 0.0);
                    }
                }
            }
        }
        let pq = Image::from_pixels(
            width,
            height,
            (encoded.par_iter().with_min_len(2048))
                .map(|p| p.map(|c| c.0))
                .collect(),
        )
        .expect("as many pixels as before");
        let windows = known.map(KnownPixels::windows);
        let ssim = ssim_with_gradient(target_pq, &pq, windows.as_ref());
        let num_values = 3 * known.map_or(encoded.len(), KnownPixels::num).max(1);
        let d_l1 = ((1.0 - ssim_share) / num_values as f64) as f32;
        let mut d_pixels = vec![[0.0; 3]; encoded.len()];
        let sum = sum_over_pixels(&mut d_pixels, width, |i, d_pixel| {
            if known.is_some_and(|known| !known.has(i)) {
                return 0.0;
            }
            let mut errors = 0.0;
            for c in 0..3 {
                let difference = pq.pixels()[i][c] - target_pq.pixels()[i][c];
                errors += f64::from(difference.abs());
                let sign = if difference == 0.0 {
                    0.0
                } else {
                    d_l1.copysign(difference)
                };
                let d_pq = sign - ssim_share as f32 * ssim.d_test.pixels()[i][c];
                d_pixel[c] = d_pq * encoded[i][c].1;
            }
            errors
        });
        let l1 = sum / num_values as f64;
        Self {
            value: (1.0 - ssim_share) * l1 + ssim_share * (1.0 - ssim.value),
            l1,
            ssim: ssim.value,
            d_radiance: Image::from_pixels(width, height, d_pixels)
                .expect("as many pixels as before"),
        }
    }
}
