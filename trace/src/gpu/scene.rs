//! Gaussians on a device, behind [`Tracer`].

use super::adjoint::{Adjoint, Outcome, Room};
use super::bvh::NO_NODE;
use super::camera::{Binned, CameraTracer};
use super::device::Device;
use super::error::GpuError;
use super::light::{Gathered, LightBuffers, LightGatherer};
use super::rays::{RayQuery, Rays};
use crate::blend::LocalGradient;
use crate::engine::{RenderedView, TraceError, Tracer};
use crate::ray::Ray;
use crate::sums::{NUM_LANES, SumImage, Sums};
use crate::surfel::{Payload, Surfel, SurfelSet};
use crate::transport::lights::Lights;
use crate::transport::{Integrator, LightOptions};
use eagpt_scene::{Camera, Gaussians};
use glam::Vec3;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Prepared Gaussians in the memory of a device.
#[derive(Debug)]
pub(super) struct SceneBuffers {
    /// [`Surfel`], `[n]`.
    pub(super) surfels: wgpu::Buffer,
    /// [`Payload`], `[n]`.
    pub(super) payloads: wgpu::Buffer,
    num_surfels: u32,
}

impl SceneBuffers {
    pub(super) fn new(device: &Device, set: &SurfelSet) -> Result<Self, GpuError> {
        let limit = device.tier().max_bytes();
        let num_surfels = u32::try_from(set.len()).map_err(|_| GpuError::Limit {
            device: device.adapter().name.clone(),
            what: "Gaussians".to_owned(),
            needed: (set.len() * size_of::<Surfel>()) as u64,
            limit,
        })?;
        let size = |one: usize| (set.len() * one) as u64;
        let buffers = Self {
            surfels: device.buffer("Gaussians", size(size_of::<Surfel>()))?,
            payloads: device.buffer("payloads", size(size_of::<Payload>()))?,
            num_surfels,
        };
        buffers.write(device, set);
        Ok(buffers)
    }

    /// Replaces the Gaussians by as many others.
    fn write(&self, device: &Device, set: &SurfelSet) {
        let lanes: Vec<[f32; NUM_LANES]> = set.payloads.iter().map(|payload| payload.0).collect();
        device.write(&self.surfels, bytemuck::cast_slice(&set.surfels));
        device.write(&self.payloads, bytemuck::cast_slice(&lanes));
    }

    /// Number of Gaussians.
    pub(super) fn num_surfels(&self) -> u32 {
        self.num_surfels
    }
}

/// Gaussians on a device.
#[derive(Debug)]
pub struct GpuScene {
    device: Arc<Device>,
    set: SurfelSet,
    lights: Option<Lights>,
    buffers: SceneBuffers,
    light: Mutex<Option<Arc<LightBuffers>>>,
    /// For cameras of the size last seen.
    view: Mutex<Option<SizedView>>,
}

/// What depends on the size of cameras.
#[derive(Debug)]
struct SizedView {
    tracer: CameraTracer,
    adjoint: Option<Adjoint>,
}

/// The view for the size of `camera`, made if there is none.
fn view_for<'a>(
    view: &'a mut Option<SizedView>,
    device: &Device,
    scene: &SceneBuffers,
    camera: &Camera,
) -> Result<&'a mut SizedView, GpuError> {
    let fits = |view: &SizedView| view.tracer.bins.fits(camera, scene.num_surfels());
    if !view.as_ref().is_some_and(fits) {
        return new_view(view, device, scene, camera, None);
    }
    match view {
        Some(view) => Ok(view),
        none => new_view(none, device, scene, camera, None),
    }
}

/// Another view in place of the one there is, with room for half more than `num_entries`: the next camera needs another number.
fn new_view<'a>(
    view: &'a mut Option<SizedView>,
    device: &Device,
    scene: &SceneBuffers,
    camera: &Camera,
    num_entries: Option<u32>,
) -> Result<&'a mut SizedView, GpuError> {
    // The old one's memory goes first.
    *view = None;
    let capacity = num_entries.map(|needed| needed.saturating_add(needed / 2));
    let size = (camera.width, camera.height);
    Ok(view.insert(SizedView {
        tracer: CameraTracer::new(device, scene, size, capacity)?,
        adjoint: None,
    }))
}

