//! The CPU engine behind [`Tracer`].

use super::bvh::{Bvh, RayScratch};
use super::camera::{self, HitSearch, Keep};
use super::realizations::{Realizations, SCENE_SEED};
use crate::blend::{Contribution, PixelValue};
use crate::engine::{RenderedView, TraceError, Tracer};
use crate::features::{Features, GBuffer};
use crate::ray::Ray;
use crate::surfel::{Attributes, SurfelSet};
use crate::transport::lights::Lights;
use crate::transport::matrix::{Directions, Receiver, TransportMatrix};
use crate::transport::{self, Integrator, LightOptions, RayTracer, SampledHit};
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians};
use rayon::prelude::*;
use std::cell::RefCell;
use std::sync::OnceLock;

thread_local! {
    static SCRATCH: RefCell<RayScratch> = RefCell::default();
}

/// Gaussians with their acceleration structure, traced by all threads of the current rayon pool.
#[derive(Debug, Clone)]
pub struct CpuScene {
    set: SurfelSet,
    bvh: Bvh,
    lights: Option<Lights>,
    /// Made when they are first needed.
    realizations: OnceLock<Realizations>,
}

impl CpuScene {
    /// Prepares a scene.
    pub fn new(gaussians: &Gaussians) -> Self {
        let set = SurfelSet::new(gaussians);
        let bvh = Bvh::new(&set);
        Self {
            set,
            bvh,
            lights: Lights::new(gaussians),
            realizations: OnceLock::new(),
        }
    }

    /// The prepared Gaussians.
    pub fn surfels(&self) -> &SurfelSet {
        &self.set
    }

    fn realizations(&self) -> &Realizations {
        self.realizations
            .get_or_init(|| Realizations::new(&self.set, SCENE_SEED))
    }

    /// The acceleration structure.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }
}

impl RayTracer for CpuScene {
    fn trace(&self, ray: &Ray) -> Features {
        SCRATCH.with_borrow_mut(|scratch| self.bvh.trace(&self.set, ray, scratch))
    }

    fn sample_hit(&self, ray: &Ray, seed: u32) -> Option<SampledHit> {
        let hit = SCRATCH.with_borrow_mut(|scratch| self.bvh.sample_hit(ray, seed, scratch))?;
        Some(SampledHit {
            index: hit.index(),
            t: hit.t(),
        })
    }

    fn realization_hit(&self, ray: &Ray, realization: u32) -> Option<SampledHit> {
        SCRATCH.with_borrow_mut(|scratch| self.realizations().nearest(ray, realization, scratch))
    }

    fn attributes(&self, index: u32) -> &Attributes {
        &self.set.attributes[index as usize]
    }

    fn lights(&self) -> Option<&Lights> {
        self.lights.as_ref()
    }
}

impl Tracer for CpuScene {
    fn device(&self) -> String {
        "cpu".to_owned()
    }

    fn update(&mut self, gaussians: &Gaussians) -> Result<(), TraceError> {
        let before = std::mem::take(&mut self.set.surfels);
        self.set.update(gaussians);
        if before != self.set.surfels {
            self.realizations.take();
        }
        self.bvh.update(&self.set);
        self.lights = Lights::new(gaussians);
        Ok(())
    }

    fn gbuffer(&self, camera: &Camera) -> Result<GBuffer, TraceError> {
        Ok(camera::trace(&self.set, camera, HitSearch::Tiles, Keep::Nothing).0)
    }

    fn contributions(
        &self,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<(GBuffer, Vec<Contribution>), TraceError> {
        let (features, record) = camera::trace(&self.set, camera, HitSearch::Tiles, Keep::Record);
        Ok((features, record.contributions(value)))
    }

    fn trace_rays(&self, rays: &[Ray]) -> Result<Vec<Features>, TraceError> {
        Ok(rays.par_iter().map(|ray| self.trace(ray)).collect())
    }

    fn render(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<RenderedView, TraceError> {
        let features = self.gbuffer(camera)?;
        let light = transport::render(self, camera, &features, integrator, options);
        Ok(RenderedView {
            radiance: light.radiance,
            second_moment: light.second_moment,
            features,
            num_rays: light.num_rays,
        })
    }

    fn trace_transport(
        &self,
        receivers: &[Receiver],
        directions: Directions,
        key: RandomKey,
    ) -> Result<TransportMatrix, TraceError> {
        Ok(TransportMatrix::trace(self, receivers, directions, key))
    }
}
