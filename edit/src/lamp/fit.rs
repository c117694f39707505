//! Robust least squares on a few parameters.

use glam::DVec3;
use nalgebra::{SMatrix, SVector};

/// Steps of a fit; distances beyond so many medians count less (Huber).
const NUM_STEPS: usize = 30;
const HUBER: f64 = 1.5;
/// Largest median distance of a surface from what it stands for, in radii.
const MAX_DISTANCE: f64 = 0.2;

/// Value below which a share of the weight lies.
pub(super) fn quantile(values: impl Iterator<Item = (f64, f64)>, share: f64) -> f64 {
    let mut sorted: Vec<(f64, f64)> = values.collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let end = share * sorted.iter().map(|v| v.1).sum::<f64>();
    let mut sum = 0.0;
    let found = sorted.iter().find(|(_, weight)| {
        sum += weight;
        sum >= end
    });
    found.or(sorted.last()).map_or(0.0, |v| v.0)
}

/// The point that lines pass closest (least squares), of a point, a unit direction and a weight for
/// each; `None` where they are parallel.
pub(super) fn crossing<const N: usize>(
    lines: impl Iterator<Item = (SVector<f64, N>, SVector<f64, N>, f64)>,
) -> Option<SVector<f64, N>> {
    let (mut matrix, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::zeros());
    for (point, direction, weight) in lines {
        let across = (SMatrix::identity() - direction * direction.transpose()) * weight;
        matrix += across;
        right += across * point;
    }
    Some(matrix.cholesky()?.solve(&right))
}

/// The result of [`fit`].
pub(super) struct Fitted<const N: usize> {
    pub(super) parameters: SVector<f64, N>,
    /// Median distance of the points.
    distance: f64,
}

impl<const N: usize> Fitted<N> {
    /// Whether the points lie on the surface, as far as one of this radius says it.
    pub(super) fn is_near(&self, radius: f64) -> bool {
        radius > 0.0 && self.distance <= MAX_DISTANCE * radius
    }
}

/// Gauss–Newton steps on the distances of points from a surface, which come with their derivatives
/// by its parameters; far ones count less (Huber, "Robust Estimation of a Location Parameter",
/// 1964). `None` where the points do not determine the parameters.
pub(super) fn fit<const N: usize>(
    start: SVector<f64, N>,
    points: &(impl Iterator<Item = (DVec3, f64)> + Clone),
    distance: impl Fn(&SVector<f64, N>, DVec3) -> (f64, SVector<f64, N>),
) -> Option<Fitted<N>> {
    let mut parameters = start;
    let median = |parameters: &SVector<f64, N>| {
        let far = points
            .clone()
            .map(|(point, weight)| (distance(parameters, point).0.abs(), weight));
        quantile(far, 0.5)
    };
    for _ in 0..NUM_STEPS {
        let limit = HUBER * median(&parameters).max(f64::MIN_POSITIVE);
        let (mut matrix, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::zeros());
        for (point, weight) in points.clone() {
            let (far, slope) = distance(&parameters, point);
            let weight = weight * (limit / far.abs().max(limit));
            matrix += slope * slope.transpose() * weight;
            right -= slope * (far * weight);
        }
        parameters += matrix.cholesky()?.solve(&right);
    }
    let distance = median(&parameters);
    distance.is_finite().then_some(Fitted {
        parameters,
        distance,
    })
}
