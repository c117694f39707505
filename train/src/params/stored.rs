//! Values of the lights of a scene while they are not shown.

use super::learned::Learned;
use super::{ALBEDO, RADIANCE};
use eagpt_scene::harmonics::NUM_COEFFICIENTS;

/// ln r (3), logit e.
pub const NUM_OF_LIGHT: usize = ALBEDO - RADIANCE;

/// Parameters of one light: those that differ between lights.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LightParameters {
    /// ln r (3), logit e, `[n]`.
    pub light: Learned<NUM_OF_LIGHT>,
    /// As [`super::ParameterState::harmonics`].
    pub harmonics: Learned<NUM_COEFFICIENTS>,
}

/// The lights of a state.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Lights {
    /// Index of the light whose values are those of the state.
    pub current: usize,
    /// Values of every light, those of the current one out of date; none where there is one light
    /// alone.
    pub stored: Vec<LightParameters>,
}

impl Lights {
    /// Number of lights, at least 1.
    pub fn num(&self) -> usize {
        self.stored.len().max(1)
    }

    /// All arrays of rows of light.
    pub(super) fn for_each(
        &mut self,
        mut light: impl FnMut(&mut Learned<NUM_OF_LIGHT>),
        mut harmonics: impl FnMut(&mut Learned<NUM_COEFFICIENTS>),
    ) {
        for stored in &mut self.stored {
            light(&mut stored.light);
            if !stored.harmonics.is_empty() {
                harmonics(&mut stored.harmonics);
            }
        }
    }
}
