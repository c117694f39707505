//! Where rays from one point meet a shape.

use crate::shape::{Flat, Shape};
use glam::{Mat3, Vec3};

/// Rays along each axis of a pixel.
pub(crate) const RAYS: u32 = 3;
/// Unit directions of the rays of a pixel, row by row.
pub(crate) type PixelRays = [Vec3; (RAYS * RAYS) as usize];

/// Which of these are in the corners, the others, and the one in the middle.
const CORNERS: [usize; 4] = [0, 2, 6, 8];
const OTHERS: [usize; 5] = [1, 3, 4, 5, 7];
const MIDDLE: usize = 4;

/// A shape as a point sees it.
pub(crate) struct ShapeFrom<'a> {
    shape: &'a Shape,
    /// The shape's axes from those of the world.
    own: Mat3,
    /// The point, along the shape's axes from its middle.
    origin: Vec3,
    /// From the point to the middle.
    to_centre: Vec3,
    /// Radius of a ball about the middle that has the shape in it.
    radius: f32,
}

impl<'a> ShapeFrom<'a> {
    pub(crate) fn new(shape: &'a Shape, origin: Vec3) -> Self {
        let own = Mat3::from_quat(shape.rotation().conjugate());
        let to_centre = shape.centre() - origin;
        Self {
            shape,
            own,
            origin: own * -to_centre,
            to_centre,
            radius: 0.5 * shape.size().length(),
        }
    }

    /// Distance along a ray of unit `direction` to the shape's first point, if it is met; a flat
    /// shape only from the side of its normal.
    pub(crate) fn meet(&self, direction: Vec3) -> Option<f32> {
        let (o, d) = (self.origin, self.own * direction);
        match *self.shape {
            Shape::Rectangle(flat) => {
                let (t, [x, y]) = meet_plane(&flat, o, d)?;
                (x.abs() <= 1.0 && y.abs() <= 1.0).then_some(t)
            }
            Shape::Ellipse(flat) => {
                let (t, [x, y]) = meet_plane(&flat, o, d)?;
                (x * x + y * y <= 1.0).then_some(t)
            }
            Shape::Ball { radius, .. } => {
                let along = self.to_centre.dot(direction);
                let short = radius * radius - self.off(direction);
                (short >= 0.0 && along > 0.0).then(|| along - short.sqrt())
            }
            Shape::Tube {
                radius,
                length,
                taper,
                ..
            } => meet_tube(o, d, radius, 0.5 * length, taper),
            Shape::Box { size, .. } => meet_box(o, d, 0.5 * size),
        }
    }

    /// Part of a pixel's rays that meet the shape, and the farthest place where they do.
    pub(crate) fn cover(&self, rays: &PixelRays) -> (f32, f32) {
        let width = rays[CORNERS[0]].distance(rays[MIDDLE]);
        let reach = self.radius + width * (self.to_centre.length() + self.radius);
        if self.off(rays[MIDDLE]) > reach * reach {
            return (0.0, 0.0);
        }
        // All shapes are convex: what all corners meet, the others do as well, and not farther.
        let corners = CORNERS.map(|i| self.meet(rays[i]));
        if let [Some(a), Some(b), Some(c), Some(d)] = corners {
            return (1.0, a.max(b).max(c).max(d));
        }
        let others = OTHERS.map(|i| self.meet(rays[i]));
        let (mut met, mut farthest) = (0, 0.0_f32);
        for distance in corners.into_iter().chain(others).flatten() {
            met += 1;
            farthest = farthest.max(distance);
        }
        (met as f32 / rays.len() as f32, farthest)
    }

    /// Squared distance of the middle from the line of a ray.
    fn off(&self, direction: Vec3) -> f32 {
        let along = self.to_centre.dot(direction);
        (self.to_centre - direction * along).length_squared()
    }
}

/// Distance to the plane of `flat`, met against its normal, and where, in half sizes.
fn meet_plane(flat: &Flat, o: Vec3, d: Vec3) -> Option<(f32, [f32; 2])> {
    if d.z >= 0.0 || o.z <= 0.0 {
        return None;
    }
    let t = -o.z / d.z;
    let [width, height] = flat.size;
    let place = [
        2.0 * (o.x + t * d.x) / width,
        2.0 * (o.y + t * d.y) / height,
    ];
    Some((t, place))
}

