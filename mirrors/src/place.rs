//! Mirrors put into a scene, in place of what training made of what they show.

use crate::Mirror;
use crate::evidence::{Evidence, Scale, difference};
use eagpt_scene::{Camera, Gaussians, SceneEdit, View};
use eagpt_trace::blend::Contribution;
use eagpt_trace::features::GBuffer;
use eagpt_trace::{Features, TraceError, Tracer};
use glam::Vec3;

/// What is this near to the plane of a mirror, in thicknesses of surfaces, is of it.
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
    shown: Vec<Shown>,
}

/// Weight of a Gaussian in the pixels of all views.
#[derive(Clone, Copy, Default)]
struct Shown {
    all: f32,
    /// In pixels whose lines of sight meet a mirror, …
    in_mirrors: f32,
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
        Self {
            mirrors,
            scale: evidence.scale(),
            gaussians,
            tracer,
            shown: vec![Shown::default(); gaussians.len()],
        }
    }

    /// Adds what a view of that light shows.
    ///
    /// # Errors
    /// If the device fails.
    pub fn add(&mut self, view: &View) -> Result<(), TraceError> {
        let crossed = crossed(self.mirrors, &view.camera);
        let mut rays = Vec::new();
        let mut reflected = Vec::new();
        let frame = view.camera.ray_frame();
        for (pixel, met) in crossed.iter().enumerate() {
            let Some((distance, mirror)) = *met else {
                continue;
            };
            let (x, y) = (
                pixel as u32 % view.camera.width,
                pixel as u32 / view.camera.width,
            );
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            let plane = mirror.plane();
            rays.push(plane.reflected(frame.origin, direction, distance, self.scale.past()));
            reflected.push((pixel, mirror.reflectance));
        }
        let met = self.tracer.trace_rays(&rays)?;
        let mut is_image = vec![false; crossed.len()];
        for ((pixel, reflectance), met) in reflected.into_iter().zip(met) {
            let image = self.scale.log(met.radiance() * reflectance);
            let seen = self.scale.log(view.radiance.pixels()[pixel].into());
            is_image[pixel] = difference(seen - image) <= MOST_OFF;
        }
        let is_crossed: Vec<bool> = crossed.iter().map(Option::is_some).collect();
        for found in self.weights(&view.camera, &is_crossed)? {
            let shown = &mut self.shown[found.gaussian as usize];
            shown.in_mirrors += found.weighted_value;
            shown.all += found.weight;
        }
        for found in self.weights(&view.camera, &is_image)? {
            self.shown[found.gaussian as usize].as_image += found.weighted_value;
        }
        Ok(())
    }

    /// Weights of Gaussians, and in `some` of the pixels of a camera.
    fn weights(&self, camera: &Camera, some: &[bool]) -> Result<Vec<Contribution>, TraceError> {
        let value = |pixel: usize, _: &Features| f32::from(u8::from(some[pixel]));
        Ok(self.tracer.contributions(camera, &value)?.1)
    }

    /// What has to go, and the discs of the mirrors, which are fixed. In and behind them all goes
    /// that is seen in their place, before them what shows what they reflect.
    pub fn edit(&self) -> SceneEdit {
        let goes = |(position, shown): (&Vec3, &Shown)| {
            self.mirrors.iter().any(|mirror| {
                let height = mirror.plane().height(*position);
                if height.abs() <= AT_PLANE * self.scale.near && mirror.covers(*position) {
                    // What is large and reaches beyond is of the wall around.
                    return shown.in_mirrors >= SHARE_SHOWN * shown.all;
                }
                let (of_mirror, share) = match height {
                    ..0.0 => (shown.in_mirrors, SHARE_SHOWN),
                    _ if height <= self.scale.past() => (shown.as_image, SHARE_CLOSE),
                    _ => (shown.as_image, SHARE_SHOWN),
                };
                of_mirror > share * shown.all
            })
        };
        let all = self.gaussians.positions.iter().zip(&self.shown);
        let discs: Vec<Gaussians> = self.mirrors.iter().map(Mirror::discs).collect();
        SceneEdit {
            keep: all.map(|of| !goes(of)).collect(),
            moved: Vec::new(),
            fixed: discs.iter().flat_map(Gaussians::iter).collect(),
        }
    }
}

/// The nearest mirror along the ray of each pixel, and its distance.
fn crossed<'a>(mirrors: &'a [Mirror], camera: &Camera) -> Vec<Option<(f32, &'a Mirror)>> {
    let frame = camera.ray_frame();
    let pixels = (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| (x, y)));
    let nearest = |(x, y): (u32, u32)| {
        let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
        let met = |mirror: &'a Mirror| Some((mirror.meet(frame.origin, direction)?, mirror));
        let met = mirrors.iter().filter_map(met);
        met.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    pixels.map(nearest).collect()
}

/// Whether each pixel of `camera` shows one of `mirrors`, in part at least, in the scene with them
/// that is `seen` from there; `None` if none does.
pub fn pixels(mirrors: &[Mirror], camera: &Camera, seen: &GBuffer) -> Option<Vec<bool>> {
    let shows = |(met, seen): (&Option<(f32, &Mirror)>, &Features)| {
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
