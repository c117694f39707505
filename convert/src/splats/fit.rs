//! The fit of our harmonics to light that others describe by a sum.
//!
//! Ours is r · exp(Σ cₖ Yₖ(ω)) in linear light; theirs a sum of the same functions in display
//! colour, cut at 0. For each Gaussian and channel, ln r and the cₖ minimise the squared difference
//! of linear light over directions spread evenly over the sphere, by the method of Levenberg and
//! Marquardt.

use eagpt_scene::Harmonics;
use eagpt_scene::harmonics::{NUM_FUNCTIONS, functions, num_functions};
use glam::Vec3;

/// Directions of the fit: more than six for each unknown.
pub(super) const NUM_DIRECTIONS: usize = 64;
const NUM_UNKNOWNS: usize = 1 + NUM_FUNCTIONS;
const MAX_ROUNDS: usize = 16;
/// Weight, in the mean square of the light, of coefficients being 0: keeps those finite that light
/// of no direction determines, as where it is cut at 0.
const RIDGE: f64 = 1e-5;
/// Light below this is none.
const DARK: f64 = 1e-9;
/// Improvement, in parts, that ends the search.
const DONE: f64 = 1e-7;

/// The directions and the functions there.
pub(super) struct Fit {
    /// Values of degrees 1 and 2 in each direction.
    pub(super) functions: [[f32; NUM_FUNCTIONS]; NUM_DIRECTIONS],
    rows: [[f64; NUM_UNKNOWNS]; NUM_DIRECTIONS],
}

/// Light of a Gaussian, and how near it is to what it was fitted to.
pub(super) struct Fitted {
    pub(super) radiance: Vec3,
    pub(super) harmonics: Harmonics,
    /// Sum of the squares of the light over directions and channels,
    pub(super) light: f64,
    /// of the error,
    pub(super) error: f64,
    /// and of the error of the mean alone.
    pub(super) error_of_constant: f64,
}

impl Fit {
    pub(super) fn new() -> Self {
        let functions = std::array::from_fn(|i| functions(direction(i)));
        let rows = functions.map(|values| {
            let mut row = [1.0; NUM_UNKNOWNS];
            for (to, from) in row[1..].iter_mut().zip(values) {
                *to = f64::from(from);
            }
            row
        });
        Self { functions, rows }
    }

    /// Fits linear light in three channels, with functions up to `degree`.
    pub(super) fn light(&self, light: &[[f64; NUM_DIRECTIONS]; 3], degree: u32) -> Fitted {
        let num = 1 + num_functions(degree.min(2));
        let mut fitted = Fitted {
            radiance: Vec3::ZERO,
            harmonics: Harmonics::NONE,
            light: 0.0,
            error: 0.0,
            error_of_constant: 0.0,
        };
        for (channel, target) in light.iter().enumerate() {
            let squares: f64 = target.iter().map(|value| value * value).sum();
            let mean = target.iter().sum::<f64>() / NUM_DIRECTIONS as f64;
            let error_of_mean: f64 = target.iter().map(|value| (value - mean).powi(2)).sum();
            fitted.light += squares;
            fitted.error_of_constant += error_of_mean;
            if mean < DARK {
                fitted.error += squares;
                continue;
            }
            if num == 1 {
                fitted.radiance[channel] = mean as f32;
                fitted.error += error_of_mean;
                continue;
            }
            let found = self.search(target, mean, num);
            fitted.error += self.error(&found, target);
            fitted.radiance[channel] = found[0].exp() as f32;
            for (k, value) in found[1..].iter().enumerate() {
                fitted.harmonics.0[3 * k + channel] = *value as f32;
            }
        }
        fitted
    }

