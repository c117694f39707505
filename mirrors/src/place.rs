//! Mirrors put into a scene, in place of what training made of what they show.

use crate::Mirror;
use crate::evidence::{Evidence, Scale, difference};
use crate::plane;
use eagpt_scene::{Camera, Gaussians, SceneEdit, View};
use eagpt_trace::blend::Contribution;
use eagpt_trace::features::GBuffer;
use eagpt_trace::{Features, TraceError, Tracer};

/// Height above or below the plane of a mirror up to which a Gaussian is of it, in thicknesses of
/// surfaces.
const AT_PLANE: f32 = 1.5;
/// Share of the weight of a Gaussian in pixels that show what is mirrored from which on it is of
/// that, and the same of one close before a mirror.
const SHARE_SHOWN: f32 = 0.5;
const SHARE_CLOSE: f32 = 0.25;
/// A pixel is explained by what a mirror reflects if it differs by less, in squared logarithms of
/// light.
const MOST_OFF: f32 = 0.15;
/// A pixel shows a mirror if the scene is at most this nearer than it, in parts of its distance.
const BEFORE: f32 = 0.02;

/// A scene that makes room for mirrors.
pub struct Room<'a> {
    mirrors: &'a [Mirror],
    scale: Scale,
    gaussians: &'a Gaussians,
    tracer: &'a dyn Tracer,
    /// Weight of each Gaussian in the pixels of all views.
    weights: Vec<f32>,
    /// The same in pixels of each mirror, `[mirrors][n]`.
    shown: Vec<Vec<Shown>>,
}

/// Weight of a Gaussian in the pixels of a mirror.
#[derive(Clone, Copy, Default)]
struct Shown {
    /// In those whose lines of sight meet it, …
    in_mirror: f32,
    /// … and in those that show what it reflects.
    as_image: f32,
}

impl<'a> Room<'a> {
    /// The scene of `gaussians`, which `tracer` traces in the light of the evidence by which the
    /// mirrors were found.
    pub fn new(
        mirrors: &'a [Mirror],
        evidence: &Evidence,
        gaussians: &'a Gaussians,
        tracer: &'a dyn Tracer,
    ) -> Self {
        let num = gaussians.len();
        Self {
            mirrors,
            scale: evidence.scale(),
            gaussians,
            tracer,
            weights: vec![0.0; num],
            shown: vec![vec![Shown::default(); num]; mirrors.len()],
        }
    }

    /// Adds what a view of that light shows.
    ///
    /// # Errors
    /// If the device fails.
    pub fn add(&mut self, view: &View) -> Result<(), TraceError> {
        let crossed = crossed(self.mirrors, &view.camera);
        for found in self.contributions(&view.camera, &vec![false; crossed.len()])? {
            self.weights[found.gaussian as usize] += found.weight;
        }
        let is_image = self.images(view, &crossed)?;
        for number in 0..self.mirrors.len() {
            let is_of = |met: &Option<(f32, usize)>| met.is_some_and(|(_, own)| own == number);
            let is_in: Vec<bool> = crossed.iter().map(is_of).collect();
            if !is_in.contains(&true) {
                continue;
            }
            let is_shown: Vec<bool> = (is_in.iter().zip(&is_image))
                .map(|(is_in, is_image)| *is_in && *is_image)
                .collect();
            for found in self.contributions(&view.camera, &is_in)? {
                let shown = &mut self.shown[number][found.gaussian as usize];
                shown.in_mirror += found.weighted_value;
            }
            for found in self.contributions(&view.camera, &is_shown)? {
                let shown = &mut self.shown[number][found.gaussian as usize];
                shown.as_image += found.weighted_value;
            }
        }
        Ok(())
    }

