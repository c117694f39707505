//! Images of a camera: light, and the surfaces behind every pixel.

mod exposure;

use crate::light::Lighting;
use crate::light::points::Points;
use crate::room::{Hit, MAX_CONDITIONS, Room};
use eagpt_scene::camera::RayFrame;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Image, View};
use exposure::{Exposure, Pixel, expose};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Sampling of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Sampling {
    /// Rays for each pixel of the camera, at least one for each cell; rounded up to as many in
    /// every cell.
    pub(crate) num_samples: u32,
    /// Cells along each side of a pixel, whose light is kept apart: the pixels of the sensor.
    pub(crate) num_cells: u32,
    /// Pixels around the camera's image that are photographed, too, for a lens that sees more.
    pub(crate) margin: u32,
    /// Treatment of noise.
    pub(crate) noise: SampleNoise,
}

/// Treatment of the noise of sampled light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SampleNoise {
    /// Irradiance is filtered; albedo, texture and emitters stay as sampled.
    #[default]
    Filtered,
    /// All light stays as sampled.
    Kept,
}

impl Sampling {
    fn per_cell(&self) -> u32 {
        self.num_samples.div_ceil(self.num_cells * self.num_cells)
    }
}

/// A photograph before any camera adds its noise, in all conditions.
#[derive(Debug, Clone)]
pub(crate) struct Photograph {
    camera: Camera,
    /// The camera with the margin.
    wide: Camera,
    sampling: Sampling,
    /// Linear radiance in each condition, margin included, `num_cells` times as large as the wide
    /// camera's image along each side.
    radiance: Vec<Image<3>>,
    /// Mean diffuse albedo in each condition, margin included; black where surfaces emit.
    albedo: Vec<Image<3>>,
    /// Hit of the ray through each pixel's centre, margin included.
    centres: Vec<Option<Hit>>,
    /// F0 of the surface there, and perceptual roughness; 0 where nothing is glossy.
    gloss: Vec<[f32; 4]>,
    /// Conditions in which emitters cover at least half of each pixel, margin included.
    emitting: Vec<Conditions>,
}

/// A bit for each condition.
type Conditions = u8;

/// Rays along each side of a pixel that test its share of emitters. Even: an edge through the
/// middle of a pixel lies between rays.
const GRID: u32 = 8;

impl Photograph {
    /// Takes a photograph. The same bits for any number of threads.
    pub(crate) fn take(
        lighting: &Lighting<'_>,
        camera: &Camera,
        sampling: Sampling,
        key: RandomKey,
    ) -> Self {
        let wide = widened(camera, sampling.margin);
        let frame = wide.ray_frame();
        let num_pixels = wide.num_pixels() as u32;
        let place =
            |pixel: u32| Vec2::new((pixel % wide.width) as f32, (pixel / wide.width) as f32);
        let pixels: Vec<Pixel> = (0..num_pixels)
            .into_par_iter()
            .map(|pixel| {
                let points = Points::new(key, pixel);
                expose(lighting, &frame, place(pixel), sampling, &points)
            })
            .collect();
        let centres = (0..num_pixels)
            .into_par_iter()
            .map(|pixel| meet(lighting.room, &frame, place(pixel) + 0.5));
        let centres: Vec<Option<Hit>> = centres.collect();
        let emitting = emitting(lighting.room, &wide, &centres);
        let gloss = |hit: &Option<Hit>| {
            let gloss = lighting.room.material(hit.as_ref()?.surface).gloss?;
            let [r, g, b] = gloss.reflectance.to_array();
            Some([r, g, b, gloss.roughness])
        };
        let gloss = centres.iter().map(|hit| gloss(hit).unwrap_or_default());
        let gloss = gloss.collect();
        let exposure = Exposure {
            camera: &wide,
            num_cells: sampling.num_cells,
            per_cell: sampling.per_cell(),
            pixels,
        };
        let conditions = 0..lighting.room.num_conditions();
        Self {
            camera: *camera,
            wide,
            sampling,
            radiance: conditions
                .clone()
                .map(|condition| exposure.fine(condition, sampling.noise))
                .collect(),
            albedo: conditions
                .map(|condition| exposure.image(|pixel| pixel.sums[condition].albedo.to_array()))
                .collect(),
            centres,
            gloss,
            emitting,
        }
    }

    /// Light in a condition, margin included, finer than the camera's image by the number of cells
    /// along each side.
    pub(crate) fn fine(&self, condition: usize) -> &Image<3> {
        &self.radiance[condition]
    }

    /// The pinhole camera of [`Self::fine`].
    pub(crate) fn fine_camera(&self) -> Camera {
        self.wide.magnified(self.sampling.num_cells)
    }

    /// Hit of the ray through the centre of each pixel, margin included, row by row.
    pub(crate) fn centres(&self) -> &[Option<Hit>] {
        &self.centres
    }

