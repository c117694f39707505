//! Medians, the upper one of two; 0 of nothing.

use glam::Vec3;

pub(crate) fn median_of(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    values.sort_unstable_by(f32::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Of each coordinate.
pub(crate) fn median(points: &(impl Iterator<Item = Vec3> + Clone)) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|axis| median_of(points.clone().map(|p| p[axis]))))
}

pub(crate) fn median_distance(centre: Vec3, points: impl Iterator<Item = Vec3>) -> f32 {
    median_of(points.map(|p| p.distance(centre)))
}

/// Of values with weights.
pub(crate) fn weighted_median(values: impl Iterator<Item = (f32, f32)>) -> f32 {
    let mut values: Vec<(f32, f32)> = values.collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|v| v.1).sum::<f32>();
    let mut sum = 0.0;
    for (value, weight) in &values {
        sum += weight;
        if sum >= half {
            return *value;
        }
    }
    values.last().map_or(0.0, |v| v.0)
}
