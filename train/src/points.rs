//! Points of the cloud that a view sees, which tell how far its surfaces are.

use eagpt_scene::Camera;
use eagpt_scene::ply::PointCloud;
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZeroUsize;

/// Neighbours whose distances give the radius of a point.
const NEIGHBOURS: usize = 3;
/// Most pixels from the middle of a point to its edge.
const MAX_PIXELS: f32 = 16.0;
/// A point is hidden that lies more than so many of its radii behind another.
const HIDDEN: f32 = 3.0;

/// A point cloud whose points are discs that leave no holes between them.
#[derive(Debug, Clone)]
pub(crate) struct Discs {
    positions: Vec<Vec3>,
    /// Mean distance of the nearest neighbours, `[n]`, scene units.
    radii: Vec<f32>,
}

/// The points that one view sees.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SeenPoints {
    /// Pixels, row by row, each once, and the distance from the eye of the point there, scene
    /// units.
    pub distances: Vec<(u32, f32)>,
}

impl Discs {
    /// Discs at the points of `cloud`.
    pub(crate) fn new(cloud: &PointCloud) -> Self {
        let positions = cloud.positions.clone();
        let coordinates: Vec<[f32; 3]> = positions.iter().map(Vec3::to_array).collect();
        let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&coordinates);
        let wanted = NonZeroUsize::new(NEIGHBOURS + 1).expect("a positive constant");
        let radius = |point: &[f32; 3]| {
            // The first neighbour is the point itself.
            let near = tree.nearest_n::<SquaredEuclidean>(point, wanted);
            let near = near.iter().skip(1).map(|n| n.distance.sqrt());
            near.sum::<f32>() / NEIGHBOURS as f32
        };
        Self {
            radii: coordinates.par_iter().map(radius).collect(),
            positions,
        }
    }

    /// The points that `camera` sees: no disc lies before them.
    pub(crate) fn seen_by(&self, camera: &Camera) -> SeenPoints {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let mut nearest = vec![f32::INFINITY; width * height];
        let is_inside = |at: Vec3| {
            at.z > 0.0
                && (0.0..width as f32).contains(&at.x)
                && (0.0..height as f32).contains(&at.y)
        };
        let pixel = |at: Vec3| at.y as usize * width + at.x as usize;
        let places: Vec<Vec3> = self.positions.iter().map(|p| camera.project(*p)).collect();
        for (at, radius) in places.iter().zip(&self.radii) {
            if !is_inside(*at) {
                continue;
            }
            let reach = (radius * camera.fx as f32 / at.z).min(MAX_PIXELS);
            let range = |middle: f32, size: usize| {
                let last = (middle + reach) as usize;
                (middle - reach).max(0.0) as usize..=last.min(size - 1)
            };
            for y in range(at.y, height) {
                for x in range(at.x, width) {
                    let depth = &mut nearest[y * width + x];
                    *depth = depth.min(at.z);
                }
            }
        }
        let eye = camera.origin();
        let mut seen: Vec<(u32, f32)> = (places.iter().zip(&self.radii).zip(&self.positions))
            .filter(|((at, radius), _)| {
                is_inside(**at) && at.z <= nearest[pixel(**at)] + HIDDEN * **radius
            })
            .map(|((at, _), point)| (pixel(*at) as u32, point.distance(eye)))
            .collect();
        seen.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        seen.dedup_by_key(|(pixel, _)| *pixel);
        SeenPoints { distances: seen }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, Vec2};

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
        let seen = Discs::new(&cloud).seen_by(&camera);
        let shown = |points: &[Vec3]| {
            let inside = points.iter().map(|point| camera.project(*point));
            let inside =
                inside.filter(|at| (0.0..40.0).contains(&at.x) && (0.0..30.0).contains(&at.y));
            inside.count()
        };
        let num_near = seen.distances.iter().filter(|(_, d)| *d < 3.0).count();
        assert_eq!(num_near, num_board);
        // The board hides 10×10 pixels, on which the wall has 8×8 points, and discs reach a pixel
        // beyond its points.
        let num_far = seen.distances.len() - num_near;
        let num_wall = shown(&cloud.positions[num_board..]);
        assert!(
            (num_wall - 100..=num_wall - 64).contains(&num_far),
            "{num_far} of {num_wall}"
        );
        let mut pixels: Vec<u32> = seen.distances.iter().map(|(pixel, _)| *pixel).collect();
        pixels.dedup();
        assert_eq!(pixels.len(), seen.distances.len());
        for &(pixel, distance) in &seen.distances {
            let at = Vec2::new((pixel % 40) as f32 + 0.5, (pixel / 40) as f32 + 0.5);
            let ray = (at - Vec2::new(20.0, 15.0)) / 20.0;
            let depth = if distance < 3.0 { 2.0 } else { 4.0 };
            // Points lie up to half a pixel from the middle of theirs.
            assert!((distance - depth * ray.extend(1.0).length()).abs() < 0.036 * depth);
        }
    }
}
