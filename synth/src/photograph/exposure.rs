//! Samples of all pixels, and images from them.

use super::{SampleNoise, Sampling};
use crate::light::Lighting;
use crate::light::path::{MAX_BOUNCES, PathSample};
use crate::light::points::Points;
use crate::room::{Hit, MAX_CONDITIONS, PerCondition};
use eagpt_denoise::{Frame, filter};
use eagpt_scene::camera::RayFrame;
use eagpt_scene::color::luminance;
use eagpt_scene::{Camera, Image};
use glam::{Vec2, Vec3};

/// Albedo below which light is not divided by it but by this.
const MIN_ALBEDO: f32 = 1e-3;

/// A filter of a quarter of the usual work: fits at every other pixel, in smaller windows. Light
/// solved for the room has little noise.
const FILTER: filter::Settings = filter::Settings {
    radius: 8,
    first_radius: 6,
    stride: 2,
    ..filter::Settings::DEFAULT
};

/// The samples of all pixels.
pub(super) struct Exposure<'a> {
    pub(super) camera: &'a Camera,
    pub(super) num_cells: u32,
    pub(super) per_cell: u32,
    pub(super) pixels: Vec<Pixel>,
}

/// Samples of a pixel.
pub(super) struct Pixel {
    cells: Vec<[Cell; MAX_CONDITIONS]>,
    pub(super) sums: [LightTotals; MAX_CONDITIONS],
}

/// Means over a cell, in one condition.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    /// Emitted or mirrored light.
    exact: Vec3,
    /// Light that is reflected diffusely.
    reflected: Vec3,
    albedo: Vec3,
}

/// Means over a pixel, in one condition: what a filter has to know of the surfaces that reflect.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LightTotals {
    exact: Vec3,
    reflected: Vec3,
    pub(super) albedo: Vec3,
    normal: Vec3,
    position: Vec3,
    coverage: f32,
    second_moment: f32,
}

impl Exposure<'_> {
    /// An image of the camera's size.
    pub(super) fn image<const C: usize>(&self, value: impl Fn(&Pixel) -> [f32; C]) -> Image<C> {
        super::image(self.camera, self.pixels.iter().map(value).collect())
    }

    /// Light in a condition, cell by cell.
    pub(super) fn fine(&self, condition: usize, noise: SampleNoise) -> Image<3> {
        let filtered = match noise {
            SampleNoise::Filtered => Some(self.filtered(condition)),
            SampleNoise::Kept => None,
        };
        let (num_cells, columns) = (self.num_cells, self.camera.width);
        let (width, height) = (columns * num_cells, self.camera.height * num_cells);
        let mut fine = Image::filled(width, height, [0.0; 3]);
        let rows = fine.pixels_mut().chunks_exact_mut(width as usize);
        for (y, row) in (0..).zip(rows) {
            for (x, value) in (0..).zip(row) {
                let index = (y / num_cells * columns + x / num_cells) as usize;
                let cell = (y % num_cells * num_cells + x % num_cells) as usize;
                let cell = &self.pixels[index].cells[cell][condition];
                let reflected = filtered.as_ref().map_or(cell.reflected, |light| {
                    // Of the pixel's light, what the cell's own texture makes of it.
                    let whole = self.pixels[index].sums[condition].albedo;
                    let light = Vec3::from_array(light.pixels()[index]);
                    light.max(Vec3::ZERO) * cell.albedo / whole.max(Vec3::splat(MIN_ALBEDO))
                });
                *value = (cell.exact + reflected).to_array();
            }
        }
        fine
    }

    /// Diffusely reflected light without the noise of its samples.
    fn filtered(&self, condition: usize) -> Image<3> {
        let vector = |value: fn(&LightTotals) -> Vec3| {
            self.image(|pixel| value(&pixel.sums[condition]).to_array())
        };
        let number =
            |value: fn(&LightTotals) -> f32| self.image(|pixel| [value(&pixel.sums[condition])]);
        let frame = Frame {
            emitted: vector(|sums| sums.exact),
            reflected: vector(|sums| sums.reflected),
            albedo: vector(|sums| sums.albedo),
            normal: vector(|sums| sums.normal),
            position: vector(|sums| sums.position),
            coverage: number(|sums| sums.coverage),
            second_moment: number(|sums| sums.second_moment),
            num_samples: self.num_cells * self.num_cells * self.per_cell,
        };
        filter::reflected(&frame, &FILTER)
    }
}

