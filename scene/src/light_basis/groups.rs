//! Which Gaussians that emit are one light.

use crate::gaussians::Gaussians;
use crate::lamps::{EMISSION_THRESHOLD, Lamps};

/// The light of all Gaussians that emit and belong to no lamp.
pub const REST: &str = "rest";

/// The light of Gaussians that do not emit.
pub const NO_LIGHT: u32 = u32::MAX;

/// The Gaussians of a scene that emit, by lamp.
#[derive(Debug, Clone, PartialEq)]
pub struct LightGroups {
    /// Names of the lights, in order.
    pub names: Vec<String>,
    /// Index of the light of each Gaussian, `[n]`; [`NO_LIGHT`] where it does not emit.
    pub of: Vec<u32>,
}

impl LightGroups {
    /// Lamps that a Gaussian of `scene` belongs to, in their order, then [`REST`] if one belongs to
    /// none.
    ///
    /// # Errors
    /// In words, if a lamp has the name of the rest.
    pub fn new(scene: &Gaussians, lamps: &Lamps) -> Result<Self, String> {
        if lamps.named(REST).is_some() {
            return Err(format!("`{REST}` is the light of what belongs to no lamp"));
        }
        let rest = lamps.lamps.len();
        let lamp_of = |(position, &emission): (_, &f32)| {
            (emission > EMISSION_THRESHOLD).then(|| lamps.of(position).unwrap_or(rest))
        };
        let positions = scene.positions.iter().copied();
        let lamp_of: Vec<Option<usize>> = positions.zip(&scene.emissions).map(lamp_of).collect();
        let mut is_there = vec![false; rest + 1];
        for &lamp in lamp_of.iter().flatten() {
            is_there[lamp] = true;
        }
        let names = lamps.names().chain([REST]).zip(&is_there);
        let names = names.filter(|(_, is_there)| **is_there);
        let before = |lamp: usize| is_there[..lamp].iter().filter(|there| **there).count() as u32;
        Ok(Self {
            names: names.map(|(name, _)| name.to_owned()).collect(),
            of: (lamp_of.into_iter())
                .map(|lamp| lamp.map_or(NO_LIGHT, before))
                .collect(),
        })
    }
}
