//! Powers and colours of lamps that explain photographs in another light.
//!
//! Of a scene with the light of each lamp ([`LightBasis`]) every view is a sum of pictures, one for
//! each light. Which factors give the photographs is a linear least squares problem for each
//! channel of a few views. The differences of light count as they are: where a lamp itself is seen,
//! it decides, and elsewhere what is brightest. Clipped channels and unknown pixels do not count.
//!
//! A scene may reflect too much or too little of a lamp. Photographs of the same views in the light
//! of the bake tell by how much, and factors are then relative to those that explain these.

mod choose;
mod solve;

use crate::error::Result;
use eagpt_scene::dataset::is_known;
use eagpt_scene::light_basis::LightBasis;
use eagpt_scene::{Camera, Dataset, Gaussians, Image, SceneError, View, ply};
use eagpt_trace::Device;
use serde::Serialize;
use solve::{NormalEquations, Solution, solve, standard_error};
use std::path::PathBuf;

/// Blocks of pixels along the width of a view.
const BLOCKS_ACROSS: usize = 8;

/// Width, at most, of the pictures that views are chosen by: a bulb has a few pixels.
const CHOOSING_WIDTH: u32 = 128;

/// Views to fit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FitViews {
    /// Those of these names, at least one.
    Named(Vec<String>),
    /// So many, at least one, that tell most of the lights.
    Best(usize),
}

/// A fit to be done.
#[derive(Debug, Clone)]
pub struct LightFitRequest {
    /// The baked scene.
    pub scene: PathBuf,
    /// Its light by its lamps.
    pub lights: PathBuf,
    /// Photographs in the new light: a dataset in the world of the scene.
    pub reference: PathBuf,
    /// Photographs of the same views in the light of the bake.
    pub before: Option<PathBuf>,
    /// Views of the reference to fit.
    pub views: FitViews,
    /// Device that traces cameras.
    pub device: Device,
}

/// Progress of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "message")]
pub enum LightFitProgress {
    /// Views are rendered in the light of one lamp after the other.
    Rendering {
        /// Lights done.
        done: usize,
        /// Lights in all.
        total: usize,
    },
}

/// The factor of a light; each of R, G, B.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedLight {
    /// Its name.
    pub name: String,
    /// Its light in the photographs as parts of that of the bake.
    pub factor: [f64; 3],
    /// Standard error of the factor.
    pub error: [f64; 3],
    /// Factor that explains the photographs in the light of the bake, of which `factor` is a
    /// multiple; `None` without such photographs.
    pub before: Option<[f64; 3]>,
    /// Whether a view tells of the light, in any channel; the factor of those without is 0.
    pub is_seen: bool,
}

/// Result of a fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LightFit {
    /// All lights of the scene, in order.
    pub lights: Vec<FittedLight>,
    /// Share of the light of the photographs, root mean square, that is left unexplained.
    pub unexplained: f64,
    /// Names of the views.
    pub views: Vec<String>,
    /// Values that counted, pixels times channels.
    pub num_values: usize,
}

