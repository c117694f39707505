//! Least squares of a response: 256 unknowns, any number of pixels.

use super::NUM_CODES;
use eagpt_scene::color::linear_from_srgb;

/// Standard deviation of a code: rounding and JPEG.
const CODE_SIGMA: f64 = 1.0;
/// Relative error of light that does not depend on codes: photon noise, exposure times.
const LIGHT_SIGMA: f64 = 0.01;
/// Standard deviation of the second difference of a response over sRGB's: contrast curves of
/// cameras bend by about one e-fold within 140 codes. With 5e-4, codes that few pixels have may
/// wave by 3 % in the rhythm of the exposures, which any pixel agrees with.
const BEND_SIGMA: f64 = 1e-4;
/// Standard deviations from which on a pixel counts less.
const OUTLIER: f64 = 3.0;
/// Rounds of weighting; the second already settles which pixels moved.
const ROUNDS: usize = 3;

/// One pixel of one channel: code and logarithm of the exposure in each shot that shows it.
pub(crate) type Chain = Vec<(u16, f64)>;

/// Logarithm of the light of each code, that of `grey` by sRGB's curve, and the root mean square
/// of what remains.
pub(super) fn curve(chains: &[Chain], grey: usize) -> (Vec<f64>, f64) {
    let mut bend = vec![0.0; NUM_CODES];
    let mut error = 0.0;
    for round in 0..ROUNDS {
        let mut system = Equations::new(grey);
        let (mut squares, mut weights) = (0.0, 0.0);
        for chain in chains {
            let weighted = weighted(chain, &bend, round > 0);
            system.add(&weighted);
            for shot in &weighted {
                squares += shot.weight * shot.residual * shot.residual;
                weights += shot.weight;
            }
        }
        // Of the curve that the round began with; the last changes it by little.
        error = (squares / weights).sqrt();
        bend = system.solved();
    }
    let curve = (0..NUM_CODES).map(|code| srgb_log(code) + bend[code]);
    (curve.collect(), error)
}

/// A shot of a pixel.
struct Shot {
    code: usize,
    /// The bend wanted at the code, but for the logarithm of the pixel's light.
    wanted: f64,
    weight: f64,
    residual: f64,
}

/// The shots of a pixel with their weights; with `robust`, those that disagree count less.
fn weighted(chain: &Chain, bend: &[f64], robust: bool) -> Vec<Shot> {
    let mut shots: Vec<Shot> = chain
        .iter()
        .map(|&(code, exposure)| {
            let code = usize::from(code);
            let slope = 0.5 * (srgb_log(code + 1) - srgb_log(code - 1));
            let variance = (slope * CODE_SIGMA).powi(2) + LIGHT_SIGMA * LIGHT_SIGMA;
            Shot {
                code,
                wanted: exposure - srgb_log(code),
                weight: 1.0 / variance,
                residual: 0.0,
            }
        })
        .collect();
    let light = |shots: &[Shot]| {
        let sum: f64 = shots.iter().map(|s| s.weight).sum();
        let weighted = shots.iter().map(|s| s.weight * (bend[s.code] - s.wanted));
        weighted.sum::<f64>() / sum
    };
    let mean = light(&shots);
    for shot in &mut shots {
        shot.residual = bend[shot.code] - shot.wanted - mean;
        if robust {
            let deviations = shot.residual * shot.residual * shot.weight;
            shot.weight /= 1.0 + deviations / (OUTLIER * OUTLIER);
        }
    }
    shots
}

