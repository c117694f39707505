//! Our own denoiser: local linear regression of the irradiance on noise-free guides.
//!
//! Light is divided by the albedo first, so that textures need not survive the filter. The
//! remaining irradiance varies slowly except at shadows, and with the normal: around a point it is
//! close to a linear function of image position and normal. This function is fitted around every
//! pixel to the noisy values, as in Moon et al. 2014 ("Adaptive rendering based on weighted local
//! regression") and Bitterli et al. 2016 ("Nonlinearly weighted first-order regression for
//! denoising Monte Carlo renderings"), which beats weighted means: those flatten every gradient.
//! Steps:
//!
//! 1. `guides`: distance between the surfaces of two pixels: plane distance and normal.
//! 2. `outliers`: values far above their surroundings are lowered.
//! 3. `regression` with weights from the guides alone: a first estimate, blind to shadows.
//! 4. Values are clamped to the first estimate plus some standard deviations of their mean, known
//!    from the samples' second moment.
//! 5. `regression` again, with weights from the first estimate as well: edges of shadows stay
//!    sharp.
//! 6. `outliers`: the light removed in 2 and 4 is spread widely and added back, which keeps the
//!    filter unbiased in total.
//!
//! Sums run over a pixel's window in a fixed order: the result does not depend on the number of
//! threads.

mod guides;
mod outliers;
mod regression;

use crate::frame::Frame;
use eagpt_scene::Image;
use eagpt_scene::color::luminance;
use glam::Vec3;
use guides::Guides;
use rayon::prelude::*;
use regression::Samples;

/// Least albedo that light is divided by: irradiance at black surfaces is not visible in them.
const MIN_ALBEDO: f32 = 1e-3;

/// Parameters of the filter; the defaults were tuned on path-traced rooms with 16 samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Half the window of the regression, pixels.
    pub radius: i32,
    /// The same, for the first estimate.
    pub first_radius: i32,
    /// Standard deviation of the weights over the image, in radii.
    pub spatial: f32,
    /// Spacing of the fitted functions along each axis, pixels; a pixel takes the mean of those
    /// around it.
    pub stride: i32,
    /// The same, for the first estimate.
    pub first_stride: i32,
    /// Difference of unit normals that counts as one standard deviation.
    pub normal: f32,
    /// Sine of the angle out of the tangent plane that counts as one standard deviation.
    pub plane: f32,
    /// Share of a pixel's variance assumed to remain in the first estimate, a generous bound.
    pub left: f32,
    /// Relative difference of the first estimate that always counts as noise.
    pub relative: f32,
    /// Ridge regularisation of slopes.
    pub ridge: f32,
    /// Standard deviations of the mean above the first estimate at which values are cut off.
    pub cut: f32,
}

impl Settings {
    /// The default settings.
    pub const DEFAULT: Self = Self {
        radius: 10,
        first_radius: 7,
        spatial: 0.6,
        stride: 1,
        first_stride: 2,
        normal: 0.4,
        plane: 0.1,
        left: 0.5,
        relative: 0.02,
        ridge: 1e-2,
        cut: 1.0,
    };
}

impl Default for Settings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Denoises the reflected light of a frame.
pub fn reflected(frame: &Frame, settings: &Settings) -> Image<3> {
    let guides = Guides::new(frame, settings);
    let calm = Calm::new(frame, &guides, settings);
    let samples = Samples::new(&guides, &calm.light);
    let second = samples
        .steered(&calm.first, &calm.deviation, settings)
        .regressed(settings);
    let sum: Vec<Vec3> = second
        .iter()
        .zip(&calm.excess)
        .map(|(a, b)| *a + *b)
        .collect();
    shaded(frame, &sum)
}

/// Reflected light with its fireflies spread over the surrounding surfaces: input for another
/// denoiser in place of the second regression.
pub(crate) fn calmed(frame: &Frame, settings: &Settings) -> [Image<3>; 2] {
    let guides = Guides::new(frame, settings);
    let calm = Calm::new(frame, &guides, settings);
    [calm.light, calm.excess].map(|light| shaded(frame, &light))
}

/// Irradiance after the steps 2 to 4 and 6.
struct Calm {
    first: Vec<Vec3>,
    /// Standard deviation of each pixel's mean before clamping.
    deviation: Vec<f32>,
    light: Vec<Vec3>,
    excess: Vec<Vec3>,
}

impl Calm {
    fn new(frame: &Frame, guides: &Guides, settings: &Settings) -> Self {
        let incoming = incoming(frame);
        let samples = Samples::new(guides, &outliers::despeckled(guides, &incoming));
        let first = samples.regressed(&Settings {
            radius: settings.first_radius,
            stride: settings.first_stride,
            ..*settings
        });
        let deviation = guides.blurred(&deviations(frame, &incoming));
        let deviation = outliers::plausible(&deviation, &first);
        let light = outliers::cut(&incoming, &first, &deviation, settings.cut);
        let excess = outliers::spread(guides, &incoming, &light, &first);
        Self {
            first,
            deviation,
            light,
            excess,
        }
    }
}

/// Reflected radiance: albedo times irradiance over π.
fn shaded(frame: &Frame, incoming: &[Vec3]) -> Image<3> {
    let pixels = incoming.iter().zip(frame.albedo.pixels());
    let light =
        pixels.map(|(light, albedo)| (light.max(Vec3::ZERO) * Vec3::from(*albedo)).to_array());
    let (width, height) = frame.reflected.size();
    Image::from_pixels(width, height, light.collect()).expect("a value for each pixel")
}

/// Irradiance over π.
fn incoming(frame: &Frame) -> Vec<Vec3> {
    let pixels = frame.reflected.pixels().iter().zip(frame.albedo.pixels());
    pixels
        .map(|(light, albedo)| {
            Vec3::from(*light) / Vec3::from(*albedo).max(Vec3::splat(MIN_ALBEDO))
        })
        .collect()
}

/// Standard deviation of every pixel's mean luminance, from the scatter of its samples.
fn deviations(frame: &Frame, incoming: &[Vec3]) -> Vec<f32> {
    let moments = frame.second_moment.pixels().iter();
    let pixels = moments.zip(frame.coverage.pixels()).zip(incoming);
    pixels
        .map(|(([moment], [coverage]), mean)| {
            // One sample has no scatter: its own value is used instead.
            let num_samples = coverage * frame.num_samples as f32;
            let variance = if num_samples >= 2.0 {
                (moment - luminance(mean.to_array()).powi(2)) / (num_samples - 1.0)
            } else {
                *moment
            };
            variance.max(0.0).sqrt()
        })
        .collect()
}

/// Size of an image, and its pixels in parallel.
#[derive(Debug, Clone, Copy)]
struct Grid {
    width: i32,
    height: i32,
}

impl Grid {
    fn index(self, x: i32, y: i32) -> usize {
        (y * self.width + x) as usize
    }

    /// `f(x, y)` of every pixel, row by row.
    fn map<T: Send>(self, f: impl Fn(i32, i32) -> T + Sync) -> Vec<T> {
        (0..self.width * self.height)
            .into_par_iter()
            .with_min_len(64)
            .map(|i| f(i % self.width, i / self.width))
            .collect()
    }

    /// The pixels of the window of a radius about (x, y).
    fn window(self, x: i32, y: i32, radius: i32) -> impl Iterator<Item = (i32, i32)> {
        let columns = (x - radius).max(0)..(x + radius + 1).min(self.width);
        let rows = (y - radius).max(0)..(y + radius + 1).min(self.height);
        rows.flat_map(move |v| columns.clone().map(move |u| (u, v)))
    }
}