/// Distance to a box of half its lengths `half` about the origin, from outside.
fn meet_box(o: Vec3, d: Vec3, half: Vec3) -> Option<f32> {
    // Along an axis that the ray does not go the planes are at infinity, on either side of it.
    let (a, b) = ((-half - o) / d, (half - o) / d);
    let (enters, leaves) = (a.min(b).max_element(), a.max(b).min_element());
    (enters <= leaves && enters > 0.0).then_some(enters)
}

/// Distance to a closed cone about z of half its length `half`, from outside; its radius is
/// `radius · (1 + taper · z / half)`.
fn meet_tube(o: Vec3, d: Vec3, radius: f32, half: f32, taper: f32) -> Option<f32> {
    let slope = radius * taper / half;
    let mut nearest: Option<f32> = None;
    let mut add = |t: f32| nearest = Some(nearest.map_or(t, |n| n.min(t)));
    // x² + y² = (radius + slope z)² along the ray.
    let (r, dr) = (radius + slope * o.z, slope * d.z);
    let a = d.x * d.x + d.y * d.y - dr * dr;
    let b = o.x * d.x + o.y * d.y - r * dr;
    let c = o.x * o.x + o.y * o.y - r * r;
    let discriminant = b * b - a * c;
    if discriminant >= 0.0 && a != 0.0 {
        for root in [-discriminant.sqrt(), discriminant.sqrt()] {
            let t = (-b + root) / a;
            if t > 0.0 && (o.z + t * d.z).abs() <= half {
                add(t);
            }
        }
    }
    if d.z != 0.0 {
        for end in [-half, half] {
            let t = (end - o.z) / d.z;
            let (at, radius) = (o + d * t, radius + slope * end);
            if t > 0.0 && at.x * at.x + at.y * at.y <= radius * radius {
                add(t);
            }
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use std::f32::consts::PI;

    /// Whole rows of pixels across shapes: as many rays of each are met as one by one.
    #[test]
    fn what_a_pixel_shows_is_what_its_rays_meet() {
        let rotation = Quat::from_scaled_axis(Vec3::new(0.4, -0.2, 0.3));
        let (centre, size) = (Vec3::new(0.02, -0.01, 1.0), [0.5, 0.3]);
        let flat = Flat {
            centre,
            // Towards the point that sees it.
            rotation: rotation * Quat::from_rotation_x(PI),
            size,
        };
        let tube = Shape::Tube {
            centre,
            rotation,
            radius: 0.2,
            length: 0.4,
            taper: -0.3,
        };
        let ball = Shape::Ball {
            centre,
            radius: 0.25,
        };
        let cuboid = Shape::Box {
            centre,
            rotation,
            size: Vec3::new(0.3, 0.4, 0.35),
        };
        for shape in [
            Shape::Rectangle(flat),
            Shape::Ellipse(flat),
            tube,
            ball,
            cuboid,
        ] {
            let seen = ShapeFrom::new(&shape, Vec3::ZERO);
            let mut nums = [0; 3];
            for i in 0..4096 {
                let (x, y) = ((i % 64) as f32 - 32.0, (i / 64) as f32 - 32.0);
                let rays: PixelRays = std::array::from_fn(|k| {
                    let (dx, dy) = ((k % 3) as f32 / 3.0, (k / 3) as f32 / 3.0);
                    Vec3::new(0.02 * (x + dx), 0.02 * (y + dy), 1.0).normalize()
                });
                let met: Vec<f32> = rays.iter().filter_map(|ray| seen.meet(*ray)).collect();
                let (share, farthest) = seen.cover(&rays);
                assert_eq!(share, met.len() as f32 / 9.0, "{shape:?} {x} {y}");
                // The distance is convex, or of a plane all but straight, between the corners.
                let all = met.iter().copied().fold(0.0, f32::max);
                assert!((farthest - all).abs() <= 1e-3 * all, "{farthest} {all}");
                nums[usize::from(share > 0.0) + usize::from(share == 1.0)] += 1;
            }
            assert!(nums.iter().all(|num| *num > 50), "{nums:?}");
        }
    }
}
