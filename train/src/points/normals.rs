//! Normals of the points of a cloud, from the planes that their neighbours lie in.
//!
//! A few neighbours tell the plane of a cloud without noise, a hundred that of one whose points are
//! half their distance off: the fewest that tell it well enough are taken, so that normals of small
//! things and near edges remain. Points of another surface count less the farther off they are.

use eagpt_scene::median::{SIGMA_OF_MAD, median_of};
use eagpt_scene::plane::FittedPlane;
use glam::Vec3;

/// Numbers of neighbours that are tried, the point itself among them, ascending.
const NUM_NEIGHBOURS: [usize; 4] = [12, 25, 50, 100];
/// Neighbours that are asked for.
pub(super) const MOST_NEIGHBOURS: usize = NUM_NEIGHBOURS[3];
/// Points off a plane, root mean square, in parts of their extent along its shorter side: what is
/// thicker has no normal.
const THICKEST: f64 = 0.2;
/// Error of a normal that is small enough, radians: one degree.
const PRECISE: f64 = 0.0175;
/// Rounds of a fit after the first.
const ROUNDS: usize = 3;
/// Distance from the plane at which a point counts half, in standard deviations.
const HALF: f32 = 2.0;
/// A point farther than so many standard deviations from the plane does not lie in it.
const OFF: f32 = 3.0;
/// Least standard deviation in distances of the farthest point: that of a cloud without noise is
/// rounding.
const LEAST_DEVIATION: f32 = 1e-3;

/// The plane of a point by its neighbours, nearest first, of which it is the first itself: the place
/// in the plane nearest to it, and the unit normal, of either sign. `None` where they lie in no
/// plane, or it is off theirs.
pub(super) fn plane(near: &[Vec3]) -> Option<(Vec3, Vec3)> {
    let mut found = None;
    for num in NUM_NEIGHBOURS.map(|num| num.min(near.len())) {
        let (own, ratio) = fitted(&near[..num])?;
        found = own;
        if found.is_some() && ratio <= PRECISE * (num as f64).sqrt() {
            break;
        }
    }
    found
}

/// The plane of the first of some points, if all lie in one, and how thick they are in their extent.
fn fitted(points: &[Vec3]) -> Option<(Option<(Vec3, Vec3)>, f64)> {
    let mut fit = FittedPlane::through(points.iter().copied());
    let least = LEAST_DEVIATION * points[0].distance(points[points.len() - 1]);
    let mut deviation = least;
    for _ in 0..ROUNDS {
        let (normal, centre) = (fit.normal?, fit.centre);
        let off = |point: &Vec3| normal.dot(*point - centre).abs();
        deviation = least.max(SIGMA_OF_MAD as f32 * median_of(points.iter().map(off)));
        let half = HALF * deviation;
        let weight = |point: &Vec3| f64::from(1.0 + (off(point) / half).powi(2)).recip();
        fit = FittedPlane::weighted(points.iter().map(|point| (*point, weight(point))));
    }
    let normal = fit.normal?;
    let [thickness, side, _] = fit.variances;
    // Rounding may make the thickness of a perfect plane negative.
    let ratio = (thickness.max(0.0) / side).sqrt();
    let height = normal.dot(points[0] - fit.centre);
    let is_in = height.abs() <= OFF * deviation;
    let place = points[0] - height * normal;
    Some((
        (ratio <= THICKEST && is_in).then_some((place, normal)),
        ratio,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};

    /// The nearest of the points of two walls that meet at a right angle, a point every unit or so,
    /// `noise` off (root mean square) along its normal, to the point of the floor at that place.
    fn near(at: Vec3, noise: f32) -> Vec<Vec3> {
        let key = RandomKey::new(1, Purpose::Initialise, 7);
        let mut points: Vec<Vec3> = (0..2000)
            .map(|i| {
                let [a, b, off, which] = key.stream(i, 0).next_uniforms();
                let off = (off - 0.5) * 12.0_f32.sqrt() * noise;
                let (a, b) = (32.0 * a, 32.0 * (b - 0.5));
                match which < 0.5 {
                    true => Vec3::new(a, b, off),
                    false => Vec3::new(off, b, a),
                }
            })
            .collect();
        points.sort_by(|a, b| a.distance_squared(at).total_cmp(&b.distance_squared(at)));
        let first = points.iter().position(|p| p.x > p.z).unwrap_or(0);
        points.drain(..first);
        points.truncate(MOST_NEIGHBOURS);
        points
    }

    #[test]
    fn noisy_points_have_normals_by_many_neighbours() {
        for (noise, most) in [(0.0, 0.1), (0.1, 1.5), (0.5, 4.0)] {
            let points = near(Vec3::new(20.0, 0.0, 0.0), noise);
            let (place, normal) = plane(&points).unwrap();
            let error = normal.z.abs().min(1.0).acos().to_degrees();
            assert!(error <= most, "{noise}: {error}");
            assert!(place.z.abs() <= 0.4 * noise + 1e-4, "{noise}: {place}");
        }
        // Ten neighbours of the noisiest do not tell it.
        let few = &near(Vec3::new(20.0, 0.0, 0.0), 0.5)[..10];
        assert_eq!(plane(few), None);
    }

    #[test]
    fn points_of_a_perfect_plane_have_its_normal() {
        let key = RandomKey::new(1, Purpose::Initialise, 10);
        for wall in 0..200 {
            let [height, ..] = key.stream(wall, 0).next_uniforms();
            let place = |i| {
                let [x, y, ..] = key.stream(100 * wall + i, 1).next_uniforms();
                Vec3::new(x, y, height)
            };
            let mut points: Vec<Vec3> = (0..100).map(place).collect();
            let at = points[0];
            points.sort_by(|a, b| a.distance_squared(at).total_cmp(&b.distance_squared(at)));
            let found = plane(&points).map(|(place, normal)| (place, normal.z.abs()));
            assert_eq!(found, Some((at, 1.0)));
        }
    }

    #[test]
    fn points_by_an_edge_have_the_normal_of_their_side_or_none() {
        for x in [0.5, 1.0, 2.0, 4.0] {
            let points = near(Vec3::new(x, 0.0, 0.0), 0.05);
            let own = plane(&points);
            assert!(own.is_none_or(|(_, n)| n.z.abs() > 0.95), "{x}: {own:?}");
        }
        assert!(plane(&near(Vec3::new(4.0, 0.0, 0.0), 0.05)).is_some());
    }

    #[test]
    fn points_of_a_ball_of_leaves_have_none() {
        let key = RandomKey::new(1, Purpose::Initialise, 8);
        let leaf = |i| Vec3::from_slice(&key.stream(i, 0).next_uniforms()[..3]);
        let leaves: Vec<Vec3> = (0..100).map(leaf).collect();
        assert_eq!(plane(&leaves), None);
        assert_eq!(plane(&leaves[..1]), None);
    }
}
