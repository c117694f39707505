//! What a camera sees: light, and what is known of the surfaces behind every pixel.

use crate::light::Lighting;
use crate::light::path::{Draw, MAX_BOUNCES, mirrored};
use crate::light::points::Points;
use crate::room::{Gloss, Hit, LIFT, MAX_CONDITIONS, PerCondition};
use eagpt_scene::camera::RayFrame;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Image, View};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// How pixels are sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sampling {
    /// Rays for each pixel of the camera, at least one for each cell; rounded up to as many in every cell.
    pub num_samples: u32,
    /// Cells along each side of a pixel, whose light is kept apart: the pixels of the sensor.
    pub num_cells: u32,
}

impl Sampling {
    fn per_cell(&self) -> u32 {
        self.num_samples.div_ceil(self.num_cells * self.num_cells)
    }
}

/// A photograph without noise, in all conditions.
#[derive(Debug, Clone)]
pub struct Photograph {
    camera: Camera,
    num_cells: u32,
    /// Linear radiance in each condition, `num_cells` times as large as the camera's image along each side.
    radiance: Vec<Image<3>>,
    /// Mean diffuse albedo in each condition, of the camera's size; black where surfaces shine.
    albedo: Vec<Image<3>>,
    /// What the ray through each pixel's centre meets.
    centres: Vec<Option<Hit>>,
}

/// Light and albedo of a pixel's cells.
struct Pixel {
    /// `[cell][condition]`.
    radiance: Vec<PerCondition>,
    albedo: PerCondition,
}

impl Photograph {
    /// Takes a photograph. The same bits for any number of threads.
    pub fn take(
        lighting: &Lighting<'_>,
        camera: &Camera,
        sampling: Sampling,
        key: RandomKey,
    ) -> Self {
        let frame = camera.ray_frame();
        let num_pixels = camera.num_pixels() as u32;
        let place =
            |pixel: u32| Vec2::new((pixel % camera.width) as f32, (pixel / camera.width) as f32);
        let pixels: Vec<Pixel> = (0..num_pixels)
            .into_par_iter()
            .map(|pixel| {
                let points = Points::new(key, pixel);
                expose(lighting, &frame, place(pixel), sampling, &points)
            })
            .collect();
        let centres = (0..num_pixels).into_par_iter().map(|pixel| {
            let at = place(pixel) + 0.5;
            lighting
                .room
                .meet(frame.origin, frame.direction(at.x, at.y))
        });
        let conditions = 0..lighting.room.num_conditions();
        Self {
            camera: *camera,
            num_cells: sampling.num_cells,
            radiance: conditions
                .clone()
                .map(|condition| spread(camera, sampling.num_cells, &pixels, condition))
                .collect(),
            albedo: conditions
                .map(|condition| {
                    let albedo = pixels.iter().map(|p| p.albedo[condition].to_array());
                    image(camera, albedo.collect())
                })
                .collect(),
            centres: centres.collect(),
        }
    }

    /// Light on the sensor in a condition: the camera's image, finer by the number of cells along each side.
    pub fn fine(&self, condition: usize) -> &Image<3> {
        &self.radiance[condition]
    }

    /// What the ray through the centre of each pixel meets, row by row.
    pub fn centres(&self) -> &[Option<Hit>] {
        &self.centres
    }

    /// The photograph in a condition with everything that is known about it. Radiance and albedo are means over the pixel; mask, normal
    /// and depth are those of its centre.
    pub fn view(&self, lighting: &Lighting<'_>, condition: usize, name: &str) -> View {
        let room = lighting.room;
        let (origin, forward) = (self.camera.origin(), self.camera.forward());
        let shines = |hit: &Hit| room.emitted_in(condition, hit.surface, hit.face) != Vec3::ZERO;
        View {
            name: name.to_owned(),
            camera: self.camera,
            radiance: self.radiance[condition].averaged(self.num_cells),
            emission: Some(self.derived(|hit| [f32::from(u8::from(shines(hit)))])),
            normal: Some(self.derived(|hit| hit.normal.to_array())),
            alpha: None,
            depth: Some(self.derived(|hit| [(hit.position - origin).dot(forward)])),
            albedo: Some(self.albedo[condition].clone()),
        }
    }

    fn derived<const C: usize>(&self, value: impl Fn(&Hit) -> [f32; C]) -> Image<C> {
        let values = self
            .centres
            .iter()
            .map(|hit| hit.as_ref().map_or([0.0; C], &value));
        image(&self.camera, values.collect())
    }
}

