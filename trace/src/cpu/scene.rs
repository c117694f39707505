//! The CPU engine behind [`Tracer`].

use super::bvh::{Bvh, RayScratch};
use super::camera::{self, HitSearch, Keep};
use super::draws::{Draws, SCENE_SEED};
use crate::blend::{Contribution, PixelValue};
use crate::engine::{RenderedView, TraceError, Tracer};
use crate::ray::Ray;
use crate::sums::{SumImage, Sums};
use crate::surfel::{Payload, SurfelSet};
use crate::transport::lights::Lights;
use crate::transport::links::{Directions, Links, NOTHING, Receiver};
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
    draws: OnceLock<Draws>,
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
            draws: OnceLock::new(),
        }
    }

    /// The prepared Gaussians.
    pub fn surfels(&self) -> &SurfelSet {
        &self.set
    }

    fn draws(&self) -> &Draws {
        self.draws.get_or_init(|| Draws::new(&self.set, SCENE_SEED))
    }

    /// The acceleration structure.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }
}

impl RayTracer for CpuScene {
    fn trace(&self, ray: &Ray) -> Sums {
        SCRATCH.with_borrow_mut(|scratch| self.bvh.trace(&self.set, ray, scratch))
    }

    fn sample_hit(&self, ray: &Ray, seed: u32) -> Option<SampledHit> {
        let hit = SCRATCH.with_borrow_mut(|scratch| self.bvh.sample_hit(ray, seed, scratch))?;
        Some(SampledHit {
            index: hit.index(),
            t: hit.t(),
        })
    }

    fn drawn_hit(&self, ray: &Ray, draw: u32) -> Option<SampledHit> {
        SCRATCH.with_borrow_mut(|scratch| self.draws().nearest(ray, draw, scratch))
    }

    fn payload(&self, index: u32) -> &Payload {
        &self.set.payloads[index as usize]
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
            self.draws.take();
        }
        self.bvh.update(&self.set);
        self.lights = Lights::new(gaussians);
        Ok(())
    }

    fn camera_sums(&self, camera: &Camera) -> Result<SumImage, TraceError> {
        Ok(camera::trace(&self.set, camera, HitSearch::Tiles, Keep::Nothing).0)
    }

    fn contributions(
        &self,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<(SumImage, Vec<Contribution>), TraceError> {
        let (sums, record) = camera::trace(&self.set, camera, HitSearch::Tiles, Keep::Record);
        Ok((sums, record.contributions(value)))
    }

    fn trace_rays(&self, rays: &[Ray]) -> Result<Vec<Sums>, TraceError> {
        Ok(rays.par_iter().map(|ray| self.trace(ray)).collect())
    }

    fn render(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<RenderedView, TraceError> {
        let sums = self.camera_sums(camera)?;
        let light = transport::render(self, camera, &sums, integrator, options);
        Ok(RenderedView {
            radiance: light.radiance,
            second_moment: light.second_moment,
            sums,
            num_rays: light.num_rays,
        })
    }

    fn trace_links(
        &self,
        receivers: &[Receiver],
        directions: Directions,
        key: RandomKey,
    ) -> Result<Links, TraceError> {
        Ok(Links::trace(self, receivers, directions, key))
    }

    fn drawn_hits(&self, rays: &[Ray], draws: &[u32]) -> Result<Vec<u32>, TraceError> {
        let first = |(ray, draw): (&Ray, &u32)| self.drawn_hit(ray, *draw);
        let pairs = rays.par_iter().zip(draws).with_min_len(256);
        Ok(pairs
            .map(|pair| first(pair).map_or(NOTHING, |hit| hit.index))
            .collect())
    }
}