/// Finds the factors of all lights of a scene.
///
/// # Errors
/// Bad input, naming file and value: a view that is not there, a file of another scene, views of
/// another size than the cameras before, or photographs in which nothing is known or bright.
pub fn fit_lights(
    request: &LightFitRequest,
    progress: &mut dyn FnMut(LightFitProgress),
) -> Result<LightFit> {
    let scene = ply::read_gaussians(&request.scene)?;
    let basis = LightBasis::read(&request.lights)?;
    (basis.check(&scene))
        .map_err(|problem| SceneError::invalid(&request.lights, "scene", problem))?;
    let reference = Dataset::open(&request.reference)?;
    let names = match &request.views {
        FitViews::Named(names) => names.clone(),
        FitViews::Best(num) => best_views(request, &scene, &basis, &reference, *num)?,
    };
    let after = views(&reference, &names)?;
    let before = match &request.before {
        Some(path) => Some(views(&Dataset::open(path)?, &names)?),
        None => None,
    };
    let cameras: Vec<Camera> = after.iter().map(|view| view.camera).collect();
    let pictures = pictures(&request.device, &scene, &basis, &cameras, progress)?;
    let num = basis.lights().len();
    let now = Channels::new(&after, &pictures, num);
    let then = match (&before, &request.before) {
        (Some(before), Some(path)) => {
            if let Some((b, a)) = before
                .iter()
                .zip(&after)
                .find(|(b, a)| b.camera != a.camera)
            {
                let problem = format!("view {}: another camera than that of {}", b.name, a.name);
                return Err(SceneError::invalid(path, "transforms.json", problem).into());
            }
            Some(Channels::new(before, &pictures, num))
        }
        _ => None,
    };
    if now.num_values == 0 || now.solutions.iter().all(|one| one.total == 0.0) {
        let problem = "nothing is known and bright in these views";
        return Err(SceneError::invalid(&request.reference, "radiance", problem).into());
    }
    let lights = (basis.lights().iter().enumerate())
        .map(|(k, light)| fitted(k, light.name.clone(), &now, then.as_ref()))
        .collect();
    let sum = |of: fn(&Solution) -> f64| now.solutions.iter().map(of).sum::<f64>();
    Ok(LightFit {
        lights,
        unexplained: (sum(|one| one.residual) / sum(|one| one.total)).sqrt(),
        views: names,
        num_values: now.num_values,
    })
}

/// The views of these names.
fn views(dataset: &Dataset, names: &[String]) -> Result<Vec<View>> {
    let load = |name: &String| {
        let place = dataset
            .frames()
            .iter()
            .position(|frame| frame.name == *name);
        let Some(index) = place else {
            let problem = dataset.no_such_view(name);
            return Err(SceneError::invalid(dataset.transforms(), "frames", problem).into());
        };
        Ok(dataset.load_view(index)?)
    };
    names.iter().map(load).collect()
}

/// Names of `num` views of the reference that tell most of the lights, in its order: by small
/// pictures of all of them.
fn best_views(
    request: &LightFitRequest,
    scene: &Gaussians,
    basis: &LightBasis,
    reference: &Dataset,
    num: usize,
) -> Result<Vec<String>> {
    let frames = reference.frames();
    if num > frames.len() {
        let problem = format!("{num} views are asked for, there are {}", frames.len());
        return Err(SceneError::invalid(reference.transforms(), "frames", problem).into());
    }
    let small = |camera: &Camera| {
        let reduction = camera.width.div_ceil(CHOOSING_WIDTH);
        let [width, height] = [camera.width, camera.height].map(|size| size.div_ceil(reduction));
        camera.resized(width, height)
    };
    let cameras: Vec<Camera> = frames.iter().map(|frame| small(&frame.camera)).collect();
    let pictures = pictures(&request.device, scene, basis, &cameras, &mut |_| ())?;
    let sums = (0..cameras.len()).map(|view| {
        let of_view: Vec<&[f32]> = pictures.iter().map(|of| of[view].values()).collect();
        let mut sums = NormalEquations::new(of_view.len());
        let mut row = vec![0.0; of_view.len()];
        for i in 0..3 * cameras[view].num_pixels() {
            for (light, values) in row.iter_mut().zip(&of_view) {
                *light = f64::from(values[i]);
            }
            sums.add(&row, 0.0, 1.0);
        }
        sums
    });
    let sums: Vec<NormalEquations> = sums.collect();
    let best = choose::best(&sums, num).into_iter();
    Ok(best.map(|i| frames[i].name.clone()).collect())
}

/// Pictures of each camera in each light alone, at the factor 1: `[lights][cameras]`.
fn pictures(
    device: &Device,
    scene: &Gaussians,
    basis: &LightBasis,
    cameras: &[Camera],
    progress: &mut dyn FnMut(LightFitProgress),
) -> Result<Vec<Vec<Image<3>>>> {
    let total = basis.lights().len();
    let mut pictures = Vec::with_capacity(total);
    let mut lit = scene.clone();
    for done in 0..total {
        progress(LightFitProgress::Rendering { done, total });
        basis.light_alone(&mut lit, done);
        let tracer = device.scene(&lit)?;
        let seen = cameras
            .iter()
            .map(|camera| Ok(tracer.gbuffer(camera)?.radiance()));
        pictures.push(seen.collect::<Result<Vec<_>>>()?);
    }
    progress(LightFitProgress::Rendering { done: total, total });
    Ok(pictures)
}

