//! Reference normals from other data of a dataset: of the surface that a depth map spans, and of
//! the plane around a point.

use eagpt_scene::plane::FittedPlane;
use eagpt_scene::{Camera, Image};
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZeroUsize;

/// Tolerance between a depth and the mean of its two neighbours, relative to itself, on one
/// surface: an edge between two surfaces, or a crease, exceeds it.
const MAX_BEND: f32 = 0.01;
/// Neighbours whose plane gives a point's normal.
const PLANE_NEIGHBOURS: usize = 12;
/// Largest ratio of the smallest to the middle variance of neighbours that lie in a plane.
const MAX_THICKNESS: f64 = 0.05;

/// Unit normals, world space, turned to the camera, of the surface that depths along the optical
/// axis span; zero at the image's border, where depths are unknown (0), and where the surface is
/// broken.
pub(crate) fn normals_from_depth(depth: &Image<1>, camera: &Camera) -> Image<3> {
    let (width, height) = (depth.width() as usize, depth.height() as usize);
    let frame = camera.ray_frame();
    let values = depth.values();
    let point = |index: usize| {
        let (x, y) = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
        // Not normalised: its length along the axis is 1.
        (frame.base + frame.step_x * x + frame.step_y * y) * values[index]
    };
    let normal = |index: usize| -> Option<Vec3> {
        let (x, y) = (index % width, index / width);
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            return None;
        }
        let here = values[index];
        let pairs = [(index - 1, index + 1), (index - width, index + width)];
        let is_smooth = |&(a, b): &(usize, usize)| {
            let (a, b) = (values[a], values[b]);
            a > 0.0 && b > 0.0 && (0.5 * (a + b) - here).abs() <= MAX_BEND * here
        };
        if !(here > 0.0 && here.is_finite() && pairs.iter().all(is_smooth)) {
            return None;
        }
        let [across, down] = pairs.map(|(a, b)| point(b) - point(a));
        // x right, y down: down × across points back to the camera.
        down.cross(across).try_normalize()
    };
    let pixels = (0..width * height)
        .into_par_iter()
        .with_min_len(4096)
        .map(|index| normal(index).unwrap_or(Vec3::ZERO).to_array())
        .collect();
    Image::from_pixels(depth.width(), depth.height(), pixels)
        .expect("a value for each pixel of the depth map")
}

/// Unit normals of the planes through the neighbours of each point, of either sign; zero where they
/// lie in none.
pub(crate) fn normals_of_points(positions: &[Vec3]) -> Vec<Vec3> {
    if positions.len() <= PLANE_NEIGHBOURS {
        return vec![Vec3::ZERO; positions.len()];
    }
    let coordinates: Vec<[f32; 3]> = positions.iter().map(Vec3::to_array).collect();
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&coordinates);
    let expected = NonZeroUsize::new(PLANE_NEIGHBOURS + 1).expect("a positive constant");
    coordinates
        .par_iter()
        .map(|point| {
            let near = tree.nearest_n::<SquaredEuclidean>(point, expected);
            let near = near.iter().map(|n| positions[n.item as usize]);
            flat_normal(near).unwrap_or(Vec3::ZERO)
        })
        .collect()
}

/// The normal of points that lie in a plane.
fn flat_normal(points: impl Iterator<Item = Vec3> + Clone) -> Option<Vec3> {
    let plane = FittedPlane::through(points);
    let [thickness, width, _] = plane.variances;
    plane.normal.filter(|_| thickness <= MAX_THICKNESS * width)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DMat3, DVec3};

    #[test]
    fn a_slanted_wall_has_its_normal_and_an_edge_has_none() {
        let camera = Camera {
            width: 40,
            height: 30,
            fx: 35.0,
            fy: 33.0,
            cx: 19.0,
            cy: 16.0,
            world_from_camera: DAffine3 {
                matrix3: DMat3::from_rotation_y(0.7),
                translation: DVec3::new(1.0, 2.0, 3.0),
            },
        };
        // The plane n · p = −4 in camera space; depth at a direction d of length 1 along the axis
        // is −4 / (n · d).
        let normal = DVec3::new(0.3, -0.2, -0.9).normalize();
        let mut depth = Image::filled(40, 30, [0.0_f32]);
        for (index, pixel) in depth.pixels_mut().iter_mut().enumerate() {
            let (x, y) = ((index % 40) as f64 + 0.5, (index / 40) as f64 + 0.5);
            let direction = DVec3::new((x - 19.0) / 35.0, (y - 16.0) / 33.0, 1.0);
            pixel[0] = (-4.0 / normal.dot(direction)) as f32;
            if index % 40 > 30 {
                pixel[0] *= 1.5;
            }
        }
        let expected = (camera.world_from_camera.matrix3 * normal).as_vec3();
        let found = normals_from_depth(&depth, &camera);
        for x in 1..39 {
            let own = Vec3::from(found.get(x, 15));
            if x == 30 || x == 31 {
                assert_eq!(own, Vec3::ZERO, "{x}");
            } else {
                // Single precision of depths, differences of some hundredths.
                assert!(own.dot(expected) > 0.9999, "{x}: {own} {expected}");
            }
        }
        assert_eq!(found.get(0, 15), [0.0; 3]);
    }

    #[test]
    fn points_of_a_plane_have_its_normal_and_those_of_a_ball_none() {
        let grid = |f: &dyn Fn(f32, f32, f32) -> Vec3| -> Vec<Vec3> {
            let side = 0..6;
            let all = side.clone().flat_map(|x| side.clone().map(move |y| (x, y)));
            let all = all.flat_map(|(x, y)| (0..6).map(move |z| (x, y, z)));
            all.map(|(x, y, z)| f(x as f32, y as f32, z as f32))
                .collect()
        };
        let wall = grid(&|x, y, z| Vec3::new(x + 0.17 * z, 2.0, y + 0.13 * z));
        assert!(normals_of_points(&wall).iter().all(|n| n.y.abs() > 0.9999));
        let block = grid(&Vec3::new);
        let inner = normals_of_points(&block)[2 * 36 + 2 * 6 + 2];
        assert_eq!(inner, Vec3::ZERO);
    }
}
