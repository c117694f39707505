//! Runs of neighbouring pixels: most of a picture is nowhere near a lamp, and is passed over run by
//! run.

use super::{Pixel, Sight};
use crate::shape::meet::ShapeFrom;
use glam::Vec3;
use std::ops::Range;

/// Pixels of a run, at most.
const LENGTH: usize = 16;

/// Pixels of one row, one after the other.
#[derive(Debug, Clone)]
pub(super) struct Run {
    numbers: Range<usize>,
    /// Unit direction of the one in the middle, and the largest distance between it and another's.
    direction: Vec3,
    width: f32,
}

impl Run {
    /// All of `pixels`, which come row by row.
    pub(super) fn all(pixels: &[Pixel]) -> Vec<Self> {
        let mut first = 0;
        let rows = pixels.chunk_by(|a, b| a.y == b.y);
        let runs = rows.flat_map(|row| row.chunks(LENGTH)).map(|run| {
            let numbers = first..first + run.len();
            first = numbers.end;
            let direction = run[run.len() / 2].direction;
            let widths = run.iter().map(|pixel| pixel.direction.distance(direction));
            Self {
                numbers,
                direction,
                width: widths.fold(0.0, f32::max),
            }
        });
        runs.collect()
    }
}

impl Sight {
    /// Pixels whose rays, and those that differ from them by up to `width`, may meet a shape as the
    /// camera sees it, and their numbers, ascending.
    pub(crate) fn near<'a>(
        &'a self,
        seen: &'a ShapeFrom<'_>,
        width: f32,
    ) -> impl Iterator<Item = (usize, &'a Pixel)> {
        let runs = self.runs.iter();
        let runs = runs.filter(move |run| seen.is_near(run.direction, width + run.width));
        let pixels =
            runs.flat_map(|run| run.numbers.clone().zip(&self.pixels[run.numbers.clone()]));
        pixels.filter(move |(_, pixel)| seen.is_near(pixel.direction, width))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::Lit;
    use crate::shape::Shape;
    use eagpt_scene::Camera;
    use glam::DVec3;

    #[test]
    fn no_pixel_near_a_shape_is_passed_over() {
        let pose = Camera::level_pose(DVec3::new(1.0, 2.0, 3.0), DVec3::X);
        let camera = Camera::centred([100, 60], 1.3, pose);
        let frame = camera.ray_frame();
        let places = (0..60).flat_map(|y| (0..100).map(move |x| (x, y)));
        // Rows have gaps.
        let kept = places.filter(|(x, y)| (x / 7 + y / 5) % 3 != 0);
        let pixel = |(x, y): (u32, u32)| Pixel {
            x,
            y,
            direction: frame.direction(x as f32 + 0.5, y as f32 + 0.5),
            solid_angle: 1e-4,
            weight: 1.0,
            radiance: Vec3::ZERO,
            distance: 1.0,
            normal: Vec3::ZERO,
            lit: Lit::Dark,
            region: 0,
            beside: None,
            behind: Vec3::ZERO,
        };
        let pixels: Vec<Pixel> = kept.map(pixel).collect();
        let sight = Sight {
            name: String::new(),
            light: 0,
            camera,
            frame,
            runs: Run::all(&pixels),
            pixels,
            levels: Vec::new(),
        };
        let ball = |pixel: usize, radius: f32| Shape::Ball {
            centre: sight.origin() + 3.0 * sight.pixels[pixel].direction,
            radius,
        };
        let balls = [
            (ball(17, 0.05), 0.0),
            (ball(900, 0.4), 0.02),
            (ball(2500, 9.0), 0.1),
        ];
        for (ball, width) in balls {
            let seen = ShapeFrom::new(&ball, sight.origin());
            let numbers: Vec<usize> = sight.near(&seen, width).map(|(i, _)| i).collect();
            let is_near = |(_, pixel): &(usize, &Pixel)| seen.is_near(pixel.direction, width);
            let all = sight.pixels.iter().enumerate().filter(is_near);
            assert_eq!(numbers, all.map(|(i, _)| i).collect::<Vec<_>>());
            assert!(!numbers.is_empty());
        }
    }
}