    /// Whether the photograph shows in each pixel what the mirror there reflects.
    fn images(
        &self,
        view: &View,
        crossed: &[Option<(f32, usize)>],
    ) -> Result<Vec<bool>, TraceError> {
        let (mut rays, mut reflected) = (Vec::new(), Vec::new());
        let (camera, frame) = (&view.camera, view.camera.ray_frame());
        for (pixel, met) in crossed.iter().enumerate() {
            let Some((distance, number)) = *met else {
                continue;
            };
            let mirror = &self.mirrors[number];
            let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            let from = self.scale.past();
            let ray = (frame.origin, direction);
            rays.push(plane::reflected(mirror.plane(), ray, distance, from));
            reflected.push((pixel, mirror.reflectance));
        }
        let met = self.tracer.trace_rays(&rays)?;
        let mut is_image = vec![false; crossed.len()];
        for ((pixel, reflectance), met) in reflected.into_iter().zip(met) {
            let image = self.scale.log(met.radiance() * reflectance);
            let seen = self.scale.log(view.radiance.pixels()[pixel].into());
            is_image[pixel] = difference(seen - image) <= MOST_OFF;
        }
        Ok(is_image)
    }

    /// Weights of Gaussians, and in `some` of the pixels of a camera.
    fn contributions(
        &self,
        camera: &Camera,
        some: &[bool],
    ) -> Result<Vec<Contribution>, TraceError> {
        let value = |pixel: usize, _: &Features| f32::from(u8::from(some[pixel]));
        Ok(self.tracer.contributions(camera, &value)?.1)
    }

    /// The edit that takes out what mirrors replace and brings their discs, which are fixed. In and
    /// behind them all goes that is seen in their place, before them what shows what they reflect.
    pub fn edit(&self) -> SceneEdit {
        let goes = |i: usize| {
            let (position, all) = (self.gaussians.positions[i], self.weights[i]);
            self.mirrors.iter().zip(&self.shown).any(|(mirror, shown)| {
                let (shown, height) = (shown[i], mirror.plane().height(position));
                if height.abs() <= AT_PLANE * self.scale.near && mirror.covers(position) {
                    // A large one that reaches beyond is of the wall around.
                    return shown.in_mirror >= SHARE_SHOWN * all;
                }
                let (of_mirror, share) = match height {
                    ..0.0 => (shown.in_mirror, SHARE_SHOWN),
                    _ if height <= self.scale.past() => (shown.as_image, SHARE_CLOSE),
                    _ => (shown.as_image, SHARE_SHOWN),
                };
                of_mirror > share * all
            })
        };
        let discs: Vec<Gaussians> = self.mirrors.iter().map(Mirror::discs).collect();
        SceneEdit {
            keep: (0..self.gaussians.len()).map(|i| !goes(i)).collect(),
            moved: Vec::new(),
            fixed: discs.iter().flat_map(Gaussians::iter).collect(),
        }
    }
}

/// Distance and number of the nearest mirror along the ray of each pixel.
fn crossed(mirrors: &[Mirror], camera: &Camera) -> Vec<Option<(f32, usize)>> {
    let frame = camera.ray_frame();
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
    let nearest = |(x, y): (u32, u32)| {
        let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
        let met = |(number, mirror): (usize, &Mirror)| {
            Some((mirror.meet(frame.origin, direction)?, number))
        };
        let met = mirrors.iter().enumerate().filter_map(met);
        met.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    pixels.map(nearest).collect()
}

/// Whether each pixel of `camera` shows one of `mirrors`, in part at least, in the scene with them
/// that is `seen` from there; `None` if none does.
pub fn pixels(mirrors: &[Mirror], camera: &Camera, seen: &GBuffer) -> Option<Vec<bool>> {
    let shows = |(met, seen): (&Option<(f32, usize)>, &Features)| {
        met.is_some_and(|(distance, _)| seen.mean_distance() >= (1.0 - BEFORE) * distance)
    };
    let whole: Vec<bool> = (crossed(mirrors, camera).iter().zip(&seen.pixels))
        .map(shows)
        .collect();
    if !whole.contains(&true) {
        return None;
    }
    let (width, height) = (camera.width as usize, camera.height as usize);
    let around = |i: usize| {
        let (x, y) = (i % width, i / width);
        let rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
        let columns = x.saturating_sub(1)..=(x + 1).min(width - 1);
        rows.flat_map(|y| columns.clone().map(move |x| y * width + x))
            .any(|i| whole[i])
    };
    Some((0..whole.len()).map(around).collect())
}
