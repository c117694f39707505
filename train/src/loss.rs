//! Losses of EAG-PT (section 3.2) and their gradients with respect to the composited features of
//! each pixel.
//!
//! `λc [0.8 L1 + 0.2 (1 − SSIM)](PQ(R), PQ(GT)) + λn mean(1 − Ñ·N_mono) + λd mean(1 − Ñ_d·N_mono) +
//! λe mean|E − M| + λa mean|A − A_gt| + λp mean|D̃ − d|/d`. A view without a mask has no emission
//! term; a view without a normal map has the normals of the points that it sees; where no normal is
//! known Ñ and Ñ_d are compared with each other, with weight λd. Pixels that are not known take part
//! in no term, nor do windows of SSIM that touch one; means are those over the pixels that do, but
//! that of distances is over all points that the view sees. Where a view is clipped the colour term
//! sees the target in place of anything brighter.
//!
//! Features over pixels are taken row by row in f64, rows in order: the same bits for any number of
//! threads.

pub mod color;
pub(crate) mod depth;
pub mod depth_normal;
pub(crate) mod normal;
pub mod target;

use crate::options::LossWeights;
use crate::points::{PixelPoint, normal_map};
use color::ColorLoss;
use eagpt_eval::KnownPixels;
use eagpt_scene::{Image, View};
use eagpt_trace::features::{Features, GBuffer, lane};
use glam::Vec3;
use normal::normal_map_loss;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The terms of a loss, each before its weight λ, and their weighted sum.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LossTerms {
    /// The weighted sum.
    pub total: f64,
    /// Mean absolute PQ error.
    pub l1: f64,
    /// SSIM of the PQ images.
    pub ssim: f64,
    /// Mean of 1 − Ñ·N_mono.
    pub normal: f64,
    /// Mean of 1 − Ñ_d·N.
    pub depth_normal: f64,
    /// Mean |E − M|.
    pub emission: f64,
    /// Mean |A − A_gt|.
    pub alpha: f64,
    /// Mean |D̃ − d| / d of points of the cloud, each at most 0.1.
    #[serde(default)]
    pub depth: f64,
}

/// Whether the normal terms take part yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NormalTerms {
    /// Too early.
    Off,
    /// Active.
    On,
}

/// Loss of stage 0 for one view and its gradient dL/dV for every pixel. `points` are what the
/// cloud tells of its pixels.
pub fn radiance_loss(
    features: &GBuffer,
    view: &View,
    target_pq: &Image<3>,
    points: Option<&[PixelPoint]>,
    weights: &LossWeights,
    normals: NormalTerms,
) -> (LossTerms, Vec<Features>) {
    let mut d_features = vec![Features::default(); features.pixels.len()];
    let mut terms = LossTerms::default();

    let known = view.valid.as_ref().map(KnownPixels::new);
    let known = known.as_ref();

    let color = ColorLoss::new(
        &features.radiance(),
        target_pq,
        weights.ssim_share,
        known,
        view.clipped.as_ref(),
    );
    terms.l1 = color.l1;
    terms.ssim = color.ssim;
    terms.total += weights.color * color.value;
    for (d, c) in d_features.iter_mut().zip(color.d_radiance.pixels()) {
        for k in 0..3 {
            d.0[lane::RADIANCE + k] = weights.color as f32 * c[k];
        }
    }

    if normals == NormalTerms::On {
        let map = normal_map(points, view);
        if let Some(map) = &map {
            terms.normal = normal_map_loss(features, map, weights.normal, known, &mut d_features);
            terms.total += weights.normal * terms.normal;
        }
        terms.depth_normal = depth_normal::add(
            features,
            &view.camera,
            map.as_deref(),
            weights.depth_normal,
            known,
            &mut d_features,
        );
        terms.total += weights.depth_normal * terms.depth_normal;
    }
    if let Some(mask) = &view.emission {
        terms.emission = absolute_loss(
            features,
            lane::EMISSION,
            Some(mask),
            weights.emission,
            known,
            &mut d_features,
        );
        terms.total += weights.emission * terms.emission;
    }
    terms.alpha = absolute_loss(
        features,
        lane::ALPHA,
        view.alpha.as_ref(),
        weights.alpha,
        known,
        &mut d_features,
    );
    terms.total += weights.alpha * terms.alpha;
    if let Some(points) = points {
        terms.depth = depth::add(features, points, weights.depth, known, &mut d_features);
        terms.total += weights.depth * terms.depth;
    }
    (terms, d_features)
}

