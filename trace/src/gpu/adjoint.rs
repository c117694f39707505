//! Gradients of camera rays on the device, and contributions of Gaussians to pixels;
//! [`super::passes::trace_and_go_back`] are the passes.
//!
//! Tiles are traced again with a record of what is blended. Pixels turn their records into a weight
//! and dL/dα for each hit, tiles add up the gradients of their Gaussians, Gaussians those of their
//! tiles. Every sum has a fixed order and nothing is added atomically, so that the same device
//! gives the same bits in every run, and the rounding is that of the CPU.

use super::camera::CameraTracer;
use super::capacity::{Capacity, Incomplete};
use super::declarations::camera::{Band, TILE};
use super::device::{Commands, Device};
use super::error::GpuError;
use super::passes::{self, RecordedBand};
use super::record::RecordBuffers;
use super::scene_buffers::SceneBuffers;
use crate::blend::{Contribution, LocalGradient, PixelValue};
use crate::camera_rays::CameraRays;
use crate::features::{Features, NUM_LANES};
use rayon::prelude::*;

/// The adjoint of the camera rays of a scene, for cameras of one size. Buffers stay on the device
/// from call to call.
#[derive(Debug)]
pub(super) struct Adjoint {
    capacity: Capacity,
    record: RecordBuffers,
    num_surfels: u32,
    bands: Vec<RecordedBand>,
}

impl Adjoint {
    pub(super) fn new(
        device: &Device,
        scene: &SceneBuffers,
        tracer: &CameraTracer,
        capacity: Capacity,
    ) -> Result<Self, GpuError> {
        let bins = &tracer.bins;
        let (width, height) = bins.size();
        let capacity = Capacity {
            entries: bins.capacity,
            rows: capacity.rows.min(tracer.rows()),
            ..capacity
        };
        let num_surfels = scene.num_surfels();
        let record = RecordBuffers::new(device, bins, &capacity, num_surfels)?;
        let tiles_x = width.div_ceil(TILE);
        let bands = (0..height)
            .step_by(capacity.rows as usize)
            .map(|first_row| {
                let end_row = (first_row + capacity.rows).min(height);
                let band = Band {
                    first_tile: first_row / TILE * tiles_x,
                    end_tile: end_row.div_ceil(TILE) * tiles_x,
                    first_pixel: first_row * width,
                    first_chunk: capacity.first_chunk(width),
                    ..Band::default()
                };
                let pixels = (first_row * width) as usize..(end_row * width) as usize;
                let at = (pixels, band);
                passes::trace_and_go_back(device, scene, bins, &tracer.features, &record, at)
            });
        let bands = bands.collect::<Result<_, _>>()?;
        device.check()?;
        Ok(Self {
            capacity,
            record,
            num_surfels,
            bands,
        })
    }

    /// Gradients by all Gaussians, read back; `d_features` are derivatives by the features of each
    /// pixel that `rays` make, row by row.
    pub(super) fn gradients(
        &self,
        device: &Device,
        tracer: &CameraTracer,
        rays: &CameraRays,
        d_features: &[Features],
    ) -> Result<Vec<LocalGradient>, Incomplete> {
        let num_pixels = rays.camera().num_pixels();
        assert_eq!(d_features.len(), num_pixels, "one for each pixel");
        let d_features = rays.adjoint_of_means(d_features);
        let back = |band: &RecordedBand| {
            let d_features = d_features[band.pixels.clone()].iter();
            let lanes: Vec<[f32; NUM_LANES]> = d_features.map(|features| features.0).collect();
            device.write(&self.record.d_features, bytemuck::cast_slice(&lanes));
            device.run(&band.gradients)
        };
        self.go_back(device, tracer, rays, back, || {
            let all = 0..self.num_surfels as usize;
            let rows = device.read::<[f32; NUM_LANES]>(&self.record.gradients, all)?;
            Ok(rows.into_iter().map(LocalGradient).collect())
        })
    }

