//! Steps of training on the host, for a scene on any device: targets, losses and the parameters are
//! on the host; rays and their adjoint are the scene's.

mod albedo;

use super::irradiance::GaussianIrradiance;
use super::irradiance_cache::IrradianceCache;
use super::step::{RadianceStep, StepOutcome, Taken, TrainingView};
use crate::densify::{self, Attribution, Densified};
use crate::error::Result;
use crate::loss::radiance_loss;
use crate::loss::target::Target;
use crate::params::ParameterState;
use eagpt_eval::KnownPixels;
use eagpt_scene::color::pq_from_linear;
use eagpt_scene::{Gaussians, SceneEdit};
use eagpt_trace::Tracer;
use eagpt_trace::blend::GradientMask;
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::features::Features;
use glam::Vec3;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// The parameters while they are on the host.
pub(super) struct HostParameters {
    pub(super) state: ParameterState,
    /// The Gaussians that follow from `state`.
    pub(super) gaussians: Gaussians,
}

impl HostParameters {
    pub(super) fn new(state: ParameterState) -> Self {
        let gaussians = state.gaussians();
        Self { state, gaussians }
    }

    /// Makes the Gaussians follow changed parameters.
    fn refresh(&mut self) {
        if self.gaussians.len() == self.state.len() {
            self.state.write_gaussians(&mut self.gaussians);
        } else {
            self.gaussians = self.state.gaussians();
        }
    }
}

/// Everything of a run but the parameters: the scene with their Gaussians, and data that is
/// prepared once. Host code runs on all threads of the current rayon pool.
pub(super) struct Trainer<S> {
    pub(super) scene: S,
    /// Errors of views since Gaussians were last split.
    attribution: Option<Attribution>,
    /// For stage 1 with [`crate::options::Gather::Pixels`], whose single rays are the CPU's;
    /// geometry and light do not change from its first step on.
    pixel_gathering: Option<CpuScene>,
    /// For gathering the irradiance of Gaussians, until stage 1 takes its first step.
    gathering: Option<Box<dyn Tracer>>,
    /// By light.
    irradiance: BTreeMap<usize, GaussianIrradiance>,
    pub(super) cache: Option<IrradianceCache>,
    targets: HashMap<usize, Arc<Target>>,
    /// Bytes that further prepared targets may take.
    target_budget: usize,
}

impl<S: Tracer> Trainer<S> {
    /// Training of the Gaussians of `scene`; prepared images may take `target_budget` bytes.
    pub(super) fn new(scene: S, target_budget: usize) -> Self {
        Self {
            scene,
            attribution: None,
            pixel_gathering: None,
            gathering: None,
            irradiance: BTreeMap::new(),
            cache: None,
            targets: HashMap::new(),
            target_budget,
        }
    }

    pub(super) fn target(&mut self, view: &TrainingView) -> Arc<Target> {
        if let Some(target) = self.targets.get(&view.index) {
            return Arc::clone(target);
        }
        let target = Arc::new(Target::new(&view.view.radiance));
        if let Some(left) = self.target_budget.checked_sub(target.num_bytes()) {
            self.target_budget = left;
            self.targets.insert(view.index, Arc::clone(&target));
        }
        target
    }

    /// Brings changed parameters to the scene.
    fn refresh(&mut self, parameters: &mut HostParameters) -> Result<()> {
        parameters.refresh();
        Ok(self.scene.update(&parameters.gaussians)?)
    }

    /// A step of stage 0.
    pub(super) fn radiance_step(
        &mut self,
        parameters: &mut HostParameters,
        view: &TrainingView,
        step: &RadianceStep<'_>,
    ) -> Result<Taken> {
        let target = self.target(view);
        let camera = view.view.camera;
        let rays = step.rays(camera, target.edges());
        let features = self.scene.record(&rays)?;
        let points = view.points.as_ref();
        let points = points.map(|points| points.pixels(&view.view.camera));
        let (terms, d_features) = radiance_loss(
            &features,
            &view.view,
            &target.pq(),
            points.as_deref(),
            step.weights,
            step.normals,
        );
        let mask = if step.sizes.move_geometry() {
            GradientMask::Everything
        } else {
            GradientMask::LightAndMaterial
        };
        let gradients = self.scene.adjoint(&rays, &d_features, mask)?;
        let HostParameters { state, gaussians } = parameters;
        let moved = state.step(gaussians, camera.origin(), &gradients, &step.sizes);
        if moved.is_ok() {
            self.refresh(parameters)?;
        }
        Ok(taken(step.iteration, view, moved.map(|()| terms)))
    }