impl GpuScene {
    /// Brings a scene to `device`.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn new(device: &Arc<Device>, gaussians: &Gaussians) -> Result<Self, GpuError> {
        let set = SurfelSet::new(gaussians);
        Ok(Self {
            device: Arc::clone(device),
            buffers: SceneBuffers::new(device, &set)?,
            set,
            lights: Lights::new(gaussians),
            light: Mutex::default(),
            view: Mutex::default(),
        })
    }

    /// Gradient of the loss with respect to every Gaussian, given `d_sums` = dL/dV for every pixel of `camera`, row by row: that of
    /// [`crate::cpu::camera::CameraRecord::adjoint`].
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    ///
    /// # Panics
    /// If `d_sums` are not as many as the camera has pixels.
    pub fn camera_adjoint(
        &self,
        camera: &Camera,
        d_sums: &[Sums],
    ) -> Result<Vec<LocalGradient>, GpuError> {
        assert_eq!(d_sums.len(), camera.num_pixels(), "one for each pixel");
        let (device, scene) = (&*self.device, &self.buffers);
        let mut slot = self.view();
        let mut view = view_for(&mut slot, device, scene, camera)?;
        loop {
            let adjoint = match &mut view.adjoint {
                Some(adjoint) => adjoint,
                none => {
                    let room = Room::usual(device, (camera.width, camera.height))?;
                    none.insert(Adjoint::new(device, scene, &view.tracer, room)?)
                }
            };
            match adjoint.run(device, &view.tracer.bins, camera, d_sums)? {
                Outcome::Gradients(gradients) => return Ok(gradients),
                Outcome::MoreEntries(needed) => {
                    view = new_view(&mut slot, device, scene, camera, Some(needed))?;
                }
                Outcome::MoreRoom(room) => {
                    view.adjoint = None;
                    view.adjoint = Some(Adjoint::new(device, scene, &view.tracer, room)?);
                }
            }
        }
    }

    /// Blended sums along each of `rays`: those of [`crate::transport::RayTracer::trace`].
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn trace_rays(&self, rays: &[Ray]) -> Result<Vec<Sums>, GpuError> {
        let queries: Vec<RayQuery> = rays.iter().map(|ray| RayQuery::new(ray, 0)).collect();
        self.rays(&*self.light()?).blend(&queries)
    }

    /// The Gaussian of one hit of each ray, chosen by its weight; `None` with the probability of meeting nothing. The number beside a ray makes
    /// the choice.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn choose_hits(&self, rays: &[(Ray, u32)]) -> Result<Vec<Option<u32>>, GpuError> {
        let queries: Vec<RayQuery> = rays
            .iter()
            .map(|(ray, seed)| RayQuery::new(ray, *seed))
            .collect();
        let chosen = self.rays(&*self.light()?).choose(&queries)?;
        let hit = |index| (index != NO_NODE).then_some(index);
        Ok(chosen.into_iter().map(hit).collect())
    }

    fn rays<'a>(&'a self, light: &'a LightBuffers) -> Rays<'a> {
        Rays {
            device: &self.device,
            scene: &self.buffers,
            light,
        }
    }

    /// Traces `camera`, band by band; see [`CameraTracer::trace`]. `finish` is made when all buffers are.
    fn trace_camera<F>(
        &self,
        camera: &Camera,
        make_finish: impl FnOnce(&CameraTracer) -> Result<F, GpuError>,
    ) -> Result<(), GpuError>
    where
        F: FnMut(&Range<usize>, Vec<Sums>) -> Result<(), GpuError>,
    {
        let (device, scene) = (&*self.device, &self.buffers);
        let mut slot = self.view();
        let mut view = view_for(&mut slot, device, scene, camera)?;
        while let Binned::MoreEntries(needed) = view.tracer.bin(device, camera)? {
            view = new_view(&mut slot, device, scene, camera, Some(needed))?;
        }
        view.tracer.trace(device, make_finish(&view.tracer)?)
    }

    /// What single rays need, made when first asked for.
    fn light(&self) -> Result<Arc<LightBuffers>, GpuError> {
        let mut light = self.light.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(light) = &*light {
            return Ok(Arc::clone(light));
        }
        let made = LightBuffers::new(&self.device, &self.set, self.lights.as_ref())?;
        Ok(Arc::clone(light.insert(Arc::new(made))))
    }

    fn render_view(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<RenderedView, GpuError> {
        let device = &*self.device;
        let light = match integrator {
            Integrator::ZeroBounce => None,
            _ => Some(self.light()?),
        };
        let mut pixels = Vec::with_capacity(camera.num_pixels());
        let mut gathered = Vec::new();
        let mut num_samples = 0;
        self.trace_camera(camera, |tracer| {
            let gatherer = match &light {
                Some(light) => {
                    let scene = (&self.buffers, &**light);
                    LightGatherer::new(device, scene, tracer, integrator, options)?
                }
                None => None,
            };
            num_samples = gatherer.as_ref().map_or(0, LightGatherer::num_samples);
            let (pixels, gathered) = (&mut pixels, &mut gathered);
            Ok(move |band: &Range<usize>, sums: Vec<Sums>| {
                pixels.extend(sums);
                if let Some(gatherer) = &gatherer {
                    let (first, num) = (band.start as u32, band.len() as u32);
                    gathered.extend(gatherer.gather(device, first, num)?);
                }
                Ok(())
            })
        })?;
        let sums = SumImage {
            width: camera.width,
            height: camera.height,
            pixels,
        };
        Ok(finished(sums, &gathered, num_samples, options))
    }

    fn view(&self) -> MutexGuard<'_, Option<SizedView>> {
        // Whoever panicked left nothing half-done: results are written to buffers before they are read.
        self.view.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The frame of sums and of the light that `num_samples` samples of each pixel have brought.
fn finished(
    sums: SumImage,
    gathered: &[Gathered],
    num_samples: u32,
    options: &LightOptions,
) -> RenderedView {
    let scale = 1.0 / num_samples.max(1) as f32;
    let is_sampled = |pixel: usize| {
        num_samples > 0 && sums.pixels[pixel].emission() <= options.emission_threshold
    };
    let mut pixel = 0;
    let radiance = sums.extract(|seen| {
        let at = pixel;
        pixel += 1;
        if is_sampled(at) {
            (seen.albedo() * Vec3::from(gathered[at].total) * scale).to_array()
        } else {
            seen.radiance().to_array()
        }
    });
    pixel = 0;
    let second_moment = sums.extract(|_| {
        let at = pixel;
        pixel += 1;
        [if is_sampled(at) {
            gathered[at].squares * scale
        } else {
            0.0
        }]
    });
    RenderedView {
        radiance,
        second_moment,
        num_rays: gathered.iter().map(|light| u64::from(light.num_rays)).sum(),
        sums,
    }
}

impl Tracer for GpuScene {
    fn device(&self) -> String {
        format!("gpu: {}", self.device.adapter().name)
    }

    fn update(&mut self, gaussians: &Gaussians) -> Result<(), TraceError> {
        if gaussians.len() != self.set.len() {
            *self = Self::new(&self.device, gaussians)?;
            return Ok(());
        }
        // What depends on their number stays as it is.
        self.set.update(gaussians);
        self.lights = Lights::new(gaussians);
        self.buffers.write(&self.device, &self.set);
        self.light = Mutex::default();
        Ok(self.device.check()?)
    }

    fn camera_sums(&self, camera: &Camera) -> Result<SumImage, TraceError> {
        let mut pixels = Vec::with_capacity(camera.num_pixels());
        self.trace_camera(camera, |_| {
            Ok(|_: &Range<usize>, sums| {
                pixels.extend(sums);
                Ok(())
            })
        })?;
        Ok(SumImage {
            width: camera.width,
            height: camera.height,
            pixels,
        })
    }

    fn render(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<RenderedView, TraceError> {
        Ok(self.render_view(camera, integrator, options)?)
    }
}
