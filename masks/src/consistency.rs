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
pub struct Support {
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
    pub support: Vec<Vec<Support>>,
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DMat3, DVec3};

    /// Cameras side by side that look along +z (x right, y down) at a wall two units away.
    fn camera(x: f64) -> Camera {
        Camera {
            width: 40,
            height: 30,
            fx: 40.0,
            fy: 40.0,
            cx: 20.0,
            cy: 15.0,
            world_from_camera: DAffine3::from_mat3_translation(
                DMat3::IDENTITY,
                DVec3::new(x, 0.0, 0.0),
            ),
        }
    }

    /// A view at `x` of that wall with a lamp at world x from −0.2 to 0.2 and, if it is there, a
    /// reflection that moves as the viewer does.
    fn sight(x: f64, lamp: bool, reflection: bool) -> Sight {
        let camera = camera(x);
        let depth = Image::filled(40, 30, [2.0]);
        let mask = Mask::from_fn(40, 30, |column, row| {
            let world = 2.0 * (f64::from(column) + 0.5 - 20.0) / 40.0 + x;
            let on_lamp = lamp && world.abs() < 0.2 && (5..10).contains(&row);
            // Twice as far to the side as the viewer: as an image of something behind the wall.
            let on_reflection =
                reflection && (world - 2.0 * x).abs() < 0.1 && (20..24).contains(&row);
            on_lamp || on_reflection
        });
        let regions = mask.regions();
        let regions = regions.iter();
        Sight {
            regions: regions
                .map(|region| places(region, (40, 30), &mask, &camera, &depth))
                .collect(),
            camera,
            depth,
            mask: Some(mask),
        }
    }

    #[test]
    fn lamps_are_confirmed_and_reflections_are_not() {
        let sights: Vec<Sight> = [-0.4, -0.2, 0.0, 0.2, 0.4]
            .map(|x| sight(x, true, true))
            .into();
        let found = compare(&sights, 0.5);
        for support in &found.support {
            let verdicts: Vec<Verdict> = support.iter().map(|s| s.verdict(0.5)).collect();
            assert_eq!(verdicts, [Verdict::Confirmed, Verdict::Inconsistent]);
            assert_eq!(support[0].share(), Some(1.0));
            assert_eq!(support[0].num_views, 4);
        }
        assert_eq!(found.missed, [None; 5]);
    }

    #[test]
    fn a_view_that_lacks_a_lamp_is_told() {
        let mut sights: Vec<Sight> = [-0.2, 0.0, 0.2].map(|x| sight(x, true, false)).into();
        sights.push(sight(0.1, false, false));
        assert_eq!(compare(&sights, 0.5).missed, [None, None, None, Some(1.0)]);
        // No mask at all is not an empty mask.
        sights[3].mask = None;
        assert_eq!(compare(&sights, 0.5).missed, [None; 4]);
    }

    #[test]
    fn what_is_hidden_or_behind_is_not_seen() {
        let mut sights = vec![sight(0.0, true, false), sight(0.1, false, false)];
        sights[1].depth = Image::filled(40, 30, [1.0]);
        let found = compare(&sights, 0.5);
        assert_eq!(found.support[0][0], Support::default());
        assert_eq!(found.support[0][0].verdict(0.5), Verdict::Unseen);
        let at = |z: f32, step: [Vec3; 2]| {
            let point = Vec3::new(0.0, 0.0, z);
            let neighbours = step.map(|step| point + step);
            sights[0].pixel_of(&Place { point, neighbours })
        };
        let facing = [Vec3::X * 0.05, Vec3::Y * 0.05];
        assert_eq!(at(2.0, facing), Some([20, 15]));
        assert_eq!(at(-2.0, facing), None);
        // From behind, and with a tenth of the area.
        assert_eq!(at(2.0, [facing[1], facing[0]]), None);
        assert_eq!(at(2.0, [facing[0], 0.1 * facing[1]]), None);
    }

    #[test]
    fn large_views_are_compared_at_a_bounded_size() {
        let mut large = camera(0.0);
        (large.width, large.height) = (6000, 4000);
        let small = reduced(&large);
        assert_eq!((small.width, small.height), (540, 360));
        // A single pixel survives.
        let mask = Mask::from_fn(6000, 4000, |x, y| (x, y) == (5999, 3999));
        assert_eq!(
            reduced_mask(&mask, &small),
            Mask::from_fn(540, 360, |x, y| (x, y) == (539, 359))
        );
        let same = reduced(&camera(0.0));
        assert_eq!((same.width, same.height), (40, 30));
    }

    #[test]
    fn places_lie_inside_where_the_pixels_look() {
        let mask = Mask::from_fn(40, 30, |x, y| (10..13).contains(&x) && y < 3);
        let region = &mask.regions()[0];
        let (camera, depth) = (camera(0.0), Image::filled(40, 30, [2.0]));
        let found = places(region, (40, 30), &mask, &camera, &depth);
        // The middle column, and the top row, whose lamp may go on beyond the picture.
        assert_eq!(found.len(), 2);
        let expected = Vec3::new(2.0 * -8.5 / 40.0, 2.0 * -14.5 / 40.0, 2.0);
        assert!((found[0].point - expected).length() < 1e-6, "{found:?}");
        let step = found[0].neighbours[0] - found[0].point;
        assert!((step - Vec3::X * 0.05).length() < 1e-6);
        let unknown = Image::filled(40, 30, [0.0]);
        assert!(places(region, (40, 30), &mask, &camera, &unknown).is_empty());
        let thin = Mask::from_fn(40, 30, |x, y| x > 10 && (4..6).contains(&y));
        assert!(places(&thin.regions()[0], (40, 30), &thin, &camera, &depth).is_empty());
    }
}
