//! The room as a dataset on disk.

use super::cameras::cameras;
use super::light::{self, MAX_BOUNCES};
use super::shapes::{self, Hit};
use eagpt_scene::color::srgb8_from_linear;
use eagpt_scene::dataset::{DatasetInfo, DatasetWriter, UpAxis};
use eagpt_scene::exr::Precision;
use eagpt_scene::ply::PointCloud;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Image, Result, View};
use glam::Vec3;
use rayon::prelude::*;
use std::path::Path;

/// Points are off their surface by up to this much along each axis, metres, as those of
/// photogrammetry are.
const POINT_NOISE_M: f32 = 0.005;

/// Photography of the room.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RoomOptions {
    /// Number of views.
    pub num_views: usize,
    /// Width of the images, pixels.
    pub width: u32,
    /// Height of the images, pixels.
    pub height: u32,
    /// Light samples per pixel.
    pub num_samples: u32,
    /// Points of the cloud.
    pub num_points: usize,
    /// Seed of the samples.
    pub seed: u64,
}

impl Default for RoomOptions {
    fn default() -> Self {
        Self {
            num_views: 32,
            width: 160,
            height: 120,
            num_samples: 64,
            num_points: 12_000,
            seed: 0,
        }
    }
}

/// Writes the dataset: radiance, emission masks, normals, depths, albedos, and points on what the
/// training views of the split `every-8th` see. `progress` gets the number of views done.
///
/// # Errors
/// If a file cannot be written.
pub fn write(root: &Path, options: &RoomOptions, mut progress: impl FnMut(usize)) -> Result<()> {
    let mut writer = DatasetWriter::create(root, Precision::Half)?;
    let cameras = cameras(options.num_views, options.width, options.height);
    let mut views = Vec::with_capacity(cameras.len());
    for (index, camera) in cameras.iter().enumerate() {
        let view = photograph(index, camera, options);
        writer.write_view(&view)?;
        views.push(view);
        progress(index + 1);
    }
    writer.write_points(&points(&views, options))?;
    writer.finish(&DatasetInfo {
        up_axis: Some(UpAxis::Z),
        metres_per_unit: Some(1.0),
        ..DatasetInfo::default()
    })
}

/// One view with everything that is known about it: one ray through each pixel centre.
fn photograph(index: usize, camera: &Camera, options: &RoomOptions) -> View {
    let key = RandomKey::new(options.seed, Purpose::Render, index as u32);
    let hits: Vec<Hit> = (0..camera.num_pixels())
        .map(|pixel| hit(camera, pixel))
        .collect();
    let light = |(pixel, hit): (usize, &Hit)| {
        let sample = |s| light::radiance(hit, MAX_BOUNCES, &mut key.stream(pixel as u32, s));
        let total: Vec3 = (0..options.num_samples).map(sample).sum();
        (total / options.num_samples as f32).to_array()
    };
    let radiance = hits.par_iter().enumerate().map(light).collect();
    let forward = camera.forward();
    View {
        name: format!("{index:03}"),
        camera: *camera,
        radiance: image(camera, radiance),
        emission: Some(derived(camera, &hits, |h| [f32::from(h.is_light())])),
        normal: Some(derived(camera, &hits, |h| h.normal.to_array())),
        alpha: None,
        depth: Some(derived(camera, &hits, |h| {
            [(h.position - camera.origin()).dot(forward)]
        })),
        albedo: Some(derived(camera, &hits, |h| h.albedo.to_array())),
        specular: None,
        roughness: None,
        clipped: None,
        valid: None,
    }
}

fn hit(camera: &Camera, pixel: usize) -> Hit {
    let frame = camera.ray_frame();
    let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
    shapes::intersect(
        frame.origin,
        frame.direction(x as f32 + 0.5, y as f32 + 0.5),
    )
}

fn image<const C: usize>(camera: &Camera, pixels: Vec<[f32; C]>) -> Image<C> {
    Image::from_pixels(camera.width, camera.height, pixels).expect("one value for each pixel")
}

fn derived<const C: usize>(
    camera: &Camera,
    hits: &[Hit],
    value: impl Fn(&Hit) -> [f32; C],
) -> Image<C> {
    image(camera, hits.iter().map(value).collect())
}

/// Points that random pixels of the training views see, with the colours seen there.
fn points(views: &[View], options: &RoomOptions) -> PointCloud {
    let training: Vec<&View> = (0..)
        .zip(views)
        .filter(|(index, _)| index % 8 != 0)
        .map(|(_, view)| view)
        .collect();
    let key = RandomKey::new(options.seed, Purpose::Initialise, 0);
    let mut cloud = PointCloud::default();
    if training.is_empty() {
        return cloud;
    }
    for point in 0..options.num_points {
        let mut random = key.stream(point as u32, 0);
        let [which, pixel, ..] = random.next_words();
        let view = training[which as usize % training.len()];
        let pixel = pixel as usize % view.camera.num_pixels();
        let [x, y, z, _] = random.next_uniforms();
        let noise = (Vec3::new(x, y, z) * 2.0 - 1.0) * POINT_NOISE_M;
        cloud
            .positions
            .push(hit(&view.camera, pixel).position + noise);
        let color = view.radiance.pixels()[pixel].map(srgb8_from_linear);
        cloud.colors_srgb8.push(color);
    }
    cloud
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::Dataset;
    use eagpt_scene::dataset::SplitRule;

    #[test]
    fn the_dataset_reads_back_and_shows_the_light() {
        let dir = tempfile::tempdir().unwrap();
        let options = RoomOptions {
            num_views: 9,
            width: 24,
            height: 16,
            num_samples: 2,
            num_points: 50,
            seed: 3,
        };
        write(dir.path(), &options, |_| ()).unwrap();
        let dataset = Dataset::open(dir.path()).unwrap();
        assert_eq!(dataset.split(SplitRule::Every8th).unwrap().test, [0, 8]);
        assert_eq!(dataset.points().unwrap().unwrap().len(), 50);
        let mut num_lit = 0;
        for index in 0..dataset.len() {
            let view = dataset.load_view(index).unwrap();
            assert!(view.depth.unwrap().values().iter().all(|d| *d > 0.0));
            let mask = view.emission.unwrap();
            for (pixel, [is_light]) in view.radiance.pixels().iter().zip(mask.pixels()) {
                num_lit += usize::from(*is_light == 1.0);
                // Half precision of a light of 12, 11 and 9 is exact.
                let is_bright = *pixel == shapes::LIGHT_RADIANCE.to_array();
                assert_eq!(is_bright, *is_light == 1.0);
            }
        }
        assert!(num_lit > 20, "{num_lit}");
    }
}
