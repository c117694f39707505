//! Composited features of all pixels of a camera on the device.

use super::bins::BinBuffers;
use super::capacity::Incomplete;
use super::declarations::camera::{Band, TILE};
use super::device::{Commands, Device, Pass};
use super::error::GpuError;
use super::passes;
use super::scene_buffers::SceneBuffers;
use crate::camera_rays::CameraRays;
use crate::features::{Features, NUM_LANES};
use std::ops::Range;

/// Rows of pixels whose features fit into one buffer, whole rows of tiles.
fn rows_per_buffer(device: &Device, width: u32, height: u32) -> u32 {
    let row_bytes = u64::from(width) * size_of::<Features>() as u64;
    let rows = device.max_bytes() / row_bytes.max(1);
    let rows = u32::try_from(rows).unwrap_or(u32::MAX) / TILE * TILE;
    rows.clamp(TILE, height.next_multiple_of(TILE))
}

/// Camera rays of a scene, for cameras of one size. Buffers stay on the device from call to call.
#[derive(Debug)]
pub(super) struct CameraTracer {
    pub(super) bins: BinBuffers,
    binning: Vec<Pass>,
    /// [`Features`] of a band of rows.
    pub(super) features: wgpu::Buffer,
    rows: u32,
    bands: Vec<TracedBand>,
}

#[derive(Debug)]
struct TracedBand {
    pixels: Range<usize>,
    passes: Vec<Pass>,
}

impl CameraTracer {
    /// Buffers for cameras of `size` pixels; `num_entries` as for [`BinBuffers::new`].
    pub(super) fn new(
        device: &Device,
        scene: &SceneBuffers,
        size: (u32, u32),
        num_entries: u32,
    ) -> Result<Self, GpuError> {
        let bins = BinBuffers::new(device, scene, size, num_entries)?;
        let binning = passes::bin(device, scene, &bins)?;
        let (width, height) = size;
        let rows = rows_per_buffer(device, width, height);
        let bytes = u64::from(rows.min(height)) * u64::from(width) * size_of::<Features>() as u64;
        let features = device.buffer("features", bytes)?;
        let tiles_x = width.div_ceil(TILE);
        let bands = (0..height)
            .step_by(rows as usize)
            .map(|first_row| {
                let end_row = (first_row + rows).min(height);
                let band = Band {
                    first_tile: first_row / TILE * tiles_x,
                    end_tile: end_row.div_ceil(TILE) * tiles_x,
                    first_pixel: first_row * width,
                    ..Band::default()
                };
                TracedBand {
                    pixels: (first_row * width) as usize..(end_row * width) as usize,
                    passes: passes::trace(device, &bins, &features, band),
                }
            })
            .collect();
        device.check()?;
        Ok(Self {
            bins,
            binning,
            features,
            rows,
            bands,
        })
    }

    /// Rows of pixels that are traced at once, whole rows of tiles.
    pub(super) fn rows(&self) -> u32 {
        self.rows
    }

    /// Pixels that are traced at once.
    pub(super) fn pixels_at_once(&self) -> usize {
        self.bands
            .iter()
            .map(|band| band.pixels.len())
            .max()
            .unwrap_or(0)
    }

    /// Appends the binning for `rays` to `commands`.
    pub(super) fn record_binning(
        &self,
        device: &Device,
        rays: &CameraRays,
        commands: &mut Commands,
    ) {
        self.bins.begin(device, rays, commands);
        device.record(&self.binning, commands);
    }

    /// Brings the lists of Gaussians of the grid of `rays` to the device. Waits for it.
    pub(super) fn bin(&self, device: &Device, rays: &CameraRays) -> Result<(), Incomplete> {
        let mut commands = device.commands();
        self.record_binning(device, rays, &mut commands);
        device.submit(commands)?;
        let needed = self.bins.counters(device)?;
        if needed.entries > self.bins.capacity {
            return Err(Incomplete::Overflow(needed));
        }
        Ok(())
    }

    /// Traces the rays that were binned last, and hands each band of the grid with its features to
    /// `finish` while they are on the device.
    pub(super) fn trace(
        &self,
        device: &Device,
        mut finish: impl FnMut(&Range<usize>, Vec<Features>) -> Result<(), GpuError>,
    ) -> Result<(), GpuError> {
        for band in &self.bands {
            device.run(&band.passes)?;
            let lanes = device.read::<[f32; NUM_LANES]>(&self.features, 0..band.pixels.len())?;
            finish(&band.pixels, lanes.into_iter().map(Features).collect())?;
        }
        Ok(())
    }
}
