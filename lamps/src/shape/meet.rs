//! Where rays from one point meet a shape.

#[cfg(test)]
mod tests;

use crate::shape::{Flat, Shape};
use eagpt_scene::camera::RayFrame;
use glam::{Mat3, Vec3};

/// Rays of a pixel.
const NUM: usize = 16;
/// Their places in it, 0 to 1, each in a row and a column of its own (Hammersley 1960): an edge
/// along an axis of the picture passes them one by one as it moves, where a grid of as many has
/// four rows.
pub(crate) const PLACES: [[f32; 2]; NUM] = hammersley();

/// Distance at which a ray meets nothing.
const NOWHERE: f32 = f32::INFINITY;

/// Unit directions of rays, one array for each axis: loops over these become SIMD instructions.
#[derive(Clone, Copy)]
pub(crate) struct Rays<const N: usize> {
    x: [f32; N],
    y: [f32; N],
    z: [f32; N],
}

impl<const N: usize> Rays<N> {
    fn new(directions: [Vec3; N]) -> Self {
        Self {
            x: directions.map(|d| d.x),
            y: directions.map(|d| d.y),
            z: directions.map(|d| d.z),
        }
    }

    /// Those of a camera through places in its picture, pixels from the upper left corner.
    #[inline(always)]
    pub(crate) fn through(frame: &RayFrame, places: [[f32; 2]; N]) -> Self {
        Self::new(places.map(|[x, y]| frame.direction(x, y)))
    }

    #[inline(always)]
    fn get(&self, ray: usize) -> Vec3 {
        Vec3::new(self.x[ray], self.y[ray], self.z[ray])
    }

    /// The value of `of` for each ray.
    #[inline(always)]
    fn map(&self, of: impl Fn(Vec3) -> f32) -> [f32; N] {
        let mut values = [NOWHERE; N];
        for (ray, value) in values.iter_mut().enumerate() {
            *value = of(self.get(ray));
        }
        values
    }
}

/// Unit directions of the rays of a pixel.
#[derive(Clone)]
pub(crate) struct PixelRays {
    rays: Rays<NUM>,
    middle: Vec3,
    /// Distance between the farthest of the directions and the one in the middle.
    width: f32,
}

impl PixelRays {
    /// Of a pixel with these unit directions through places in it, 0 to 1.
    pub(crate) fn new(direction: impl Fn([f32; 2]) -> Vec3) -> Self {
        let rays = Rays::new(PLACES.map(&direction));
        let middle = direction([0.5; 2]);
        let distances = rays.map(|ray| ray.distance(middle));
        Self {
            rays,
            middle,
            width: distances.into_iter().fold(0.0, f32::max),
        }
    }
}

/// A shape as a point sees it.
pub(crate) struct ShapeFrom<'a> {
    shape: &'a Shape,
    /// The shape's axes from those of the world.
    own: Mat3,
    /// The point, along the shape's axes from its middle.
    origin: Vec3,
    /// From the point to the middle.
    to_centre: Vec3,
    /// Half the size of the box about the middle, along the shape's axes, that has it in it.
    half_size: Vec3,
    /// Radius of the ball about the middle that does.
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
            half_size: 0.5 * shape.size(),
            radius: 0.5 * shape.size().length(),
        }
    }

    /// Distance along a ray of unit `direction` to the shape's first point, if it is met; a flat
    /// shape only from the side of its normal.
    pub(crate) fn meet(&self, direction: Vec3) -> Option<f32> {
        let [distance] = self.meet_all(&Rays::new([direction]));
        (distance < NOWHERE).then_some(distance)
    }

    /// Part of some rays that meet the shape, and the farthest place where they do.
    #[inline(always)]
    pub(crate) fn part_met<const N: usize>(&self, rays: &Rays<N>) -> (f32, f32) {
        met(&self.meet_all(rays))
    }

    /// As [`Self::meet`], of several rays; [`NOWHERE`] of those that miss it.
    #[inline(always)]
    fn meet_all<const N: usize>(&self, rays: &Rays<N>) -> [f32; N] {
        let o = self.origin;
        let own = |direction: Vec3| self.own * direction;
        match *self.shape {
            Shape::Rectangle(flat) => rays.map(|ray| {
                let (t, [x, y]) = meet_plane(&flat, o, own(ray));
                met_if((x.abs() <= 1.0) & (y.abs() <= 1.0), t)
            }),
            Shape::Ellipse(flat) => rays.map(|ray| {
                let (t, [x, y]) = meet_plane(&flat, o, own(ray));
                met_if(x * x + y * y <= 1.0, t)
            }),
            Shape::Ball { radius, .. } => rays.map(|ray| {
                let along = self.to_centre.dot(ray);
                let short = radius * radius - self.off(ray);
                met_if((short >= 0.0) & (along > 0.0), along - short.sqrt())
            }),
            Shape::Tube {
                radius,
                length,
                taper,
                is_open,
                ..
            } => rays.map(|ray| meet_tube(o, own(ray), [radius, 0.5 * length, taper], is_open)),
            Shape::Box { size, .. } => rays.map(|ray| meet_box(o, own(ray), 0.5 * size)),
        }
    }

    /// Whether rays may meet the shape that differ by up to `width` from one of unit `direction`.
    pub(crate) fn is_near(&self, direction: Vec3, width: f32) -> bool {
        // Where the shape is, none of them is farther than that from the one.
        let margin = width * (self.to_centre.length() + self.radius);
        let reach = self.radius + margin;
        if self.off(direction) > reach * reach {
            return false;
        }
        let half = self.half_size + margin;
        let is_inside = self.origin.abs().cmple(half).all();
        is_inside || meet_box(self.origin, self.own * direction, half) < NOWHERE
    }

    /// Part of a pixel's rays that meet the shape, and the farthest place where they do.
    pub(crate) fn cover(&self, pixel: &PixelRays) -> (f32, f32) {
        if !self.is_near(pixel.middle, pixel.width) {
            return (0.0, 0.0);
        }
        self.part_met(&pixel.rays)
    }

    /// Squared distance of the middle from the line of a ray.
    #[inline(always)]
    fn off(&self, direction: Vec3) -> f32 {
        let along = self.to_centre.dot(direction);
        (self.to_centre - direction * along).length_squared()
    }
}