    fn search(&self, target: &[f64; NUM_DIRECTIONS], mean: f64, num: usize) -> [f64; NUM_UNKNOWNS] {
        let mut best = [0.0; NUM_UNKNOWNS];
        best[0] = mean.ln();
        let mean_square = target.iter().map(|v| v * v).sum::<f64>() / NUM_DIRECTIONS as f64;
        let ridge = RIDGE * mean_square;
        let cost = |x: &[f64; NUM_UNKNOWNS]| {
            let size: f64 = x[1..].iter().map(|c| c * c).sum();
            self.error(x, target) + ridge * size
        };
        let mut least = cost(&best);
        let mut damping = 1e-3;
        for _ in 0..MAX_ROUNDS {
            let (normal, gradient) = self.linearised(&best, target, num, ridge);
            let Some(step) = solved(normal, gradient, num, damping) else {
                break;
            };
            let mut next = best;
            for (value, step) in next.iter_mut().zip(step) {
                *value -= step;
            }
            let after = cost(&next);
            if after < least {
                let is_done = least - after < DONE * least;
                (best, least) = (next, after);
                damping *= 0.2;
                if is_done {
                    break;
                }
            } else {
                damping *= 8.0;
            }
        }
        best
    }

    /// Normal matrix and gradient of the squared error.
    fn linearised(
        &self,
        x: &[f64; NUM_UNKNOWNS],
        target: &[f64; NUM_DIRECTIONS],
        num: usize,
        ridge: f64,
    ) -> (Matrix, [f64; NUM_UNKNOWNS]) {
        let mut normal = [[0.0; NUM_UNKNOWNS]; NUM_UNKNOWNS];
        let mut gradient = [0.0; NUM_UNKNOWNS];
        for (row, wanted) in self.rows.iter().zip(target) {
            let value = seen(x, row);
            let error = value - wanted;
            for i in 0..num {
                let d = value * row[i];
                gradient[i] += d * error;
                for j in 0..=i {
                    normal[i][j] += d * value * row[j];
                }
            }
        }
        for i in 1..num {
            normal[i][i] += ridge;
            gradient[i] += ridge * x[i];
        }
        (normal, gradient)
    }

    fn error(&self, x: &[f64; NUM_UNKNOWNS], target: &[f64; NUM_DIRECTIONS]) -> f64 {
        let rows = self.rows.iter().zip(target);
        rows.map(|(row, wanted)| (seen(x, row) - wanted).powi(2))
            .sum()
    }
}

type Matrix = [[f64; NUM_UNKNOWNS]; NUM_UNKNOWNS];

fn seen(x: &[f64; NUM_UNKNOWNS], row: &[f64; NUM_UNKNOWNS]) -> f64 {
    let exponent: f64 = x[1..].iter().zip(&row[1..]).map(|(c, y)| c * y).sum();
    let most = f64::from(eagpt_scene::harmonics::MAX_EXPONENT);
    (x[0] + exponent.clamp(-most, most)).exp()
}

/// Solves (A + damping · diag A) x = b by Cholesky's method; the lower half of A counts. `None` if
/// it is not positive definite.
fn solved(
    mut a: Matrix,
    b: [f64; NUM_UNKNOWNS],
    num: usize,
    damping: f64,
) -> Option<[f64; NUM_UNKNOWNS]> {
    let mut x = b;
    for i in 0..num {
        a[i][i] *= 1.0 + damping;
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| a[i][k] * a[j][k]).sum();
            if i == j {
                let square = a[i][i] - sum;
                if square.is_nan() || square <= 0.0 {
                    return None;
                }
                a[i][i] = square.sqrt();
            } else {
                a[i][j] = (a[i][j] - sum) / a[j][j];
            }
        }
        let sum: f64 = (0..i).map(|k| a[i][k] * x[k]).sum();
        x[i] = (x[i] - sum) / a[i][i];
    }
    for i in (0..num).rev() {
        let sum: f64 = (i + 1..num).map(|k| a[k][i] * x[k]).sum();
        x[i] = (x[i] - sum) / a[i][i];
    }
    x[num..].fill(0.0);
    Some(x)
}

/// Directions spread evenly over the sphere: a Fibonacci lattice.
fn direction(i: usize) -> Vec3 {
    let z = 1.0 - (2.0 * i as f64 + 1.0) / NUM_DIRECTIONS as f64;
    let angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt()) * i as f64;
    let radius = (1.0 - z * z).sqrt();
    Vec3::new(
        (radius * angle.cos()) as f32,
        (radius * angle.sin()) as f32,
        z as f32,
    )
}
