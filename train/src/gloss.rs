//! Gloss of surfaces, estimated after stage 0 from how their radiance differs with the direction.
//!
//! Photographs show a point of a surface from many directions. What a diffuse surface sends is the
//! same in all of them; a lobe adds what the scene sends from around the mirrored direction. Light
//! from there is traced through the scene's own radiance ([`sampler`]), for lobes of several
//! roughnesses, and each surface ([`segments`]) takes the lobe that explains the differences
//! between views of its points best ([`fit`]); neighbours that one lobe explains as well as one
//! each are one surface ([`join`]). Levels do not count, only differences at the same point: a
//! bright texture is no gloss. What continues a glossy surface or is seen on it alone is of it
//! ([`share`], [`fill`]), and discs of a plane are turned to face its way ([`planes`]).
//!
//! A surface stays diffuse unless its lobe explains a good part of the differences, and that found
//! in one half of the views explains the other half.

mod evidence;
mod fill;
mod fit;
mod join;
mod observe;
mod planes;
mod sampler;
mod share;

use crate::backend::TrainingView;
use crate::checkpoint::NUM_OF_GLOSS;
use crate::error::Result;
use eagpt_light::irradiance::smooth::Smoothing;
use eagpt_light::segments::Segments;
use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Gaussians, Gloss, SceneEdit};
use eagpt_trace::cpu::CpuScene;
use evidence::{Decision, Evidence, METAL};
use fill::Part;
use glam::{Quat, Vec3};
use observe::Observations;
use planes::Planes;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// A surface that was found to be glossy.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GlossySurface {
    /// Mean of the centres of its Gaussians, world space.
    pub centre: [f32; 3],
    /// Its part of the area of all Gaussians that cameras see.
    pub area_share: f32,
    /// Number of its Gaussians.
    pub num_gaussians: usize,
    /// F0, linear Rec.709.
    pub specular: [f32; 3],
    /// Perceptual roughness.
    pub roughness: f32,
    /// Share of the differences between views that the lobe explains.
    pub explained: f32,
    /// The least share of one half of the views that the lobe of the other half explains.
    pub foretold: f32,
}

/// The glossy surfaces of a scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Estimate {
    /// Of each Gaussian; empty where nothing is glossy.
    pub(crate) gloss: Vec<Gloss>,
    /// Whether each Gaussian is of bare metal, which scatters nothing.
    pub(crate) is_bare: Vec<bool>,
    /// Rotations of all Gaussians, those of metal planes turned to face one way.
    pub(crate) rotations: Vec<Quat>,
    /// Surfaces, largest first.
    pub(crate) surfaces: Vec<GlossySurface>,
}

impl Estimate {
    /// Gloss and rotations of `gaussians`, of surfaces that are `decided` by their own views, have
    /// the lobe of the surface in `shared`, and consist of `parts`.
    fn new(
        gaussians: &Gaussians,
        seen: &Observations,
        (decided, shared): (&[Option<Decision>], &[Option<usize>]),
        planes: &Planes,
        parts: &[Part],
    ) -> Self {
        let mut found = Self {
            gloss: vec![Gloss::NONE; gaussians.len()],
            is_bare: vec![false; gaussians.len()],
            rotations: gaussians.rotations.clone(),
            surfaces: Vec::new(),
        };
        let area =
            |i: usize| gaussians.scales[i].x * gaussians.scales[i].y * gaussians.opacities[i];
        let all = seen.receivers.iter().chain(&seen.faint);
        let total: f32 = all.map(|(i, _)| area(*i as usize)).sum();
        let mut sums: BTreeMap<usize, (f32, usize, Vec3)> = BTreeMap::new();
        for part in parts {
            let i = part.gaussian as usize;
            let source = shared[part.segment as usize];
            let Some((source, own)) = source.and_then(|s| Some((s, decided[s]?))) else {
                continue;
            };
            found.gloss[i] = own.gloss;
            found.is_bare[i] = own.is_bare;
            let sum = sums.entry(source).or_default();
            *sum = (sum.0 + area(i), sum.1 + 1, sum.2 + gaussians.positions[i]);
            // Dielectrics mirror little: even normals bring less than the turn costs.
            let is_metal = f64::from(own.gloss.specular.max_element()) >= METAL;
            if let Some(plane) = part.plane.filter(|_| is_metal) {
                let whole = planes.of[source].filter(|whole| {
                    whole.has(plane.normal()) && whole.reaches(gaussians.positions[i])
                });
                let normal = whole.unwrap_or(plane).normal();
                found.rotations[i] = fill::turned(found.rotations[i], normal);
            }
        }
        let surface = |(source, (area, num_gaussians, place)): (usize, (f32, usize, Vec3))| {
            let own = decided[source]?;
            Some(GlossySurface {
                centre: (place / num_gaussians as f32).to_array(),
                area_share: area / total,
                num_gaussians,
                specular: own.gloss.specular.to_array(),
                roughness: own.gloss.roughness,
                explained: own.explained as f32,
                foretold: own.foretold as f32,
            })
        };
        found.surfaces = sums.into_iter().filter_map(surface).collect();
        (found.surfaces).sort_by(|a, b| b.area_share.total_cmp(&a.area_share));
        found
    }

