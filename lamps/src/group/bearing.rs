//! The line of sight of a view to a compact lamp.

use crate::evidence::Sight;
use glam::Vec3;
use std::f32::consts::PI;

/// A line goes through a place that it misses by as many pixels, and by this share of the angle
/// that the lamp's radius has there: what hides a part of a lamp moves its middle.
const MISS_PIXELS: f32 = 1.0;
const MISS_SHARE: f32 = 0.25;
/// A lamp is compact if no pixel is farther from its middle than so many radii, and a pixel: a long
/// one has its middle elsewhere in each view.
const MAX_REACH: f32 = 2.0;
/// Largest angle of the radius of a lamp that the edge of a picture cuts, rad: 5 cm at a metre. Of
/// larger ones the trained scene knows more than the middle of what might be a disc.
const MAX_CUT_RADIUS: f32 = 0.05;

/// Where a view has the middle of a compact lamp, of which it shows at least half.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bearing {
    pub(crate) view: usize,
    pub(crate) origin: Vec3,
    /// Unit vector.
    pub(crate) direction: Vec3,
    /// Angle of a pixel in the middle of the picture, rad.
    pub(crate) pixel: f32,
    /// Angle of the lamp's radius if it is round, rad.
    pub(crate) radius: f32,
    /// Pixels of the lamp, about: smaller ones towards the edge of a picture.
    pub(crate) num_pixels: f32,
}

impl Bearing {
    /// That of pixels of a view, by their numbers; `None` where they are not compact, and where the
    /// picture shows too little of the lamp.
    pub(crate) fn new(view: usize, sight: &Sight, members: &[(u32, u32)]) -> Option<Self> {
        let pixels = || members.iter().map(|m| &sight.pixels[m.1 as usize]);
        let all: f32 = pixels().map(|p| p.solid_angle).sum();
        let pixel = (all / pixels().map(|p| p.weight).sum::<f32>()).sqrt();
        let (direction, radius) = match pixels().any(|pixel| sight.at_edge(pixel)) {
            false => {
                let sum: Vec3 = pixels().map(|p| p.direction * p.solid_angle).sum();
                (sum.try_normalize()?, (all / PI).sqrt())
            }
            true => {
                let [x, y, radius] = cut_disc(sight, members)?;
                let radius = (radius * pixel <= MAX_CUT_RADIUS).then_some(radius * pixel)?;
                (sight.frame.direction(x, y), radius)
            }
        };
        let bearing = Self {
            view,
            origin: sight.origin(),
            direction,
            pixel: sight.pixel_width(),
            radius,
            num_pixels: PI * (radius / pixel).powi(2),
        };
        let away = pixels().map(|p| p.direction.cross(bearing.direction).length());
        let reach = MAX_REACH * bearing.radius + bearing.pixel;
        (away.fold(0.0, f32::max) <= reach).then_some(bearing)
    }

    /// Angle between the line and a place, in what a line may miss its lamp by: 1 is just right.
    pub(crate) fn miss(&self, place: Vec3) -> f32 {
        let towards = (place - self.origin).normalize_or_zero();
        let angle = if towards.dot(self.direction) > 0.0 {
            towards.cross(self.direction).length()
        } else {
            1.0
        };
        angle / (MISS_PIXELS * self.pixel + MISS_SHARE * self.radius)
    }

    /// Radius of a lamp at a place.
    pub(crate) fn radius_at(&self, place: Vec3) -> f32 {
        self.radius * place.distance(self.origin)
    }
}

/// Middle and radius, pixels, of a round lamp that one edge of the picture cuts: the edge shows its
/// width if half of it is in the picture. `None` where less is, and in corners.
fn cut_disc(sight: &Sight, members: &[(u32, u32)]) -> Option<[f32; 3]> {
    let size = [sight.camera.width, sight.camera.height];
    let mut range = [[u32::MAX, 0]; 2];
    for (_, pixel) in members {
        let pixel = &sight.pixels[*pixel as usize];
        for ([low, high], at) in range.iter_mut().zip([pixel.x, pixel.y]) {
            (*low, *high) = ((*low).min(at), (*high).max(at + 1));
        }
    }
    let cut = [0, 1].map(|axis| [range[axis][0] == 0, range[axis][1] == size[axis]]);
    let range = range.map(|ends| ends.map(|end| end as f32));
    let middle = [0, 1].map(|axis: usize| 0.5 * (range[axis][0] + range[axis][1]));
    let radius = [0, 1].map(|axis: usize| 0.5 * (range[axis][1] - range[axis][0]));
    let [x, y] = [0, 1].map(|axis: usize| match cut[axis] {
        [true, false] => range[axis][1] - radius[1 - axis],
        [false, true] => range[axis][0] + radius[1 - axis],
        _ => middle[axis],
    });
    let [shown, radius] = match cut.map(|ends| ends.iter().filter(|cut| **cut).count()) {
        [1, 0] => radius,
        [0, 1] => [radius[1], radius[0]],
        _ => return None,
    };
    (2.0 * shown >= radius).then_some([x, y, radius])
}