    /// The photograph in a condition with everything that is known about it. Radiance and albedo
    /// are means over the pixel, the mask is where lights cover at least half of it; normal and
    /// depth are those of its centre.
    pub(crate) fn view(&self, condition: usize, name: &str) -> View {
        let (origin, forward) = (self.camera.origin(), self.camera.forward());
        let mask = self.emitting.iter();
        let mask = mask.map(|emitting| [f32::from(emitting >> condition & 1)]);
        View {
            name: name.to_owned(),
            camera: self.camera,
            radiance: self.cropped(&self.radiance[condition].averaged(self.sampling.num_cells)),
            emission: Some(self.cropped(&image(&self.wide, mask.collect()))),
            normal: Some(self.derived(|hit| hit.normal.to_array())),
            alpha: None,
            depth: Some(self.derived(|hit| [(hit.position - origin).dot(forward)])),
            albedo: Some(self.cropped(&self.albedo[condition])),
            specular: Some(self.of_gloss(|&[r, g, b, _]| [r, g, b])),
            roughness: Some(self.of_gloss(|&[.., roughness]| [roughness])),
            clipped: None,
            valid: None,
        }
    }

    fn derived<const C: usize>(&self, value: impl Fn(&Hit) -> [f32; C]) -> Image<C> {
        let values = self
            .centres
            .iter()
            .map(|hit| hit.as_ref().map_or([0.0; C], &value));
        self.cropped(&image(&self.wide, values.collect()))
    }

    fn of_gloss<const C: usize>(&self, value: impl Fn(&[f32; 4]) -> [f32; C]) -> Image<C> {
        self.cropped(&image(&self.wide, self.gloss.iter().map(value).collect()))
    }

    /// An image without its margin.
    fn cropped<const C: usize>(&self, wide: &Image<C>) -> Image<C> {
        let (margin, camera) = (self.sampling.margin, &self.camera);
        let pixels = (0..camera.height)
            .flat_map(|y| (0..camera.width).map(move |x| wide.get(x + margin, y + margin)));
        image(camera, pixels.collect())
    }
}

fn meet(room: &Room, frame: &RayFrame, at: Vec2) -> Option<Hit> {
    room.meet(frame.origin, frame.direction(at.x, at.y))
}

/// The conditions in which lights cover at least half of each pixel: by a grid of rays where the
/// centres of a pixel and its neighbours do not agree. The samples of the light are no measure for
/// that: at a half, their noise would decide.
fn emitting(room: &Room, camera: &Camera, centres: &[Option<Hit>]) -> Vec<Conditions> {
    let frame = camera.ray_frame();
    let num_conditions = room.num_conditions();
    let emits_in = |hit: &Hit, condition: usize| {
        room.emitted_in(condition, hit.surface, hit.face) != Vec3::ZERO
    };
    let of_hit = |hit: &Option<Hit>| -> Conditions {
        let Some(hit) = hit else { return 0 };
        let emitting = (0..num_conditions).filter(|&condition| emits_in(hit, condition));
        emitting.fold(0, |bits, condition| bits | 1 << condition)
    };
    let of_centres: Vec<Conditions> = centres.par_iter().map(of_hit).collect();
    let (width, height) = (camera.width, camera.height);
    let is_uniform = |x: u32, y: u32| {
        let own = of_centres[(y * width + x) as usize];
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let mut around =
            rows.flat_map(|y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| (x, y)));
        around.all(|(x, y)| of_centres[(y * width + x) as usize] == own)
    };
    let by_grid = |x: u32, y: u32| {
        let mut num = [0_u32; MAX_CONDITIONS];
        for ray in 0..GRID * GRID {
            let part = Vec2::new((ray % GRID) as f32, (ray / GRID) as f32) + 0.5;
            let at = Vec2::new(x as f32, y as f32) + part / GRID as f32;
            let bits = of_hit(&meet(room, &frame, at));
            for (condition, num) in num.iter_mut().enumerate() {
                *num += u32::from(bits >> condition & 1);
            }
        }
        let covered = (0..num_conditions).filter(|&condition| 2 * num[condition] >= GRID * GRID);
        covered.fold(0, |bits, condition| bits | 1 << condition)
    };
    (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let (x, y) = (pixel % width, pixel / width);
            if is_uniform(x, y) {
                of_centres[pixel as usize]
            } else {
                by_grid(x, y)
            }
        })
        .collect()
}

/// A camera that sees `margin` more pixels on all sides.
fn widened(camera: &Camera, margin: u32) -> Camera {
    Camera {
        width: camera.width + 2 * margin,
        height: camera.height + 2 * margin,
        cx: camera.cx + f64::from(margin),
        cy: camera.cy + f64::from(margin),
        ..*camera
    }
}

fn image<const C: usize>(camera: &Camera, pixels: Vec<[f32; C]>) -> Image<C> {
    Image::from_pixels(camera.width, camera.height, pixels).expect("one value for each pixel")
}
