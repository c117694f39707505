//! More Gaussians where the pictures are wrong, none where nobody sees them.
//!
//! The paper's number of Gaussians is fixed, and they stay where the point cloud was: too few at
//! fine detail, many behind surfaces. Here a run begins with a part of them and now and then splits
//! those that the training views' errors belong to (Rota Bulò, Porzi and Kontschieder 2024,
//! "Revising Densification in Gaussian Splatting": a Gaussian's share of an error is its blending
//! weight). Gaussians that no view sees are put to the same use. All of it follows from the scene
//! and the views; nothing but the parameters has to be remembered between two times.

use crate::params::ParameterState;
use eagpt_scene::Gaussians;
use eagpt_trace::blend::Contribution;

/// A Gaussian whose weight exceeds this in no pixel of any view is not needed where it is.
const MIN_WEIGHT: f32 = 0.02;
/// A Gaussian that fills fewer pixels than this in every view is as small as the views can tell.
const MIN_PIXELS: f32 = 3.0;
/// Standard deviations between the middle of a Gaussian and those of its halves, along the longer
/// axis …
const OFFSET: f32 = 0.7;
/// … which become this times as long: `0.7² + 0.7² ≈ 1` keeps the spread of the whole.
const SHRINK: f32 = 0.7;

/// Errors and visibility of the Gaussians in all training views.
#[derive(Debug, Clone, Default)]
pub(crate) struct Attribution {
    /// Largest weight in a pixel, `[n]`.
    largest_weight: Vec<f32>,
    /// Most pixels filled in one view, `[n]`.
    pixels: Vec<f32>,
    /// Error of all pixels of all views times the weights, `[n]`.
    error: Vec<f64>,
    /// Pixels filled in the current view, `[n]`; all zero in between.
    view_pixels: Vec<f32>,
}

/// Result of a densification.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Densified {
    /// Gaussians that nobody saw, put elsewhere.
    pub num_moved: usize,
    /// Gaussians now.
    pub num_gaussians: usize,
}

impl Attribution {
    /// No view yet; for `n` Gaussians.
    pub(crate) fn new(n: usize) -> Self {
        Self {
            largest_weight: vec![0.0; n],
            pixels: vec![0.0; n],
            error: vec![0.0; n],
            view_pixels: vec![0.0; n],
        }
    }

    /// Adds one view; the values of `contributions` are the errors of its pixels.
    pub(crate) fn add(&mut self, contributions: &[Contribution]) {
        for c in contributions {
            let i = c.gaussian as usize;
            self.largest_weight[i] = self.largest_weight[i].max(c.largest_weight);
            self.error[i] += f64::from(c.weighted_value);
            self.view_pixels[i] += c.weight;
        }
        for c in contributions {
            let i = c.gaussian as usize;
            self.pixels[i] = self.pixels[i].max(self.view_pixels[i]);
            self.view_pixels[i] = 0.0;
        }
    }
}

