//! Starting Gaussians from a coloured point cloud and the training views.
//!
//! The reference starts every Gaussian with the same scale, a random rotation and the cloud's 8-bit
//! colour. Here scales come from neighbour distances, normals from the local plane of the
//! neighbours, and light from the training views: samples whose display colour agrees with the
//! point's are taken to see the point, and give its linear radiance (beyond the display's white,
//! too) and its emission.

pub(crate) mod agreement;
mod seen;
mod smooth;
mod sweep;

use crate::error::{Result, TrainError};
use crate::options::{InitOptions, TrainOptions};
use eagpt_scene::color::{linear_from_srgb, srgb8_from_linear};
use eagpt_scene::plane::FittedPlane;
use eagpt_scene::ply::PointCloud;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Gaussian, Gaussians, Gloss, Harmonics, View, rotation};
use glam::{Vec2, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZeroUsize;
use std::path::Path;

/// Neighbours whose distances give the scale.
const SCALE_NEIGHBOURS: usize = 3;
/// Neighbours whose plane gives the normal.
const PLANE_NEIGHBOURS: usize = 12;
/// Scales stay within this factor of the cloud's median: an isolated point would become a disc
/// across the room.
const SCALE_RANGE: f32 = 8.0;
/// Share of the points left out on either side of each axis when the extent is measured.
const EXTENT_TAIL: f32 = 0.01;
/// Largest difference of display colours, in 8-bit steps, at which a view is taken to see a point.
const COLOR_TOLERANCE: i32 = 16;

/// Sums over the training views that see a point.
#[derive(Debug, Clone, Copy, Default)]
struct Observed {
    radiance: Vec3,
    num: u32,
    emission: f32,
    num_masked: u32,
}

/// Collects the light of the points from training views, one view after another.
#[derive(Debug, Clone)]
pub struct Initialiser {
    points: PointCloud,
    observed: Vec<Observed>,
    /// Half the diagonal of the box around the middle 98 % of the points, scene units.
    pub extent: f32,
}

impl Initialiser {
    /// Chooses the points to start from: all of them, a random part, or all and random repetitions.
    ///
    /// # Errors
    /// [`TrainError::Dataset`] if there are too few points or they all coincide.
    pub fn new(cloud: &PointCloud, options: &TrainOptions, dataset: &Path) -> Result<Self> {
        let problem = |problem: String| TrainError::Dataset {
            path: dataset.to_owned(),
            problem,
        };
        if cloud.len() <= PLANE_NEIGHBOURS {
            let few = cloud.len();
            return Err(problem(format!(
                "the point cloud has {few} points, at least {} are needed",
                PLANE_NEIGHBOURS + 1
            )));
        }
        let budget = options.gaussians_for(cloud.len());
        let num = options.radiance.densify.num_after(0, budget).max(1);
        let points = choose(cloud, num, options.seed);
        let extent = extent(&points.positions);
        if extent <= 0.0 || !extent.is_finite() {
            return Err(problem(format!(
                "the point cloud has an extent of {extent}"
            )));
        }
        let observed = vec![Observed::default(); points.len()];
        Ok(Self {
            points,
            observed,
            extent,
        })
    }

    /// Adds what one training view shows of the points.
    pub fn observe(&mut self, view: &View) {
        let camera = &view.camera;
        self.observed
            .par_iter_mut()
            .zip(&self.points.positions)
            .zip(&self.points.colors_srgb8)
            .with_min_len(1024)
            .for_each(|((seen, position), color)| {
                let at = camera.project(*position);
                let inside = at.z > 0.0 && at.x >= 0.0 && at.y >= 0.0;
                if !inside || at.x >= camera.width as f32 || at.y >= camera.height as f32 {
                    return;
                }
                let (x, y) = (at.x as u32, at.y as u32);
                if view.valid.as_ref().is_some_and(|v| v.get(x, y) == [0.0]) {
                    return;
                }
                let radiance = view.radiance.get(x, y);
                let agrees = radiance.iter().zip(color).all(|(r, c)| {
                    (i32::from(srgb8_from_linear(*r)) - i32::from(*c)).abs() <= COLOR_TOLERANCE
                });
                if !agrees {
                    return;
                }
                seen.radiance += Vec3::from(radiance);
                seen.num += 1;
                if let Some(mask) = &view.emission {
                    seen.emission += mask.get(x, y)[0];
                    seen.num_masked += 1;
                }
            });
    }

    /// The starting Gaussians.
    pub fn finish(self, options: &InitOptions) -> Gaussians {
        let coordinates: Vec<[f32; 3]> = self.points.positions.iter().map(Vec3::to_array).collect();
        let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&coordinates);
        let wanted = NonZeroUsize::new(PLANE_NEIGHBOURS + 1).expect("a positive constant");
        let shapes: Vec<(f32, Vec3)> = coordinates
            .par_iter()
            .map(|point| {
                let near = tree.nearest_n::<SquaredEuclidean>(point, wanted);
                // The first neighbour is the point itself.
                let mean_square = near[1..=SCALE_NEIGHBOURS]
                    .iter()
                    .map(|n| n.distance)
                    .sum::<f32>()
                    / SCALE_NEIGHBOURS as f32;
                let neighbours = near.iter().map(|n| self.points.positions[n.item as usize]);
                let plane = FittedPlane::through(neighbours);
                (mean_square.sqrt(), plane.normal.unwrap_or(Vec3::Z))
            })
            .collect();
        let mut sorted: Vec<f32> = shapes.iter().map(|s| s.0).collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let median = sorted[sorted.len() / 2].max(self.extent * 1e-6);
        shapes
            .into_iter()
            .enumerate()
            .map(|(i, (distance, normal))| {
                let seen = &self.observed[i];
                let color = Vec3::from(
                    self.points.colors_srgb8[i].map(|c| linear_from_srgb(f32::from(c) / 255.0)),
                );
                let scale = distance.clamp(median / SCALE_RANGE, median * SCALE_RANGE)
                    * options.scale_factor;
                Gaussian {
                    position: self.points.positions[i],
                    scale: Vec2::splat(scale),
                    rotation: rotation::from_z_to(normal),
                    opacity: options.opacity,
                    radiance: if seen.num > 0 {
                        seen.radiance / seen.num as f32
                    } else {
                        color
                    },
                    harmonics: Harmonics::NONE,
                    gloss: Gloss::NONE,
                    emission: match seen.num_masked {
                        0 => options.emission,
                        n => (seen.emission / n as f32).clamp(0.02, 0.98),
                    },
                    albedo: Vec3::splat(options.albedo),
                }
            })
            .collect()
    }
}

