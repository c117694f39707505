//! Buffers of binning on the device; [`super::passes::bin`] are its passes.
//!
//! Gaussians are projected, sorted by the distance from which on they can be hit, spread over the
//! tiles that they may cover, and these entries are sorted by tile; both sorts are stable, so that
//! lists come out nearest first, and the same in every run.

use super::declarations::camera::{
    Counters, ENTRIES, GAUSSIANS, KEY_BITS, Seen, SplitPixels, TILE, TILES_PER_DISPATCH, View,
};
use super::device::{Commands, Device};
use super::error::GpuError;
use super::scene_buffers::SceneBuffers;
use super::sort::Sorter;
use crate::camera_rays::CameraRays;
use bytemuck::Zeroable as _;
use std::mem::offset_of;

/// Pixels that a side of an image may have: kernels count pixels in 32 bits, and columns and rows
/// of tiles in 16.
const MAX_SIDE: u32 = 65_535;

/// Entries of the lists for each Gaussian, at first.
const ENTRIES_PER_SURFEL: u32 = 4;

/// Lists of the Gaussians that tiles may see, for cameras of one size and scenes of one number of
/// Gaussians.
#[derive(Debug)]
pub(super) struct BinBuffers {
    pub(super) view: wgpu::Buffer,
    /// [`SplitPixels`] of the tiles of each dispatch.
    pub(super) split: Vec<wgpu::Buffer>,
    /// [`Seen`], `[n]`.
    pub(super) seen: wgpu::Buffer,
    /// Rectangle of tiles of each Gaussian, `[n]`.
    pub(super) rects: wgpu::Buffer,
    /// [`crate::attributes::Attributes`] as the camera sees them, `[n]`.
    pub(super) attributes: wgpu::Buffer,
    /// [`Counters`].
    pub(super) counters: wgpu::Buffer,
    pub(super) by_distance: Sorter,
    /// First entry of each Gaussian of [`Self::order`], and the end, `[n + 1]`.
    pub(super) entry_starts: wgpu::Buffer,
    /// Gaussian of each entry.
    pub(super) entry_surfels: wgpu::Buffer,
    pub(super) by_tile: Sorter,
    /// Place of each entry in the lists.
    pub(super) places: wgpu::Buffer,
    /// Gaussian and tile of each place.
    pub(super) listed: wgpu::Buffer,
    /// First place of each tile, and the end.
    pub(super) list_starts: wgpu::Buffer,
    /// Entries that the lists hold.
    pub(super) capacity: u32,
    num_surfels: u32,
    size: (u32, u32),
}

impl BinBuffers {
    /// Buffers for the lists of `scene` as cameras of `width` × `height` pixels see it, with as
    /// many entries in all as is usual, or `num_entries` if these are more.
    pub(super) fn new(
        device: &Device,
        scene: &SceneBuffers,
        (width, height): (u32, u32),
        num_entries: u32,
    ) -> Result<Self, GpuError> {
        if width.max(height) > MAX_SIDE {
            return Err(GpuError::Image {
                device: device.adapter().name.clone(),
                width,
                height,
                limit: MAX_SIDE,
            });
        }
        let n = scene.num_surfels();
        let usual = n.saturating_mul(ENTRIES_PER_SURFEL).max(1024);
        let capacity = num_entries.max(usual);
        let num_tiles = width.div_ceil(TILE) * height.div_ceil(TILE);
        let tile_bits = u32::BITS - num_tiles.leading_zeros();
        let bytes = |num: u32, size: usize| u64::from(num) * size as u64;
        let of_gaussians = |what, size| device.buffer(what, bytes(n, size));
        let of_entries = |what, size| device.buffer(what, bytes(capacity, size));
        let view = View::zeroed();
        let counters = device.buffer("counters", size_of::<Counters>() as u64)?;
        let bins = Self {
            view: device.uniform("view", &view),
            split: (0..num_tiles.div_ceil(TILES_PER_DISPATCH))
                .map(|_| device.uniform("split pixels", &SplitPixels::zeroed()))
                .collect(),
            seen: of_gaussians("Gaussians as seen", size_of::<Seen>())?,
            rects: of_gaussians("rectangles", size_of::<[u32; 2]>())?,
            attributes: match &scene.harmonics {
                None => scene.attributes.clone(),
                Some(_) => device.buffer("attributes as seen", scene.attributes.size())?,
            },
            by_distance: Sorter::new(device, n, KEY_BITS, (&counters, GAUSSIANS))?,
            entry_starts: device.buffer("starts of entries", bytes(n + 1, 4))?,
            entry_surfels: of_entries("Gaussians of entries", 4)?,
            by_tile: Sorter::new(device, capacity, tile_bits, (&counters, ENTRIES))?,
            places: of_entries("places of entries", 4)?,
            listed: of_entries("lists of tiles", size_of::<[u32; 2]>())?,
            list_starts: device.buffer("starts of lists", bytes(num_tiles + 1, 4))?,
            counters,
            capacity,
            num_surfels: n,
            size: (width, height),
        };
        bins.restart(device);
        device.check()?;
        Ok(bins)
    }

    /// Gaussians, those that may be hit nearer first, `[n]`.
    pub(super) fn order(&self) -> &wgpu::Buffer {
        self.by_distance.sorted().1
    }

    /// True for grids of the size of that of `rays` and this many Gaussians.
    pub(super) fn fits(&self, rays: &CameraRays, num_surfels: u32) -> bool {
        self.size == rays.grid_size() && self.num_surfels == num_surfels
    }

    /// Prepares the buffers for other `rays`.
    pub(super) fn begin(&self, device: &Device, rays: &CameraRays, commands: &mut Commands) {
        let view = View::new(rays, self.num_surfels);
        device.write(&self.view, bytemuck::bytes_of(&view));
        for (buffer, split) in self.split.iter().zip(&SplitPixels::of(rays)) {
            device.write(buffer, bytemuck::bytes_of(split));
        }
        commands.clear_buffer(&self.list_starts, 0, None);
    }

    /// Sets the counters to where they begin, the overflow flag among them.
    pub(super) fn restart(&self, device: &Device) {
        let counters = Counters {
            num_gaussians: self.num_surfels,
            ..Counters::default()
        };
        device.write(&self.counters, bytemuck::bytes_of(&counters));
    }

    /// Counts chunks from 0 again.
    pub(super) fn clear_chunks(&self, commands: &mut Commands) {
        let offset = offset_of!(Counters, chunks) as u64;
        commands.clear_buffer(&self.counters, offset, Some(size_of::<u32>() as u64));
    }

    /// Counters after the work submitted so far. Waits for the device.
    pub(super) fn counters(&self, device: &Device) -> Result<Counters, GpuError> {
        let read = device.read::<Counters>(&self.counters, 0..1)?;
        Ok(read.first().copied().unwrap_or_default())
    }

    /// Pixels of its cameras.
    pub(super) fn size(&self) -> (u32, u32) {
        self.size
    }
}