    /// Contributions of Gaussians, read back, without those that contribute nothing; the features
    /// of each pixel, row by row, go to `pixels`.
    pub(super) fn contributions(
        &self,
        device: &Device,
        tracer: &CameraTracer,
        rays: &CameraRays,
        value: PixelValue<'_>,
        pixels: &mut Vec<Features>,
    ) -> Result<Vec<Contribution>, Incomplete> {
        pixels.clear();
        let back = |band: &RecordedBand| {
            let lanes = device.read::<[f32; NUM_LANES]>(&tracer.features, 0..band.pixels.len())?;
            pixels.extend(lanes.into_iter().map(Features));
            let value = |pixel: usize| value(pixel, &pixels[pixel]);
            let values: Vec<f32> = band.pixels.clone().into_par_iter().map(value).collect();
            device.write(&self.record.values, bytemuck::cast_slice(&values));
            device.run(&band.contributions)
        };
        self.go_back(device, tracer, rays, back, || {
            let all = 0..self.num_surfels as usize;
            let mut rows = device.read::<Contribution>(&self.record.contributions, all)?;
            rows.retain(|row| row.weight > 0.0);
            Ok(rows)
        })
    }

    /// Traces all bands of `rays` with a record, goes `back` from each of them, and reads what
    /// Gaussians have got from all.
    fn go_back<T>(
        &self,
        device: &Device,
        tracer: &CameraTracer,
        rays: &CameraRays,
        mut back: impl FnMut(&RecordedBand) -> Result<(), GpuError>,
        read: impl FnOnce() -> Result<T, GpuError>,
    ) -> Result<T, Incomplete> {
        let mut commands = device.commands();
        tracer.record_binning(device, rays, &mut commands);
        commands.clear_buffer(&self.record.gradients, 0, None);
        commands.clear_buffer(&self.record.contributions, 0, None);
        device.submit(commands)?;
        // Lists that are incomplete say nothing about the hits on them.
        self.check(device, tracer)?;
        for band in &self.bands {
            let mut commands = device.commands();
            self.forward(device, tracer, band, &mut commands);
            device.submit(commands)?;
            back(band)?;
            self.check(device, tracer)?;
        }
        Ok(read()?)
    }

    /// Whether all of the last band has fitted. Waits for the device.
    fn check(&self, device: &Device, tracer: &CameraTracer) -> Result<(), Incomplete> {
        let needed = tracer.bins.counters(device)?;
        match self.capacity.holds(&needed) {
            true => Ok(()),
            false => Err(Incomplete::Overflow(needed)),
        }
    }

    fn forward(
        &self,
        device: &Device,
        tracer: &CameraTracer,
        band: &RecordedBand,
        commands: &mut Commands,
    ) {
        commands.clear_buffer(&self.record.masks, 0, None);
        tracer.bins.clear_chunks(commands);
        device.record(&band.forward, commands);
    }

    /// The band of the whole image, if it is one.
    pub(super) fn whole(&self) -> Option<WholeImage<'_>> {
        match self.bands.as_slice() {
            [band] => Some(WholeImage {
                adjoint: self,
                band,
            }),
            _ => None,
        }
    }
}

/// An image that is traced at once: its features, their derivatives and the gradients are on the
/// device together.
#[derive(Debug, Clone, Copy)]
pub(super) struct WholeImage<'a> {
    adjoint: &'a Adjoint,
    band: &'a RecordedBand,
}

impl WholeImage<'_> {
    /// Derivatives by the features, `[pixels]`.
    pub(super) fn d_features(&self) -> &wgpu::Buffer {
        &self.adjoint.record.d_features
    }

    /// Gradients, `[n]`.
    pub(super) fn gradients(&self) -> &wgpu::Buffer {
        &self.adjoint.record.gradients
    }

    /// Capacities of its buffers.
    pub(super) fn capacity(&self) -> Capacity {
        self.adjoint.capacity
    }

    /// Bins and traces `rays`; the counters tell whether all of it has fitted.
    pub(super) fn forward(
        &self,
        device: &Device,
        tracer: &CameraTracer,
        rays: &CameraRays,
        commands: &mut Commands,
    ) {
        tracer.record_binning(device, rays, commands);
        commands.clear_buffer(&self.adjoint.record.gradients, 0, None);
        self.adjoint.forward(device, tracer, self.band, commands);
    }

    /// Gradients of what was traced last.
    pub(super) fn backward(&self, device: &Device, commands: &mut Commands) {
        device.record(&self.band.gradients, commands);
    }
}
