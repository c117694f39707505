//! A denoiser of our own: local linear regression of the arriving light on what is known of every
//! pixel.
//!
//! Light is divided by the albedo first, so that textures need not survive the filter. What is
//! left, the light that arrives, varies slowly but for shadows, and bends with the normal: about a
//! point it is close to a linear function of the place on the image and of the normal. This
//! function is fitted around every pixel to the noisy values, as in Moon et al. 2014 ("Adaptive
//! rendering based on weighted local regression") and Bitterli et al. 2016 ("Nonlinearly weighted
//! first-order regression for denoising Monte Carlo renderings"), where it beats weighted means:
//! those flatten every gradient. Steps:
//!
//! 1. `guides`: how far two pixels are apart as surfaces: plane distance and normal.
//! 2. `outliers`: values far above their surroundings are lowered.
//! 3. `regression` with weights by the guides alone: a first estimate, blind to shadows.
//! 4. Values are lowered to the first estimate plus some standard deviations of their mean, known
//!    from the samples' second moment.
//! 5. `regression` again, weights by the first estimate, too: edges of shadows stay.
//! 6. `outliers`: the light cut off in 2 and 4 is spread widely and added, since it is as real as
//!    the rest.
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

/// Albedo below which light is not divided by it but by this: what arrives at black surfaces is not
/// seen in them.
const MIN_ALBEDO: f32 = 1e-3;

/// What decides how the filter works; the default was tuned on path-traced rooms with 16 samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Half the window of the regression, pixels.
    pub radius: i32,
    /// The same for the first estimate.
    pub first_radius: i32,
    /// Standard deviation of the weights over the image, in radii.
    pub spatial: f32,
    /// Every so many pixels along each axis a function is fitted; a pixel takes the mean of those
    /// around it.
    pub stride: i32,
    /// The same for the first estimate.
    pub first_stride: i32,
    /// Difference of unit normals that counts as one standard deviation.
    pub normal: f32,
    /// Sine of the angle out of the tangent plane that counts as one standard deviation.
    pub plane: f32,
    /// Share of a pixel's variance that is left in the first estimate, generously.
    pub left: f32,
    /// Relative difference of the first estimate that always counts as noise.
    pub relative: f32,
    /// How strongly slopes are held to zero.
    pub ridge: f32,
    /// Standard deviations of the mean above the first estimate at which values are cut off.
    pub cut: f32,
}

impl Settings {
    /// The default.
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

/// Reflected light without its fireflies, and what they brought, spread over the surfaces around:
/// for another denoiser in the place of the second regression.
pub(crate) fn calmed(frame: &Frame, settings: &Settings) -> [Image<3>; 2] {
    let guides = Guides::new(frame, settings);
    let calm = Calm::new(frame, &guides, settings);
    [calm.light, calm.excess].map(|light| shaded(frame, &light))
}

/// Arriving light after the steps 2 to 4 and 6.
struct Calm {
    first: Vec<Vec3>,
    /// Of the mean of each pixel before anything was cut off.
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

/// What surfaces reflect of the light that arrives.
fn shaded(frame: &Frame, incoming: &[Vec3]) -> Image<3> {
    let pixels = incoming.iter().zip(frame.albedo.pixels());
    let light =
        pixels.map(|(light, albedo)| (light.max(Vec3::ZERO) * Vec3::from(*albedo)).to_array());
    let (width, height) = frame.reflected.size();
    Image::from_pixels(width, height, light.collect()).expect("a value for each pixel")
}

/// The light that arrives, over π.
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
            // One sample says nothing of the scatter: its own size stands for it.
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
