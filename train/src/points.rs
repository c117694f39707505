//! The point cloud as a view sees it: how far surfaces are, and how they face.

mod normals;

use eagpt_scene::ply::PointCloud;
use eagpt_scene::{Camera, Image, View};
use glam::{Vec2, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use normals::MOST_NEIGHBOURS;
use rayon::prelude::*;
use std::borrow::Cow;
use std::num::NonZeroUsize;
use std::sync::Arc;

/// Neighbours whose distances give the radius of a point.
const NEIGHBOURS: usize = 3;
/// Most pixels from the middle of a point to its edge.
const MAX_PIXELS: f32 = 16.0;
/// A point is hidden that lies more than so many of its radii behind another.
const HIDDEN: f32 = 3.0;
/// Radius of the part of its plane that a point stands for, in its radii: on a grid of points most
/// of a plane is covered, and little beyond its edge.
const COVERED: f32 = 0.6;
/// Most of that radius as seen at an angle.
const MOST_OBLIQUE: f32 = 2.0;
/// Distance from a point within which a place is at its surface, in its radii.
const AT_POINT: f32 = 0.5;
/// Of a pixel without a point.
pub(crate) const NOTHING: u32 = u32::MAX;

/// A point cloud whose points are discs that leave no holes between them.
#[derive(Debug, Clone)]
pub(crate) struct Discs {
    /// Points, in the planes of their neighbours where they have one, `[n]`.
    pub(crate) positions: Vec<Vec3>,
    /// Mean distance of the nearest neighbours, `[n]`, scene units.
    pub(crate) radii: Vec<f32>,
    /// Unit normals of either sign, or zero where the neighbours lie in no plane, `[n]`.
    pub(crate) normals: Vec<Vec3>,
}

/// The points that one view sees. One of a plane stands for the pixels about it, another for its
/// own.
#[derive(Debug, Clone)]
pub struct SeenPoints {
    pub(crate) discs: Arc<Discs>,
    /// Point of each pixel, row by row, or [`NOTHING`].
    pub(crate) of_pixels: Vec<u32>,
}

/// The surface that a point of the cloud tells of in a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelPoint {
    /// Pixel, counted row by row.
    pub pixel: u32,
    /// Distance from the eye, scene units.
    pub distance: f32,
    /// Unit normal, towards the eye; zero where it is not known.
    pub normal: Vec3,
}

impl SeenPoints {
    /// The surfaces in pixels of `camera`, which is the one that sees the points, row by row.
    pub fn pixels(&self, camera: &Camera) -> Vec<PixelPoint> {
        let frame = camera.ray_frame();
        let told = |(pixel, point): (usize, &u32)| {
            let i = *point as usize;
            let place = *self.discs.positions.get(i)?;
            let to_eye = frame.origin - place;
            let normal = self.discs.normals[i];
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            let distance = match normal == Vec3::ZERO {
                true => to_eye.length(),
                false => {
                    let distance = -to_eye.dot(normal) / direction.dot(normal);
                    let off = (frame.origin + direction * distance).distance(place);
                    let is_near = off <= MOST_OBLIQUE * self.discs.radii[i];
                    is_near.then_some(distance)?
                }
            };
            Some(PixelPoint {
                pixel: pixel as u32,
                distance,
                normal: normal * normal.dot(to_eye).signum(),
            })
        };
        let pixels = self.of_pixels.par_iter().enumerate();
        pixels.with_min_len(2048).filter_map(told).collect()
    }
}

/// The coordinates of places, and a tree that finds the nearest ones.
fn tree(places: &[Vec3]) -> (Vec<[f32; 3]>, ImmutableKdTree<f32, 3>) {
    let coordinates: Vec<[f32; 3]> = places.iter().map(Vec3::to_array).collect();
    let tree = ImmutableKdTree::new_from_slice(&coordinates);
    (coordinates, tree)
}

/// The normal map of `view`, or else the normals of the points that it sees, and zero elsewhere.
pub(crate) fn normal_map<'a>(
    points: Option<&[PixelPoint]>,
    view: &'a View,
) -> Option<Cow<'a, Image<3>>> {
    let of_points = |points: &[PixelPoint]| {
        let mut map = Image::filled(view.camera.width, view.camera.height, [0.0; 3]);
        for point in points {
            map.pixels_mut()[point.pixel as usize] = point.normal.to_array();
        }
        Cow::Owned(map)
    };
    let own = view.normal.as_ref().map(Cow::Borrowed);
    own.or_else(|| points.map(of_points))
}

