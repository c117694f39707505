//! The losses on the device: [`crate::loss::radiance_loss`] and [`crate::loss::albedo_loss`] in
//! single precision, in which drivers round their own way.

use super::kernels::{self, ADD_PER_THREAD, ADD_THREADS};
use super::report::Report;
use super::structures::{Encoded, LossParameters, Moments, SurfaceGradient, Terms};
use super::target::TargetView;
use crate::error::Result;
use crate::loss::{LossTerms, NormalTerms, PixelLight};
use crate::options::LossWeights;
use eagpt_scene::Camera;
use eagpt_trace::CameraRays;
use eagpt_trace::features::Features;
use eagpt_trace::gpu::kernel::{Buffer, Pass, groups};
use eagpt_trace::gpu::{Device, Frame};

/// Terms of the loss of a view.
#[derive(Debug, Clone)]
pub(super) struct LossOptions {
    pub(super) weights: LossWeights,
    pub(super) normals: NormalTerms,
    /// Whether pixels at edges are means of 2×2 rays.
    pub(super) antialias: bool,
    /// Of stage 1 the light of the view, by which albedos are compared in place of radiance; see
    /// [`lit_pixels`].
    pub(super) lit: Option<Buffer>,
}

/// Parameters of the loss of `view`, which `camera` sees.
fn parameters(camera: &Camera, view: &TargetView, options: &LossOptions) -> LossParameters {
    let frame = camera.ray_frame();
    let weights = &options.weights;
    let over = |weight: f64, num: usize| (weight / num.max(1) as f64) as f32;
    LossParameters {
        base: frame.base.to_array(),
        width: camera.width,
        step_x: frame.step_x.to_array(),
        height: camera.height,
        step_y: frame.step_y.to_array(),
        num_pixels: camera.num_pixels() as u32,
        rays_per_axis: match options.antialias {
            true => CameraRays::RAYS_PER_AXIS,
            false => 1,
        },
        has_normals: u32::from(options.normals == NormalTerms::On),
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
        depth: over(weights.depth, view.num_points),
    }
}

/// The light of a view for [`LossOptions::lit`].
pub(super) fn lit_pixels(device: &Device, light: &PixelLight) -> Result<Buffer> {
    let lit = light.irradiance.iter().zip(&light.emitted);
    let pixels: Vec<[f32; 4]> = lit
        .map(|(irradiance, emitted)| match emitted {
            Some(radiance) => radiance.extend(1.0).to_array(),
            None => irradiance.extend(0.0).to_array(),
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

/// Pixels of a workgroup that adds up.
const PIXELS_PER_GROUP: u32 = ADD_THREADS * ADD_PER_THREAD;

impl LossBuffers {
    /// Buffers for views of `num_pixels` pixels.
    pub(super) fn new(device: &Device, num_pixels: usize) -> Result<Self> {
        let of_pixels = |what, size: usize| device.buffer(what, (num_pixels * size) as u64);
        let num_groups = num_pixels.div_ceil(PIXELS_PER_GROUP as usize);
        Ok(Self {
            num_pixels,
            means: of_pixels("means of rays", size_of::<Features>())?,
            encoded: of_pixels("PQ values", size_of::<Encoded>())?,
            blurred: of_pixels("blurred moments", size_of::<Moments>())?,
            partials: of_pixels("derivatives by moments", size_of::<Moments>())?,
            terms: of_pixels("terms of the loss", size_of::<Terms>())?,
            surfaces: of_pixels("derivatives by surfaces", size_of::<SurfaceGradient>())?,
            group_sums: device
                .buffer("sums of groups", (num_groups * size_of::<Terms>()) as u64)?,
        })
    }

    /// Whether these are for views of `num_pixels` pixels.
    pub(super) fn fits(&self, num_pixels: usize) -> bool {
        self.num_pixels == num_pixels
    }

    /// The passes from the features of `frame` to the derivatives by them, for a view of `camera`.
    /// Sums over pixels go to `report`.
    pub(super) fn passes(
        &self,
        device: &Device,
        (camera, view): (&Camera, &TargetView),
        options: &LossOptions,
        (frame, report): (&Frame, &Buffer),
    ) -> Vec<Pass> {
        let Self {
            means,
            encoded,
            blurred,
            partials,
            terms,
            surfaces,
            group_sums,
            ..
        } = self;
        let parameters = &device.uniform("loss", &parameters(camera, view, options));
        let targets = &view.pixels;
        let (rays, d_rays) = (&frame.features, &frame.d_features);
        let each_pixel = groups(self.num_pixels as u32);
        let each_run = (self.num_pixels as u32).div_ceil(PIXELS_PER_GROUP);

        // Means over the rays of a pixel, encoded.
        let encode = match &options.lit {
            None => {
                let buffers = [parameters, rays, means, targets, encoded];
                device.pass(&kernels::ENCODE, &buffers, each_pixel)
            }
            Some(lit) => {
                let buffers = [parameters, rays, means, targets, encoded, lit];
                device.pass(&kernels::ENCODE_LIT, &buffers, each_pixel)
            }
        };
        // Colours above a clipped target.
        let clip = view.clipped.as_ref().map(|clipped| {
            let buffers = [parameters, targets, encoded, clipped];
            device.pass(&kernels::CLIP, &buffers, each_pixel)
        });
        // SSIM: windows of moments, the value, and the derivatives by the moments.
        let buffers = [parameters, targets, encoded, blurred];
        let blur_moments = device.pass(&kernels::BLUR_MOMENTS, &buffers, each_pixel);
        let buffers = [
            parameters, means, targets, encoded, blurred, partials, terms,
        ];
        let compare = device.pass(&kernels::COMPARE, &buffers, each_pixel);
        let buffers = [parameters, blurred, partials];
        let blur_partials = device.pass(&kernels::BLUR_PARTIALS, &buffers, each_pixel);
        // Normals.
        let buffers = [parameters, means, targets, terms, surfaces];
        let surface_terms = device.pass(&kernels::SURFACE_TERMS, &buffers, each_pixel);
        // Sums over all pixels.
        let buffers = [parameters, terms, group_sums];
        let add_pixels = device.pass(&kernels::ADD_PIXELS, &buffers, each_run);
        let buffers = [parameters, group_sums, report];
        let add_groups = device.pass(&kernels::ADD_GROUPS, &buffers, 1);
        // Derivatives by the features of every ray.
        let derivatives = match &options.lit {
            None => {
                let buffers = [
                    parameters, means, targets, encoded, blurred, terms, surfaces, report, d_rays,
                ];
                device.pass(&kernels::DERIVATIVES, &buffers, each_pixel)
            }
            Some(lit) => {
                let buffers = [parameters, targets, encoded, blurred, d_rays, lit];
                device.pass(&kernels::DERIVATIVES_LIT, &buffers, each_pixel)
            }
        };
        let first = [Some(encode), clip].into_iter().flatten();
        let others = [
            blur_moments,
            compare,
            blur_partials,
            surface_terms,
            add_pixels,
            add_groups,
            derivatives,
        ];
        first.chain(others).collect()
    }
}

/// The terms of a loss, from the sums over pixels.
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
        depth,
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
        depth: depth / view.num_points.max(1) as f64,
        ..shown
    };
    terms.total += weights.normal * terms.normal
        + weights.depth_normal * terms.depth_normal
        + weights.emission * terms.emission
        + weights.alpha * terms.alpha
        + weights.depth * terms.depth;
    terms
}
