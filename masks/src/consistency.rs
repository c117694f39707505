//! Masks compared between views.
//!
//! A lamp emits in all directions; a reflection of it, however bright, moves over its surface with
//! the viewer. The surface points of each masked region are projected into all other views that see
//! them: if most of those views do not mask them, the region is not a lamp. Conversely, a view that
//! sees points of confirmed regions and masks none of them lacks a lamp in its own mask.
//!
//! Only places that a view can show are compared: well inside of a region, and seen neither from
//! behind nor at a grazing angle. Lamps a pixel or two thin are not judged.
//!
//! Points come from depth, so regions without depth (a window onto the sky) are not judged, and
//! depths of a trained scene may place the image of a lamp behind the mirror, where all views agree
//! on it.

#[cfg(test)]
mod tests;

use crate::mask::{Mask, Region};
use eagpt_scene::{Camera, Image};
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;

/// Longest side at which views are compared, pixels: bounds the memory, 9 bytes a pixel, to 2.6 MB
/// a view.
pub(crate) const MAX_SIDE: u32 = 540;
/// Most places of a region.
const MAX_PLACES: usize = 64;
/// Least projected area, pixels, of a pixel's surface in another view for that view to count.
const MIN_AREA: f32 = 0.25;
/// Tolerance between a point and the depth of a view, relative to its own depth: noise of depths. A
/// larger one would make a bulb visible through the rim of its shade.
const DEPTH_TOLERANCE: f32 = 0.01;
/// Fewest views that must see a region's surface before they can reject it.
const MIN_VIEWS: usize = 2;
/// Share of a view's places in confirmed regions that it does not mask, above which it lacks a
/// lamp.
const MAX_MISSED: f64 = 0.5;
/// Fewest such places.
const MIN_MISSED: u32 = 16;

/// A view as the comparison needs it.
#[derive(Debug, Clone)]
pub(crate) struct Sight {
    /// Camera at the size of the comparison.
    pub camera: Camera,
    /// Depth along the optical axis at that size; 0 where unknown.
    pub depth: Image<1>,
    /// The mask at that size, a pixel if any part of it is masked; `None` for a view without one.
    pub mask: Option<Mask>,
    /// Places on the surfaces of the mask's regions; empty where there is no depth.
    pub regions: Vec<Vec<Place>>,
}

/// The surface that a pixel shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    /// Position, world space.
    point: Vec3,
    /// Points where the rays of the neighbouring pixels to the right and below meet the surface's
    /// depth.
    neighbours: [Vec3; 2],
}

/// Visibility of a region in other views.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub(crate) struct Support {
    /// Views that see its surface.
    pub num_views: usize,
    /// Places at which they see it.
    pub num_seen: u32,
    /// Places that they mask as well.
    pub num_masked: u32,
}

/// Verdict of other views on a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Other views mask it as well.
    Confirmed,
    /// They see its surface and do not mask it: likely a reflection.
    Inconsistent,
    /// Too few other views see it.
    Unseen,
}

impl Support {
    /// Share of places that are masked; `None` if there are none.
    pub(crate) fn share(&self) -> Option<f64> {
        (self.num_seen > 0).then(|| f64::from(self.num_masked) / f64::from(self.num_seen))
    }

    /// The verdict if at least `min_support` of the places have to be masked.
    pub(crate) fn verdict(&self, min_support: f32) -> Verdict {
        match self.share() {
            Some(share) if self.num_views >= MIN_VIEWS => {
                if share >= f64::from(min_support) {
                    Verdict::Confirmed
                } else {
                    Verdict::Inconsistent
                }
            }
            _ => Verdict::Unseen,
        }
    }
}

/// The comparison of all views.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Comparison {
    /// For each view and region, what other views see of it.
    pub(crate) support: Vec<Vec<Support>>,
    /// For each view, the share of its places in regions confirmed by others that it does not mask,
    /// if it lacks a lamp.
    pub missed: Vec<Option<f64>>,
}

