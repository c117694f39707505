//! Fireflies: rare samples that find a lot of light.

use super::guides::Guides;
use eagpt_scene::color::luminance;
use glam::Vec3;

/// Half the window that a value is compared with.
const RADIUS: i32 = 3;
/// Standard deviations of the square roots around a value above which it is lowered.
const DEVIATIONS: f32 = 2.0;
/// Passes that spread cut-off light, each twice as wide as the one before: the last reaches 32
/// pixels.
const SPREAD_LEVELS: u32 = 5;
/// Most light of one pixel that is spread, in units of the estimate there: one value may not light
/// up a whole region.
const MAX_EXCESS: f32 = 64.0;

/// Values without those far above all around them. Square roots are compared: they scatter more
/// evenly than light itself.
pub(super) fn despeckled(guides: &Guides, values: &[Vec3]) -> Vec<Vec3> {
    let grid = guides.grid;
    grid.map(|x, y| {
        let here = grid.index(x, y);
        let (mut weights, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for (u, v) in grid.window(x, y, RADIUS) {
            let i = grid.index(u, v);
            if i != here {
                let weight = guides.weight(&guides.pixels[here], &guides.pixels[i], 0.0);
                let light = brightness(values[i]);
                weights += weight;
                sum += weight * light.sqrt();
                squares += weight * light;
            }
        }
        // Less than half a pixel of weight does not count.
        if weights < 0.5 {
            return values[here];
        }
        let mean = sum / weights;
        let deviation = (squares / weights - mean * mean).max(0.0).sqrt();
        lowered(values[here], (mean + DEVIATIONS * deviation).powi(2))
    })
}

/// Deviations clamped to the estimate itself: that of a firefly is far above and would spread to
/// its surroundings.
pub(super) fn plausible(deviation: &[f32], estimate: &[Vec3]) -> Vec<f32> {
    let pixels = deviation.iter().zip(estimate);
    pixels
        .map(|(deviation, estimate)| deviation.min(brightness(*estimate)))
        .collect()
}

/// Values lowered to `estimate` plus so many deviations.
pub(super) fn cut(
    values: &[Vec3],
    estimate: &[Vec3],
    deviation: &[f32],
    deviations: f32,
) -> Vec<Vec3> {
    (0..values.len())
        .map(|i| {
            let most = brightness(estimate[i]) + deviations * deviation[i];
            lowered(values[i], most)
        })
        .collect()
}

/// The light removed between `values` and `kept`, spread over the surrounding surfaces by the
/// smoothing of an à-trous transform (Dammertz et al. 2010).
pub(super) fn spread(
    guides: &Guides,
    values: &[Vec3],
    kept: &[Vec3],
    estimate: &[Vec3],
) -> Vec<Vec3> {
    let grid = guides.grid;
    let mut excess: Vec<Vec3> = (0..values.len())
        .map(|i| lowered(values[i] - kept[i], MAX_EXCESS * brightness(estimate[i])))
        .collect();
    for level in 0..SPREAD_LEVELS {
        excess = grid.map(|x, y| {
            let center = &guides.pixels[grid.index(x, y)];
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            for v in -2..=2_i32 {
                for u in -2..=2_i32 {
                    let (x, y) = (x + (u << level), y + (v << level));
                    if x < 0 || y < 0 || x >= grid.width || y >= grid.height {
                        continue;
                    }
                    let i = grid.index(x, y);
                    let weight = SPLINE[u.unsigned_abs() as usize]
                        * SPLINE[v.unsigned_abs() as usize]
                        * guides.weight(center, &guides.pixels[i], 0.0);
                    sum += excess[i] * weight;
                    weights += weight;
                }
            }
            if weights > 0.0 {
                sum / weights
            } else {
                Vec3::ZERO
            }
        });
    }
    excess
}

/// The cubic B-spline at 0, 1 and 2.
const SPLINE: [f32; 3] = [0.375, 0.25, 0.0625];

/// The colour with a luminance of at most `most`.
fn lowered(color: Vec3, most: f32) -> Vec3 {
    let light = brightness(color);
    if light > most {
        color * (most / light)
    } else {
        color
    }
}

fn brightness(color: Vec3) -> f32 {
    luminance(color.to_array()).max(0.0)
}
