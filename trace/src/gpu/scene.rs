//! A scene on a device that wgpu has opened.

use super::camera::CameraTracer;
use super::declarations::light::RayQuery;
use super::device::Device;
use super::error::GpuError;
use super::kernels;
use super::light::{LightGatherer, TreeBuffers};
use super::matrix::{TransportBuffers, TransportRays};
use super::rays::Rays;
use super::scene_buffers::SceneBuffers;
use super::views::Views;
use crate::blend::{Contribution, GradientMask, LocalGradient, PixelValue};
use crate::camera_rays::CameraRays;
use crate::cpu::CpuScene;
use crate::error::TraceError;
use crate::features::{Features, GBuffer};
use crate::ray::Ray;
use crate::tracer::Tracer;
use crate::transport::glossy::{GlossyPoint, Mirrored};
use crate::transport::matrix::{Directions, Receiver, TransportMatrix};
use crate::transport::vertex::Start;
use crate::transport::{Integrator, LightOptions};
use crate::view::{Pixels, RenderedView, SampledLight, View};
use crate::weights::BlendWeights;
use eagpt_scene::rng::RandomKey;
use eagpt_scene::{Camera, Gaussians, Gloss};
use glam::Vec3;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Gaussians on a device. The structures for single rays are built on the host when the first ray
/// needs them. Kernels of the caller may move the Gaussians on the device: see
/// [`Self::release_host_copy`] and [`super::Frame`].
#[derive(Debug)]
pub struct GpuScene {
    pub(super) device: Arc<Device>,
    pub(super) buffers: SceneBuffers,
    /// The scene on the host, for structures that are built from it and
    /// [`Tracer::mirrored_towards`]. None where Gaussians are moved on the device.
    host: Option<CpuScene>,
    light: Mutex<Option<Arc<TreeBuffers>>>,
    matrix: Mutex<Option<Arc<TransportBuffers>>>,
    views: Mutex<Views>,
}

impl GpuScene {
    /// Uploads a scene to `device`.
    ///
    /// # Errors
    /// If the device fails or has not enough memory.
    pub fn new(device: &Arc<Device>, gaussians: &Gaussians) -> Result<Self, GpuError> {
        let host = CpuScene::new(gaussians);
        Ok(Self {
            device: Arc::clone(device),
            buffers: SceneBuffers::new(device, host.surfels())?,
            host: Some(host),
            light: Mutex::default(),
            matrix: Mutex::default(),
            views: Mutex::default(),
        })
    }

    /// Leaves the Gaussians to kernels of the caller, which move them in the buffers of the device.
    /// From here on cameras see them as they are there, and single rays fail until
    /// [`Tracer::update`] replaces them.
    pub fn release_host_copy(&mut self) {
        self.host = None;
        self.views().restart(&self.device);
        self.light = Mutex::default();
        self.matrix = Mutex::default();
    }

    fn host(&self) -> Result<&CpuScene, GpuError> {
        self.host.as_ref().ok_or_else(|| GpuError::Moved {
            device: self.device.adapter().name.clone(),
        })
    }

    pub(super) fn rays<'a>(&'a self, light: &'a TreeBuffers) -> Rays<'a> {
        Rays {
            device: &self.device,
            scene: &self.buffers,
            light,
        }
    }

    fn transport_rays<'a>(&'a self, matrix: &'a TransportBuffers) -> TransportRays<'a> {
        TransportRays {
            device: &self.device,
            scene: &self.buffers,
            matrix,
        }
    }

    /// Traces `camera`, band by band; see [`CameraTracer::trace`]. `finish` is made when all
    /// buffers are.
    fn trace_camera<F>(
        &self,
        camera: &Camera,
        make_finish: impl FnOnce(&CameraTracer) -> Result<F, GpuError>,
    ) -> Result<(), GpuError>
    where
        F: FnMut(&Range<usize>, Vec<Features>) -> Result<(), GpuError>,
    {
        let device = &*self.device;
        let mut views = self.views();
        let tracer = views.binned(device, &self.buffers, &CameraRays::from(*camera))?;
        tracer.trace(device, make_finish(tracer)?)
    }

    /// Trees for single rays, made when first asked for.
    pub(super) fn light(&self) -> Result<Arc<TreeBuffers>, GpuError> {
        made_once(&self.light, || {
            let host = self.host()?;
            TreeBuffers::new(&self.device, &host.surfels().surfels, host.lights())
        })
    }

    /// Structures for the transport matrix, made when first needed.
    fn matrix(&self) -> Result<Arc<TransportBuffers>, GpuError> {
        made_once(&self.matrix, || {
            let host = self.host()?;
            TransportBuffers::new(&self.device, host.surfels(), host.light_list())
        })
    }