impl Shape {
    /// Distance along a ray of unit `direction` to the shape's first point, if it is met; a flat
    /// shape only from the side of its normal.
    pub fn meet(&self, origin: Vec3, direction: Vec3) -> Option<f32> {
        ShapeFrom::new(self, origin).meet(direction)
    }

    /// Angle by which a ray of unit `direction` misses the shape, 0 if it is met; about the middle,
    /// less the angle that a ball as large as its smallest size is seen at.
    pub(crate) fn off(&self, origin: Vec3, direction: Vec3) -> f32 {
        if self.meet(origin, direction).is_some() {
            return 0.0;
        }
        let to_centre = self.centre() - origin;
        direction.angle_between(to_centre)
            - (0.5 * self.thinnest() / to_centre.length()).min(1.0).asin()
    }
}

const fn hammersley() -> [[f32; 2]; NUM] {
    let mut places = [[0.0; 2]; NUM];
    let mut i = 0;
    while i < NUM {
        let reversed = i.reverse_bits() >> (usize::BITS - NUM.trailing_zeros());
        places[i] = [place(i), place(reversed)];
        i += 1;
    }
    places
}

/// The middle of one of as many equal parts of 0 to 1 as a pixel has rays.
const fn place(part: usize) -> f32 {
    (part as f32 + 0.5) / NUM as f32
}

/// Part of `distances` at which rays meet something, and the farthest of these.
#[inline(always)]
fn met(distances: &[f32]) -> (f32, f32) {
    let met = || distances.iter().filter(|distance| **distance < NOWHERE);
    let part = met().count() as f32 / distances.len() as f32;
    (part, met().copied().fold(0.0, f32::max))
}

/// `distance`, or [`NOWHERE`]: a choice between values, where a branch would keep rays apart.
#[inline(always)]
fn met_if(is_met: bool, distance: f32) -> f32 {
    if is_met { distance } else { NOWHERE }
}

/// Distance to the plane of `flat`, [`NOWHERE`] from behind, and where, in half sizes.
#[inline(always)]
fn meet_plane(flat: &Flat, o: Vec3, d: Vec3) -> (f32, [f32; 2]) {
    let t = -o.z / d.z;
    let [width, height] = flat.size;
    let place = [
        2.0 * (o.x + t * d.x) / width,
        2.0 * (o.y + t * d.y) / height,
    ];
    (met_if((d.z < 0.0) & (o.z > 0.0), t), place)
}

/// Distance to a box of half its lengths `half` about the origin, from outside.
#[inline(always)]
fn meet_box(o: Vec3, d: Vec3, half: Vec3) -> f32 {
    // Along an axis that the ray does not go the planes are at infinity, on either side of it.
    let (a, b) = ((-half - o) / d, (half - o) / d);
    let (enters, leaves) = (a.min(b).max_element(), a.max(b).min_element());
    met_if((enters <= leaves) & (enters > 0.0), enters)
}

/// Distance to a cone about z of this mean radius, half of its length and taper, from outside; its
/// radius is `radius · (1 + taper · z / half)`. Through open ends its dark inside is seen.
#[inline(always)]
fn meet_tube(o: Vec3, d: Vec3, [radius, half, taper]: [f32; 3], is_open: bool) -> f32 {
    let slope = radius * taper / half;
    let (mut side, mut end) = (NOWHERE, NOWHERE);
    // x² + y² = (radius + slope z)² along the ray.
    let (r, dr) = (radius + slope * o.z, slope * d.z);
    let a = d.x * d.x + d.y * d.y - dr * dr;
    let b = o.x * d.x + o.y * d.y - r * dr;
    let c = o.x * o.x + o.y * o.y - r * r;
    let discriminant = b * b - a * c;
    let meets_cone = (discriminant >= 0.0) & (a != 0.0);
    for root in [-discriminant.sqrt(), discriminant.sqrt()] {
        let t = (-b + root) / a;
        let is_on = (t > 0.0) & ((o.z + t * d.z).abs() <= half);
        side = side.min(met_if(meets_cone & is_on, t));
    }
    for z in [-half, half] {
        let t = (z - o.z) / d.z;
        let (at, radius) = (o + d * t, radius + slope * z);
        let is_on = (t > 0.0) & (at.x * at.x + at.y * at.y <= radius * radius);
        end = end.min(met_if((d.z != 0.0) & is_on, t));
    }
    met_if(!is_open | (side < end), side.min(end))
}
