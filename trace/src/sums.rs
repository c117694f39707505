//! What a ray collects: one vector of 16 lanes, so that blending a hit is one multiply-add over a SIMD register.

use eagpt_scene::Image;
use glam::Vec3;

/// Number of lanes of [`Sums`].
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
pub struct Sums(pub [f32; NUM_LANES]);

impl Sums {
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
        // Moments about the first hit, not about zero: with the latter the digits cancel for distant surfaces.
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

/// [`Sums`] for every pixel of a camera, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct SumImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `[height · width]`.
    pub pixels: Vec<Sums>,
}

impl SumImage {
    /// An image of one quantity derived from each pixel's sums.
    pub fn extract<const C: usize>(&self, f: impl FnMut(&Sums) -> [f32; C]) -> Image<C> {
        Image::from_pixels(self.width, self.height, self.pixels.iter().map(f).collect())
            .expect("the number of sums is the number of pixels")
    }

    /// Radiance R of every pixel.
    pub fn radiance(&self) -> Image<3> {
        self.extract(|sums| sums.radiance().to_array())
    }
}
