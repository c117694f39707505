//! The losses on the device: the twins of [`crate::loss::radiance_loss`] and
//! [`crate::loss::albedo_loss`].

use super::kernels;
use super::report::Report;
use super::target::{TargetPixel, TargetView};
use crate::error::Result;
use crate::loss::{LossTerms, NormalTerms, PixelLight};
use crate::options::LossWeights;
use eagpt_scene::Camera;
use eagpt_trace::features::Features;
use eagpt_trace::gpu::kernel::{Buffer, Layout, Module, Step, layout};
use eagpt_trace::gpu::{Device, Frame};

/// Invocations of a workgroup that adds up.
pub(super) const ADD_THREADS: u32 = 128;
/// Pixels that each of them adds.
pub(super) const ADD_PER_THREAD: u32 = 16;

/// What decides the loss of one view.
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct LossParameters {
    /// Directions through pixels, as in [`eagpt_scene::camera::RayFrame`].
    base: [f32; 3],
    width: u32,
    step_x: [f32; 3],
    height: u32,
    step_y: [f32; 3],
    num_pixels: u32,
    rays_per_axis: u32,
    has_normals: u32,
    has_map: u32,
    has_emission: u32,
    /// Weights; those of means are divided by what they are means over.
    color: f32,
    l1: f32,
    ssim: f32,
    per_window: f32,
    normal: f32,
    depth_normal: f32,
    emission: f32,
    alpha: f32,
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
            has_map: "u32",
            has_emission: "u32",
            color: "f32",
            l1: "f32",
            ssim: "f32",
            per_window: "f32",
            normal: "f32",
            depth_normal: "f32",
            emission: "f32",
            alpha: "f32",
        })
    }

    fn new(camera: &Camera, view: &TargetView, options: &LossOptions) -> Self {
        let frame = camera.ray_frame();
        let weights = &options.weights;
        let over = |weight: f64, num: usize| (weight / num.max(1) as f64) as f32;
        Self {
            base: frame.base.to_array(),
            width: camera.width,
            step_x: frame.step_x.to_array(),
            height: camera.height,
            step_y: frame.step_y.to_array(),
            num_pixels: camera.num_pixels() as u32,
            rays_per_axis: options.rays_per_axis,
            has_normals: u32::from(options.normals == NormalTerms::On),
            has_map: view.has_map.into(),
            has_emission: view.has_emission.into(),
            color: weights.color as f32,
            l1: over(1.0 - weights.ssim_share, 3 * view.num_known),
            ssim: weights.ssim_share as f32,
            per_window: over(1.0, 3 * view.num_windows),
            normal: weights.normal as f32,
            depth_normal: weights.depth_normal as f32,
            emission: if view.has_emission {
                over(weights.emission, view.num_known)
            } else {
                0.0
            },
            alpha: over(weights.alpha, view.num_known),
        }
    }
}

/// How a view is compared.
#[derive(Debug, Clone)]
pub(super) struct LossOptions {
    pub(super) weights: LossWeights,
    pub(super) normals: NormalTerms,
    /// Rays along each axis of a pixel.
    pub(super) rays_per_axis: u32,
    /// Of stage 1 the light of the view, by which albedos are compared in place of radiance; see
    /// [`lit_pixels`].
    pub(super) lit: Option<Buffer>,
}

/// The light of a view for [`LossOptions::lit`].
pub(super) fn lit_pixels(device: &Device, light: &PixelLight) -> Result<Buffer> {
    let lit = light.irradiance.iter().zip(&light.emitted);
    let pixels: Vec<[f32; 4]> = lit
        .map(|(arriving, emitted)| match emitted {
            Some(radiance) => radiance.extend(1.0).to_array(),
            None => arriving.extend(0.0).to_array(),
        })
        .collect();
    Ok(device.upload("light of a view", bytemuck::cast_slice(&pixels))?)
}

/// Memory of the kernels, for views of one number of pixels.
#[derive(Debug)]
pub(super) struct LossBuffers {
    num_pixels: usize,
    means: Buffer,
    encoded: Buffer,
    blurred: Buffer,
    partials: Buffer,
    terms: Buffer,
    surfaces: Buffer,
    group_sums: Buffer,
}

impl LossBuffers {
    /// Room for views of `num_pixels` pixels.
    pub(super) fn new(device: &Device, num_pixels: usize) -> Result<Self> {
        // Vectors of three take as much as vectors of four.
        let vectors = |num: u64| 16 * num * num_pixels as u64;
        let groups = (num_pixels as u64).div_ceil(u64::from(ADD_THREADS * ADD_PER_THREAD));
        const { assert!(size_of::<Features>() == 64 && size_of::<TargetPixel>() == 16) };
        Ok(Self {
            num_pixels,
            means: device.buffer("means of rays", vectors(4))?,
            encoded: device.buffer("PQ values", vectors(2))?,
            blurred: device.buffer("blurred moments", vectors(4))?,
            partials: device.buffer("derivatives by moments", vectors(4))?,
            terms: device.buffer("terms of the loss", vectors(2))?,
            surfaces: device.buffer("derivatives by surfaces", vectors(3))?,
            group_sums: device.buffer("features of groups", 32 * groups)?,
        })
    }