/// `num` points: a random choice in the cloud's order, or the whole cloud followed by random points
/// of it, moved about.
fn choose(cloud: &PointCloud, num: usize, seed: u64) -> PointCloud {
    let key = RandomKey::new(seed, Purpose::Initialise, 0);
    if num <= cloud.len() {
        let mut order: Vec<(u32, usize)> = (0..cloud.len())
            .map(|i| (key.stream(i as u32, 0).next_words()[0], i))
            .collect();
        order.sort_unstable();
        let mut chosen: Vec<usize> = order.into_iter().take(num).map(|(_, i)| i).collect();
        chosen.sort_unstable();
        return PointCloud {
            positions: chosen.iter().map(|&i| cloud.positions[i]).collect(),
            colors_srgb8: chosen.iter().map(|&i| cloud.colors_srgb8[i]).collect(),
        };
    }
    let mut out = cloud.clone();
    let coordinates: Vec<[f32; 3]> = cloud.positions.iter().map(Vec3::to_array).collect();
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&coordinates);
    let wanted = NonZeroUsize::new(SCALE_NEIGHBOURS + 1).expect("a positive constant");
    for extra in 0..(num - cloud.len()) as u32 {
        let [which, neighbour, share, _] = key.stream(extra, 1).next_uniforms();
        let i = (which * cloud.len() as f32) as usize % cloud.len();
        let near = tree.nearest_n::<SquaredEuclidean>(&coordinates[i], wanted);
        let other = near[1 + (neighbour * SCALE_NEIGHBOURS as f32) as usize % SCALE_NEIGHBOURS].item
            as usize;
        // Between two neighbours the new point lies on the surface, where a random offset would
        // leave it.
        out.positions
            .push(cloud.positions[i].lerp(cloud.positions[other], 0.25 + 0.5 * share));
        out.colors_srgb8.push(cloud.colors_srgb8[i]);
    }
    out
}

