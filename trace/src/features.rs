//! Features composited along a ray: one vector of 16 lanes, so that blending a hit is one
//! multiply-add over a SIMD register.

use eagpt_scene::{Camera, Image};
use glam::Vec3;
use rayon::prelude::*;

/// Number of lanes of [`Features`].
pub const NUM_LANES: usize = 16;

/// First lane of each quantity.
pub mod lane {
    /// Radiance R, three lanes, linear Rec.709.
    pub const RADIANCE: usize = 0;
    /// Emission E, one lane.
    pub const EMISSION: usize = 3;
    /// Albedo P, three lanes.
    pub const ALBEDO: usize = 4;
    /// Normal N, three lanes, world space, each turned towards the ray's origin.
    pub const NORMAL: usize = 7;
    /// Opacity A = 1 − T.
    pub const ALPHA: usize = 10;
    /// Distance D, weighted by the hits' weights; scene units along the ray.
    pub const DISTANCE: usize = 11;
    /// Weighted squared difference of the hits' distances to the first one's.
    pub const SPREAD: usize = 12;
    /// Weighted size of the hit Gaussians: the geometric mean of their two scales.
    pub const SIZE: usize = 13;
    /// Distance of the first hit (not weighted).
    pub const FIRST: usize = 14;
}

/// Blended quantities along one ray, `V = Σ wᵢ vᵢ`; not normalised by the opacity.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(64))]
pub struct Features(pub [f32; NUM_LANES]);

impl Features {
    #[inline]
    fn vec3(&self, first: usize) -> Vec3 {
        Vec3::new(self.0[first], self.0[first + 1], self.0[first + 2])
    }

    /// Radiance R.
    #[inline]
    pub fn radiance(&self) -> Vec3 {
        self.vec3(lane::RADIANCE)
    }

    /// Emission E, 0 to 1.
    #[inline]
    pub fn emission(&self) -> f32 {
        self.0[lane::EMISSION]
    }

    /// Albedo P, 0 to 1.
    #[inline]
    pub fn albedo(&self) -> Vec3 {
        self.vec3(lane::ALBEDO)
    }

    /// Normal N, not normalised.
    #[inline]
    pub fn normal(&self) -> Vec3 {
        self.vec3(lane::NORMAL)
    }

    /// Unit normal Ñ; zero where the ray hit nothing or the normals cancel.
    #[inline]
    pub fn unit_normal(&self) -> Vec3 {
        self.normal().normalize_or_zero()
    }

    /// Opacity A, 0 to 1.
    #[inline]
    pub fn alpha(&self) -> f32 {
        self.0[lane::ALPHA]
    }

    /// Mean distance D̃ = D / A along the ray; 0 where the ray hit nothing.
    #[inline]
    pub fn mean_distance(&self) -> f32 {
        let alpha = self.alpha();
        if alpha > 0.0 {
            self.0[lane::DISTANCE] / alpha
        } else {
            0.0
        }
    }

    /// Standard deviation of the hits' distances, scene units.
    #[inline]
    pub fn distance_deviation(&self) -> f32 {
        let alpha = self.alpha();
        if alpha <= 0.0 {
            return 0.0;
        }
        // Moments about the first hit, not about zero: with the latter the digits cancel for
        // distant surfaces.
        let offset = self.mean_distance() - self.0[lane::FIRST];
        (self.0[lane::SPREAD] / alpha - offset * offset)
            .max(0.0)
            .sqrt()
    }

    /// Mean size of the hit Gaussians, scene units.
    #[inline]
    pub fn mean_size(&self) -> f32 {
        let alpha = self.alpha();
        if alpha > 0.0 {
            self.0[lane::SIZE] / alpha
        } else {
            0.0
        }
    }
}

impl Features {
    /// The mean of several rays' features, as of one ray that met all their hits.
    fn mean<'a>(rays: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let first = rays
            .clone()
            .filter(|ray| ray.alpha() > 0.0)
            .map(|ray| ray.0[lane::FIRST])
            .fold(f32::INFINITY, f32::min);
        let mut total = Self::default();
        let mut num = 0.0;
        for ray in rays {
            num += 1.0;
            for (sum, value) in total.0.iter_mut().zip(ray.0) {
                *sum += value;
            }
            if ray.alpha() > 0.0 {
                // Moves the second moment from the ray's first hit to the first of all: Σ w (t −
                // f)² with f = f' + d.
                let d = ray.0[lane::FIRST] - first;
                let about_first = ray.0[lane::DISTANCE] - ray.0[lane::FIRST] * ray.alpha();
                total.0[lane::SPREAD] += d * (2.0 * about_first + d * ray.alpha());
            }
        }
        total.0.iter_mut().for_each(|sum| *sum /= num);
        total.0[lane::FIRST] = if first.is_finite() { first } else { 0.0 };
        total
    }
}

/// [`Features`] for every pixel of a camera, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct GBuffer {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `[height · width]`.
    pub pixels: Vec<Features>,
}

