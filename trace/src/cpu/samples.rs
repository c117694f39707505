//! Light of the samples of a pixel.

use crate::view::SampledLight;
use eagpt_scene::color::luminance;
use glam::Vec3;

/// Light of a path, and the rays traced for it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PathLight {
    pub(super) light: Vec3,
    pub(super) num_rays: u32,
}

/// Samples of the light at one point, before the albedo.
#[derive(Default)]
pub(super) struct Samples {
    total: Vec3,
    squares: f32,
    num: u32,
    num_rays: u32,
}

impl Samples {
    pub(super) fn add(&mut self, path: PathLight) {
        self.total += path.light;
        self.squares += luminance(path.light.to_array()).powi(2);
        self.num += 1;
        self.num_rays += path.num_rays;
    }

    /// The light of all, in the mean.
    pub(super) fn light(&self) -> SampledLight {
        let num = self.num.max(1) as f32;
        SampledLight {
            mean: self.total / num,
            second_moment: self.squares / num,
            num_rays: self.num_rays,
        }
    }
}