/// Half the diagonal of a box around nearly all `positions`, of which there is at least one.
pub(crate) fn extent(positions: &[Vec3]) -> f32 {
    let range = |axis: usize| {
        let mut values: Vec<f32> = positions.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        let tail = (values.len() as f32 * EXTENT_TAIL) as usize;
        values[values.len() - 1 - tail] - values[tail]
    };
    0.5 * Vec3::new(range(0), range(1), range(2)).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::Preset;

    fn wall() -> PointCloud {
        // A 20×20 grid, 0.1 apart, on the plane through the origin with normal (1, 2, 2)/3.
        let (a, b) = (
            Vec3::new(2.0, -2.0, 1.0) / 3.0,
            Vec3::new(2.0, 1.0, -2.0) / 3.0,
        );
        let positions: Vec<Vec3> = (0..400)
            .map(|i| (a * (i % 20) as f32 + b * (i / 20) as f32) * 0.1)
            .collect();
        PointCloud {
            colors_srgb8: vec![[128, 64, 255]; positions.len()],
            positions,
        }
    }

    fn options(num: Option<usize>) -> TrainOptions {
        let mut options = TrainOptions::preset(Preset::Fast);
        options.num_gaussians = num;
        options.radiance.densify.times = 0;
        options
    }

    #[test]
    fn a_flat_grid_gets_its_normal_and_spacing() {
        let options = options(Some(400));
        let start = Initialiser::new(&wall(), &options, Path::new("x")).unwrap();
        let gaussians = start.finish(&options.init);
        assert_eq!(gaussians.len(), 400);
        let normal = Vec3::new(1.0, 2.0, 2.0) / 3.0;
        for g in gaussians.iter() {
            assert!((g.rotation * Vec3::Z).dot(normal).abs() > 0.9999);
            assert!((g.radiance.z - 1.0).abs() < 1e-6);
        }
        // Inner points have neighbours at exactly 0.1.
        let inner = gaussians.get(210);
        assert!(
            (inner.scale.x - 0.1 * options.init.scale_factor).abs() < 1e-5,
            "{}",
            inner.scale
        );
    }

    #[test]
    fn the_number_of_gaussians_is_the_one_asked_for() {
        for num in [50, 400, 1000] {
            let options = options(Some(num));
            let start = Initialiser::new(&wall(), &options, Path::new("x")).unwrap();
            let gaussians = start.finish(&options.init);
            assert_eq!(gaussians.len(), num);
            let normal = Vec3::new(1.0, 2.0, 2.0) / 3.0;
            assert!(
                gaussians
                    .positions
                    .iter()
                    .all(|p| p.dot(normal).abs() < 1e-5),
                "all lie on the wall"
            );
        }
    }

    #[test]
    fn too_small_a_cloud_is_an_error() {
        let cloud = PointCloud {
            positions: vec![Vec3::ONE; 5],
            colors_srgb8: vec![[0; 3]; 5],
        };
        let message = Initialiser::new(&cloud, &options(None), Path::new("room"))
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("room") && message.contains("5 points"),
            "{message}"
        );
        let cloud = PointCloud {
            positions: vec![Vec3::ONE; 50],
            colors_srgb8: vec![[0; 3]; 50],
        };
        assert!(Initialiser::new(&cloud, &options(None), Path::new("room")).is_err());
    }
}
