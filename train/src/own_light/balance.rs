//! Albedos whose light, after all bounces, is as bright as the photographs.

use super::{OwnLight, compare};
use crate::backend::TrainingView;
use crate::bake::gaussians::GaussianBake;
use crate::bake::solution::Solution;
use crate::error::Result;
use crate::progress::BakeProgress;
use eagpt_light::energy::MAX_SURFACE;
use eagpt_light::irradiance::usual_samples;
use eagpt_scene::gaussians::MAX_ALBEDO;
use eagpt_scene::lamps::emits;
use eagpt_scene::machine::available_memory;
use eagpt_scene::{Camera, Gaussians};
use eagpt_trace::Device;
use eagpt_trace::transport::MAX_BOUNCES;
use glam::Vec3;
use std::ops::ControlFlow;

/// How much brighter or darker a scene is made, at most: what is beyond comes of lamps that are
/// missing or too strong, which albedos are not to pay for.
const MOST_CHANGE: f64 = 1.1;
/// Halvings of the interval in which the factor of albedos is looked for.
const NUM_HALVINGS: u32 = 40;

/// A scene in its own light, as bright as its photographs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Balance {
    /// Its albedos, `[n]`.
    pub(crate) albedos: Vec<Vec3>,
    /// Factor of those of surfaces; lamps keep theirs.
    pub(crate) scale: f32,
    /// Gaussians between which light would have grown with each bounce, which are darker.
    pub(crate) num_limited: usize,
    /// How the scene compares with it.
    pub(crate) own_light: OwnLight,
}

/// Solves the light of `scene`, of which `num_moving` Gaussians, the first ones, are not of clean
/// lamps, with the `cameras` of all training views, and compares some `views`. `None` where nothing
/// emits, or `told` has ended it.
///
/// # Errors
/// If the device fails or a view cannot be read.
pub(crate) fn balance<V: Iterator<Item = Result<TrainingView>>>(
    (device, seed): (&Device, u64),
    (scene, num_moving): (&Gaussians, usize),
    cameras: &[Camera],
    views: impl Fn() -> V,
    told: &mut dyn FnMut(BakeProgress) -> ControlFlow<()>,
) -> Result<Option<Balance>> {
    let solution = Solution {
        device,
        cameras,
        method: GaussianBake {
            num_samples: Some(num_samples(scene.len(), available_memory())),
        },
        max_bounces: MAX_BOUNCES,
        seed,
    };
    let Some(mut traced) = solution.trace(scene, told)? else {
        return Ok(None);
    };
    let mut scene = scene.clone();
    let num_limited = traced.limit_growth(&mut scene);
    let Some(solved) = traced.solve(scene.clone(), told)? else {
        return Ok(None);
    };
    let Some(own_light) = compare(device, &solved.scene, views())? else {
        return Ok(None);
    };
    let scale = match own_light.median_scale {
        Some(wanted) => albedo_scale(&solved.bounces, wanted),
        None => 1.0,
    };
    multiply_albedos((&mut scene, num_moving), scale);
    let Some(solved) = traced.solve(scene, told)? else {
        return Ok(None);
    };
    let own_light = compare(device, &solved.scene, views())?;
    Ok(own_light.map(|own_light| Balance {
        albedos: solved.scene.albedos,
        scale,
        num_limited,
        own_light,
    }))
}

/// Multiplies the albedos of what does not emit of a scene, of which the first `num_moving`
/// Gaussians are not of clean lamps.
fn multiply_albedos((scene, num_moving): (&mut Gaussians, usize), by: f32) {
    let albedos = scene.albedos.iter_mut().zip(&scene.emissions);
    for (albedo, emission) in albedos.take(num_moving) {
        if !emits(*emission) {
            *albedo = (*albedo * by).min(Vec3::splat(MAX_ALBEDO));
        }
    }
}

/// The factor of albedos by which light of these `bounces` is `wanted` times as bright: bounce k,
/// from 1 on, has them k times. No surface reflects more than it receives.
fn albedo_scale(bounces: &[f64], wanted: f64) -> f32 {
    let wanted = wanted.clamp(1.0 / MOST_CHANGE, MOST_CHANGE) * bounces.iter().sum::<f64>();
    let light = |scale: f64| {
        bounces
            .iter()
            .rfold(0.0, |sum, bounce| scale * (sum + bounce))
    };
    let [mut low, mut high] = [1.0 / MOST_CHANGE, 1.0 / f64::from(MAX_SURFACE)];
    for _ in 0..NUM_HALVINGS {
        let middle = 0.5 * (low + high);
        if light(middle) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    high as f32
}

/// Directions at each of `num` Gaussians whose entries half of the `available` memory holds.
fn num_samples(num: usize, available: Option<u64>) -> u32 {
    let each = 4 * num.max(1) as u64;
    let most = available.map_or(u64::MAX, |bytes| bytes / 2 / each);
    u64::from(usual_samples(num)).min(most).max(2) as u32
}

#[cfg(test)]
mod tests;
