//! What views should look like, on the device.

use crate::error::Result;
use eagpt_eval::KnownPixels;
use eagpt_eval::known::Windows;
use eagpt_scene::{Image, View};
use eagpt_trace::gpu::Device;
use eagpt_trace::gpu::kernel::{Buffer, Layout, layout};

/// A pixel that is known.
pub(super) const KNOWN: u32 = 1;
/// A pixel whose window of SSIM touches nothing unknown.
pub(super) const WINDOW: u32 = 2;

/// What one pixel should look like.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Wanted {
    /// PQ values.
    pq: [f32; 3],
    /// [`KNOWN`] and [`WINDOW`]; the opacity in the upper half, 0 to 65,535.
    flags: u32,
    /// Zero where there is none.
    normal: [f32; 3],
    emission: f32,
}

impl Wanted {
    pub(super) fn layout() -> Layout {
        layout!(Wanted {
            pq: "vec3f",
            flags: "u32",
            normal: "vec3f",
            emission: "f32",
        })
    }
}

/// A view on the device, and the numbers that its means are taken over.
#[derive(Debug, Clone)]
pub(super) struct WantedView {
    /// [`Wanted`] of every pixel, row by row.
    pub(super) pixels: Buffer,
    /// Pixels that are known.
    pub(super) num_known: usize,
    /// Windows of SSIM that count.
    pub(super) num_windows: usize,
    pub(super) has_map: bool,
    pub(super) has_emission: bool,
}

impl WantedView {
    /// Bytes that a view of so many pixels takes.
    pub(super) fn num_bytes(num_pixels: usize) -> usize {
        num_pixels * size_of::<Wanted>()
    }

    /// Brings `view` to the device; `target_pq` is its radiance as PQ values.
    pub(super) fn new(device: &Device, view: &View, target_pq: &Image<3>) -> Result<Self> {
        let known = view.valid.as_ref().map(KnownPixels::new);
        let windows = known.as_ref().map(KnownPixels::windows);
        let num_pixels = view.camera.num_pixels();
        let pixel = |i: usize| {
            let is_known = known.as_ref().is_none_or(|known| known.has(i));
            let counts = windows.as_ref().is_none_or(|windows| windows.has(i));
            let alpha = view
                .alpha
                .as_ref()
                .map_or(1.0, |image| image.pixels()[i][0]);
            // NaN where nothing is known becomes 0.
            let opacity = (alpha.clamp(0.0, 1.0) * 65_535.0).round() as u32;
            Wanted {
                pq: target_pq.pixels()[i],
                flags: (KNOWN * u32::from(is_known))
                    | (WINDOW * u32::from(counts))
                    | (opacity << 16),
                normal: view
                    .normal
                    .as_ref()
                    .map_or([0.0; 3], |image| image.pixels()[i]),
                emission: view
                    .emission
                    .as_ref()
                    .map_or(0.0, |image| image.pixels()[i][0]),
            }
        };
        let pixels: Vec<Wanted> = (0..num_pixels).map(pixel).collect();
        Ok(Self {
            pixels: device.upload("view", bytemuck::cast_slice(&pixels))?,
            num_known: known.as_ref().map_or(num_pixels, KnownPixels::num),
            num_windows: windows.as_ref().map_or(num_pixels, Windows::num),
            has_map: view.normal.is_some(),
            has_emission: view.emission.is_some(),
        })
    }
}
