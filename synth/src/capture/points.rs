//! Point clouds that training starts from: what the training views see, a little off, as
//! photogrammetry has it.

use super::SynthOptions;
use eagpt_scene::View;
use eagpt_scene::color::srgb8_from_linear;
use eagpt_scene::ply::PointCloud;
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::Vec3;

/// Points are off their surface by up to this much along each axis, metres.
const POINT_NOISE_M: f32 = 0.005;

/// Collects points view by view.
pub(super) struct PointSource {
    key: RandomKey,
    num_points: u32,
    num_training: u32,
    clouds: Vec<PointCloud>,
}

impl PointSource {
    pub(super) fn new(options: &SynthOptions, num_views: usize, num_conditions: usize) -> Self {
        Self {
            key: RandomKey::new(options.seed, Purpose::Capture, u32::MAX),
            num_points: options.num_points,
            num_training: (0..num_views).filter(|i| is_training(*i)).count() as u32,
            clouds: vec![PointCloud::default(); num_conditions],
        }
    }

    /// Takes its share of points from a view, if it is one to train on. The same places in all
    /// conditions.
    pub(super) fn look(&mut self, index: usize, condition: usize, view: &View) {
        let Some(depth) = view.depth.as_ref().filter(|_| is_training(index)) else {
            return;
        };
        let before = (0..index).filter(|i| is_training(*i)).count() as u64;
        let until =
            |view: u64| (u64::from(self.num_points) * view / u64::from(self.num_training)) as u32;
        let cloud = &mut self.clouds[condition];
        let frame = view.camera.ray_frame();
        for point in until(before)..until(before + 1) {
            let mut random = self.key.stream(point, 0);
            let [word, ..] = random.next_words();
            let pixel = word % view.camera.num_pixels() as u32;
            let (x, y) = (pixel % view.camera.width, pixel / view.camera.width);
            let [depth] = depth.get(x, y);
            if depth <= 0.0 {
                continue;
            }
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            let distance = depth / direction.dot(view.camera.forward());
            let [a, b, c, _] = random.next_uniforms();
            let noise = (Vec3::new(a, b, c) * 2.0 - 1.0) * POINT_NOISE_M;
            cloud
                .positions
                .push(frame.origin + direction * distance + noise);
            let color = view.radiance.get(x, y).map(srgb8_from_linear);
            cloud.colors_srgb8.push(color);
        }
    }

    pub(super) fn clouds(self) -> Vec<PointCloud> {
        self.clouds
    }
}

/// Whether the split `every-8th` trains on a view.
fn is_training(index: usize) -> bool {
    !index.is_multiple_of(8)
}
