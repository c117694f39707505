//! From light to numbers: colour filters, photon noise, read noise, black level, clipping.

use super::Rig;
use crate::dng::{CfaColor, Mosaic};
use eagpt_scene::Image;
use eagpt_scene::rng::{RandomKey, RandomStream};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Above this mean a Poisson distribution is taken as normal: its skewness has fallen below a
/// tenth.
const POISSON_BELOW: f64 = 100.0;

/// A sensor with its sensitivity.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sensor {
    rig: Rig,
    camera_from_rec709: [[f64; 3]; 3],
    /// Linear radiance of a neutral surface at which green clips in one second, in the middle of
    /// the image.
    clip_of_second: f64,
}

impl Sensor {
    /// The sensor of a rig whose shortest exposure just holds `brightest`, with a quarter of a stop
    /// to spare.
    pub(crate) fn new(rig: &Rig, brightest: f32) -> Self {
        const HEADROOM: f64 = 1.19;
        let shortest = rig
            .exposures_s
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        let brightest = if brightest > 0.0 {
            brightest.into()
        } else {
            1.0
        };
        Self {
            rig: rig.clone(),
            camera_from_rec709: rig.camera_from_rec709(),
            clip_of_second: HEADROOM * brightest * shortest,
        }
    }

    /// Linear radiance of a neutral surface at which green clips in an exposure of one second.
    pub(crate) fn clip_of_second(&self) -> f64 {
        self.clip_of_second
    }

    /// Electrons of one step of the digitised signal.
    pub(crate) fn electrons_of_step(&self) -> f64 {
        self.rig.full_well_e / f64::from(self.rig.white - self.rig.black)
    }

    /// Mean electrons of the pixel with filter `color` that `light` falls on for `exposure_s`,
    /// before clipping.
    pub(crate) fn electrons(&self, light: [f32; 3], color: CfaColor, exposure_s: f64) -> f64 {
        let row = self.camera_from_rec709[color as usize];
        let response: f64 = row.iter().zip(light).map(|(m, l)| m * f64::from(l)).sum();
        response.max(0.0) * exposure_s / self.clip_of_second * self.rig.full_well_e
    }

    /// Exposes the sensor to linear Rec.709 light on its pixels. `shot` numbers the exposures of
    /// `key`.
    pub(crate) fn expose(
        &self,
        light: &Image<3>,
        exposure_s: f64,
        (key, shot): (RandomKey, u32),
    ) -> Mosaic {
        let (width, height) = light.size();
        let middle = [0.5 * f64::from(width), 0.5 * f64::from(height)];
        let corner2 = middle[0] * middle[0] + middle[1] * middle[1];
        let cfa = self.rig.cfa();
        let sample = |(index, light): (usize, &[f32; 3])| {
            let (x, y) = (index as u32 % width, index as u32 / width);
            let offset = [
                f64::from(x) + 0.5 - middle[0],
                f64::from(y) + 0.5 - middle[1],
            ];
            let r2 = (offset[0] * offset[0] + offset[1] * offset[1]) / corner2;
            let color = cfa[(y % 2 * 2 + x % 2) as usize];
            let mean = self.electrons(*light, color, exposure_s) * self.rig.falloff(r2);
            self.digitise(mean, &mut key.stream(index as u32, shot))
        };
        Mosaic {
            width,
            height,
            samples: light.pixels().par_iter().enumerate().map(sample).collect(),
        }
    }

    /// A sample for a mean number of electrons.
    fn digitise(&self, mean: f64, random: &mut RandomStream) -> u16 {
        let electrons = poisson(mean, random) + self.rig.read_noise_e * normal(random);
        let value = f64::from(self.rig.black) + electrons / self.electrons_of_step();
        // The cast takes what is below 0 to 0.
        value.round().min(self.rig.white.into()) as u16
    }
}