/// Visibility of a region of one view in another view.
struct Sighting {
    view: usize,
    num_seen: u32,
    num_masked: u32,
}

/// The size at which a view of `camera` is compared.
pub(crate) fn reduced(camera: &Camera) -> Camera {
    let longest = camera.width.max(camera.height);
    if longest <= MAX_SIDE {
        return *camera;
    }
    let scaled = |side: u32| (side * MAX_SIDE / longest).max(1);
    camera.resized(scaled(camera.width), scaled(camera.height))
}

/// A mask at the size of `camera`: a pixel if any of the pixels that it covers is masked.
pub(crate) fn reduced_mask(mask: &Mask, camera: &Camera) -> Mask {
    let range = |at: u32, size: u32, full: u32| {
        let bound = |at: u32| (u64::from(at) * u64::from(full) / u64::from(size)) as u32;
        bound(at)..bound(at + 1).max(bound(at) + 1)
    };
    Mask::from_fn(camera.width, camera.height, |x, y| {
        let columns = range(x, camera.width, mask.width());
        range(y, camera.height, mask.height()).any(|y| columns.clone().any(|x| mask.has(x, y)))
    })
}

/// Places well inside of a region, evenly chosen; none where depth is unknown. The region is one of
/// an image of `full_size` (width, height), `mask` and `depth` are those of `camera`.
pub(crate) fn places(
    region: &Region,
    full_size: (u32, u32),
    mask: &Mask,
    camera: &Camera,
    depth: &Image<1>,
) -> Vec<Place> {
    let frame = camera.ray_frame();
    let point = |[x, y]: [u32; 2]| {
        let [depth] = depth.get(x.min(camera.width - 1), y.min(camera.height - 1));
        let ray = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
        (depth > 0.0).then(|| frame.origin + depth / ray.dot(camera.forward()) * ray)
    };
    let scaled = |at: u32, size: u32, full: u32| {
        ((2 * u64::from(at) + 1) * u64::from(size) / (2 * u64::from(full))) as u32
    };
    let mut inside: Vec<[u32; 2]> = region
        .pixels
        .iter()
        .map(|&[x, y]| {
            [
                scaled(x, camera.width, full_size.0),
                scaled(y, camera.height, full_size.1),
            ]
        })
        .collect();
    inside.dedup();
    // A lamp may continue beyond the image's edge: pixels outside do not count against it.
    let is_masked = |[x, y]: [u32; 2]| x >= camera.width || y >= camera.height || mask.has(x, y);
    inside.retain(|&pixel| around(pixel).all(is_masked));
    let num = inside.len().min(MAX_PLACES);
    let chosen = (0..num).filter_map(|i| {
        // The middle of each of equal parts.
        let pixel = inside[(2 * i + 1) * inside.len() / (2 * num)];
        let [x, y] = pixel;
        Some(Place {
            point: point(pixel)?,
            neighbours: [point([x + 1, y])?, point([x, y + 1])?],
        })
    });
    chosen.collect()
}

/// Compares all views with each other.
pub(crate) fn compare(sights: &[Sight], min_support: f32) -> Comparison {
    let sightings: Vec<Vec<Vec<Sighting>>> = sights
        .par_iter()
        .enumerate()
        .map(|(own, sight)| {
            let regions = sight.regions.iter();
            regions
                .map(|points| seen_from(points, own, sights))
                .collect()
        })
        .collect();
    let support: Vec<Vec<Support>> = sightings
        .iter()
        .map(|regions| regions.iter().map(|seen| sum(seen)).collect())
        .collect();
    let mut expected = vec![(0_u32, 0_u32); sights.len()];
    for (regions, supports) in sightings.iter().zip(&support) {
        for (seen, support) in regions.iter().zip(supports) {
            if support.verdict(min_support) == Verdict::Confirmed {
                for sighting in seen {
                    expected[sighting.view].0 += sighting.num_seen;
                    expected[sighting.view].1 += sighting.num_masked;
                }
            }
        }
    }
    let missed = expected.into_iter().map(|(num_seen, num_masked)| {
        let num_missed = num_seen - num_masked;
        let share = f64::from(num_missed) / f64::from(num_seen.max(1));
        (num_missed >= MIN_MISSED && share > MAX_MISSED).then_some(share)
    });
    Comparison {
        missed: missed.collect(),
        support,
    }
}

