//! Structures in buffers of the kernels, beside those of views and reports.

use eagpt_trace::gpu::kernel::{Layout, layout};

/// Parameters of the loss of one view.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct LossParameters {
    /// Directions through pixels, as in [`eagpt_scene::camera::RayFrame`].
    pub(super) base: [f32; 3],
    pub(super) width: u32,
    pub(super) step_x: [f32; 3],
    pub(super) height: u32,
    pub(super) step_y: [f32; 3],
    pub(super) num_pixels: u32,
    /// Of a pixel at an edge; others have one ray.
    pub(super) rays_per_axis: u32,
    pub(super) has_normals: u32,
    pub(super) has_emission: u32,
    /// Weights; those of means are divided by what they are means over.
    pub(super) color: f32,
    pub(super) l1: f32,
    pub(super) ssim: f32,
    pub(super) per_window: f32,
    pub(super) normal: f32,
    pub(super) depth_normal: f32,
    pub(super) emission: f32,
    pub(super) alpha: f32,
    pub(super) depth: f32,
}

impl LossParameters {
    pub(super) fn layout() -> Layout {
        layout!(LossParameters {
            base: "vec3f",
            width: "u32",
            step_x: "vec3f",
            height: "u32",
            step_y: "vec3f",
            num_pixels: "u32",
            rays_per_axis: "u32",
            has_normals: "u32",
            has_emission: "u32",
            color: "f32",
            l1: "f32",
            ssim: "f32",
            per_window: "f32",
            normal: "f32",
            depth_normal: "f32",
            emission: "f32",
            alpha: "f32",
            depth: "f32",
        })
    }
}

/// PQ values of a pixel and their slopes. Vectors of three take as much as vectors of four.
#[derive(Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(super) struct Encoded {
    pq: [f32; 4],
    slope: [f32; 4],
}

/// Moments of the colours of a pixel's window, or derivatives by them.
#[derive(Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(super) struct Moments {
    of_target: [f32; 4],
    of_shown: [f32; 4],
    of_squares: [f32; 4],
    of_product: [f32; 4],
}

/// Summands of a pixel in the terms of the loss; see [`super::report::Report::terms`].
#[derive(Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(super) struct Terms {
    image: [f32; 4],
    surface: [f32; 4],
    depth: f32,
    padding: [f32; 3],
}

/// Derivatives of the term of spanned normals of a pixel.
#[derive(Clone, Copy)]
#[repr(C)]
#[allow(dead_code, reason = "lives on the device alone; Rust knows its size")]
pub(super) struct SurfaceGradient {
    d_across: [f32; 4],
    d_down: [f32; 4],
    d_normal: [f32; 4],
}

/// One step's constants.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct AdamParameters {
    pub(super) sizes: [[f32; 4]; 5],
    /// Of each coefficient of one channel.
    pub(super) harmonics: [[f32; 4]; 2],
    /// Centre of the camera.
    pub(super) eye: [f32; 3],
    pub(super) harmonics_decay: f32,
    pub(super) correction_1: f32,
    pub(super) correction_2: f32,
    pub(super) harmonics_correction_1: f32,
    pub(super) harmonics_correction_2: f32,
    /// Those that the kernels are about, the first ones.
    pub(super) num_gaussians: u32,
    /// From here on they are fixed: their radiance moves where they do not shine, if anything.
    pub(super) first_fixed: u32,
    pub(super) padding: [u32; 2],
}

impl AdamParameters {
    pub(super) fn layout() -> Layout {
        layout!(AdamParameters {
            sizes: "array<vec4f, 5>",
            harmonics: "array<vec4f, 2>",
            eye: "vec3f",
            harmonics_decay: "f32",
            correction_1: "f32",
            correction_2: "f32",
            harmonics_correction_1: "f32",
            harmonics_correction_2: "f32",
            num_gaussians: "u32",
            first_fixed: "u32",
            padding: "vec2u",
        })
    }
}

/// Which lanes of rows are exchanged.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct ExchangeParameters {
    pub(super) num_rows: u32,
    /// Lanes of a whole row.
    pub(super) row: u32,
    pub(super) first_lane: u32,
    pub(super) num_lanes: u32,
}

impl ExchangeParameters {
    pub(super) fn layout() -> Layout {
        layout!(ExchangeParameters {
            num_rows: "u32",
            row: "u32",
            first_lane: "u32",
            num_lanes: "u32",
        })
    }
}