    /// Gives `gaussians` the gloss that was found, takes the albedo of bare metal, and turns discs
    /// of metal planes.
    pub(crate) fn apply(&self, gaussians: &mut Gaussians) {
        if !self.gloss.is_empty() {
            gaussians.gloss.clone_from(&self.gloss);
            gaussians.rotations.copy_from_slice(&self.rotations);
            for (albedo, is_bare) in gaussians.albedos.iter_mut().zip(&self.is_bare) {
                if *is_bare {
                    *albedo = Vec3::ZERO;
                }
            }
        }
    }

    /// Follows an edit of the scene. What comes has no gloss.
    pub(crate) fn edit(&mut self, edit: &SceneEdit) {
        if self.gloss.is_empty() {
            return;
        }
        edit.retain(&mut self.gloss);
        edit.retain(&mut self.is_bare);
        edit.retain(&mut self.rotations);
        self.rotations.extend(&edit.fixed.rotations);
        self.gloss.resize(self.rotations.len(), Gloss::NONE);
        self.is_bare.resize(self.rotations.len(), false);
    }

    /// Gloss, rotation and whether it is of bare metal of each Gaussian, `[n]`, for
    /// [`Self::from_rows`].
    pub(crate) fn rows(&self) -> Vec<[f32; NUM_OF_GLOSS]> {
        let rows = self.gloss.iter().zip(&self.rotations).zip(&self.is_bare);
        let row = |((gloss, rotation), is_bare): ((&Gloss, &Quat), &bool)| {
            let [r, g, b] = gloss.specular.to_array();
            let [x, y, z, w] = rotation.to_array();
            let is_bare = f32::from(u8::from(*is_bare));
            [r, g, b, gloss.roughness, x, y, z, w, is_bare]
        };
        rows.map(row).collect()
    }

    /// That of [`Self::rows`], without the list of surfaces.
    pub(crate) fn from_rows(rows: &[[f32; NUM_OF_GLOSS]]) -> Self {
        let gloss = |row: &[f32; NUM_OF_GLOSS]| Gloss {
            specular: Vec3::new(row[0], row[1], row[2]),
            roughness: row[3],
        };
        let rotation = |row: &[f32; NUM_OF_GLOSS]| Quat::from_xyzw(row[4], row[5], row[6], row[7]);
        Self {
            gloss: rows.iter().map(gloss).collect(),
            is_bare: rows.iter().map(|row| row[8] > 0.0).collect(),
            rotations: rows.iter().map(rotation).collect(),
            surfaces: Vec::new(),
        }
    }
}

/// Looks for glossy surfaces among the Gaussians of stage 0, by the photographs of `views`.
///
/// `lights`: those Gaussians in each light, at least one. Differences count within a light; those
/// of all lights add up.
///
/// # Errors
/// If a view cannot be read.
pub(crate) fn estimate(
    lights: &[Gaussians],
    views: impl Iterator<Item = Result<TrainingView>>,
    seed: u64,
) -> Result<Estimate> {
    let gaussians = &lights[0];
    let scenes: Vec<CpuScene> = lights.iter().map(CpuScene::new).collect();
    let key = RandomKey::new(seed, Purpose::Albedo, 2);
    let seen = Observations::new(&scenes, views, key)?;
    if seen.receivers.is_empty() {
        return Ok(Estimate::default());
    }
    let smoothing = Smoothing::new(&seen.receivers);
    let segments = Segments::new(&seen.colors, &seen.spreads, &smoothing);
    let planes = Planes::new(&seen.receivers, &segments, &smoothing, gaussians);
    let evidence = evidence::evidence(&scenes, &seen, &segments, &planes, key);
    let (segments, evidence) = join::joined(&segments, evidence, (&smoothing, &planes));
    let planes = Planes::new(&seen.receivers, &segments, &smoothing, gaussians);
    let decided: Vec<Option<Decision>> = evidence.par_iter().map(Evidence::decide).collect();
    if decided.iter().all(Option::is_none) {
        return Ok(Estimate::default());
    }
    let shared = share::shared(&decided, &evidence, &seen, &segments, (&smoothing, &planes));
    let known = |(own, shared): (&Evidence, &Option<usize>)| {
        (shared.is_some() || own.is_known()).then_some(shared.is_some())
    };
    let known: Vec<Option<bool>> = evidence.iter().zip(&shared).map(known).collect();
    let parts = fill::parts(gaussians, &seen, &segments, &planes, &known);
    Ok(Estimate::new(
        gaussians,
        &seen,
        (&decided, &shared),
        &planes,
        &parts,
    ))
}

#[cfg(test)]
mod tests;