    fn render_view(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<RenderedView, GpuError> {
        let device = &*self.device;
        let is_glossy = self.buffers.glosses.is_some();
        let light = match integrator {
            Integrator::ZeroBounce | Integrator::Gather { .. } if !is_glossy => None,
            Integrator::ZeroBounce if !self.host()?.has_mirrors() => None,
            _ => Some(self.light()?),
        };
        let (mut glosses, mut means) = (Vec::new(), Vec::new());
        if let Some(light) = light.as_ref().filter(|_| is_glossy) {
            let met = self.rays(light).of_camera(camera)?;
            (glosses, means) = met
                .into_iter()
                .map(|(f, gloss)| (gloss, f.radiance()))
                .unzip();
        }
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
            let (pixels, gathered, glosses) = (&mut pixels, &mut gathered, &glosses);
            Ok(move |band: &Range<usize>, features: Vec<Features>| {
                pixels.extend(features);
                if let Some(gatherer) = &gatherer {
                    let glosses = glosses.get(band.clone()).unwrap_or_default();
                    let (first, num) = (band.start as u32, band.len() as u32);
                    gathered.extend(gatherer.gather(device, first, num, glosses)?);
                }
                Ok(())
            })
        })?;
        let features = GBuffer {
            width: camera.width,
            height: camera.height,
            pixels,
        };
        let pixels = Pixels {
            features,
            glosses,
            means,
        };
        let view = View::new(camera, pixels, integrator, options.emission_threshold);
        let starts = view.starts();
        let of_start = |start: &Start| gathered[start.pixel as usize].light(num_samples);
        let lights: Vec<SampledLight> = starts.iter().map(of_start).collect();
        view.finish(&starts, &lights, |rays| match &light {
            Some(light) => self.rays(light).trace_glossy(rays),
            None => Ok(Vec::new()),
        })
    }

    pub(super) fn views(&self) -> MutexGuard<'_, Views> {
        Views::lock(&self.views)
    }
}

/// The content of `place`, made by `make` if there is none.
fn made_once<T>(
    place: &Mutex<Option<Arc<T>>>,
    make: impl FnOnce() -> Result<T, GpuError>,
) -> Result<Arc<T>, GpuError> {
    let mut place = place.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(made) = &*place {
        return Ok(Arc::clone(made));
    }
    Ok(Arc::clone(place.insert(Arc::new(make()?))))
}

impl Tracer for GpuScene {
    fn device(&self) -> crate::Device {
        crate::Device::Gpu(Arc::clone(&self.device))
    }

    fn update(&mut self, gaussians: &Gaussians) -> Result<(), TraceError> {
        let host = match self.host.take() {
            Some(mut host) => {
                host.update(gaussians)?;
                host
            }
            None => CpuScene::new(gaussians),
        };
        if self.buffers.fit(host.surfels()) {
            // Structures that depend on the number of Gaussians alone stay as they are.
            self.buffers.write(&self.device, host.surfels());
        } else {
            // The old buffers' memory goes first.
            self.views().clear();
            self.buffers = SceneBuffers::new(&self.device, host.surfels())?;
        }
        self.host = Some(host);
        self.light = Mutex::default();
        self.matrix = Mutex::default();
        Ok(self.device.check()?)
    }

    fn set_albedos(&mut self, albedos: &[Vec3]) -> Result<(), TraceError> {
        self.host()?;
        if let Some(host) = &mut self.host {
            host.set_albedos(albedos)?;
            self.buffers.write(&self.device, host.surfels());
        }
        Ok(self.device.check()?)
    }

    fn gbuffer(&self, camera: &Camera) -> Result<GBuffer, TraceError> {
        let rays = &CameraRays::from(*camera);
        Ok(self.views().features(&self.device, &self.buffers, rays)?)
    }

    fn record(&mut self, rays: &CameraRays) -> Result<GBuffer, TraceError> {
        Ok(self.views().features(&self.device, &self.buffers, rays)?)
    }

    fn adjoint(
        &mut self,
        rays: &CameraRays,
        d_features: &[Features],
        _: GradientMask,
    ) -> Result<Vec<LocalGradient>, TraceError> {
        let mut views = self.views();
        Ok(views.adjoint(&self.device, &self.buffers, rays, d_features)?)
    }

    fn weights(&mut self, _: &Camera, _: f32) -> Result<Option<BlendWeights>, TraceError> {
        Ok(None)
    }

    fn contributions(
        &self,
        camera: &Camera,
        value: PixelValue<'_>,
    ) -> Result<(GBuffer, Vec<Contribution>), TraceError> {
        Ok(self
            .views()
            .contributions(&self.device, &self.buffers, camera, value)?)
    }

    fn trace_rays(&self, rays: &[Ray]) -> Result<Vec<Features>, TraceError> {
        let queries: Vec<RayQuery> = rays.iter().map(|ray| RayQuery::new(ray, 0)).collect();
        Ok(self
            .rays(&*self.light()?)
            .trace(&kernels::BLEND_RAYS, &queries)?)
    }

    fn are_free(&self, rays: &[Ray], distances: &[f32]) -> Result<Vec<bool>, TraceError> {
        Ok(self.rays(&*self.light()?).are_free(rays, distances)?)
    }

    fn render(
        &self,
        camera: &Camera,
        integrator: &Integrator,
        options: &LightOptions,
    ) -> Result<RenderedView, TraceError> {
        Ok(self.render_view(camera, integrator, options)?)
    }

    fn trace_transport(
        &self,
        receivers: &[Receiver],
        directions: Directions,
        key: RandomKey,
    ) -> Result<TransportMatrix, TraceError> {
        let matrix = self.matrix()?;
        Ok(self
            .transport_rays(&matrix)
            .trace(receivers, directions, key)?)
    }

    fn pixel_gloss(&self, camera: &Camera) -> Result<Vec<Gloss>, TraceError> {
        self.host()?.pixel_gloss(camera)
    }

    fn mirrored_towards(
        &self,
        points: &[GlossyPoint],
        num_samples: u32,
        key: RandomKey,
    ) -> Result<Vec<Vec<Option<Mirrored>>>, TraceError> {
        self.host()?.mirrored_towards(points, num_samples, key)
    }
}