/// A standard normal number (Box and Muller 1958).
fn normal(random: &mut RandomStream) -> f64 {
    let [a, b, ..] = random.next_uniforms().map(f64::from);
    (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
}

/// A Poisson number: by inversion where it is small, else as the rounded normal.
fn poisson(mean: f64, random: &mut RandomStream) -> f64 {
    if mean >= POISSON_BELOW {
        return (mean + mean.sqrt() * normal(random)).round().max(0.0);
    }
    let [high, low, ..] = random.next_words();
    let uniform = (f64::from(high) + f64::from(low) / 4_294_967_296.0) / 4_294_967_296.0;
    let (mut number, mut share) = (0.0, (-mean).exp());
    let mut left = uniform - share;
    while left > 0.0 && share > 0.0 {
        number += 1.0;
        share *= mean / number;
        left -= share;
    }
    number
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dng::RGGB;
    use eagpt_scene::rng::Purpose;

    fn key() -> RandomKey {
        RandomKey::new(5, Purpose::Capture, 0)
    }

    fn sensor() -> Sensor {
        Sensor::new(&Rig::default(), 10.0)
    }

    fn flat(value: f32) -> Image<3> {
        Image::filled(200, 150, [value; 3])
    }

    /// Mean and variance of numbers.
    fn moments(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
        let num = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / num;
        (
            mean,
            values.map(|v| (v - mean).powi(2)).sum::<f64>() / (num - 1.0),
        )
    }

    #[test]
    fn poisson_numbers_have_the_mean_as_their_variance() {
        let num = 40_000;
        for expected in [0.3, 4.0, 60.0, 99.0, 101.0, 3000.0] {
            let all: Vec<f64> = (0..num)
                .map(|i| poisson(expected, &mut key().stream(i, 0)))
                .collect();
            let (mean, variance) = moments(all.iter().copied());
            // Five standard errors: of the mean √(λ/n), of the variance √((2λ² + λ)/n).
            let n = f64::from(num);
            assert!(
                (mean - expected).abs() < 5.0 * (expected / n).sqrt(),
                "{mean} for {expected}"
            );
            let error = ((2.0 * expected * expected + expected) / n).sqrt();
            assert!(
                (variance - expected).abs() < 5.0 * error,
                "{variance} for {expected}"
            );
        }
    }

    /// Green pixels within a hundredth of the falloff of the middle.
    fn middle_greens(mosaic: &Mosaic) -> Vec<f64> {
        let (width, height) = (mosaic.width, mosaic.height);
        (0..width * height)
            .filter(|i| {
                let (x, y) = (i % width, i / width);
                let green = RGGB[(y % 2 * 2 + x % 2) as usize] == CfaColor::G;
                green && x.abs_diff(width / 2) < 20 && y.abs_diff(height / 2) < 20
            })
            .map(|i| f64::from(mosaic.samples[i as usize]))
            .collect()
    }

    #[test]
    fn noise_is_that_of_photons_and_electronics() {
        let sensor = sensor();
        let (exposure, light) = (0.04, 0.1);
        let mosaic = sensor.expose(&flat(light), exposure, (key(), 0));
        let step = sensor.electrons_of_step();
        let greens = middle_greens(&mosaic);
        let (mean, variance) = moments(greens.iter().map(|v| (v - 512.0) * step));
        let expected = sensor.electrons([light; 3], CfaColor::G, exposure);
        let n = greens.len() as f64;
        let wanted = expected + 9.0 + step * step / 12.0;
        // Falloff within the patch loses less than 1 %; five standard errors of n samples.
        assert!((mean - expected).abs() < 0.01 * expected + 5.0 * (wanted / n).sqrt());
        assert!(
            (variance / wanted - 1.0).abs() < 0.03 + 5.0 * (2.0 / n).sqrt(),
            "{variance} {wanted}"
        );
    }

    #[test]
    fn exposures_have_their_ratio_and_clip() {
        let sensor = sensor();
        let mean = |exposure: f64| {
            let mosaic = sensor.expose(&flat(0.3), exposure, (key(), 0));
            moments(middle_greens(&mosaic).iter().map(|v| v - 512.0)).0
        };
        let ratio = mean(0.04) / mean(0.01);
        // 2,000 and 500 steps with noise of √n electrons, means of some 760 pixels.
        assert!((ratio - 4.0).abs() < 0.02, "{ratio}");
        let bright = sensor.expose(&flat(10.0), 0.64, (key(), 0));
        assert!(bright.samples.iter().all(|s| *s == 16_383));
        // The shortest exposure holds the brightest light.
        let short = sensor.expose(&flat(10.0), 0.0025, (key(), 1));
        assert!(short.samples.iter().all(|s| *s < 16_383));
        let dark = sensor.expose(&flat(0.0), 0.64, (key(), 2));
        let (mean, _) = moments(dark.samples.iter().map(|s| f64::from(*s)));
        assert!((mean - 512.0).abs() < 0.05, "{mean}");
    }
}
