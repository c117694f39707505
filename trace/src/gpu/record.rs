//! The record of the blended hits of camera rays on the device.

use super::bins::BinBuffers;
use super::capacity::Capacity;
use super::declarations::camera::CHUNK_HITS;
use super::device::Device;
use super::error::GpuError;
use crate::blend::Contribution;
use crate::features::NUM_LANES;

/// Bytes of one row of gradients.
const ROW_BYTES: u64 = (NUM_LANES * size_of::<f32>()) as u64;

/// The record of the blended hits of a band of rows, and what is made of it.
#[derive(Debug)]
pub(super) struct RecordBuffers {
    /// [`super::declarations::camera::PIXEL_WORDS`] for each pixel, then the other chunks.
    pub(super) chunks: wgpu::Buffer,
    /// Pixels that blended the Gaussian at each place in the lists, a bit each.
    pub(super) masks: wgpu::Buffer,
    /// First of the hits of each place.
    pub(super) hit_starts: wgpu::Buffer,
    /// Weight and dL/dα of each hit; see `adjoint_weights.wgsl`.
    pub(super) hits: wgpu::Buffer,
    /// Gradients or contributions of each place.
    pub(super) rows: wgpu::Buffer,
    /// Places whose rows there are at a time.
    pub(super) num_rows: u32,
    /// Derivatives of the loss by the features of each pixel.
    pub(super) d_features: wgpu::Buffer,
    /// A number for each pixel.
    pub(super) values: wgpu::Buffer,
    /// [`crate::blend::LocalGradient`], `[n]`.
    pub(super) gradients: wgpu::Buffer,
    /// [`Contribution`], `[n]`.
    pub(super) contributions: wgpu::Buffer,
}

impl RecordBuffers {
    /// Buffers for a band of `capacity` on the lists of `bins`, of `num_surfels` Gaussians.
    pub(super) fn new(
        device: &Device,
        bins: &BinBuffers,
        capacity: &Capacity,
        num_surfels: u32,
    ) -> Result<Self, GpuError> {
        let (width, height) = bins.size();
        let num_rows = u64::from(bins.capacity).min(device.max_bytes() / ROW_BYTES);
        let num_pixels = u64::from(width) * u64::from(capacity.rows.min(height));
        let num_hits = (num_pixels + u64::from(capacity.chunks)) * u64::from(CHUNK_HITS);
        let of_places = |what, size: u64| device.buffer(what, size * u64::from(bins.capacity));
        let of_gaussians = |what, size: u64| device.buffer(what, size * u64::from(num_surfels));
        Ok(Self {
            chunks: device.buffer("record of hits", capacity.record_bytes(width))?,
            masks: of_places("pixels of hits", 8)?,
            hit_starts: of_places("starts of hits", 4)?,
            hits: device.buffer("hits", 8 * num_hits)?,
            d_features: device.buffer("derivatives by features", ROW_BYTES * num_pixels)?,
            values: device.buffer("values of pixels", 4 * num_pixels)?,
            rows: device.buffer("rows of gradients", ROW_BYTES * num_rows)?,
            num_rows: u32::try_from(num_rows).unwrap_or(u32::MAX),
            gradients: of_gaussians("gradients", ROW_BYTES)?,
            contributions: of_gaussians("contributions", size_of::<Contribution>() as u64)?,
        })
    }
}
