//! Light that unseen cells are expected to reflect: what they get, by the albedo of what is seen of
//! their face.

use super::hull::{Hull, NUM_FACES};
use crate::alike::{Compared, MAX_ALBEDO};
use crate::irradiance;
use eagpt_scene::rng::RandomKey;
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::{TraceError, Tracer};
use glam::Vec3;
use std::collections::BTreeMap;

/// Directions from which the light that a cell gets is gathered.
const NUM_SAMPLES: u32 = 256;
/// A surface this near to a face, in parts of the box's length there, that faces as it does
/// (cosine) is part of it; share of receivers that tell its albedo, at least.
const NEAR_FACE: f32 = 0.1;
const FACING: f32 = 0.9;
const LEAST_OF_FACE: f32 = 0.005;

/// Irradiance over π of a cell, and the radiance that it is expected to reflect.
pub(super) struct Lit {
    pub(super) irradiance: Vec3,
    pub(super) reflected: Vec3,
}

/// Those of some cells, by their numbers, in a scene of these radiances.
///
/// # Errors
/// If the device fails.
pub(super) fn expected(
    hull: &Hull,
    cells: impl Iterator<Item = usize> + Clone,
    (tracer, radiances): (&dyn Tracer, &[Vec3]),
    compared: &Compared,
    key: RandomKey,
) -> Result<BTreeMap<usize, Lit>, TraceError> {
    let surfaces = cells.clone().zip(0..);
    let surfaces: Vec<Receiver> = surfaces.map(|(cell, i)| (i, hull.surface(cell))).collect();
    let light = irradiance::received(tracer, &surfaces, radiances, (NUM_SAMPLES, key))?;
    let albedos = albedos(hull, compared);
    let lit = |(cell, irradiance): (usize, Vec3)| {
        let reflected = albedos[hull.cell(cell).face as usize] * irradiance;
        (
            cell,
            Lit {
                irradiance,
                reflected,
            },
        )
    };
    Ok(cells.zip(light).map(lit).collect())
}

/// Albedo that cells of each face are expected to have: that of the surface that is seen of it, or,
/// if that is too little, of all.
fn albedos(hull: &Hull, compared: &Compared) -> [Vec3; NUM_FACES as usize] {
    let receivers = &compared.receivers;
    let all: Vec<usize> = (0..receivers.len()).collect();
    let albedo = |of: &[usize]| {
        let sum = |light: &[Vec3]| of.iter().map(|&i| light[i]).sum::<Vec3>();
        (sum(&compared.radiances) / sum(&compared.known)).min(Vec3::splat(MAX_ALBEDO))
    };
    let least = (LEAST_OF_FACE * receivers.len() as f32) as usize;
    [0, 1, 2, 3, 4, 5].map(|face| {
        let inwards = hull.rotation_of(face) * Vec3::Z;
        let corner = hull.rotation * hull.corner(face);
        let near = NEAR_FACE * (hull.high - hull.low)[face as usize / 2];
        let is_of = |&&i: &&usize| {
            let (_, surface) = &receivers[i];
            let height = (surface.position - corner).dot(inwards);
            surface.normal.dot(inwards) > FACING && height < near
        };
        let own: Vec<usize> = all.iter().filter(is_of).copied().collect();
        albedo(if own.len() > least { &own } else { &all })
    })
}