    /// Whether there is room for views of `num_pixels` pixels, and not for others.
    pub(super) fn fits(&self, num_pixels: usize) -> bool {
        self.num_pixels == num_pixels
    }

    /// The kernels from the features of `frame` to the derivatives by them, for a view of `camera`.
    /// Features over pixels go to `report`.
    pub(super) fn steps(
        &self,
        device: &Device,
        (camera, view): (&Camera, &TargetView),
        options: &LossOptions,
        (frame, report): (&Frame, &Buffer),
    ) -> Vec<Step> {
        let parameters = LossParameters::new(camera, view, options);
        let parameters = device.uniform("loss", &parameters);
        let all = [
            &parameters,
            &frame.features,
            &self.means,
            &view.pixels,
            &self.encoded,
            &self.blurred,
            &self.partials,
            &self.terms,
        ];
        let step = |module: &'static Module,
                    entry: &'static str,
                    bindings: &[u32],
                    more: &[(u32, &Buffer)]| {
            let mut buffers: Vec<(u32, &Buffer)> =
                bindings.iter().map(|&b| (b, all[b as usize])).collect();
            buffers.extend_from_slice(more);
            let per_group = match entry {
                "add_pixels" => ADD_THREADS * ADD_PER_THREAD,
                "add_groups" => u32::MAX,
                _ => 64,
            };
            let groups = (self.num_pixels as u32).div_ceil(per_group);
            device.step(module, entry, &buffers, groups)
        };
        let surfaces = (8, &self.surfaces);
        let d_features = (10, &frame.d_features);
        let (encode, derivatives) = match &options.lit {
            None => (
                step(&kernels::COLOR, "encode", &[0, 1, 2, 4], &[]),
                step(
                    &kernels::DERIVATIVES,
                    "derivatives",
                    &[0, 2, 3, 4, 5, 7],
                    &[surfaces, (9, report), d_features],
                ),
            ),
            Some(lit) => (
                step(&kernels::COLOR, "encode_lit", &[0, 1, 2, 4], &[(11, lit)]),
                step(
                    &kernels::DERIVATIVES,
                    "derivatives_lit",
                    &[0, 3, 4, 5],
                    &[d_features, (11, lit)],
                ),
            ),
        };
        let features = (8, &self.group_sums);
        vec![
            encode,
            step(&kernels::COLOR, "blur_moments", &[0, 3, 4, 5], &[]),
            step(&kernels::COLOR, "compare", &[0, 2, 3, 4, 5, 6, 7], &[]),
            step(&kernels::COLOR, "blur_partials", &[0, 5, 6], &[]),
            step(
                &kernels::SURFACE,
                "surface_terms",
                &[0, 2, 3, 7],
                &[surfaces],
            ),
            step(&kernels::ADD_UP, "add_pixels", &[0, 7], &[features]),
            step(
                &kernels::ADD_UP,
                "add_groups",
                &[0],
                &[features, (9, report)],
            ),
            derivatives,
        ]
    }
}

/// The terms of a loss, from the features over pixels.
pub(super) fn terms(report: &Report, view: &TargetView, options: &LossOptions) -> LossTerms {
    let [
        l1,
        ssim,
        emission,
        alpha,
        normal,
        num_map,
        spanned,
        num_spanned,
    ] = report.terms();
    let weights = &options.weights;
    let mean = |sum: f64, num: f64| if num > 0.0 { sum / num } else { 0.0 };
    let known = view.num_known.max(1) as f64;
    let l1 = l1 / (3.0 * known);
    let ssim = match view.num_windows {
        0 => 1.0,
        num => ssim / (3.0 * num as f64),
    };
    let color = (1.0 - weights.ssim_share) * l1 + weights.ssim_share * (1.0 - ssim);
    let shown = LossTerms {
        total: weights.color * color,
        l1,
        ssim,
        ..LossTerms::default()
    };
    if options.lit.is_some() {
        return shown;
    }
    let mut terms = LossTerms {
        normal: mean(normal, num_map),
        depth_normal: mean(spanned, num_spanned),
        emission: emission / known,
        alpha: alpha / known,
        ..shown
    };
    terms.total += weights.normal * terms.normal
        + weights.depth_normal * terms.depth_normal
        + weights.emission * terms.emission
        + weights.alpha * terms.alpha;
    terms
}
