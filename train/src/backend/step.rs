//! Steps of training, and what takes them.

use crate::densify::Densified;
use crate::error::Result;
use crate::loss::{LossTerms, NormalTerms};
use crate::options::{AlbedoOptions, LossWeights};
use crate::params::{BadGradient, ParameterState, StepSizes};
use crate::points::SeenPoints;
use eagpt_scene::{Camera, SceneEdit, View};
use eagpt_trace::CameraRays;
use eagpt_trace::features::GBuffer;
use eagpt_trace::transport::matrix::Receiver;
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;

/// A training view with the index by which a backend may keep prepared copies.
#[derive(Debug, Clone)]
pub struct TrainingView {
    /// Index of the frame among those of all datasets.
    pub index: usize,
    /// Index of the light that it was taken in.
    pub light: usize,
    /// The images.
    pub view: Arc<View>,
    /// The points of the cloud that it sees, where training compares with them.
    pub points: Option<Arc<SeenPoints>>,
}

/// One iteration of stage 0.
#[derive(Debug, Clone, Copy)]
pub struct RadianceStep<'a> {
    /// Iteration, counted from 1.
    pub iteration: u32,
    /// Loss weights.
    pub weights: &'a LossWeights,
    /// Whether the normal terms take part yet.
    pub normals: NormalTerms,
    /// Whether pixels at edges of the view are means of 2×2 rays; see `Target::edges`.
    pub antialias: bool,
    /// Step sizes.
    pub sizes: StepSizes,
}

impl RadianceStep<'_> {
    /// The rays of `camera` whose view has these edges.
    pub(crate) fn rays(&self, camera: Camera, edges: &Arc<[bool]>) -> CameraRays {
        match self.antialias {
            true => CameraRays::splitting(camera, Arc::clone(edges)),
            false => camera.into(),
        }
    }
}

/// One iteration of stage 1.
#[derive(Debug, Clone, Copy)]
pub struct AlbedoStep<'a> {
    /// Options of the stage.
    pub options: &'a AlbedoOptions,
    /// Weights of the colour term.
    pub ssim_share: f64,
    /// Seed of the run.
    pub seed: u64,
    /// Iteration, counted from 1.
    pub iteration: u32,
    /// Step sizes.
    pub sizes: StepSizes,
}

/// Loss of a step, or the gradient that is not finite.
pub(crate) type StepOutcome = std::result::Result<LossTerms, BadGradient>;

/// A finished step.
#[derive(Debug, Clone)]
pub struct Taken {
    /// Iteration, counted from 1.
    pub iteration: u32,
    /// The view it compared with.
    pub view: TrainingView,
    /// Parameters stay as they are if a gradient is not finite, and no later step is taken then.
    pub outcome: StepOutcome,
}

/// A device that trains.
///
/// A step may still be under way when the call that begins it returns: each call returns the steps
/// finished by then, and [`Self::finish`] the rest, in the order in which they were begun.
pub trait Backend {
    /// Shows the scene in another of its lights: steps, and what is asked of the scene, are in that
    /// light until another one is shown.
    ///
    /// # Errors
    /// If the device fails, or the scene has no such light.
    fn show_light(&mut self, light: usize) -> Result<()>;

    /// From here on radiance may differ with the direction: coefficients are there, all zero.
    /// Nothing happens where they are there already.
    ///
    /// # Errors
    /// If the device fails.
    fn begin_harmonics(&mut self) -> Result<()>;

    /// Begins a step of stage 0.
    ///
    /// # Errors
    /// If the device fails.
    fn radiance_step(&mut self, view: &TrainingView, step: &RadianceStep<'_>)
    -> Result<Vec<Taken>>;

    /// Begins a step of stage 1.
    ///
    /// # Errors
    /// If the device fails.
    fn albedo_step(&mut self, view: &TrainingView, step: &AlbedoStep<'_>) -> Result<Vec<Taken>>;

    /// Waits until all steps are finished.
    ///
    /// # Errors
    /// If the device fails.
    fn finish(&mut self) -> Result<Vec<Taken>>;

    /// Adds the errors of `view` to those by which [`Self::densify`] chooses Gaussians.
    ///
    /// # Errors
    /// If the device fails.
    fn attribute(&mut self, view: &TrainingView) -> Result<()>;

    /// Splits Gaussians until there are `target`, and resets the errors of views.
    ///
    /// # Errors
    /// If the device fails.
    fn densify(&mut self, target: usize) -> Result<Densified>;

    /// Carries out an edit after all steps, in stage 0: see [`ParameterState::edit`]. Errors of
    /// views are reset. `radiances` are those of its fixed Gaussians in each light of a scene that
    /// has several, `[lights][m]`: where there is none they do not shine, and their radiance is
    /// learned.
    ///
    /// # Errors
    /// If the device fails.
    ///
    /// # Panics
    /// If the edit is one of another number of Gaussians.
    fn edit(&mut self, edit: &SceneEdit, radiances: &[Vec<Option<Vec3>>]) -> Result<()>;

    /// Lets Gaussians emit the light that they have, or reflect it, in each light those that are
    /// given with whether they emit, `[lights]`.
    ///
    /// # Errors
    /// If the device fails.
    fn mark_emitting(&mut self, emitting: &[Vec<(usize, bool)>]) -> Result<()>;

    /// Multiplies the radiance of Gaussians, by their indices, in the light shown.
    ///
    /// # Errors
    /// If the device fails.
    fn brighten(&mut self, factors: &[(usize, f32)]) -> Result<()>;

    /// Finds the Gaussians that `cameras` see, and a point of the surface of each, to gather the
    /// light shown. Returns their number.
    ///
    /// # Errors
    /// If the device fails.
    fn begin_gathering(&mut self, cameras: &[Camera]) -> Result<usize>;

    /// Gathers the irradiance of the next of those Gaussians, `range`, with `num_samples`
    /// directions each.
    ///
    /// # Errors
    /// If the device fails.
    fn gather(&mut self, range: Range<usize>, num_samples: u32, seed: u64) -> Result<()>;

    /// Irradiance over π that is gathered in a light, for each Gaussian that cameras see, with the
    /// surface that it is part of; empty before all is gathered.
    fn gathered(&self, light: usize) -> Vec<(Receiver, Vec3)>;

    /// Begins stage 1: forgets Adam's moments and sets the albedos to start from. They are the
    /// closed form `ρ = π r / E` where irradiance was gathered, of sums over several lights, and
    /// otherwise the paper's: radiance, clamped to 0.01–0.99, as a vector of unit length. Of the
    /// radiance of each Gaussian in each light the albedo is to explain the share in `shares`
    /// `[lights][n]`, or all where that is empty.
    ///
    /// # Errors
    /// If the device fails.
    fn begin_albedo(&mut self, shares: &[Vec<f32>]) -> Result<()>;

    /// Composited features of a camera after all steps, for previews.
    ///
    /// # Errors
    /// If the device fails.
    fn gbuffer(&mut self, camera: &Camera) -> Result<GBuffer>;

    /// The full state after all steps, read back.
    ///
    /// # Errors
    /// If the device fails.
    fn state(&mut self) -> Result<ParameterState>;
}