/// Light of a view's pixels in stage 1: emitted radiance, or irradiance.
#[derive(Debug, Clone, PartialEq)]
pub struct PixelLight {
    /// Width of the picture.
    pub width: u32,
    /// Height of the picture.
    pub height: u32,
    /// `1/π · ∫ R(ω) (ω·Ñ) dω`, row by row.
    pub irradiance: Vec<Vec3>,
    /// R where an emitter is seen.
    pub emitted: Vec<Option<Vec3>>,
}

impl PixelLight {
    /// The light of `features`, whose pixels are emitters' where emission exceeds `threshold`, and
    /// `irradiance` elsewhere.
    pub fn new(features: &GBuffer, irradiance: Vec<Vec3>, threshold: f32) -> Self {
        let emitted = |seen: &Features| (seen.emission() > threshold).then(|| seen.radiance());
        Self {
            width: features.width,
            height: features.height,
            irradiance,
            emitted: features.pixels.iter().map(emitted).collect(),
        }
    }

    /// Bytes in memory.
    pub fn num_bytes(&self) -> usize {
        size_of_val(&*self.irradiance) + size_of_val(&*self.emitted)
    }
}

/// Loss of stage 1 for one view: the picture is R where an emitter is seen, and elsewhere `albedos`
/// times the irradiance over π; pixels that are not `known` do not count, and channels that are
/// `clipped` only where they are too dark. The gradient is that of the albedos, row by row.
pub fn albedo_loss(
    albedos: &[Vec3],
    light: &PixelLight,
    target_pq: &Image<3>,
    ssim_share: f64,
    known: Option<&KnownPixels>,
    clipped: Option<&Image<3>>,
) -> (LossTerms, Vec<Vec3>) {
    let pixels = || light.irradiance.iter().zip(&light.emitted);
    let shown = (albedos.iter().zip(pixels()))
        .map(|(albedo, (irradiance, emitted))| emitted.unwrap_or(*albedo * *irradiance).to_array());
    let image = Image::from_pixels(light.width, light.height, shown.collect())
        .expect("irradiance and albedo have one entry per pixel");
    let color = ColorLoss::new(&image, target_pq, ssim_share, known, clipped);
    let d_albedos = (color.d_radiance.pixels().iter().zip(pixels()))
        .map(|(d, (irradiance, emitted))| match emitted {
            None => Vec3::from(*d) * *irradiance,
            Some(_) => Vec3::ZERO,
        })
        .collect();
    (
        LossTerms {
            total: color.value,
            l1: color.l1,
            ssim: color.ssim,
            ..LossTerms::default()
        },
        d_albedos,
    )
}

/// `mean |V − target|` of one lane over known pixels; a missing target is 1 everywhere.
fn absolute_loss(
    features: &GBuffer,
    which: usize,
    target: Option<&Image<1>>,
    weight: f64,
    known: Option<&KnownPixels>,
    d_features: &mut [Features],
) -> f64 {
    let num = known.map_or(features.pixels.len(), KnownPixels::num).max(1);
    let share = 1.0 / num as f64;
    let d_share = (weight * share) as f32;
    let sum = sum_over_pixels(d_features, features.width, |i, d| {
        if known.is_some_and(|known| !known.has(i)) {
            return 0.0;
        }
        let wanted = target.map_or(1.0, |t| t.pixels()[i][0]);
        let difference = features.pixels[i].0[which] - wanted;
        d.0[which] += if difference == 0.0 {
            0.0
        } else {
            d_share.copysign(difference)
        };
        f64::from(difference.abs())
    });
    sum * share
}

/// Sum of what `term` is in each pixel of an image so many pixels wide, given its number, row by
/// row; it writes the gradient there. Of all `d_pixels`, rows in order.
fn sum_over_pixels<T: Send>(
    d_pixels: &mut [T],
    width: u32,
    term: impl Fn(usize, &mut T) -> f64 + Sync,
) -> f64 {
    let width = width as usize;
    let rows = d_pixels.par_chunks_mut(width).enumerate();
    let of_row = |(y, row): (usize, &mut [T])| {
        let pixels = (y * width..).zip(row);
        pixels.map(|(i, d)| term(i, d)).sum::<f64>()
    };
    rows.map(of_row).collect::<Vec<f64>>().iter().sum()
}

#[cfg(test)]
pub(crate) mod tests;