/// Splits Gaussians of `state` in two, those with the most error first, until there are `target` of
/// them and those that no view sees are used up. `gaussians` are the activated values of `state`.
/// Those that are fixed count, and stay as they are.
pub(crate) fn densify(
    state: &mut ParameterState,
    gaussians: &Gaussians,
    seen: &Attribution,
    target: usize,
) -> Densified {
    let n = state.len();
    let num_moving = state.num_moving();
    let unseen: Vec<usize> = (0..num_moving)
        .filter(|&i| seen.largest_weight[i] < MIN_WEIGHT)
        .collect();
    let mut worth: Vec<usize> = (0..num_moving)
        .filter(|&i| seen.largest_weight[i] >= MIN_WEIGHT && seen.pixels[i] >= MIN_PIXELS)
        .collect();
    worth.sort_by(|&a, &b| seen.error[b].total_cmp(&seen.error[a]).then(a.cmp(&b)));
    let places = unseen.iter().copied().chain(n..n.max(target));
    let mut num_moved = 0;
    for (&parent, place) in worth.iter().zip(places) {
        let whole = gaussians.get(parent);
        let (axis, along) = if whole.scale.x >= whole.scale.y {
            (0, glam::Vec3::X)
        } else {
            (1, glam::Vec3::Y)
        };
        let step = whole.rotation * along * (OFFSET * whole.scale[axis]);
        state.split(parent, place, axis, step, SHRINK);
        num_moved += usize::from(place < n);
    }
    state.put_fixed_last(num_moving);
    Densified {
        num_moved,
        num_gaussians: state.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::{Gaussian, Gloss, Harmonics};
    use glam::{Quat, Vec2, Vec3};

    fn row(n: usize) -> Gaussians {
        (0..n)
            .map(|i| Gaussian {
                position: Vec3::new(i as f32, 0.0, 0.0),
                scale: Vec2::new(0.1, 0.4),
                rotation: Quat::from_rotation_z(0.5),
                opacity: 0.5,
                radiance: Vec3::splat(1.0 + i as f32),
                harmonics: Harmonics::NONE,
                gloss: Gloss::NONE,
                emission: 0.1,
                albedo: Vec3::splat(0.5),
            })
            .collect()
    }

    fn seen(gaussian: u32, weight: f32, error: f32, largest_weight: f32) -> Contribution {
        Contribution {
            gaussian,
            weight,
            weighted_value: error,
            largest_weight,
            pixel: 0,
        }
    }

    #[test]
    fn the_worst_are_split_and_the_unseen_are_used_up() {
        let before = row(5);
        let mut state = ParameterState::new(&before);
        let mut attribution = Attribution::new(5);
        // Errors of two views add; pixels of two tiles of a view add, those of two views do not.
        attribution.add(&[
            seen(0, 9.0, 1.0, 0.9),
            seen(1, 2.0, 4.0, 0.9),
            seen(1, 2.0, 4.0, 0.9),
            seen(3, 2.0, 50.0, 0.9),
            seen(4, 9.0, 2.0, 0.9),
        ]);
        attribution.add(&[
            seen(2, 0.1, 0.1, 0.01),
            seen(3, 2.0, 50.0, 0.9),
            seen(4, 9.0, 3.0, 0.5),
        ]);
        let outcome = densify(&mut state, &before, &attribution, 6);
        let expected = Densified {
            num_moved: 1,
            num_gaussians: 6,
        };
        assert_eq!(outcome, expected);
        // 3 has the most error but is too small to split; then come 1 (8), whose half replaces 2,
        // which nobody sees, and 4 (5).
        let after = state.gaussians();
        for (parent, place) in [(1, 2), (4, 5)] {
            let (whole, one, other) = (before.get(parent), after.get(parent), after.get(place));
            assert!(((one.position + other.position) / 2.0 - whole.position).length() < 1e-6);
            let apart = (one.position - other.position).length();
            assert!((apart - 2.0 * OFFSET * 0.4).abs() < 1e-6);
            for half in [one, other] {
                assert!((half.scale - Vec2::new(0.1, 0.4 * SHRINK)).length() < 1e-6);
                assert!((half.radiance - whole.radiance).length() < 1e-5);
            }
        }
        for kept in [0, 3] {
            assert_eq!(
                after.get(kept),
                ParameterState::new(&before).gaussians().get(kept)
            );
        }
    }

    #[test]
    fn what_is_fixed_is_neither_split_nor_used_up_and_stays_last() {
        let before = row(4);
        let mut state = ParameterState::new(&before);
        state.num_fixed = 2;
        let mut attribution = Attribution::new(4);
        // Of the fixed ones, one has the most error, and nobody sees the other.
        attribution.add(&[
            seen(0, 9.0, 1.0, 0.9),
            seen(1, 9.0, 2.0, 0.9),
            seen(2, 9.0, 50.0, 0.9),
        ]);
        let fixed = [2, 3].map(|i| state.raw.values[i]);
        let outcome = densify(&mut state, &before, &attribution, 6);
        let expected = Densified {
            num_moved: 0,
            num_gaussians: 6,
        };
        assert_eq!(outcome, expected);
        assert_eq!(state.raw.values[4..], fixed);
        let after = state.gaussians();
        for (parent, half) in [(1, 2), (0, 3)] {
            let middle = (after.positions[parent] + after.positions[half]) / 2.0;
            assert!((middle - before.positions[parent]).length() < 1e-6);
        }
    }

    #[test]
    fn nothing_happens_where_nothing_was_seen() {
        let before = row(3);
        let mut state = ParameterState::new(&before);
        let outcome = densify(&mut state, &before, &Attribution::new(3), 10);
        assert_eq!((outcome.num_moved, outcome.num_gaussians), (0, 3));
    }
}
