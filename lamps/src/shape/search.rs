//! Shapes of least residual: the way down a sum of squares (Levenberg 1944, Marquardt 1963), and
//! the minimum of a function that has no derivative (Nelder and Mead 1965, with the coefficients of
//! that paper).

use crate::shape::Shape;
use crate::shape::change::MAX_CHANGES;
use glam::Vec3;
use nalgebra::{DMatrix, DVector};

/// Spread of values at which a search has arrived.
const ARRIVED: f32 = 1e-5;

/// Evaluations of searches for the place of a shape, and for that in a plane, and their first steps,
/// in sizes of the shape.
const NUM_PLACES: usize = 200;
const NUM_PLACES_IN_PLANE: usize = 60;
const STEP: f32 = 0.2;

/// Damping that a descent begins with, its range, and the factors by which it falls after a step
/// down and grows after one that is none.
const DAMPING: f32 = 0.01;
const DAMPING_RANGE: [f32; 2] = [1e-4, 1e3];
const LESS: f32 = 0.3;
const MORE: f32 = 5.0;
/// Share of the sum by which a step has to go down for another one to follow.
const PAYS: f32 = 1e-3;

/// The shape that a descent of at most `num_steps` steps comes to from `start`, by its first
/// `num_changes` ([`Shape::changed`]). `differences` are as many for every shape; they are compared
/// for shapes that differ by `width`, scene units.
pub(crate) fn descent(
    start: &Shape,
    num_changes: usize,
    num_steps: usize,
    width: f32,
    differences: impl Fn(&Shape) -> Vec<f32>,
) -> Shape {
    let with = |by: &DVector<f32>| {
        let mut all = [0.0; MAX_CHANGES];
        all[..num_changes].copy_from_slice(by.as_slice());
        start.changed(&all)
    };
    let value = |by: &DVector<f32>| DVector::from_vec(differences(&with(by)));
    let small = start.changes_of(width);
    let mut at = DVector::zeros(num_changes);
    let mut here = value(&at);
    let mut damping = DAMPING;
    for _ in 0..num_steps {
        let columns: Vec<DVector<f32>> = (0..num_changes)
            .map(|k| {
                let mut beside = at.clone();
                beside[k] += small[k];
                (value(&beside) - &here) / small[k]
            })
            .collect();
        let jacobian = DMatrix::from_columns(&columns);
        let (square, downhill) = (jacobian.tr_mul(&jacobian), -jacobian.tr_mul(&here));
        let sum = here.norm_squared();
        let mut next = None;
        while next.is_none() && damping <= DAMPING_RANGE[1] {
            let mut damped = square.clone();
            for k in 0..num_changes {
                damped[(k, k)] += damping * square[(k, k)] + f32::MIN_POSITIVE;
            }
            let to = damped.cholesky().map(|c| &at + c.solve(&downhill));
            next = to
                .map(|to| (value(&to), to))
                .filter(|(there, _)| there.norm_squared() < sum);
            damping *= if next.is_some() { LESS } else { MORE };
        }
        let Some((there, to)) = next else { break };
        damping = damping.max(DAMPING_RANGE[0]);
        let pays = there.norm_squared() < (1.0 - PAYS) * sum;
        (here, at) = (there, to);
        if !pays {
            break;
        }
    }
    with(&at)
}

/// The shape about `start` of which `value` is least, by its first `num_changes`
/// ([`Shape::changed`]), and what it is there.
pub(crate) fn best_shape(
    start: &Shape,
    num_changes: usize,
    num_trials: usize,
    value: impl Fn(&Shape) -> f32,
) -> (Shape, f32) {
    let with = |by: &[f32]| {
        let mut all = [0.0; MAX_CHANGES];
        all[..num_changes].copy_from_slice(by);
        start.changed(&all)
    };
    let steps = &start.first_steps()[..num_changes];
    let (by, least) = minimum(|by| value(&with(by)), steps, num_trials);
    (with(&by), least)
}

/// The place about that of `start`, and the turn about its z axis, where `value` is least, and what
/// it is there.
pub(crate) fn best_place(start: &Shape, value: impl Fn(&Shape) -> f32) -> (Shape, f32) {
    let turn = match start {
        Shape::Rectangle(_) | Shape::Ellipse(_) => Some(5),
        Shape::Box { .. } => Some(6),
        Shape::Ball { .. } | Shape::Tube { .. } => None,
    };
    let with = |by: &[f32]| {
        let mut all = [0.0; MAX_CHANGES];
        all[..3].copy_from_slice(&by[..3]);
        if let Some(turn) = turn {
            all[turn] = by[3];
        }
        start.changed(&all)
    };
    let mut steps = vec![STEP; 3];
    steps.extend(turn.map(|turn| start.first_steps()[turn]));
    let (by, least) = minimum(|by| value(&with(by)), &steps, NUM_PLACES);
    (with(&by), least)
}

