//! Small statistics and the eigenvectors of a symmetric matrix.

use glam::DVec3;
use nalgebra::Matrix3;

/// The median; 0 if empty.
pub(super) fn median(values: Vec<f64>) -> f64 {
    quantile(values, 0.5)
}

/// The value below which a share of the values lies; 0 if empty.
pub(super) fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as f64 * share).round() as usize;
    let (_, value, _) = values.select_nth_unstable_by(at, f64::total_cmp);
    *value
}

/// Distance from the 5th to the 95th percentile.
pub(super) fn spread(values: Vec<f64>) -> f64 {
    quantile(values.clone(), 0.95) - quantile(values, 0.05)
}

/// Twice the distance from the median point within which nine tenths of the points lie.
pub(super) fn size(points: &[DVec3]) -> f64 {
    let along = |axis: usize| median(points.iter().map(|p| p[axis]).collect());
    let centre = DVec3::new(along(0), along(1), along(2));
    2.0 * quantile(points.iter().map(|p| (*p - centre).length()).collect(), 0.9)
}

/// Eigenvalues of Σ w v vᵀ in ascending order with their unit vectors.
pub(super) fn eigen(weighted: impl Iterator<Item = (f64, DVec3)>) -> [(f64, DVec3); 3] {
    let mut matrix = Matrix3::zeros();
    for (weight, v) in weighted {
        let v = nalgebra::Vector3::new(v.x, v.y, v.z);
        matrix += weight * v * v.transpose();
    }
    let decomposed = matrix.symmetric_eigen();
    let mut pairs = [0, 1, 2].map(|i| {
        let v = decomposed.eigenvectors.column(i);
        (decomposed.eigenvalues[i], DVec3::new(v[0], v[1], v[2]))
    });
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs
}

/// Two unit vectors that make a right-handed frame with `normal`.
pub(super) fn tangents(normal: DVec3) -> [DVec3; 2] {
    let (a, b) = normal.any_orthonormal_pair();
    [a, b]
}

/// At most `max` items, evenly taken.
pub(super) fn thinned<T: Copy>(items: &[T], max: usize) -> Vec<T> {
    let step = items.len().div_ceil(max).max(1);
    items.iter().copied().step_by(step).collect()
}
