//! Gaussians on a device, behind [`Tracer`].

use super::adjoint::{Adjoint, Outcome, Room};
use super::camera::{CameraTracer, Traced};
use super::device::Device;
use super::error::GpuError;
use crate::blend::LocalGradient;
use crate::engine::{RenderedView, TraceError, Tracer};
use crate::sums::{SumImage, Sums};
use crate::surfel::{Payload, Surfel, SurfelSet};
use crate::transport::{Integrator, LightOptions};
use eagpt_scene::{Camera, Gaussians};
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
        let lanes: Vec<[f32; 16]> = set.payloads.iter().map(|payload| payload.0).collect();
        const { assert!(size_of::<Payload>() == size_of::<[f32; 16]>()) };
        let limit = device.tier().max_bytes();
        let num_surfels = u32::try_from(set.len()).map_err(|_| GpuError::Limit {
            device: device.adapter().name.clone(),
            what: "Gaussians".to_owned(),
            needed: (set.len() * size_of::<Surfel>()) as u64,
            limit,
        })?;
        Ok(Self {
            surfels: device.upload("Gaussians", bytemuck::cast_slice(&set.surfels))?,
            payloads: device.upload("payloads", bytemuck::cast_slice(&lanes))?,
            num_surfels,
        })
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
    buffers: SceneBuffers,
    /// For cameras of the size last seen.
    views: Mutex<Views>,
}

/// What depends on the size of cameras.
#[derive(Debug, Default)]
struct Views {
    tracer: Option<CameraTracer>,
    adjoint: Option<Adjoint>,
}

impl Views {
    /// The tracer for `camera`, made if there is none.
    fn tracer(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        camera: &Camera,
    ) -> Result<&CameraTracer, GpuError> {
        let fits = |tracer: &CameraTracer| tracer.bins.fits(camera, scene.num_surfels());
        if !self.tracer.as_ref().is_some_and(fits) {
            let size = (camera.width, camera.height);
            return self.make_tracer(device, scene, size, None);
        }
        match &self.tracer {
            Some(tracer) => Ok(tracer),
            None => unreachable!("it fits"),
        }
    }

    /// Another tracer in place of the one there is.
    fn make_tracer(
        &mut self,
        device: &Device,
        scene: &SceneBuffers,
        size: (u32, u32),
        num_entries: Option<u32>,
    ) -> Result<&CameraTracer, GpuError> {
        // The old one's memory goes first.
        *self = Self::default();
        // Half more than is needed now: the next view needs another number.
        let capacity = num_entries.map(|needed| needed.saturating_add(needed / 2));
        let tracer = CameraTracer::new(device, scene, size, capacity)?;
        Ok(self.tracer.insert(tracer))
    }
}

impl GpuScene {
    /// Brings a scene to `device`.
    ///
    /// # Errors
    /// If the device gives up, or has not enough memory.
    pub fn new(device: &Arc<Device>, gaussians: &Gaussians) -> Result<Self, GpuError> {
        let buffers = SceneBuffers::new(device, &SurfelSet::new(gaussians))?;
        Ok(Self {
            device: Arc::clone(device),
            buffers,
            views: Mutex::default(),
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
        let size = (camera.width, camera.height);
        let mut views = self.views();
        views.tracer(device, scene, camera)?;
        loop {
            let Views { tracer, adjoint } = &mut *views;
            let Some(tracer) = tracer else {
                unreachable!("it was made before");
            };
            let adjoint = match adjoint {
                Some(adjoint) => adjoint,
                none => {
                    let room = Room::usual(device, size)?;
                    none.insert(Adjoint::new(device, scene, tracer, room)?)
                }
            };
            match adjoint.run(device, &tracer.bins, camera, d_sums)? {
                Outcome::Gradients(gradients) => return Ok(gradients),
                Outcome::MoreEntries(needed) => {
                    views.make_tracer(device, scene, size, Some(needed))?;
                }
                Outcome::MoreRoom(room) => {
                    views.adjoint = None;
                    let Views { tracer, adjoint } = &mut *views;
                    if let Some(tracer) = tracer {
                        *adjoint = Some(Adjoint::new(device, scene, tracer, room)?);
                    }
                }
            }
        }
    }

    fn trace_camera(&self, camera: &Camera) -> Result<SumImage, GpuError> {
        let (device, scene) = (&*self.device, &self.buffers);
        let size = (camera.width, camera.height);
        let mut views = self.views();
        let mut tracer = views.tracer(device, scene, camera)?;
        loop {
            match tracer.trace(device, camera)? {
                Traced::Sums(sums) => return Ok(sums),
                Traced::MoreEntries(needed) => {
                    tracer = views.make_tracer(device, scene, size, Some(needed))?;
                }
            }
        }
    }

    fn views(&self) -> MutexGuard<'_, Views> {
        // Whoever panicked left nothing half-done: results are written to buffers before they are read.
        self.views.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Tracer for GpuScene {
    fn device(&self) -> String {
        format!("gpu: {}", self.device.adapter().name)
    }

    fn update(&mut self, gaussians: &Gaussians) -> Result<(), TraceError> {
        *self = Self::new(&self.device, gaussians)?;
        Ok(())
    }

    fn camera_sums(&self, camera: &Camera) -> Result<SumImage, TraceError> {
        Ok(self.trace_camera(camera)?)
    }

    fn render(
        &self,
        _camera: &Camera,
        _integrator: &Integrator,
        _options: &LightOptions,
    ) -> Result<RenderedView, TraceError> {
        Err(TraceError::Device {
            device: self.device(),
            problem: "todo".into(),
        })
    }
}
