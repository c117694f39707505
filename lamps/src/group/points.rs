//! The lit pixels of a lamp as points in space.

use crate::evidence::{Evidence, Pixel, Sight};
use crate::group::Group;
use eagpt_scene::median::{median, median_distance, median_of};
use glam::Vec3;

/// A lit pixel in space.
pub(crate) struct Point {
    pub(crate) position: Vec3,
    /// Unit vector to the camera.
    pub(crate) towards: Vec3,
    /// Width of the pixel there.
    pub(crate) width: f32,
}

/// The pixels of a lamp where the trained scene has them.
pub(crate) fn points(evidence: &Evidence, group: &Group) -> Vec<Point> {
    points_with(evidence, group, |_, pixel| pixel.distance)
}

/// The pixels of a lamp about its `centre`.
pub(crate) fn points_at(evidence: &Evidence, group: &Group, centre: Vec3) -> Vec<Point> {
    points_with(evidence, group, |sight, _| centre.distance(sight.origin()))
}

fn points_with(
    evidence: &Evidence,
    group: &Group,
    distance: impl Fn(&Sight, &Pixel) -> f32,
) -> Vec<Point> {
    let point = |member: &(u32, u32)| {
        let (sight, pixel) = evidence.pixel(member);
        let distance = distance(sight, pixel);
        Point {
            position: sight.origin() + pixel.direction * distance,
            towards: -pixel.direction,
            width: distance * sight.pixel_width(),
        }
    };
    group.members.iter().map(point).collect()
}

/// The middle of a lamp and how large it is about, at least a pixel; `None` without points.
pub(crate) fn extent(points: &[Point]) -> Option<(Vec3, f32)> {
    let pixel = points.iter().map(|p| p.width);
    let centre = median(&points.iter().map(|p| p.position));
    let extent = 2.0 * median_distance(centre, points.iter().map(|p| p.position));
    (!points.is_empty()).then(|| (centre, extent.max(median_of(pixel))))
}

/// Width of a pixel on a lamp.
pub(crate) fn pixel_width(points: &[Point]) -> f32 {
    median_of(points.iter().map(|p| p.width))
}