/// The place in the plane of this normal about that of `start` where `value` is least.
pub(crate) fn best_place_in_plane(
    start: &Shape,
    normal: Vec3,
    value: impl Fn(&Shape) -> f32,
) -> Shape {
    let (along, across) = normal.any_orthonormal_pair();
    let with = |by: &[f32]| {
        let centre = start.centre() + along * by[0] + across * by[1];
        start.placed(centre, start.rotation(), Vec3::ONE)
    };
    let steps = [STEP * start.size().max_element(); 2];
    with(&minimum(|by| value(&with(by)), &steps, NUM_PLACES_IN_PLANE).0)
}

/// Searches from zeros with first steps `steps`, of which there is at least one; returns where
/// `value` is least and what it is there.
pub(crate) fn minimum(
    value: impl Fn(&[f32]) -> f32,
    steps: &[f32],
    num_trials: usize,
) -> (Vec<f32>, f32) {
    let num = steps.len();
    let mut corners: Vec<(Vec<f32>, f32)> = (0..=num)
        .map(|i| {
            let mut at = vec![0.0; num];
            if i > 0 {
                at[i - 1] = steps[i - 1];
            }
            let v = value(&at);
            (at, v)
        })
        .collect();
    for _ in num + 1..num_trials {
        corners.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (best, worst) = (corners[0].1, corners[num].1);
        if worst - best < ARRIVED {
            break;
        }
        let middle: Vec<f32> = (0..num)
            .map(|k| corners[..num].iter().map(|c| c.0[k]).sum::<f32>() / num as f32)
            .collect();
        let along = |factor: f32| {
            let at: Vec<f32> = (middle.iter().zip(&corners[num].0))
                .map(|(m, w)| m + factor * (m - w))
                .collect();
            let v = value(&at);
            (at, v)
        };
        let reflected = along(1.0);
        let new = if reflected.1 < best {
            let farther = along(2.0);
            if farther.1 < reflected.1 {
                farther
            } else {
                reflected
            }
        } else if reflected.1 < corners[num - 1].1 {
            reflected
        } else {
            let nearer = along(if reflected.1 < worst { 0.5 } else { -0.5 });
            if nearer.1 < worst.min(reflected.1) {
                nearer
            } else {
                let first = corners[0].0.clone();
                for corner in &mut corners[1..] {
                    for (x, f) in corner.0.iter_mut().zip(&first) {
                        *x = 0.5 * (*x + f);
                    }
                    corner.1 = value(&corner.0);
                }
                continue;
            }
        };
        corners[num] = new;
    }
    corners.sort_by(|a, b| a.1.total_cmp(&b.1));
    corners.swap_remove(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3};

    /// Differences that vanish for one box alone: where eight of its points are.
    #[test]
    fn a_descent_comes_to_the_shape_without_differences() {
        let corners = |shape: &Shape| -> Vec<f32> {
            let at = |i: u8| {
                let half = |bit: u8| if i & bit == 0 { -0.5 } else { 0.5 };
                let own = shape.size() * Vec3::new(half(1), half(2), half(4));
                (shape.centre() + shape.rotation() * own).to_array()
            };
            (0..8).flat_map(at).collect()
        };
        let shape = |centre: [f32; 3], turn: f32, size: [f32; 3]| Shape::Box {
            centre: centre.into(),
            rotation: Quat::from_rotation_z(turn),
            size: size.into(),
        };
        let wanted = shape([0.3, -0.2, 1.0], 0.4, [0.9, 0.2, 0.1]);
        let target = corners(&wanted);
        let differences = |shape: &Shape| -> Vec<f32> {
            let all = corners(shape);
            all.iter().zip(&target).map(|(a, b)| a - b).collect()
        };
        let start = shape([0.1, 0.1, 1.2], 0.0, [0.6, 0.4, 0.2]);
        for num_changes in [start.num_upright(), start.num_changes()] {
            let found = descent(&start, num_changes, 40, 1e-3, differences);
            // Differences of single precision over steps of a thousandth.
            assert!(found.centre().distance(wanted.centre()) < 1e-3, "{found:?}");
            assert!(found.size().distance(wanted.size()) < 1e-3, "{found:?}");
        }
        // A shape that may not tilt does not.
        let found = descent(&start, start.num_upright(), 40, 1e-3, differences);
        assert_eq!(found.rotation() * Vec3::Z, Vec3::Z);
    }

    /// A narrow curved valley (Rosenbrock) and a bowl in five dimensions.
    #[test]
    fn known_minima_are_found() {
        let valley = |x: &[f32]| {
            let (a, b) = (x[0] - 1.0, x[1] + 1.0);
            (1.0 - a).powi(2) + 100.0 * (b - a * a).powi(2)
        };
        let (at, v) = minimum(valley, &[0.5, 0.5], 2000);
        assert!(v < 1e-3, "{at:?} {v}");
        let bowl = |x: &[f32]| (0..5).map(|i| (x[i] - 0.1 * i as f32).powi(2)).sum::<f32>();
        let (at, v) = minimum(bowl, &[0.3; 5], 1000);
        assert!(v < 1e-3, "{at:?} {v}");
    }
}
