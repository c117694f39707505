//! All of the engine behind [`Tracer`].

use super::camera::{self, HitSearch, Keep};
use super::record::{CameraRecord, TileRecord};
use super::{CpuScene, glossy, integrate};
use crate::blend::{Contribution, GradientMask, LocalGradient, PixelValue};
use crate::camera_rays::CameraRays;
use crate::device::Device;
use crate::error::TraceError;
use crate::features::{Features, GBuffer};
use crate::ray::Ray;
use crate::tracer::Tracer;
use crate::transport::glossy::{GlossyPoint, Mirrored};
use crate::transport::matrix::{Directions, Receiver, TransportMatrix};
use crate::transport::{Integrator, LightOptions, lights};
use crate::view::RenderedView;
use crate::weights::BlendWeights;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians, Gloss};
use glam::Vec3;
use rayon::prelude::*;

impl Tracer for CpuScene {
    fn device(&self) -> Device {
        Device::Cpu
    }

    fn update(&mut self, gaussians: &Gaussians) -> Result<(), TraceError> {
        if self.bvh.get().is_none() && self.realizations.get().is_none() {
            self.set.update(gaussians);
        } else {
            let before = std::mem::take(&mut self.set.surfels);
            self.set.update(gaussians);
            if before != self.set.surfels {
                self.realizations.take();
                if let Some(bvh) = self.bvh.get_mut() {
                    bvh.update(&self.set);
                }
            }
        }
        self.emissive = lights::emissive(gaussians);
        self.lights.take();
        self.light_list.take();
        self.record.rays = None;
        Ok(())
    }

    fn set_albedos(&mut self, albedos: &[Vec3]) -> Result<(), TraceError> {
        self.set.set_albedos(albedos);
        self.record.rays = None;
        Ok(())
    }

    fn gbuffer(&self, camera: &Camera) -> Result<GBuffer, TraceError> {
        Ok(camera::trace(&self.set, camera, HitSearch::Tiles, Keep::Nothing).0)
    }

    fn record(&mut self, rays: &CameraRays) -> Result<GBuffer, TraceError> {
        Ok(self
            .record
            .trace(&self.set, rays, HitSearch::Tiles, Keep::Record))
    }

    fn adjoint(
        &mut self,
        rays: &CameraRays,
        d_features: &[Features],
        mask: GradientMask,
    ) -> Result<Vec<LocalGradient>, TraceError> {
        self.recorded(rays);
        Ok(self.record.adjoint(&self.set, d_features, mask))
    }

    fn weights(&mut self, camera: &Camera, least: f32) -> Result<Option<BlendWeights>, TraceError> {
        Ok(Some(self.recorded(&(*camera).into()).weights(least)))
    }

    fn contributions(
        &self,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<(GBuffer, Vec<Contribution>), TraceError> {
        if let Some(record) = self.record_of(camera) {
            return Ok((record.gbuffer(), record.contributions(value)));
        }
        let of_tile =
            |tile: usize, record: &TileRecord| record.contributions((camera, tile), value);
        let (features, per_tile) = camera::read_tiles(&self.set, camera, of_tile);
        Ok((features, per_tile.concat()))
    }

    fn pixel_gloss(&self, camera: &Camera) -> Result<Vec<Gloss>, TraceError> {
        let blended = |record: &CameraRecord| self.gloss_of_pixels(record, &record.gbuffer());
        Ok(match self.is_glossy() {
            true => self.with_record(camera, blended),
            false => Vec::new(),
        })
    }

    fn trace_rays(&self, rays: &[Ray]) -> Result<Vec<Features>, TraceError> {
        Ok(rays.par_iter().map(|ray| self.trace(ray)).collect())
    }

    fn are_free(&self, rays: &[Ray], distances: &[f32]) -> Result<Vec<bool>, TraceError> {
        let is_free = |(ray, distance): (&Ray, &f32)| self.is_free(ray, *distance);
        Ok(rays.par_iter().zip(distances).map(is_free).collect())
    }

    fn render(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<RenderedView, TraceError> {
        let needs_gloss = match integrator {
            Integrator::ZeroBounce => self.has_mirrors(),
            _ => self.is_glossy(),
        };
        let keep = match needs_gloss {
            true => Keep::Record,
            false => Keep::Nothing,
        };
        let seen = camera::trace(&self.set, camera, HitSearch::Tiles, keep);
        Ok(integrate::render(self, camera, seen, integrator, options))
    }

    fn trace_transport(
        &self,
        receivers: &[Receiver],
        directions: Directions,
        key: RandomKey,
    ) -> Result<TransportMatrix, TraceError> {
        Ok(TransportMatrix::trace(self, receivers, directions, key))
    }

    fn mirrored_towards(
        &self,
        points: &[GlossyPoint],
        num_samples: u32,
        key: RandomKey,
    ) -> Result<Vec<Vec<Option<Mirrored>>>, TraceError> {
        Ok(glossy::mirrored_towards(self, points, num_samples, key))
    }
}