impl GBuffer {
    /// An image of one quantity derived from each pixel's features.
    pub fn extract<const C: usize>(&self, f: impl Fn(&Features) -> [f32; C] + Sync) -> Image<C> {
        self.extract_with_number(|_, features| f(features))
    }

    /// As [`Self::extract`], given the number of the pixel, row by row, too.
    fn extract_with_number<const C: usize>(
        &self,
        f: impl Fn(u32, &Features) -> [f32; C] + Sync,
    ) -> Image<C> {
        let pixels = self.pixels.par_iter().with_min_len(2048).enumerate();
        let pixels = pixels.map(|(i, features)| f(i as u32, features));
        Image::from_pixels(self.width, self.height, pixels.collect())
            .expect("the number of features is the number of pixels")
    }

    /// Means over squares of `factor` × `factor` pixels, of which the image has a whole number.
    pub fn averaged(&self, factor: u32) -> Self {
        if factor == 1 {
            return self.clone();
        }
        let (width, height) = (self.width / factor, self.height / factor);
        let mean = |i: usize| self.mean_of_square(i as u32 % width, i as u32 / width, factor);
        Self {
            width,
            height,
            pixels: (0..(width * height) as usize)
                .into_par_iter()
                .with_min_len(1024)
                .map(mean)
                .collect(),
        }
    }

    /// Mean over the square of `factor` × `factor` pixels that becomes pixel (`x`, `y`).
    pub(crate) fn mean_of_square(&self, x: u32, y: u32, factor: u32) -> Features {
        let (x, y) = (x * factor, y * factor);
        let square = (y..y + factor).flat_map(|y| {
            let start = (y * self.width + x) as usize;
            &self.pixels[start..start + factor as usize]
        });
        Features::mean(square)
    }

    /// Radiance R of every pixel.
    pub fn radiance(&self) -> Image<3> {
        self.extract(|features| features.radiance().to_array())
    }

    /// Depth of every pixel along the optical axis of the `camera` the features are of; the
    /// features themselves hold distances along rays.
    pub fn depth(&self, camera: &Camera) -> Image<1> {
        let (frame, forward) = (camera.ray_frame(), camera.forward());
        self.extract_with_number(|pixel, features| {
            let (x, y) = (pixel % self.width, pixel / self.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            [features.mean_distance() * direction.dot(forward)]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attributes::Attributes;
    use crate::blend::Blender;

    /// The mean of rays has the moments of all their hits together.
    #[test]
    fn the_mean_of_rays_keeps_their_moments() {
        let ray = |hits: &[(f32, f32)]| {
            let mut blender = Blender::default();
            for &(t, alpha) in hits {
                let mut attributes = Attributes([0.0; NUM_LANES]);
                attributes.0[lane::ALPHA] = 1.0;
                blender.accumulate(t, alpha, &attributes, [0.0, 0.0, 1.0]);
            }
            blender.finish()
        };
        let rays = [ray(&[(2.0, 0.5), (3.0, 0.8)]), ray(&[(5.0, 0.4)]), ray(&[])];
        // Weights: 0.5 at 2, 0.4 at 3, 0.4 at 5.
        let mean = (0.5 * 2.0 + 0.4 * 3.0 + 0.4 * 5.0) / 1.3_f32;
        let square = (0.5 * 4.0 + 0.4 * 9.0 + 0.4 * 25.0) / 1.3_f32;
        let image = GBuffer {
            width: 2,
            height: 2,
            pixels: vec![rays[0], rays[1], rays[2], rays[2]],
        };
        let averaged = image.averaged(2).pixels[0];
        assert!((averaged.alpha() - 1.3 / 4.0).abs() < 1e-6);
        assert!((averaged.mean_distance() - mean).abs() < 1e-5);
        assert!((averaged.distance_deviation() - (square - mean * mean).sqrt()).abs() < 1e-5);
        assert_eq!(image.averaged(1), image);
        assert_eq!(
            GBuffer {
                width: 2,
                height: 2,
                pixels: vec![rays[2]; 4]
            }
            .averaged(2)
            .pixels[0],
            rays[2]
        );
    }

    #[test]
    fn depth_is_along_the_optical_axis() {
        // A wall 2 units in front of the camera: distances grow towards the corners, depths do not.
        let camera = Camera {
            width: 4,
            height: 2,
            fx: 2.0,
            fy: 2.0,
            cx: 2.0,
            cy: 1.0,
            world_from_camera: Default::default(),
        };
        let frame = camera.ray_frame();
        let pixels = (0..8_u32).map(|i| {
            let direction = frame.direction((i % 4) as f32 + 0.5, (i / 4) as f32 + 0.5);
            let mut features = Features::default();
            features.0[lane::ALPHA] = 0.5;
            features.0[lane::DISTANCE] = 0.5 * 2.0 / direction.z;
            features
        });
        let features = GBuffer {
            width: 4,
            height: 2,
            pixels: pixels.collect(),
        };
        for [value] in features.depth(&camera).pixels() {
            assert!((value - 2.0).abs() < 1e-6, "{value}");
        }
    }
}
