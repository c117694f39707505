//! Medians, the upper one of two; 0 of nothing.

use glam::Vec3;

/// Standard deviation of normally distributed values over the median of their absolute deviations.
pub const SIGMA_OF_MAD: f64 = 1.482_602_2;

/// Of values; the order in which they come does not matter.
pub fn median_of(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Of each coordinate of points.
pub fn median(points: &(impl Iterator<Item = Vec3> + Clone)) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|axis| median_of(points.clone().map(|p| p[axis]))))
}

/// Of the distances of points from `centre`.
pub fn median_distance(centre: Vec3, points: impl Iterator<Item = Vec3>) -> f32 {
    median_of(points.map(|p| p.distance(centre)))
}

/// Of values with weights, not negative: up to it lies half of the weight.
pub fn weighted_median(values: impl Iterator<Item = (f32, f32)>) -> f32 {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_in_the_middle_of_values_and_of_weight() {
        assert_eq!(median_of([5.0, 1.0, 3.0].into_iter()), 3.0);
        assert_eq!(median_of([4.0, 1.0, 3.0, 2.0].into_iter()), 3.0);
        assert_eq!(median_of(std::iter::empty()), 0.0);
        let weighted = [(5.0, 0.5), (1.0, 1.0), (3.0, 2.0)];
        assert_eq!(weighted_median(weighted.into_iter()), 3.0);
        assert_eq!(weighted_median([(7.0, 9.0), (1.0, 1.0)].into_iter()), 7.0);
        assert_eq!(weighted_median(std::iter::empty()), 0.0);
    }
}
