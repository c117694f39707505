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
    pub(super) d_sums: &'a wgpu::Buffer,
    pub(super) values: &'a wgpu::Buffer,
    pub(super) rows: &'a wgpu::Buffer,
    pub(super) num_rows: u32,
    pub(super) gradients: &'a wgpu::Buffer,
    pub(super) contributions: &'a wgpu::Buffer,
}

impl Parts<'_> {
    /// Sums, with a record of what is blended, and how many hits each place in the lists has.
    pub(super) fn forward(&self, sums: &wgpu::Buffer, band: Band) -> Result<Vec<Step>, GpuError> {
        let Self { device, bins, .. } = self;
        let mut steps = tile_steps(device, &band, |band, groups| {
            let buffers = [
                (0, &bins.view),
                (1, band),
                (2, &bins.list_starts),
                (3, &bins.listed),
                (4, &bins.seen),
                (5, &bins.payloads),
                (6, sums),
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

    /// From the record and the derivatives by the sums to gradients.
    pub(super) fn backward(&self, band: Band) -> Vec<Step> {
        let Self { device, bins, .. } = self;
        let mut steps = self.weigh(band);
        for (band, groups) in self.parts_of_rows(band) {
            let add = [
                (0, &bins.view),
                (1, &band),
                (2, &bins.listed),
                (3, &bins.seen),
                (4, self.d_sums),
                (5, self.masks),
                (6, self.hit_starts),
                (7, self.hits),
                (8, self.rows),
            ];
            steps.push(device.step(&wgsl::ADJOINT_ROWS, "add_rows", &add, groups));
            let gather = (&wgsl::ADJOINT_GATHER, "gather_rows");
            steps.push(self.gather(&band, gather, self.gradients));
        }
        steps
    }

    /// From the record and the values of pixels to contributions.
    pub(super) fn attribute(&self, band: Band) -> Vec<Step> {
        let Self { device, bins, .. } = self;
        let mut steps = self.weigh(band);
        for (band, groups) in self.parts_of_rows(band) {
            let add = [
                (0, &bins.view),
                (1, &band),
                (2, &bins.listed),
                (3, self.values),
                (4, self.masks),
                (5, self.hit_starts),
                (6, self.hits),
                (7, self.rows),
            ];
            let module = &wgsl::CONTRIBUTION_ROWS;
            steps.push(device.step(module, "add_contributions", &add, groups));
            let gather = (&wgsl::CONTRIBUTION_GATHER, "gather_contributions");
            steps.push(self.gather(&band, gather, self.contributions));
        }
        steps
    }

    /// The weight of every hit, and what it has to do with the derivatives by the sums.
    fn weigh(&self, band: Band) -> Vec<Step> {
        let Self { device, bins, .. } = self;
        tile_steps(device, &band, |band, groups| {
            let buffers = [
                (0, &bins.view),
                (1, band),
                (2, self.record),
                (3, &bins.listed),
                (4, &bins.seen),
                (5, &bins.payloads),
                (6, self.d_sums),
                (7, self.masks),
                (8, self.hit_starts),
                (9, self.hits),
            ];
            device.step(&wgsl::ADJOINT_WEIGHTS, "weigh_hits", &buffers, groups)
        })
    }

    /// `band` with each part of the lists that there are rows for, and the workgroups that fill them.
    fn parts_of_rows(&self, band: Band) -> impl Iterator<Item = (wgpu::Buffer, u32)> {
        let places = (0..self.bins.capacity).step_by(self.num_rows.max(1) as usize);
        places.map(move |first_place| {
            let part = Band {
                first_place,
                ..band
            };
            let groups = self.num_rows.div_ceil(64);
            (self.device.uniform("band", &part), groups)
        })
    }

    /// Adds up the rows of each Gaussian in `out`, `[n]`.
    fn gather(
        &self,
        band: &wgpu::Buffer,
        (module, entry): (&'static Module, &'static str),
        out: &wgpu::Buffer,
    ) -> Step {
        let bins = self.bins;
        let buffers = [
            (0, &bins.view),
            (1, band),
            (2, &bins.order),
            (3, &bins.entry_starts),
            (4, &bins.places),
            (5, self.masks),
            (6, self.rows),
            (7, out),
        ];
        let groups = self.scene.num_surfels().div_ceil(64);
        self.device.step(module, entry, &buffers, groups)
    }
}
