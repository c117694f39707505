//! The CPU engine behind [`Tracer`].

use super::bvh::{Bvh, RayScratch};
use super::camera::{self, HitSearch, Keep};
use crate::engine::{RenderedView, TraceError, Tracer};
use crate::ray::Ray;
use crate::sums::{SumImage, Sums, lane};
use crate::surfel::SurfelSet;
use crate::transport::lights::Lights;
use crate::transport::{self, Integrator, LightOptions, RayTracer};
use eagpt_scene::{Camera, Gaussians};
use glam::Vec3;
use std::cell::RefCell;

thread_local! {
    static SCRATCH: RefCell<RayScratch> = RefCell::default();
}

/// Gaussians with their acceleration structure, traced by all threads of the current rayon pool.
#[derive(Debug, Clone)]
pub struct CpuScene {
    set: SurfelSet,
    bvh: Bvh,
    lights: Option<Lights>,
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
        }
    }

    /// The prepared Gaussians.
    pub fn surfels(&self) -> &SurfelSet {
        &self.set
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

    fn sample_radiance(&self, ray: &Ray, seed: u32) -> Vec3 {
        let hit = SCRATCH.with_borrow_mut(|scratch| self.bvh.sample_hit(ray, seed, scratch));
        hit.map_or(Vec3::ZERO, |hit| {
            let lanes = &self.set.payloads[hit.index() as usize].0;
            Vec3::from_slice(&lanes[lane::RADIANCE..][..3])
        })
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
        self.set.update(gaussians);
        self.bvh.update(&self.set);
        self.lights = Lights::new(gaussians);
        Ok(())
    }

    fn camera_sums(&self, camera: &Camera) -> Result<SumImage, TraceError> {
        Ok(camera::trace(&self.set, camera, HitSearch::Tiles, Keep::Nothing).0)
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
}