fn sum(seen: &[Sighting]) -> Support {
    Support {
        num_views: seen.len(),
        num_seen: seen.iter().map(|s| s.num_seen).sum(),
        num_masked: seen.iter().map(|s| s.num_masked).sum(),
    }
}

/// Visibility of places in all views but `own`; views that see none and those without a mask are
/// left out.
fn seen_from(places: &[Place], own: usize, sights: &[Sight]) -> Vec<Sighting> {
    let mut seen = Vec::new();
    for (view, sight) in sights.iter().enumerate() {
        let Some(mask) = sight.mask.as_ref().filter(|_| view != own) else {
            continue;
        };
        let (mut num_seen, mut num_masked) = (0, 0);
        for pixel in places.iter().filter_map(|place| sight.pixel_of(place)) {
            num_seen += 1;
            // One pixel of tolerance: half for the rounding here, half for that of the region's own
            // pixel.
            num_masked += u32::from(around(pixel).any(|[x, y]| mask.has(x, y)));
        }
        if num_seen > 0 {
            seen.push(Sighting {
                view,
                num_seen,
                num_masked,
            });
        }
    }
    seen
}

impl Sight {
    /// The pixel that shows a place, if the place is in the image, large enough and not occluded.
    fn pixel_of(&self, place: &Place) -> Option<[u32; 2]> {
        let seen = self.camera.project(place.point);
        let (width, height) = (self.camera.width, self.camera.height);
        let inside = seen.z > 0.0
            && (0.0..width as f32).contains(&seen.x)
            && (0.0..height as f32).contains(&seen.y);
        if !inside || self.area(place, seen) < MIN_AREA {
            return None;
        }
        let pixel = [seen.x as u32, seen.y as u32];
        let shown = around(pixel)
            .filter(|&[x, y]| x < width && y < height)
            .any(|[x, y]| {
                let [depth] = self.depth.get(x, y);
                (depth - seen.z).abs() <= DEPTH_TOLERANCE * seen.z
            });
        shown.then_some(pixel)
    }

    /// Pixels that a place projected to `seen` covers; negative from behind.
    fn area(&self, place: &Place, seen: Vec3) -> f32 {
        let [right, below] = place
            .neighbours
            .map(|point| self.camera.project(point) - seen);
        right.x * below.y - right.y * below.x
    }
}

/// A pixel and its neighbours, some of which may be outside of the image.
fn around([x, y]: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    let side = |at: u32| at.saturating_sub(1)..=at + 1;
    side(y).flat_map(move |y| side(x).map(move |x| [x, y]))
}

/// A depth image at the size of `camera`: of each pixel the value in its middle, since depths of
/// different surfaces have no mean.
pub(crate) fn nearest(depth: &Image<1>, camera: &Camera) -> Image<1> {
    let (width, height) = (camera.width, camera.height);
    if depth.size() == (width, height) {
        return depth.clone();
    }
    let scaled = |at: u32, size: u32, full: u32| {
        ((2 * u64::from(at) + 1) * u64::from(full) / (2 * u64::from(size))) as u32
    };
    let pixels = (0..height).flat_map(|y| {
        let row = scaled(y, height, depth.height());
        (0..width).map(move |x| depth.get(scaled(x, width, depth.width()), row))
    });
    Image::from_pixels(width, height, pixels.collect()).expect("one value for each pixel")
}
