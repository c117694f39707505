//! The kernels of the adjoint on their buffers.

use crate::gpu::bins::Bins;
use crate::gpu::camera::{Band, tile_steps};
use crate::gpu::device::{Device, Step};
use crate::gpu::error::GpuError;
use crate::gpu::scan::scan;
use crate::gpu::scene::SceneBuffers;
use crate::gpu::wgsl::{self, Module};

/// What the steps of a band work on.
pub(super) struct Parts<'a> {
    pub(super) device: &'a Device,
    pub(super) scene: &'a SceneBuffers,
    pub(super) bins: &'a Bins,
    pub(super) record: &'a wgpu::Buffer,
    pub(super) masks: &'a wgpu::Buffer,
    pub(super) hit_starts: &'a wgpu::Buffer,
    pub(super) hits: &'a wgpu::Buffer,
    pub(super) d_features: &'a wgpu::Buffer,
    pub(super) values: &'a wgpu::Buffer,
    pub(super) rows: &'a wgpu::Buffer,
    pub(super) num_rows: u32,
    pub(super) gradients: &'a wgpu::Buffer,
    pub(super) contributions: &'a wgpu::Buffer,
}

impl Parts<'_> {
    /// Features, with a record of what is blended, and how many hits each place in the lists has.
    pub(super) fn forward(
        &self,
        features: &wgpu::Buffer,
        band: Band,
    ) -> Result<Vec<Step>, GpuError> {
        let Self { device, bins, .. } = self;
        let mut steps = tile_steps(device, &band, |band, groups| {
            let buffers = [
                (0, &bins.view),
                (1, band),
                (2, &bins.list_starts),
                (3, &bins.listed),
                (4, &bins.seen),
                (5, &bins.attributes),
                (6, features),
                (7, self.record),
                (8, self.masks),
                (9, &bins.totals),
            ];
            device.step(&wgsl::CAMERA_RECORD, "trace_tiles", &buffers, groups)
        });
        let count = [(2, self.masks), (3, self.hit_starts)];
        let groups = bins.capacity.div_ceil(64);
        steps.push(device.step(&wgsl::ADJOINT_COUNT, "count_hits", &count, groups));
        steps.extend(scan(device, self.hit_starts, bins.capacity)?);
        Ok(steps)
    }

    /// From the record and the derivatives by the features to gradients.
    pub(super) fn backward(&self, band: Band) -> Vec<Step> {
        let buffers = [(10, &self.bins.seen), (11, self.d_features)];
        let modules = [&wgsl::GRADIENT_ROWS, &wgsl::GRADIENT_GATHER];
        self.go_back(band, modules, &buffers, self.gradients)
    }

    /// From the record and the values of pixels to contributions.
    pub(super) fn attribute(&self, band: Band) -> Vec<Step> {
        let buffers = [(10, self.values)];
        let modules = [&wgsl::CONTRIBUTION_ROWS, &wgsl::CONTRIBUTION_GATHER];
        self.go_back(band, modules, &buffers, self.contributions)
    }

    /// From the record to what each Gaussian has in all pixels, in `out`, `[n]`; the first of two
    /// modules adds up within tiles, and needs `buffers` beside the record.
    fn go_back(
        &self,
        band: Band,
        [within_tiles, over_tiles]: [&'static Module; 2],
        buffers: &[(u32, &wgpu::Buffer)],
        out: &wgpu::Buffer,
    ) -> Vec<Step> {
        let Self { device, bins, .. } = self;
        let mut steps = self.weigh(band);
        for first_place in (0..bins.capacity).step_by(self.num_rows.max(1) as usize) {
            let part = Band {
                first_place,
                ..band
            };
            let band = device.uniform("band", &part);
            let record = [
                (0, &bins.view),
                (1, &band),
                (2, &bins.listed),
                (3, self.masks),
                (4, self.hit_starts),
                (5, self.hits),
                (6, self.rows),
            ];
            let add = [&record, buffers].concat();
            let groups = self.num_rows.div_ceil(64);
            steps.push(device.step(within_tiles, "add_rows", &add, groups));
            let gather = [
                (0, &bins.view),
                (1, &band),
                (2, &bins.order),
                (3, &bins.entry_starts),
                (4, &bins.places),
                (5, self.masks),
                (6, self.rows),
                (7, out),
            ];
            let groups = self.scene.num_surfels().div_ceil(64);
            steps.push(device.step(over_tiles, "gather_rows", &gather, groups));
        }
        steps
    }

    /// The weight of every hit, and what it has to do with the derivatives by the features.
    fn weigh(&self, band: Band) -> Vec<Step> {
        let Self { device, bins, .. } = self;
        tile_steps(device, &band, |band, groups| {
            let buffers = [
                (0, &bins.view),
                (1, band),
                (2, self.record),
                (3, &bins.listed),
                (4, &bins.seen),
                (5, &bins.attributes),
                (6, self.d_features),
                (7, self.masks),
                (8, self.hit_starts),
                (9, self.hits),
            ];
            device.step(&wgsl::ADJOINT_WEIGHTS, "weigh_hits", &buffers, groups)
        })
    }
}