    /// See [`super::Backend::show_light`].
    pub(super) fn show_light(
        &mut self,
        parameters: &mut HostParameters,
        light: usize,
    ) -> Result<()> {
        if light == parameters.state.lights.current {
            return Ok(());
        }
        parameters.state.show_light(light);
        self.forget_light();
        self.refresh(parameters)
    }

    /// Forgets scenes of the light that was shown.
    pub(super) fn forget_light(&mut self) {
        self.gathering = None;
        self.pixel_gathering = None;
    }

    /// See [`super::Backend::begin_harmonics`].
    pub(super) fn begin_harmonics(&mut self, parameters: &mut HostParameters) -> Result<()> {
        parameters.state.begin_harmonics();
        self.refresh(parameters)
    }

    /// See [`super::Backend::attribute`].
    pub(super) fn attribute(
        &mut self,
        parameters: &HostParameters,
        view: &TrainingView,
    ) -> Result<()> {
        let target = self.target(view).pq();
        let camera = &view.view.camera;
        let known = view.view.valid.as_ref().map(KnownPixels::new);
        let mask = view.view.emission.as_ref();
        let clipped = view.view.clipped.as_ref();
        let error = |pixel: usize, features: &Features| {
            if known.as_ref().is_some_and(|known| !known.has(pixel)) {
                return 0.0;
            }
            let shown = features.radiance().to_array().map(pq_from_linear);
            let wanted = target.pixels()[pixel];
            let color: f32 = (0..3)
                .map(|c| match clipped {
                    Some(mask) if mask.pixels()[pixel][c] > 0.0 => (wanted[c] - shown[c]).max(0.0),
                    _ => (shown[c] - wanted[c]).abs(),
                })
                .sum();
            let emission = mask.map_or(0.0, |mask| {
                (features.emission() - mask.pixels()[pixel][0]).abs()
            });
            color + emission
        };
        let (_, contributions) = self.scene.contributions(camera, &error)?;
        self.attribution
            .get_or_insert_with(|| Attribution::new(parameters.state.len()))
            .add(&contributions);
        Ok(())
    }

    /// See [`super::Backend::densify`].
    pub(super) fn densify(
        &mut self,
        parameters: &mut HostParameters,
        target: usize,
    ) -> Result<Densified> {
        let HostParameters { state, gaussians } = parameters;
        let seen = self.attribution.take();
        let seen = seen.unwrap_or_else(|| Attribution::new(state.len()));
        let densified = densify::densify(state, gaussians, &seen, target);
        state.sort_in_space();
        self.refresh(parameters)?;
        Ok(densified)
    }

    /// See [`super::Backend::edit`].
    pub(super) fn edit(
        &mut self,
        parameters: &mut HostParameters,
        edit: &SceneEdit,
        radiances: &[Vec<Option<Vec3>>],
    ) -> Result<()> {
        self.attribution = None;
        let state = &mut parameters.state;
        if state.lights.num() > 1 {
            let before = state.in_lights();
            state.edit(edit);
            state.light_last(radiances, &before);
        } else {
            state.edit(edit);
        }
        self.refresh(parameters)
    }

    /// See [`super::Backend::mark_emitting`].
    pub(super) fn mark_emitting(
        &mut self,
        parameters: &mut HostParameters,
        emitting: &[Vec<(usize, bool)>],
    ) -> Result<()> {
        parameters.state.mark_emitting(emitting);
        self.refresh(parameters)
    }

    /// See [`super::Backend::brighten`].
    pub(super) fn brighten(
        &mut self,
        parameters: &mut HostParameters,
        factors: &[(usize, f32)],
    ) -> Result<()> {
        parameters.state.brighten(factors);
        self.refresh(parameters)
    }
}

fn taken(iteration: u32, view: &TrainingView, outcome: StepOutcome) -> Taken {
    Taken {
        iteration,
        view: view.clone(),
        outcome,
    }
}