fn image<const C: usize>(camera: &Camera, pixels: Vec<[f32; C]>) -> Image<C> {
    Image::from_pixels(camera.width, camera.height, pixels).expect("one value for each pixel")
}

/// The cells of all pixels as an image.
fn spread(camera: &Camera, num_cells: u32, pixels: &[Pixel], condition: usize) -> Image<3> {
    let mut fine = Image::filled(
        camera.width * num_cells,
        camera.height * num_cells,
        [0.0; 3],
    );
    let width = fine.width();
    for (y, row) in fine
        .pixels_mut()
        .chunks_exact_mut(width as usize)
        .enumerate()
    {
        let y = y as u32;
        for (x, value) in (0..).zip(row) {
            let pixel = &pixels[(y / num_cells * camera.width + x / num_cells) as usize];
            let cell = y % num_cells * num_cells + x % num_cells;
            *value = pixel.radiance[cell as usize][condition].to_array();
        }
    }
    fine
}

fn expose(
    lighting: &Lighting<'_>,
    frame: &RayFrame,
    corner: Vec2,
    sampling: Sampling,
    points: &Points,
) -> Pixel {
    let (per_cell, num_cells) = (sampling.per_cell(), sampling.num_cells);
    let mut albedo = [Vec3::ZERO; MAX_CONDITIONS];
    let mut radiance = Vec::with_capacity((num_cells * num_cells) as usize);
    for cell in 0..num_cells * num_cells {
        let mut total = [Vec3::ZERO; MAX_CONDITIONS];
        for i in 0..per_cell {
            let sample = cell * per_cell + i;
            let numbers = points.block(sample, 0);
            let within = Vec2::new((cell % num_cells) as f32, (cell / num_cells) as f32)
                + Vec2::new(numbers[0], numbers[1]);
            let at = corner + within / num_cells as f32;
            let direction = frame.direction(at.x, at.y);
            let Some(hit) = lighting.room.meet(frame.origin, direction) else {
                continue;
            };
            let draw = Draw {
                sample,
                block: 1,
                max_bounces: MAX_BOUNCES,
            };
            let arriving = lighting.arriving(&hit, points, draw);
            let own = lighting.room.albedo(hit.surface, hit.face, hit.st);
            let emitted = lighting.room.emitted(hit.surface, hit.face);
            let mirror = Vec2::new(numbers[2], numbers[3]);
            let coat = lighting.room.material(hit.surface).gloss.map(|gloss| {
                reflection(lighting, &hit, (direction, gloss), points, (sample, mirror))
            });
            for condition in 0..lighting.emitters.len() {
                let emitted = emitted.map_or(Vec3::ZERO, |e| e[condition]);
                if emitted != Vec3::ZERO {
                    total[condition] += emitted;
                    continue;
                }
                let diffuse = own * arriving[condition];
                total[condition] += coat.map_or(diffuse, |(share, light)| {
                    diffuse * (1.0 - share) + light[condition] * share
                });
                albedo[condition] += own;
            }
        }
        radiance.push(total.map(|light| light / per_cell as f32));
    }
    let num = (num_cells * num_cells * per_cell) as f32;
    Pixel {
        radiance,
        albedo: albedo.map(|sum| sum / num),
    }
}

/// What a coat mirrors: its share (Schlick 1994) and one sample of the light.
fn reflection(
    lighting: &Lighting<'_>,
    hit: &Hit,
    (direction, gloss): (Vec3, Gloss),
    points: &Points,
    (sample, uniform): (u32, Vec2),
) -> (f32, PerCondition) {
    let grazing = 1.0 - hit.normal.dot(-direction).clamp(0.0, 1.0);
    let share = gloss.reflectance + (1.0 - gloss.reflectance) * grazing.powi(5);
    let mirrored = mirrored(direction, hit.normal, gloss.roughness, uniform);
    let origin = hit.position + hit.normal * LIFT;
    let Some(next) = lighting.room.meet(origin, mirrored) else {
        return (share, [Vec3::ZERO; MAX_CONDITIONS]);
    };
    let draw = Draw {
        sample,
        // Behind all that the path itself may take.
        block: 1 + 2 * MAX_BOUNCES,
        max_bounces: MAX_BOUNCES,
    };
    (share, lighting.leaving(&next, points, draw))
}
