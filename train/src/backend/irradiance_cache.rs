//! Irradiance of the pixels of views in stage 1. Geometry and light do not change there: the
//! factor of each pixel's albedo is computed once.

use super::irradiance;
use super::step::TrainingView;
use crate::error::Result;
use crate::loss::PixelLight;
use eagpt_scene::Gaussians;
use eagpt_scene::machine::available_memory;
use eagpt_trace::features::Features;
use eagpt_trace::weights::BlendWeights;
use eagpt_trace::{Device, Tracer};
use glam::Vec4;
use std::collections::HashMap;
use std::sync::Arc;

/// Share of the free memory, 1/n, that cached views may take; those that do not fit are traced
/// again.
const CACHE_SHARE: u64 = 4;

/// Weights that stage 1 keeps are at least this: the lighter ones are a third of the hits of a
/// trained room, and less than a fiftieth of a pixel.
const LEAST_WEIGHT: f32 = 1e-3;

/// Stage 1's data of a view.
pub(super) struct CachedView {
    /// Blending weights, where the device keeps them in the host's memory.
    pub(super) weights: Option<BlendWeights>,
    /// Irradiance, or emitted light.
    pub(super) light: PixelLight,
}

impl CachedView {
    fn num_bytes(&self) -> u64 {
        let weights = self.weights.as_ref().map_or(0, BlendWeights::num_bytes);
        (weights + self.light.num_bytes()) as u64
    }
}

/// Views with the irradiance that was gathered for Gaussians, as far as they fit into memory.
pub(super) struct IrradianceCache {
    /// Irradiance of each Gaussian in each light; see
    /// [`irradiance::GaussianIrradiance::by_gaussian`].
    by_light: Vec<Vec<Vec4>>,
    /// On a device that does not keep blending weights.
    showing: Option<ShowingIrradiance>,
    views: HashMap<usize, Arc<CachedView>>,
    /// Bytes that further views may take.
    budget: u64,
}

impl IrradianceCache {
    /// No view yet; `by_light` is the irradiance of all `gaussians` in each light, at least one;
    /// `device` traces them.
    ///
    /// # Errors
    /// If the device fails or has not enough memory.
    pub(super) fn new(
        device: &Device,
        gaussians: &Gaussians,
        by_light: Vec<Vec<Vec4>>,
    ) -> Result<Self> {
        let keeps_weights = matches!(device, Device::Cpu);
        let showing =
            (!keeps_weights).then(|| ShowingIrradiance::new(device, gaussians, &by_light[0]));
        Ok(Self {
            by_light,
            showing: showing.transpose()?,
            views: HashMap::new(),
            budget: available_memory().unwrap_or(0) / CACHE_SHARE,
        })
    }

    /// `view`, in which emission beyond `threshold` is an emitter's, traced through `scene` if it
    /// is not cached.
    ///
    /// # Errors
    /// If the device fails.
    pub(super) fn view(
        &mut self,
        view: &TrainingView,
        scene: &mut impl Tracer,
        threshold: f32,
    ) -> Result<Arc<CachedView>> {
        if let Some(known) = self.views.get(&view.index) {
            return Ok(Arc::clone(known));
        }
        let camera = &view.view.camera;
        let features = scene.record(&(*camera).into())?;
        let weights = scene.weights(camera, LEAST_WEIGHT)?;
        let blended = match (&weights, &mut self.showing) {
            (Some(weights), _) => weights.blend(|i| self.by_light[view.light][i as usize]),
            (None, Some(showing)) => {
                let light = |features: &Features| features.radiance().extend(features.emission());
                let scene = showing.in_light(view.light, &self.by_light)?;
                scene.gbuffer(camera)?.pixels.iter().map(light).collect()
            }
            (None, None) => vec![Vec4::ZERO; camera.num_pixels()],
        };
        let irradiance = irradiance::of_pixels(&blended);
        let light = PixelLight::new(&features, irradiance, threshold);
        let cached = Arc::new(CachedView { weights, light });
        if let Some(left) = self.budget.checked_sub(cached.num_bytes()) {
            self.budget = left;
            self.views.insert(view.index, Arc::clone(&cached));
        }
        Ok(cached)
    }
}

/// A scene of Gaussians with their irradiance in one light as their radiance, in all directions,
/// and as their emission 1 where it is known.
struct ShowingIrradiance {
    gaussians: Gaussians,
    light: usize,
    scene: Box<dyn Tracer>,
}

impl ShowingIrradiance {
    /// With the `irradiance` of the first light.
    fn new(device: &Device, gaussians: &Gaussians, irradiance: &[Vec4]) -> Result<Self> {
        let mut gaussians = gaussians.clone();
        gaussians.harmonics.clear();
        show(&mut gaussians, irradiance);
        Ok(Self {
            light: 0,
            scene: device.scene(&gaussians)?,
            gaussians,
        })
    }

    /// The scene with the irradiance of `light`, of those of all lights.
    fn in_light(&mut self, light: usize, by_light: &[Vec<Vec4>]) -> Result<&dyn Tracer> {
        if self.light != light {
            self.light = light;
            show(&mut self.gaussians, &by_light[light]);
            self.scene.update(&self.gaussians)?;
        }
        Ok(&*self.scene)
    }
}

fn show(gaussians: &mut Gaussians, irradiance: &[Vec4]) {
    gaussians.radiances = irradiance.iter().map(|light| light.truncate()).collect();
    gaussians.emissions = irradiance.iter().map(|light| light.w).collect();
}
