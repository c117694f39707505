//! Directions at random.

use glam::Vec3;
use std::f32::consts::TAU;

/// A direction about the unit `normal` with density cos θ / π, from two uniform numbers in [0, 1)
/// (Malley's method).
pub fn cosine_direction(normal: Vec3, a: f32, b: f32) -> Vec3 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let radius = a.sqrt();
    let (sin, cos) = (TAU * b).sin_cos();
    // 1 − a is exact for 24-bit uniforms and never 0: directions stay above the surface.
    (tangent * (radius * cos) + bitangent * (radius * sin) + normal * (1.0 - a).sqrt()).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};

    /// Chi-square of the sampled directions against the density, in cells of equal probability.
    #[test]
    fn directions_follow_the_cosine() {
        const RINGS: usize = 8;
        const SECTORS: usize = 8;
        let num = 64_000_u32;
        for normal in [
            Vec3::Z,
            Vec3::new(-0.3, 0.8, -0.52).normalize(),
            Vec3::NEG_Z,
        ] {
            let (tangent, bitangent) = normal.any_orthonormal_pair();
            let key = RandomKey::new(5, Purpose::Render, 0);
            let mut counts = [0_u32; RINGS * SECTORS];
            for i in 0..num {
                let [a, b, ..] = key.stream(i, 0).next_uniforms();
                let d = cosine_direction(normal, a, b);
                assert!((d.length() - 1.0).abs() < 1e-5 && d.dot(normal) > 0.0);
                // sin²θ is uniform for cosine-weighted directions, and so is the azimuth.
                let ring = ((1.0 - d.dot(normal).powi(2)) * RINGS as f32) as usize;
                let azimuth = d.dot(bitangent).atan2(d.dot(tangent)) / TAU;
                let sector = (azimuth.rem_euclid(1.0) * SECTORS as f32) as usize;
                counts[ring.min(RINGS - 1) * SECTORS + sector.min(SECTORS - 1)] += 1;
            }
            let expected = f64::from(num) / (RINGS * SECTORS) as f64;
            let chi2: f64 = counts
                .iter()
                .map(|&c| (f64::from(c) - expected).powi(2) / expected)
                .sum();
            // 63 degrees of freedom: mean 63, sd 11.2; the bound is five sd up.
            assert!(chi2 < 120.0, "chi-square {chi2} for normal {normal}");
        }
    }
}
