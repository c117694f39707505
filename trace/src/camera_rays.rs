//! The rays that make the pixels of a camera.

use crate::features::{Features, GBuffer};
use eagpt_scene::Camera;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// The rays of a camera: one through the centre of every pixel, or of some pixels 2×2, whose mean
/// the pixel is.
///
/// They lie on a grid of as many places as if every pixel were split. A pixel that is not has its
/// one ray at the first of its places; the others have none.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraRays {
    camera: Camera,
    /// Pixels that are split, row by row; without any, the grid is that of the pixels.
    split: Option<Arc<[bool]>>,
}

impl From<Camera> for CameraRays {
    /// One ray through the centre of every pixel.
    fn from(camera: Camera) -> Self {
        Self {
            camera,
            split: None,
        }
    }
}

impl CameraRays {
    /// Rays along each axis of a pixel that is split, and of every pixel of a rendering where
    /// nothing else is told.
    pub const RAYS_PER_AXIS: u32 = 2;

    /// 2×2 rays in the pixels that `split` holds for, row by row, and one through the centre of
    /// every other.
    ///
    /// # Panics
    /// If `split` is not of as many pixels as `camera` has.
    pub fn splitting(camera: Camera, split: Arc<[bool]>) -> Self {
        assert_eq!(split.len(), camera.num_pixels(), "one for each pixel");
        Self {
            camera,
            split: Some(split),
        }
    }

    /// The camera whose pixels the rays make.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Pixels that are split, row by row; `None` where each has one ray on a grid of pixels.
    pub fn split(&self) -> Option<&[bool]> {
        self.split.as_deref()
    }

    /// The camera whose pixels are the places of the grid.
    pub fn grid(&self) -> Camera {
        match self.split {
            None => self.camera,
            Some(_) => self.camera.magnified(Self::RAYS_PER_AXIS),
        }
    }

    /// Columns and rows of the grid.
    pub fn grid_size(&self) -> (u32, u32) {
        let grid = self.grid();
        (grid.width, grid.height)
    }

    /// How far right of the left edge of a place of the grid, and below its upper edge, its ray
    /// passes, in places; `None` where it has no ray.
    pub(crate) fn offset(&self, x: u32, y: u32) -> Option<f32> {
        let Some(split) = &self.split else {
            return Some(0.5);
        };
        let (column, row) = (x / Self::RAYS_PER_AXIS, y / Self::RAYS_PER_AXIS);
        if split[(row * self.camera.width + column) as usize] {
            return Some(0.5);
        }
        let is_first =
            x.is_multiple_of(Self::RAYS_PER_AXIS) && y.is_multiple_of(Self::RAYS_PER_AXIS);
        is_first.then_some(Self::RAYS_PER_AXIS as f32 / 2.0)
    }

    /// How far from the middles of their places rays pass at most, along each axis, in places.
    pub(crate) fn largest_offset(&self) -> f32 {
        match self.split {
            None => 0.0,
            Some(_) => 0.5,
        }
    }

    /// Features of the pixels, given those of the grid.
    pub(crate) fn means(&self, rays: GBuffer) -> GBuffer {
        let Some(split) = &self.split else {
            return rays;
        };
        let width = self.camera.width;
        let pixels = split.par_iter().with_min_len(1024).enumerate();
        let pixels = pixels.map(|(pixel, is_split)| {
            let (x, y) = (pixel as u32 % width, pixel as u32 / width);
            match is_split {
                true => rays.mean_of_square(x, y, Self::RAYS_PER_AXIS),
                false => rays.pixels[(Self::RAYS_PER_AXIS * (y * rays.width + x)) as usize],
            }
        });
        GBuffer {
            width,
            height: self.camera.height,
            pixels: pixels.collect(),
        }
    }

    /// Derivatives by the features of the places of the grid, given those by the pixels, row by
    /// row: the transpose of the means. The lanes of first hit and spread have no derivatives.
    pub(crate) fn adjoint_of_means<'a>(&self, d_pixels: &'a [Features]) -> Cow<'a, [Features]> {
        let Some(split) = &self.split else {
            return Cow::Borrowed(d_pixels);
        };
        let grid = self.grid();
        let share = 1.0 / (Self::RAYS_PER_AXIS * Self::RAYS_PER_AXIS) as f32;
        let d_places = (0..grid.num_pixels())
            .into_par_iter()
            .with_min_len(1024)
            .map(|place| {
                let (x, y) = (place as u32 % grid.width, place as u32 / grid.width);
                let pixel = y / Self::RAYS_PER_AXIS * self.camera.width + x / Self::RAYS_PER_AXIS;
                let d_pixel = &d_pixels[pixel as usize];
                match (self.offset(x, y), split[pixel as usize]) {
                    (None, _) => Features::default(),
                    (Some(_), false) => *d_pixel,
                    (Some(_), true) => Features(d_pixel.0.map(|d| d * share)),
                }
            })
            .collect();
        Cow::Owned(d_places)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    fn rays() -> CameraRays {
        let camera = Camera::centred([3, 2], 1.0, DAffine3::IDENTITY);
        CameraRays::splitting(camera, [true, false, false, false, true, false].into())
    }

    #[test]
    fn a_pixel_that_is_not_split_has_one_ray_through_its_middle() {
        let rays = rays();
        let at = |x, y| rays.offset(x, y);
        assert_eq!([at(0, 0), at(1, 0), at(0, 1), at(1, 1)], [Some(0.5); 4]);
        let middle = [Some(1.0), None, None, None];
        assert_eq!([at(2, 0), at(3, 0), at(2, 1), at(3, 1)], middle);
        let num = (0..4).flat_map(|y| (0..6).map(move |x| (x, y)));
        let num = num.filter(|&(x, y)| at(x, y).is_some()).count();
        assert_eq!(num, 2 * 4 + 4);
    }

    /// ⟨d, mean(x)⟩ = ⟨adjoint(d), x⟩, which defines the adjoint of a linear map.
    #[test]
    fn adjoint_of_the_means_is_their_transpose() {
        let rays = rays();
        let value = |i: usize| Features([((i * 37 + 11) % 101) as f32 / 101.0; 16]);
        let grid = GBuffer {
            width: 6,
            height: 4,
            pixels: (0..24).map(value).collect(),
        };
        let d_pixels: Vec<Features> = (0..6).map(|i| value(i + 50)).collect();
        // The lanes of first hit and spread are not means, and have no gradient.
        let dot = |a: &[Features], b: &[Features]| -> f32 {
            a.iter().zip(b).map(|(a, b)| a.0[3] * b.0[3]).sum()
        };
        let backward = dot(&rays.adjoint_of_means(&d_pixels), &grid.pixels);
        let forward = dot(&d_pixels, &rays.means(grid).pixels);
        assert!((forward - backward).abs() < 1e-5, "{forward} {backward}");
    }
}