impl Discs {
    /// Discs at the points of `cloud`; with the planes that they lie in, or without.
    pub(crate) fn new(cloud: &PointCloud, with_planes: bool) -> Self {
        let positions = &cloud.positions;
        let (coordinates, tree) = tree(positions);
        // The first neighbour is the point itself.
        let wanted = if with_planes {
            MOST_NEIGHBOURS
        } else {
            NEIGHBOURS + 1
        };
        let wanted = NonZeroUsize::new(wanted).expect("positive constants");
        let shape = |point: &[f32; 3]| {
            let near = tree.nearest_n::<SquaredEuclidean>(point, wanted);
            let nearest = near.iter().skip(1).take(NEIGHBOURS);
            let radius = nearest.map(|n| n.distance.sqrt()).sum::<f32>() / NEIGHBOURS as f32;
            let plane = || {
                let near: Vec<Vec3> = near.iter().map(|n| positions[n.item as usize]).collect();
                normals::plane(&near)
            };
            let plane = with_planes.then(plane).flatten();
            (radius, plane.unwrap_or((Vec3::from(*point), Vec3::ZERO)))
        };
        let (radii, planes): (_, Vec<_>) = coordinates.par_iter().map(shape).unzip();
        let (positions, normals) = planes.into_iter().unzip();
        Self {
            positions,
            radii,
            normals,
        }
    }

    /// Tells of places whether they lie at a point.
    pub(crate) fn near_points(&self) -> impl Fn(Vec3) -> bool + '_ {
        let (_, tree) = tree(&self.positions);
        let wanted = NonZeroUsize::new(NEIGHBOURS + 1).expect("positive constants");
        move |place| {
            let near = tree.nearest_n::<SquaredEuclidean>(&place.to_array(), wanted);
            near.iter()
                .any(|n| n.distance.sqrt() <= AT_POINT * self.radii[n.item as usize])
        }
    }

    /// The points that `camera` sees: no disc lies before them.
    pub(crate) fn seen_by(self: &Arc<Self>, camera: &Camera) -> SeenPoints {
        let num_pixels = camera.num_pixels();
        let places = self.positions.iter().map(|p| camera.project(*p));
        let places: Vec<(usize, Vec3)> = (0..)
            .zip(places)
            .filter(|(_, at)| camera.is_in_picture(*at))
            .collect();
        let own = |at: Vec3| at.y as usize * camera.width as usize + at.x as usize;
        let reach = |i: usize, at: Vec3| (self.radii[i] * camera.fx as f32 / at.z).min(MAX_PIXELS);
        let mut nearest = vec![f32::INFINITY; num_pixels];
        for &(i, at) in &places {
            for (pixel, _) in around(camera, at, reach(i, at)) {
                nearest[pixel] = nearest[pixel].min(at.z);
            }
        }
        // The nearest point of no plane in its own pixel, else that of a plane which is nearest in
        // the image.
        let mut best = vec![(NOTHING, true, f32::INFINITY); num_pixels];
        for &(i, at) in &places {
            if at.z > nearest[own(at)] + HIDDEN * self.radii[i] {
                continue;
            }
            let is_flat = self.normals[i] != Vec3::ZERO;
            let reach = if is_flat { COVERED * reach(i, at) } else { 0.0 };
            let distance = self.positions[i].distance(camera.origin());
            for (pixel, off) in around(camera, at, reach) {
                let rank = if is_flat { off } else { distance };
                if (is_flat, rank) < (best[pixel].1, best[pixel].2) {
                    best[pixel] = (i as u32, is_flat, rank);
                }
            }
        }
        let of_pixels = best.into_iter().map(|(point, ..)| point).collect();
        SeenPoints {
            discs: Arc::clone(self),
            of_pixels,
        }
    }
}

