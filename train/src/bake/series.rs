//! The Neumann series of the light of a scene on its Gaussians, see [`super::gaussians`].

mod growth;

pub(super) use growth::limit_growth;

use super::receivers::Receivers;
use crate::progress::BakeProgress;
use eagpt_light::irradiance::NoisyLight;
use eagpt_light::irradiance::smooth::Smoothing;
use eagpt_scene::color::luminance;
use eagpt_trace::transport::matrix::{Directions, TransportMatrix};
use glam::Vec3;

/// Who lights whom.
pub(super) struct Exchange<'a> {
    receivers: &'a Receivers,
    matrix: &'a TransportMatrix,
    directions: Directions,
    smoothing: Smoothing,
}

impl<'a> Exchange<'a> {
    /// The rows of `matrix` are those of the traced `receivers`.
    pub(super) fn new(
        receivers: &'a Receivers,
        matrix: &'a TransportMatrix,
        directions: Directions,
    ) -> Self {
        Self {
            receivers,
            matrix,
            directions,
            smoothing: Smoothing::new(&receivers.traced),
        }
    }
}

/// The sum of the bounces so far, and of the last one: of the light of all emitters, and where they
/// are asked for of its parts, which add up to it.
#[derive(Debug, Clone, PartialEq)]
struct Series {
    /// Bounces done.
    bounce: u32,
    /// Reflected radiance of all bounces, `[n]`; zero for what emits.
    total: Vec<Vec3>,
    /// That of the last bounce alone, `[n]`.
    last: Vec<Vec3>,
    /// Those of the parts, `[n, parts]`.
    parts: Vec<Vec3>,
    last_parts: Vec<Vec3>,
}

/// The light of emitters in parts.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DirectParts {
    /// Number of parts.
    pub(super) num: usize,
    /// Irradiance over π that comes from each, `[receivers, num]`.
    pub(super) direct: Vec<Vec3>,
}

/// Light that Gaussians reflect.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Reflected {
    /// Radiance, `[n]`; zero for what emits.
    pub(super) total: Vec<Vec3>,
    /// Of each part, `[n, parts]`; empty without parts.
    pub(super) parts: Vec<Vec3>,
    /// Luminance of each bounce, in sum over Gaussians, `[bounces]`.
    pub(super) bounces: Vec<f64>,
}

impl Series {
    fn new(num: usize, num_parts: usize) -> Self {
        Self {
            bounce: 0,
            total: vec![Vec3::ZERO; num],
            last: vec![Vec3::ZERO; num],
            parts: vec![Vec3::ZERO; num * num_parts],
            last_parts: vec![Vec3::ZERO; num * num_parts],
        }
    }

    /// Adds a bounce: what `receivers` reflect of the light of emitters, then of that of the last
    /// bounce.
    fn add(&mut self, albedos: &[Vec3], light: &Exchange<'_>, parts: Option<&DirectParts>) {
        let &Exchange {
            matrix, directions, ..
        } = light;
        let noisy = if self.bounce == 0 {
            NoisyLight::direct(matrix, directions)
        } else {
            NoisyLight::indirect(matrix, directions, &self.last)
        };
        if let Some(parts) = parts {
            self.add_parts(albedos, light, parts, &noisy);
        }
        let irradiance = noisy.smoothed(&light.smoothing);
        self.last.fill(Vec3::ZERO);
        for (i, sources) in light.receivers.each() {
            self.last[i] = albedos[i] * sources.mean(|row| irradiance[row]);
            self.total[i] += self.last[i];
        }
        self.bounce += 1;
    }

    /// The same of the parts of the light, whose sum is `noisy`.
    fn add_parts(
        &mut self,
        albedos: &[Vec3],
        light: &Exchange<'_>,
        parts: &DirectParts,
        noisy: &NoisyLight,
    ) {
        let num = parts.num;
        let indirect;
        let irradiance = if self.bounce == 0 {
            &parts.direct
        } else {
            let matrix = light.matrix;
            indirect = matrix.from_others_of_groups(light.directions, &self.last_parts, num);
            &indirect
        };
        let irradiance = noisy.smoothed_parts(&light.smoothing, irradiance, num);
        self.last_parts.fill(Vec3::ZERO);
        for (i, sources) in light.receivers.each() {
            for part in 0..num {
                let last = albedos[i] * sources.mean(|row| irradiance[num * row + part]);
                self.last_parts[num * i + part] = last;
                self.parts[num * i + part] += last;
            }
        }
    }

    /// Luminance of the last bounce, in sum over Gaussians.
    fn last_sum(&self) -> f64 {
        let luminances = self.last.iter().map(|last| luminance(last.to_array()));
        luminances.map(f64::from).sum()
    }
}

/// Reflected radiance of all Gaussians after so many bounces, and of each of `parts` of the light.
pub(super) fn sum_of_bounces(
    albedos: &[Vec3],
    light: &Exchange<'_>,
    max_bounces: u32,
    parts: Option<&DirectParts>,
    told: &mut dyn FnMut(BakeProgress),
) -> Reflected {
    let mut series = Series::new(albedos.len(), parts.map_or(0, |parts| parts.num));
    let mut bounces = Vec::new();
    while series.bounce < max_bounces {
        series.add(albedos, light, parts);
        bounces.push(series.last_sum());
        told(BakeProgress::Bounced {
            bounce: series.bounce,
            share: bounces[bounces.len() - 1] / bounces.iter().sum::<f64>().max(f64::MIN_POSITIVE),
        });
    }
    Reflected {
        total: series.total,
        parts: series.parts,
        bounces,
    }
}

#[cfg(test)]
mod tests;