/// Normal equations, the light of each pixel eliminated.
struct Equations {
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl Equations {
    /// Smoothness alone, and no bend at `grey`.
    fn new(grey: usize) -> Self {
        let mut matrix = vec![0.0; NUM_CODES * NUM_CODES];
        let weight = 1.0 / (BEND_SIGMA * BEND_SIGMA);
        for code in 1..NUM_CODES - 1 {
            let row = [(code - 1, 1.0), (code, -2.0), (code + 1, 1.0)];
            for (i, a) in row {
                for (j, b) in row {
                    matrix[i * NUM_CODES + j] += weight * a * b;
                }
            }
        }
        // A constant is free, so any weight pins it without a force; the slope is the data's.
        matrix[grey * NUM_CODES + grey] += weight;
        Self {
            matrix,
            right: vec![0.0; NUM_CODES],
        }
    }

    fn add(&mut self, shots: &[Shot]) {
        let sum: f64 = shots.iter().map(|shot| shot.weight).sum();
        let mean = shots.iter().map(|s| s.weight * s.wanted).sum::<f64>() / sum;
        for a in shots {
            self.matrix[a.code * NUM_CODES + a.code] += a.weight;
            self.right[a.code] += a.weight * (a.wanted - mean);
            for b in shots {
                self.matrix[a.code * NUM_CODES + b.code] -= a.weight * b.weight / sum;
            }
        }
    }

    /// The solution, by Cholesky: the matrix is positive definite, as smoothness leaves a line
    /// free, `grey` pins its height and any two exposures its slope.
    fn solved(self) -> Vec<f64> {
        let Self { mut matrix, right } = self;
        let mut x = right;
        for i in 0..NUM_CODES {
            for j in 0..=i {
                let (row, other) = (i * NUM_CODES, j * NUM_CODES);
                let dot: f64 = (0..j).map(|k| matrix[row + k] * matrix[other + k]).sum();
                let value = matrix[row + j] - dot;
                matrix[row + j] = if i == j {
                    value.max(f64::MIN_POSITIVE).sqrt()
                } else {
                    value / matrix[other + j]
                };
            }
        }
        for i in 0..NUM_CODES {
            let dot: f64 = (0..i).map(|k| matrix[i * NUM_CODES + k] * x[k]).sum();
            x[i] = (x[i] - dot) / matrix[i * NUM_CODES + i];
        }
        for i in (0..NUM_CODES).rev() {
            let rest = i + 1..NUM_CODES;
            let dot: f64 = rest.map(|k| matrix[k * NUM_CODES + i] * x[k]).sum();
            x[i] = (x[i] - dot) / matrix[i * NUM_CODES + i];
        }
        x
    }
}

/// Logarithm of the light of a code by sRGB's curve, which cameras vary.
fn srgb_log(code: usize) -> f64 {
    f64::from(linear_from_srgb(code.max(1) as f32 / 255.0)).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::color::srgb_from_linear;

    /// A camera's curve: sRGB, then contrast around the middle.
    fn code(light: f64) -> u16 {
        let display = f64::from(srgb_from_linear(light as f32)).min(1.0);
        let contrast = display + 0.09 * (std::f64::consts::TAU * (display - 0.5)).sin();
        (255.0 * contrast).round().clamp(0.0, 255.0) as u16
    }

    #[test]
    fn a_contrast_curve_is_recovered_whatever_the_light() {
        // Two stops apart: a wiggle of that period would explain the shots as well.
        let exposures = [0.004, 0.016, 0.0625, 0.25, 1.0, 4.0];
        let mut chains: Vec<Chain> = Vec::new();
        for pixel in 0..4000 {
            let light = 0.002 * 2.0_f64.powf(f64::from(pixel) / 400.0);
            // One in fifty moved before the last shot.
            let moved = if pixel % 50 == 0 { 3.0 } else { 1.0 };
            let shots = exposures.iter().enumerate().map(|(index, t)| {
                let light = if index == 5 { moved * light } else { light };
                (code(light * t), t.ln())
            });
            let chain: Chain = shots
                .filter(|(code, _)| crate::response::USABLE.contains(code))
                .collect();
            if chain.len() > 1 {
                chains.push(chain);
            }
        }
        let (curve, error) = curve(&chains, 128);
        let at = |light: f64| curve[usize::from(code(light))];
        // Within the bins of codes, which are wide where it is dark.
        for (light, tolerance) in [
            (0.01, 0.12),
            (0.03, 0.06),
            (0.1, 0.03),
            (0.5, 0.03),
            (0.8, 0.04),
        ] {
            let found = (at(light) - at(0.2)).exp() * 0.2;
            assert!((found / light - 1.0).abs() < tolerance, "{found} {light}");
        }
        assert!(error < 0.06, "{error}");
    }
}
