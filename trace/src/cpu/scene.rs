//! A scene on the CPU.

use super::bvh::{Bvh, RayScratch};
use super::camera::{self, HitSearch, Keep};
use super::realizations::{Realizations, SCENE_SEED, SampledHit};
use super::record::CameraRecord;
use crate::attributes::Attributes;
use crate::camera_rays::CameraRays;
use crate::features::Features;
use crate::ray::Ray;
use crate::surfel::SurfelSet;
use crate::transport::light_list::LightList;
use crate::transport::lights::{self, Lights};
use eagpt_scene::{Camera, Gaussians, Gloss};
use std::cell::RefCell;
use std::sync::OnceLock;

thread_local! {
    static SCRATCH: RefCell<RayScratch> = RefCell::default();
}

/// Gaussians traced by all threads of the current rayon pool. Structures for single rays are made
/// when the first ray needs them: cameras do without.
#[derive(Debug, Clone)]
pub struct CpuScene {
    pub(super) set: SurfelSet,
    pub(super) bvh: OnceLock<Bvh>,
    /// The Gaussians that emit.
    pub(super) emissive: Gaussians,
    pub(super) lights: OnceLock<Option<Lights>>,
    pub(super) light_list: OnceLock<Option<LightList>>,
    pub(super) realizations: OnceLock<Realizations>,
    /// Blended hits of the camera that was recorded last; without a camera where Gaussians have
    /// changed since.
    pub(super) record: CameraRecord,
}

impl CpuScene {
    /// Prepares a scene.
    pub fn new(gaussians: &Gaussians) -> Self {
        Self {
            set: SurfelSet::new(gaussians),
            bvh: OnceLock::new(),
            emissive: lights::emissive(gaussians),
            lights: OnceLock::new(),
            light_list: OnceLock::new(),
            realizations: OnceLock::new(),
            record: CameraRecord::default(),
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
        self.bvh.get_or_init(|| Bvh::new(&self.set))
    }

    /// Composited features along `ray`.
    pub fn trace(&self, ray: &Ray) -> Features {
        SCRATCH.with_borrow_mut(|scratch| self.bvh().trace(&self.set, ray, scratch))
    }

    /// Whether more than half of the light passes along `ray` up to a `distance`, scene units.
    pub fn is_free(&self, ray: &Ray, distance: f32) -> bool {
        SCRATCH.with_borrow_mut(|scratch| self.bvh().is_free(ray, distance, scratch))
    }

    /// Whether any Gaussian mirrors light.
    pub fn is_glossy(&self) -> bool {
        !self.set.gloss.is_empty()
    }

    /// Whether any Gaussian shows an image of what it reflects.
    pub(crate) fn has_mirrors(&self) -> bool {
        self.set.gloss.iter().any(Gloss::is_mirror)
    }

    /// As [`Self::trace`], with the specular part of what is met.
    pub fn trace_glossy(&self, ray: &Ray) -> (Features, Gloss) {
        if !self.is_glossy() {
            return (self.trace(ray), Gloss::NONE);
        }
        let bvh = self.bvh();
        SCRATCH.with_borrow_mut(|scratch| bvh.trace_glossy(&self.set, ray, scratch))
    }

    /// Specular part of the material of a Gaussian.
    pub fn gloss(&self, index: u32) -> Gloss {
        self.set
            .gloss
            .get(index as usize)
            .copied()
            .unwrap_or_default()
    }

    /// One hit of `ray`, chosen by its weight: over all values of `seed`, the mean of the
    /// attributes of hits is the blended sum of [`Self::trace`], at a fraction of the cost. For
    /// sums over many rays whose mean alone matters.
    pub fn sample_hit(&self, ray: &Ray, seed: u32) -> Option<SampledHit> {
        let hit = SCRATCH.with_borrow_mut(|scratch| self.bvh().sample_hit(ray, seed, scratch))?;
        Some(SampledHit {
            index: hit.index(),
            t: hit.t(),
        })
    }

    /// As [`Self::sample_hit`], with random choices shared by all rays of the same `realization`
    /// (modulo [`NUM_REALIZATIONS`](super::realizations::NUM_REALIZATIONS)): more rays through the
    /// same Gaussians do not improve a mean over few realizations, but rays that take turns in the
    /// realizations together are cheaper still.
    pub fn realization_hit(&self, ray: &Ray, realization: u32) -> Option<SampledHit> {
        SCRATCH.with_borrow_mut(|scratch| self.realizations().nearest(ray, realization, scratch))
    }

    /// Light and material of a Gaussian.
    pub fn attributes(&self, index: u32) -> &Attributes {
        &self.set.attributes[index as usize]
    }

    /// The scene's emitters, if it has any.
    pub fn lights(&self) -> Option<&Lights> {
        self.lights
            .get_or_init(|| Lights::new(&self.emissive))
            .as_ref()
    }

    /// The scene's emitters as light samples of the transport matrix choose among them.
    pub fn light_list(&self) -> Option<&LightList> {
        let make = || LightList::new(&self.set);
        self.light_list.get_or_init(make).as_ref()
    }

    /// Calls `read` with the record of `camera`: the last one if it is that, else a new one.
    pub(super) fn with_record<R>(
        &self,
        camera: &Camera,
        read: impl FnOnce(&CameraRecord) -> R,
    ) -> R {
        match self.record_of(camera) {
            Some(record) => read(record),
            None => read(&camera::trace(&self.set, camera, HitSearch::Tiles, Keep::Record).1),
        }
    }

    /// The last record, if it is that of one ray for each pixel of `camera`.
    pub(super) fn record_of(&self, camera: &Camera) -> Option<&CameraRecord> {
        let is_it = self.record.rays.as_ref() == Some(&CameraRays::from(*camera));
        is_it.then_some(&self.record)
    }

    /// Records `rays` if they are not those recorded last.
    pub(super) fn recorded(&mut self, rays: &CameraRays) -> &mut CameraRecord {
        if self.record.rays.as_ref() != Some(rays) {
            let search = HitSearch::Tiles;
            self.record.trace(&self.set, rays, search, Keep::Record);
        }
        &mut self.record
    }
}
