//! Input of a denoiser.

use crate::error::{DenoiseError, Result};
use eagpt_scene::Image;

/// A rendering, its exact and its noisy part separate, with noise-free guides. All images have one
/// size.
///
/// A pixel is the mean of its rays' light. Rays that meet an emitter bring light known exactly; the
/// others bring albedo times sampled light. Kept apart, a lamp neither needs denoising nor bleeds
/// into the wall behind it, even in pixels that show both.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Light without noise, linear radiance, its share of the pixel; never denoised: of the rays
    /// that meet emitters, and what a gather knows without sampling.
    pub emitted: Image<3>,
    /// All other light, linear radiance, its share of the pixel.
    pub reflected: Image<3>,
    /// Albedo of those other rays, its share of the pixel: `reflected / albedo` is the irradiance
    /// over π.
    pub albedo: Image<3>,
    /// Mean unit normal of those other rays, world space; zero where unknown.
    pub normal: Image<3>,
    /// Mean point that those other rays meet, world space.
    pub position: Image<3>,
    /// Share of those other rays that meet a surface, 0 to 1.
    pub coverage: Image<1>,
    /// Mean squared luminance of the irradiance samples, over those same rays.
    pub second_moment: Image<1>,
    /// Samples of a pixel without emitters.
    pub num_samples: u32,
}

impl Frame {
    /// The light as rendered: emitted and reflected together.
    pub fn noisy(&self) -> Image<3> {
        self.with_reflected(&self.reflected)
    }

    /// # Errors
    /// [`DenoiseError::Size`] if the images differ in size.
    pub(crate) fn check(&self) -> Result<()> {
        let expected = self.emitted.size();
        let sizes = [
            ("reflected", self.reflected.size()),
            ("albedo", self.albedo.size()),
            ("normal", self.normal.size()),
            ("position", self.position.size()),
            ("coverage", self.coverage.size()),
            ("second_moment", self.second_moment.size()),
        ];
        match sizes.into_iter().find(|(_, size)| *size != expected) {
            Some((image, found)) => Err(DenoiseError::Size {
                image,
                found,
                expected,
            }),
            None => Ok(()),
        }
    }

    /// The same frame without NaN and infinite values: one of them would spread over its whole
    /// neighbourhood. The reflected light of such a pixel counts as unknown, and black.
    pub(crate) fn repaired(&self) -> Self {
        let mut frame = self.clone();
        for i in 0..frame.coverage.pixels().len() {
            let known = [&self.reflected, &self.albedo, &self.normal, &self.position]
                .iter()
                .all(|image| image.pixels()[i].iter().all(|value| value.is_finite()));
            let [coverage] = self.coverage.pixels()[i];
            let [moment] = self.second_moment.pixels()[i];
            if known && coverage.is_finite() && moment.is_finite() {
                continue;
            }
            for image in [
                &mut frame.reflected,
                &mut frame.albedo,
                &mut frame.normal,
                &mut frame.position,
            ] {
                image.pixels_mut()[i] = [0.0; 3];
            }
            frame.coverage.pixels_mut()[i] = [0.0];
            frame.second_moment.pixels_mut()[i] = [0.0];
        }
        frame
    }

    /// The light with another reflected part. Pixels that show nothing but emitters keep their
    /// bits.
    pub(crate) fn with_reflected(&self, reflected: &Image<3>) -> Image<3> {
        let pixels = self.emitted.pixels().iter().zip(reflected.pixels());
        let (width, height) = self.emitted.size();
        let sum = pixels.map(|(e, r)| [e[0] + r[0], e[1] + r[1], e[2] + r[2]]);
        Image::from_pixels(width, height, sum.collect()).expect("as many pixels as before")
    }
}
