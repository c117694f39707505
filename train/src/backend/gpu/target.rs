//! Views that training compares with, on the device.

use crate::backend::step::TrainingView;
use crate::error::Result;
use crate::loss::target::Target;
use crate::points::normal_map;
use eagpt_eval::KnownPixels;
use eagpt_eval::Windows;
use eagpt_scene::Image;
use eagpt_trace::gpu::Device;
use eagpt_trace::gpu::kernel::{Buffer, Layout, layout};
use std::sync::Arc;

/// A pixel that is known.
pub(super) const KNOWN: u32 = 1;
/// A pixel whose window of SSIM touches nothing unknown.
pub(super) const WINDOW: u32 = 2;
/// A pixel at an edge; see [`Target::edges`].
pub(super) const EDGE: u32 = 4;
/// Bits of flags in front of the opacity.
pub(super) const FLAG_BITS: u32 = 3;
/// The opacity that stands for 1.
pub(super) const FULL_OPACITY: u32 = (1 << (16 - FLAG_BITS)) - 1;

/// A pixel of a target; of most 16 bits a number, half of what floats take.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct TargetPixel {
    /// Steps of a [`Target`], red in the lower half.
    red_green: u32,
    /// In the upper half the emission.
    blue_emission: u32,
    /// Signed; all zero where there is none.
    normal_xy: u32,
    /// In the upper half [`KNOWN`], [`WINDOW`] and [`EDGE`], and over them the opacity, 0 to
    /// [`FULL_OPACITY`].
    normal_z_flags: u32,
    /// Distance of the point of the cloud there, 0 where there is none.
    distance: f32,
}

impl TargetPixel {
    pub(super) fn layout() -> Layout {
        layout!(TargetPixel {
            red_green: "u32",
            blue_emission: "u32",
            normal_xy: "u32",
            normal_z_flags: "u32",
            distance: "f32",
        })
    }
}

/// 0 to 1 as 0 to `most`; what is less, more or no number becomes the nearest of them, and 0.
fn unsigned(value: f32, most: u32) -> u32 {
    (value.clamp(0.0, 1.0) * most as f32).round() as u32
}

/// −1 to 1 as a signed number of 16 bits.
fn signed(value: f32) -> u32 {
    u32::from((value.clamp(-1.0, 1.0) * 32_767.0).round() as i16 as u16)
}

/// Two numbers of 16 bits, the first one in the lower half.
fn pair(low: u32, high: u32) -> u32 {
    low | (high << 16)
}

/// A view on the device, and the numbers that its means are taken over.
#[derive(Debug, Clone)]
pub(super) struct TargetView {
    /// [`TargetPixel`] of every pixel, row by row.
    pub(super) pixels: Buffer,
    /// See [`Target::edges`].
    pub(super) edges: Arc<[bool]>,
    /// Pixels that are known.
    pub(super) num_known: usize,
    /// Windows of SSIM that count.
    pub(super) num_windows: usize,
    /// Points of the cloud that it sees.
    pub(super) num_points: usize,
    pub(super) has_emission: bool,
    /// Clipped channels of every pixel, red in the lowest bit; of views that have some.
    pub(super) clipped: Option<Buffer>,
}

impl TargetView {
    /// Bytes that a view of so many pixels takes.
    pub(super) fn num_bytes(num_pixels: usize) -> usize {
        num_pixels * size_of::<TargetPixel>()
    }

    /// Brings `training` to the device; `target` is its radiance.
    pub(super) fn new(device: &Device, training: &TrainingView, target: &Target) -> Result<Self> {
        let view = &training.view;
        let points = training.points.as_ref();
        let points = points.map(|points| points.pixels(&view.camera));
        let normals = normal_map(points.as_deref(), view);
        let points = points.as_deref().unwrap_or_default();
        let known = view.valid.as_ref().map(KnownPixels::new);
        let windows = known.as_ref().map(KnownPixels::windows);
        let num_pixels = view.camera.num_pixels();
        let single = |image: &Option<Image<1>>, i: usize| image.as_ref().map(|m| m.pixels()[i][0]);
        let pixel = |i: usize| {
            let is_known = known.as_ref().is_none_or(|known| known.has(i));
            let counts = windows.as_ref().is_none_or(|windows| windows.has(i));
            let is_edge = target.edges()[i];
            let flags = (KNOWN * u32::from(is_known))
                | (WINDOW * u32::from(counts))
                | (EDGE * u32::from(is_edge));
            let opacity = unsigned(single(&view.alpha, i).unwrap_or(1.0), FULL_OPACITY);
            let emission = single(&view.emission, i).unwrap_or(0.0);
            let pq = target.pixels()[i].map(u32::from);
            let normal = normals.as_ref();
            let normal = normal.map_or([0; 3], |map| map.pixels()[i].map(signed));
            TargetPixel {
                red_green: pair(pq[0], pq[1]),
                blue_emission: pair(pq[2], unsigned(emission, 0xffff)),
                normal_xy: pair(normal[0], normal[1]),
                normal_z_flags: pair(normal[2], flags | (opacity << FLAG_BITS)),
                distance: 0.0,
            }
        };
        let bits = |flags: &[f32; 3]| {
            let flags = flags.iter().enumerate();
            flags.fold(0, |bits, (c, flag)| bits | (u32::from(*flag > 0.0) << c))
        };
        let clipped = view.clipped.as_ref().map(|mask| {
            let bits: Vec<u32> = mask.pixels().iter().map(bits).collect();
            device.upload("clipped channels", bytemuck::cast_slice(&bits))
        });
        let mut pixels: Vec<TargetPixel> = (0..num_pixels).map(pixel).collect();
        for point in points {
            pixels[point.pixel as usize].distance = point.distance;
        }
        Ok(Self {
            pixels: device.upload("view", bytemuck::cast_slice(&pixels))?,
            edges: Arc::clone(target.edges()),
            num_known: known.as_ref().map_or(num_pixels, KnownPixels::num),
            num_windows: windows.as_ref().map_or(num_pixels, Windows::num),
            num_points: points.len(),
            has_emission: view.emission.is_some(),
            clipped: clipped.transpose()?,
        })
    }
}
