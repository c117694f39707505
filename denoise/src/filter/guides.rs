//! Distance between the surfaces of two pixels.

use super::{Grid, Settings};
use crate::frame::Frame;

/// Half the window searched for similar pixels.
const NEAR: i32 = 2;
/// Least number of similar pixels.
const MIN_ALIKE: usize = 6;
/// Share of the distance to the next pixel by which a surface may always be off its plane: surfaces
/// of Gaussians are rough.
const ROUGHNESS: f32 = 0.5;

/// Noise-free guide values of a pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct Guide {
    pub(super) position: [f32; 3],
    pub(super) normal: [f32; 3],
    /// Share of the pixel that reflects; 0: the pixel carries no information.
    pub(super) coverage: f32,
    /// Square of the distance from the plane that is always allowed, in units of `plane²`.
    slack: f32,
    /// At most 1: less where no pixel around is similar, as at the edge of a leaf.
    strictness: f32,
}

/// Guide values of all pixels.
pub(super) struct Guides {
    pub(super) grid: Grid,
    pub(super) pixels: Vec<Guide>,
    plane: f32,
    per_normal: f32,
}

impl Guides {
    pub(super) fn new(frame: &Frame, settings: &Settings) -> Self {
        let (width, height) = frame.reflected.size();
        let grid = Grid {
            width: width as i32,
            height: height as i32,
        };
        let pixels = (0..frame.coverage.pixels().len()).map(|i| Guide {
            position: frame.position.pixels()[i],
            normal: frame.normal.pixels()[i],
            coverage: frame.coverage.pixels()[i][0],
            slack: 0.0,
            strictness: 1.0,
        });
        let mut guides = Self {
            grid,
            pixels: pixels.collect(),
            plane: settings.plane.powi(2),
            per_normal: settings.normal.powi(-2),
        };
        let slack = grid.map(|x, y| guides.slack(x, y));
        for (pixel, slack) in guides.pixels.iter_mut().zip(slack) {
            pixel.slack = slack;
        }
        let strictness = grid.map(|x, y| guides.strictness(x, y));
        for (pixel, strictness) in guides.pixels.iter_mut().zip(strictness) {
            pixel.strictness = strictness;
        }
        guides
    }

    /// Dissimilarity of `other` and `center`, as the exponent of a Gaussian weight: 0 is equal.
    #[inline(always)]
    pub(super) fn distance(&self, center: &Guide, other: &Guide) -> f32 {
        let offset = difference(other.position, center.position);
        let height = dot(offset, center.normal);
        let turn = difference(other.normal, center.normal);
        let off_plane =
            height * height / (self.plane * dot(offset, offset) + center.slack + f32::MIN_POSITIVE);
        (off_plane + dot(turn, turn) * self.per_normal) * center.strictness
    }

    /// Weighted means of `values` over the similar pixels around each.
    pub(super) fn blurred(&self, values: &[f32]) -> Vec<f32> {
        const RADIUS: i32 = 3;
        self.grid.map(|x, y| {
            let center = &self.pixels[self.grid.index(x, y)];
            let (mut sum, mut weights) = (0.0, 0.0);
            for (u, v) in self.grid.window(x, y, RADIUS) {
                let i = self.grid.index(u, v);
                let weight = self.weight(center, &self.pixels[i], 0.0);
                sum += weight * values[i];
                weights += weight;
            }
            if weights > 0.0 { sum / weights } else { 0.0 }
        })
    }

    /// Weight of `other` by its distance plus another exponent.
    #[inline(always)]
    pub(super) fn weight(&self, center: &Guide, other: &Guide, more: f32) -> f32 {
        other.coverage * falloff(self.distance(center, other) + more)
    }

    fn slack(&self, x: i32, y: i32) -> f32 {
        let here = self.pixels[self.grid.index(x, y)];
        let beside = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
        let squares = beside
            .into_iter()
            .filter(|&(u, v)| {
                (0..self.grid.width).contains(&u) && (0..self.grid.height).contains(&v)
            })
            .map(|(u, v)| self.pixels[self.grid.index(u, v)])
            .filter(|there| there.coverage > 0.0)
            .map(|there| {
                let offset = difference(there.position, here.position);
                dot(offset, offset)
            });
        let nearest = squares.fold(f32::INFINITY, f32::min);
        if nearest.is_finite() {
            ROUGHNESS * ROUGHNESS * nearest
        } else {
            0.0
        }
    }

    fn strictness(&self, x: i32, y: i32) -> f32 {
        let here = self.grid.index(x, y);
        let mut distances: Vec<f32> = self
            .grid
            .window(x, y, NEAR)
            .map(|(u, v)| self.grid.index(u, v))
            .filter(|&i| i != here && self.pixels[i].coverage > 0.0)
            .map(|i| self.distance(&self.pixels[here], &self.pixels[i]))
            .collect();
        distances.sort_by(f32::total_cmp);
        let far = distances.len().min(MIN_ALIKE);
        far.checked_sub(1)
            .map_or(1.0, |last| 1.0 / distances[last].max(1.0))
    }
}

/// Close to `exp(−e)`, and 0 from 8 on: (1 − e/8)⁸.
#[inline(always)]
pub(super) fn falloff(e: f32) -> f32 {
    let one = (1.0 - e * 0.125).max(0.0);
    let two = one * one;
    let four = two * two;
    four * four
}

#[inline(always)]
pub(super) fn difference(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