/// Samples a pixel, cell by cell.
pub(super) fn expose(
    lighting: &Lighting<'_>,
    frame: &RayFrame,
    corner: Vec2,
    sampling: Sampling,
    points: &Points,
) -> Pixel {
    let (per_cell, num_cells) = (sampling.per_cell(), sampling.num_cells);
    let num_conditions = lighting.emitters.len();
    let mut sums = [LightTotals::default(); MAX_CONDITIONS];
    let mut cells = Vec::with_capacity((num_cells * num_cells) as usize);
    for cell in 0..num_cells * num_cells {
        let cell_corner = Vec2::new((cell % num_cells) as f32, (cell / num_cells) as f32);
        let mut means = [Cell::default(); MAX_CONDITIONS];
        for i in 0..per_cell {
            let sample = cell * per_cell + i;
            let [a, b, c, d] = points.block(sample, 0);
            let at = corner + (cell_corner + Vec2::new(a, b)) / num_cells as f32;
            let direction = frame.direction(at.x, at.y);
            let Some(hit) = lighting.room.meet(frame.origin, direction) else {
                continue;
            };
            let place = (sample, Vec2::new(c, d));
            let seen = look(lighting, (direction, &hit), points, place);
            for condition in 0..num_conditions {
                let (cell, sums) = (&mut means[condition], &mut sums[condition]);
                seen.add_to(condition, &hit, (cell, sums));
            }
        }
        let share = 1.0 / per_cell as f32;
        cells.push(means.map(|mean| Cell {
            exact: mean.exact * share,
            reflected: mean.reflected * share,
            albedo: mean.albedo * share,
        }));
    }
    let num = (num_cells * num_cells * per_cell) as f32;
    Pixel {
        cells,
        sums: sums.map(|sums| sums.mean(num)),
    }
}

/// One sample of what leaves a surface.
struct Seen {
    emitted: Option<PerCondition>,
    irradiance: PerCondition,
    albedo: Vec3,
    /// Share that does not reach the colour beneath (Schlick 1994), and mirrored light.
    coat: Option<(Vec3, PerCondition)>,
}

fn look(
    lighting: &Lighting<'_>,
    (direction, hit): (Vec3, &Hit),
    points: &Points,
    (sample, uniform): (u32, Vec2),
) -> Seen {
    let room = lighting.room;
    let path = PathSample {
        sample,
        block: 1,
        max_bounces: MAX_BOUNCES,
    };
    let gloss = room.material(hit.surface).gloss;
    Seen {
        emitted: room.emitted(hit.surface, hit.face).copied(),
        irradiance: lighting.irradiance(hit, points, path),
        albedo: room.albedo(hit.surface, hit.face, hit.st),
        coat: gloss.map(|gloss| {
            let share = gloss.at(hit.normal.dot(-direction));
            let sample = (path, uniform);
            let light = lighting.mirrored(hit, (direction, gloss), (points, sample));
            (share, light)
        }),
    }
}

impl Seen {
    fn add_to(&self, condition: usize, hit: &Hit, (cell, sums): (&mut Cell, &mut LightTotals)) {
        let emitted = self.emitted.map_or(Vec3::ZERO, |e| e[condition]);
        if emitted != Vec3::ZERO {
            cell.exact += emitted;
            sums.exact += emitted;
            return;
        }
        let (share, mirrored) = self
            .coat
            .map_or((Vec3::ZERO, Vec3::ZERO), |(share, light)| {
                (share, light[condition])
            });
        // Light that the coat mirrors does not reach the colour beneath.
        let albedo = self.albedo * (Vec3::ONE - share);
        let irradiance = self.irradiance[condition];
        cell.exact += mirrored;
        cell.reflected += albedo * irradiance;
        cell.albedo += albedo;
        sums.exact += mirrored;
        sums.reflected += albedo * irradiance;
        sums.albedo += albedo;
        sums.normal += hit.normal;
        sums.position += hit.position;
        sums.coverage += 1.0;
        sums.second_moment += luminance(irradiance.to_array()).powi(2);
    }
}

impl LightTotals {
    /// Means over all samples of light and albedo, and over those that reflect of what is known
    /// about surfaces.
    fn mean(&self, num_samples: f32) -> Self {
        let reflecting = self.coverage.max(1.0);
        Self {
            exact: self.exact / num_samples,
            reflected: self.reflected / num_samples,
            albedo: self.albedo / num_samples,
            normal: self.normal / reflecting,
            position: self.position / reflecting,
            coverage: self.coverage / num_samples,
            second_moment: self.second_moment / reflecting,
        }
    }
}