/// The pixels of a square about a place in the image, `reach` pixels to its sides, and the squared
/// distances of their middles.
fn around(camera: &Camera, at: Vec3, reach: f32) -> impl Iterator<Item = (usize, f32)> + use<> {
    let range = |middle: f32, size: u32| {
        let last = (middle + reach) as u32;
        (middle - reach).max(0.0) as u32..=last.min(size - 1)
    };
    let (columns, width) = (range(at.x, camera.width), camera.width);
    range(at.y, camera.height).flat_map(move |y| {
        columns.clone().map(move |x| {
            let middle = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            (
                (y * width + x) as usize,
                middle.distance_squared(at.truncate()),
            )
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::rng::{Purpose, RandomKey};
    use glam::DAffine3;

    /// Looks along −z from the origin: 40×30 pixels, 20 pixels a unit at distance 1.
    fn camera() -> Camera {
        Camera {
            width: 40,
            height: 30,
            fx: 20.0,
            fy: 20.0,
            cx: 20.0,
            cy: 15.0,
            world_from_camera: DAffine3::IDENTITY,
        }
    }

    /// A wall 4 units away with a point every 0.25, and a board of half its spacing before a part of
    /// it.
    fn wall_and_board() -> (PointCloud, usize) {
        let towards = camera().forward();
        let grid = |num: i32, spacing: f32, depth: f32| {
            let place = move |i: i32| (i as f32 + 0.3) * spacing;
            (-num..num).flat_map(move |x| {
                (-num..num)
                    .map(move |y| Vec2::new(place(x), place(y)).extend(0.0) + towards * depth)
            })
        };
        let board: Vec<Vec3> = grid(4, 0.125, 2.0).collect();
        let num_board = board.len();
        let positions: Vec<Vec3> = board.into_iter().chain(grid(20, 0.25, 4.0)).collect();
        let cloud = PointCloud {
            colors_srgb8: vec![[128; 3]; positions.len()],
            positions,
        };
        (cloud, num_board)
    }

    #[test]
    fn a_view_sees_the_nearest_surface_through_each_pixel() {
        let (cloud, num_board) = wall_and_board();
        let camera = camera();
        let seen = Arc::new(Discs::new(&cloud, true))
            .seen_by(&camera)
            .pixels(&camera);
        let ray = |pixel: u32| {
            let at = Vec2::new((pixel % 40) as f32 + 0.5, (pixel / 40) as f32 + 0.5);
            (
                at,
                ((at - Vec2::new(20.0, 15.0)) / 20.0).extend(1.0).length(),
            )
        };
        let board = cloud.positions[..num_board]
            .iter()
            .map(|p| camera.project(*p).truncate());
        let (low, high) = board.fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), at| {
            (low.min(at), high.max(at))
        });
        let (mut num_near, mut num_far) = (0, 0);
        for point in &seen {
            let (at, ray) = ray(point.pixel);
            // A point covers half a pixel about it, or up to the middle of the next pixel.
            let depth = point.distance / ray;
            if at.cmpge(low).all() && at.cmple(high).all() {
                assert!((depth - 2.0).abs() < 1e-3, "{point:?}");
                num_near += 1;
            } else if at.cmplt(low - 1.5).any() || at.cmpgt(high + 1.5).any() {
                assert!((depth - 4.0).abs() < 1e-3, "{point:?}");
                num_far += 1;
            }
            assert!(
                (point.normal + camera.forward()).length() < 1e-3,
                "{point:?}"
            );
        }
        assert!(seen.is_sorted_by_key(|point| point.pixel));
        // Nine pixels a side on the board, and 40×30 but for 12×12 on the wall.
        assert!(num_near >= 75 && num_far >= 950, "{num_near} {num_far}");
    }

    #[test]
    fn places_are_at_points_within_half_their_radii() {
        let (cloud, _) = wall_and_board();
        let discs = Discs::new(&cloud, true);
        let is_at_point = discs.near_points();
        let (point, radius) = (discs.positions[0], discs.radii[0]);
        for (off, is_there) in [(0.0, true), (0.45, true), (0.55, false)] {
            // Along its plane are others.
            let place = point + Vec3::Z * off * radius;
            assert_eq!(is_at_point(place), is_there, "{off}");
        }
    }

    #[test]
    fn without_planes_points_tell_of_their_own_pixels() {
        let (cloud, _) = wall_and_board();
        let camera = camera();
        let seen = Arc::new(Discs::new(&cloud, false)).seen_by(&camera);
        let points = seen.of_pixels.iter().filter(|point| **point != NOTHING);
        let seen = seen.pixels(&camera);
        assert!(seen.len() > 500, "{}", seen.len());
        for (told, point) in seen.iter().zip(points) {
            let place = cloud.positions[*point as usize];
            let at = camera.project(place);
            assert_eq!(told.pixel, at.y as u32 * camera.width + at.x as u32);
            assert_eq!((told.distance, told.normal), (place.length(), Vec3::ZERO));
        }
    }

    #[test]
    fn a_point_of_no_plane_tells_of_its_own_pixel() {
        let camera = camera();
        let key = RandomKey::new(1, Purpose::Initialise, 9);
        let leaf = |i| {
            let [x, y, z, _] = key.stream(i, 0).next_uniforms();
            camera.forward() * 4.0 + Vec3::new(x, y, z) - 0.5
        };
        let positions: Vec<Vec3> = (0..40).map(leaf).collect();
        let cloud = PointCloud {
            colors_srgb8: vec![[128; 3]; positions.len()],
            positions: positions.clone(),
        };
        let seen = Arc::new(Discs::new(&cloud, true))
            .seen_by(&camera)
            .pixels(&camera);
        assert!((5..=40).contains(&seen.len()), "{}", seen.len());
        for point in seen {
            assert_eq!(point.normal, Vec3::ZERO);
            assert!(
                positions
                    .iter()
                    .any(|p| (p.length() - point.distance).abs() < 1e-5)
            );
        }
    }
}