/// Solutions of all channels.
struct Channels {
    solutions: [Solution; 3],
    num_values: usize,
}

impl Channels {
    /// Those that explain `views` by `pictures`, `[lights][views]`, of `num` lights.
    fn new(views: &[View], pictures: &[Vec<Image<3>>], num: usize) -> Self {
        let mut num_values = 0;
        let solutions = [0, 1, 2].map(|channel| {
            let mut blocks = Vec::new();
            for (place, view) in views.iter().enumerate() {
                let of_view: Vec<&Image<3>> = pictures.iter().map(|of| &of[place]).collect();
                num_values += add_view(view, &of_view, channel, &mut blocks);
            }
            solve(&blocks, num)
        });
        Self {
            solutions,
            num_values,
        }
    }
}

/// Adds the blocks of a view, of which each light has a picture; returns the number of pixels that
/// count.
fn add_view(
    view: &View,
    pictures: &[&Image<3>],
    channel: usize,
    blocks: &mut Vec<NormalEquations>,
) -> usize {
    let (width, height) = (
        view.radiance.width() as usize,
        view.radiance.height() as usize,
    );
    let side = width.div_ceil(BLOCKS_ACROSS).max(1);
    let across = width.div_ceil(side);
    let mut here = vec![NormalEquations::new(pictures.len()); across * height.div_ceil(side)];
    let counts = |i: usize| {
        let is_known = view
            .valid
            .as_ref()
            .is_none_or(|valid| is_known(valid.pixels()[i][0]));
        let is_clipped = |clipped: &Image<3>| clipped.pixels()[i][channel] > 0.0;
        is_known && !view.clipped.as_ref().is_some_and(is_clipped)
    };
    let mut row = vec![0.0; pictures.len()];
    let mut num = 0;
    for (i, pixel) in view
        .radiance
        .pixels()
        .iter()
        .enumerate()
        .filter(|(i, _)| counts(*i))
    {
        for (light, picture) in row.iter_mut().zip(pictures) {
            *light = f64::from(picture.pixels()[i][channel]);
        }
        let block = (i / width / side) * across + (i % width) / side;
        here[block].add(&row, f64::from(pixel[channel]), 1.0);
        num += 1;
    }
    blocks.append(&mut here);
    num
}

/// The factor of light `k`.
fn fitted(k: usize, name: String, now: &Channels, then: Option<&Channels>) -> FittedLight {
    let mut light = FittedLight {
        name,
        factor: [0.0; 3],
        error: [0.0; 3],
        before: then.map(|then| [0, 1, 2].map(|channel| then.solutions[channel].x[k])),
        is_seen: false,
    };
    for channel in 0..3 {
        let solution = &now.solutions[channel];
        // Nothing is a multiple of what does not shine.
        if !solution.is_seen[k] || light.before.is_some_and(|before| before[channel] <= 0.0) {
            continue;
        }
        light.is_seen = true;
        let own = |pulls: &Vec<f64>| pulls[k];
        (light.factor[channel], light.error[channel]) = match then {
            None => (
                solution.x[k],
                standard_error(solution.pulls.iter().map(own)),
            ),
            Some(then) => {
                let then = &then.solutions[channel];
                let factor = solution.x[k] / then.x[k];
                // The same block pulls at both: what a scene gets wrong is wrong twice, and
                // cancels.
                let pairs = solution.pulls.iter().zip(&then.pulls);
                let pull = pairs.map(|(now, before)| (now[k] - factor * before[k]) / then.x[k]);
                (factor, standard_error(pull))
            }
        };
    }
    light
}

#[cfg(test)]
mod tests;
