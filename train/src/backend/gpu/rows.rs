//! Rows of numbers that Adam moves, on a device.

use crate::error::Result;
use crate::params::Learned;
use eagpt_trace::gpu::Device;
use eagpt_trace::gpu::kernel::Buffer;

/// [`Learned`] on a device, `[n, K]` each.
#[derive(Debug)]
pub(super) struct ResidentRows<const K: usize> {
    pub(super) values: Buffer,
    pub(super) first: Buffer,
    pub(super) second: Buffer,
    pub(super) num_steps: u32,
}

fn bytes<const K: usize>(rows: &[[f32; K]]) -> Vec<u8> {
    bytemuck::cast_slice(rows.as_flattened()).to_vec()
}

impl<const K: usize> ResidentRows<K> {
    /// Brings the moments of `rows` to the device, which has their `values`.
    pub(super) fn new(device: &Device, rows: &Learned<K>, values: Buffer) -> Result<Self> {
        Ok(Self {
            values,
            first: device.upload("first moments", &bytes(&rows.first))?,
            second: device.upload("second moments", &bytes(&rows.second))?,
            num_steps: rows.num_steps,
        })
    }

    /// Brings `rows` to the device.
    pub(super) fn upload(device: &Device, rows: &Learned<K>) -> Result<Self> {
        let values = device.upload("values of rows", &bytes(&rows.values))?;
        Self::new(device, rows, values)
    }

    /// Values and moments.
    pub(super) fn buffers(&self) -> [&Buffer; 3] {
        [&self.values, &self.first, &self.second]
    }

    /// Read back.
    pub(super) fn learned(&self, device: &Device, num_rows: usize) -> Result<Learned<K>> {
        let rows = |buffer: &Buffer| device.read::<[f32; K]>(buffer, 0..num_rows);
        Ok(Learned {
            values: rows(&self.values)?,
            first: rows(&self.first)?,
            second: rows(&self.second)?,
            num_steps: self.num_steps,
        })
    }
}
