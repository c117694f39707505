//! Light of one scene in several lights: radiance, emission and harmonics for each, geometry and
//! albedo for all.
//!
//! Steps take place in one light at a time, whose values stand where those of a scene in a single
//! light do; those of the others are stored.

use super::learned::Learned;
use super::state::ParameterState;
use super::stored::{LightParameters, NUM_OF_LIGHT};
use super::{ALBEDO, NUM_PARAMETERS, RADIANCE, Raw, logit};
use eagpt_scene::Gaussians;
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Emission of a fixed Gaussian where its lamp is off.
const DARK: f32 = 0.0;

impl ParameterState {
    /// The state with `others`, its light in each of the other lights: radiance and emission of the
    /// same Gaussians, `[n]`.
    #[must_use]
    pub fn with_lights(mut self, others: &[Gaussians]) -> Self {
        let own = self.gaussians();
        let stored = |gaussians: &Gaussians| LightParameters {
            light: Learned::new(light_rows(&ParameterState::new(gaussians).raw.values)),
            harmonics: Learned::new(vec![[0.0; NUM_COEFFICIENTS]; self.harmonics.len()]),
        };
        self.lights.stored = match others {
            [] => Vec::new(),
            _ => [&own].into_iter().chain(others).map(stored).collect(),
        };
        self
    }

    /// Puts the values of another light in the place of the current ones.
    ///
    /// # Panics
    /// If there is no such light.
    pub fn show_light(&mut self, light: usize) {
        assert!(light < self.lights.num(), "no light {light}");
        if light == self.lights.current {
            return;
        }
        let before = &mut self.lights.stored[self.lights.current];
        exchange(&mut self.raw, &mut before.light);
        std::mem::swap(&mut self.harmonics, &mut before.harmonics);
        let after = &mut self.lights.stored[light];
        exchange(&mut self.raw, &mut after.light);
        std::mem::swap(&mut self.harmonics, &mut after.harmonics);
        self.lights.current = light;
    }

    /// The gradient of a fixed Gaussian without all but that of its radiance where it does not
    /// shine in the current light.
    pub(super) fn of_fixed(&self, row: usize, gradient: &Raw) -> Raw {
        let mut left = [0.0; NUM_PARAMETERS];
        let shines = self.raw.values[row][ALBEDO - 1] > 0.0;
        if !shines {
            left[RADIANCE..ALBEDO - 1].copy_from_slice(&gradient[RADIANCE..ALBEDO - 1]);
        }
        left
    }

    /// Gives the last Gaussians their light in every light: `radiances` `[lights][m]`, `None` where
    /// they do not shine. Those have the radiance that the nearest of `before`, the Gaussians
    /// before an edit in each light, had there.
    pub(crate) fn light_last(&mut self, radiances: &[Vec<Option<Vec3>>], before: &[Gaussians]) {
        let current = self.lights.current;
        for (light, (radiances, before)) in radiances.iter().zip(before).enumerate() {
            let reflects = |i: &usize| before.emissions[*i] <= super::sigmoid(0.0);
            let dark: Vec<usize> = (0..before.len()).filter(reflects).collect();
            let places: Vec<[f32; 3]> = dark
                .iter()
                .map(|&i| before.positions[i].to_array())
                .collect();
            let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&places);
            self.show_light(light);
            let first = self.len() - radiances.len();
            for (raw, radiance) in self.raw.values[first..].iter_mut().zip(radiances) {
                if let Some(radiance) = radiance {
                    set_light(raw, *radiance, 1.0);
                } else if !dark.is_empty() {
                    let place = [raw[0], raw[1], raw[2]];
                    let nearest = tree.nearest_one::<SquaredEuclidean>(&place).item as usize;
                    set_light(raw, before.radiances[dark[nearest]], DARK);
                }
            }
        }
        self.show_light(current);
    }

    /// Lets Gaussians emit the light that they have, or reflect it, in each light those that are
    /// given with whether they emit, `[lights]`.
    pub(crate) fn mark_emitting(&mut self, emitting: &[Vec<(usize, bool)>]) {
        let current = self.lights.current;
        for (light, emitting) in emitting.iter().enumerate() {
            self.show_light(light);
            for &(i, emits) in emitting {
                self.raw.values[i][ALBEDO - 1] = logit(f32::from(emits));
            }
        }
        self.show_light(current);
    }

    /// Multiplies the radiance of Gaussians, by their indices, in the light shown.
    pub(crate) fn brighten(&mut self, factors: &[(usize, f32)]) {
        for &(i, factor) in factors {
            for logarithm in &mut self.raw.values[i][RADIANCE..RADIANCE + 3] {
                *logarithm += factor.ln();
            }
        }
    }

    /// The Gaussians in each light.
    pub fn in_lights(&self) -> Vec<Gaussians> {
        let mut state = self.clone();
        let shown = |light| {
            state.show_light(light);
            state.gaussians()
        };
        (0..self.lights.num()).map(shown).collect()
    }
}

pub(super) fn light_rows(raw: &[Raw]) -> Vec<[f32; NUM_OF_LIGHT]> {
    raw.iter()
        .map(|row| std::array::from_fn(|k| row[RADIANCE + k]))
        .collect()
}

fn set_light(raw: &mut Raw, radiance: Vec3, emission: f32) {
    let ln = |r: f32| r.max(super::MIN_RADIANCE).ln();
    raw[RADIANCE..RADIANCE + 3].copy_from_slice(&radiance.to_array().map(ln));
    raw[ALBEDO - 1] = logit(emission);
}

/// Swaps light with the lanes of raw values that hold it.
fn exchange<const K: usize>(raw: &mut Learned<K>, light: &mut Learned<NUM_OF_LIGHT>) {
    let pairs = [
        (&mut raw.values, &mut light.values),
        (&mut raw.first, &mut light.first),
        (&mut raw.second, &mut light.second),
    ];
    for (raw, light) in pairs {
        for (row, stored) in raw.iter_mut().zip(light) {
            row[RADIANCE..ALBEDO].swap_with_slice(stored);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::StepSizes;
    use crate::params::tests::sample;
    use eagpt_scene::{Gaussian, SceneEdit};
    use eagpt_trace::blend::LocalGradient;

    fn row(radiance: f32, emission: f32) -> Gaussians {
        (0..3)
            .map(|i| Gaussian {
                position: Vec3::X * i as f32,
                radiance: Vec3::splat(radiance + i as f32),
                emission,
                ..sample()
            })
            .collect()
    }

    fn state() -> ParameterState {
        ParameterState::new(&row(1.0, 0.01)).with_lights(&[row(10.0, 0.01), row(20.0, 0.01)])
    }

    fn everything() -> StepSizes {
        StepSizes {
            raw: [0.1; NUM_PARAMETERS],
            ..StepSizes::albedo(0.1)
        }
    }

    #[test]
    fn each_light_keeps_its_own_values_and_moments() {
        let mut state = state();
        state.begin_harmonics();
        let before = state.in_lights();
        let radiances = before.iter().map(|light| light.radiances[1].x.round());
        assert_eq!(radiances.collect::<Vec<_>>(), [2.0, 11.0, 21.0]);
        state.show_light(1);
        let gradients = [LocalGradient([1.0; 16]); 3];
        let shown = state.gaussians();
        (state.step(&shown, Vec3::ZERO, &gradients, &everything())).unwrap();
        let after = state.in_lights();
        assert_eq!(state.lights.current, 1);
        for light in 0..3 {
            let same = before[light].radiances == after[light].radiances;
            assert_eq!(same, light != 1, "{light}");
            // Geometry and albedo are those of all.
            assert_eq!(after[light].positions, after[0].positions);
            assert_ne!(after[light].albedos, before[light].albedos);
        }
        state.show_light(2);
        assert_eq!(state.raw.first[0][RADIANCE], 0.0);
        assert_ne!(state.raw.first[0][0], 0.0);
        state.show_light(1);
        assert_ne!(state.raw.first[0][RADIANCE], 0.0);
    }

    #[test]
    fn lights_follow_splits_and_another_order() {
        let mut state = state();
        state.split(1, 3, 0, Vec3::X * 0.1, 0.7);
        state.sort_in_space();
        for (light, first) in state.in_lights().iter().zip([1.0, 10.0, 20.0]) {
            for (place, radiance) in light.positions.iter().zip(&light.radiances) {
                let wanted = first + place.x.round();
                assert!((radiance.x - wanted).abs() < 1e-3, "{radiance} {wanted}");
            }
        }
    }

    #[test]
    fn what_emits_is_marked_in_its_light_alone() {
        let mut state = state();
        state.show_light(1);
        let before = state.in_lights();
        state.mark_emitting(&[vec![(1, true)], vec![], vec![(2, true)]]);
        // A later mark replaces an earlier one.
        state.mark_emitting(&[
            vec![(1, false)],
            vec![(2, true)],
            vec![(0, true), (1, true), (2, false)],
        ]);
        assert_eq!(state.lights.current, 1);
        let after = state.in_lights();
        let emits = after
            .iter()
            .map(|light| light.emissions.iter().map(|e| *e > 0.5).collect());
        let wanted = [[false; 3], [false, false, true], [true, true, false]];
        assert_eq!(emits.collect::<Vec<Vec<bool>>>(), wanted);
        for (before, after) in before.iter().zip(&after) {
            assert_eq!(before.radiances, after.radiances);
        }
    }

    /// A lamp stays as it was found where it shines, and learns what it reflects where it is off.
    #[test]
    fn a_fixed_gaussian_learns_its_radiance_where_it_does_not_shine() {
        let mut state = state();
        let lamp = Gaussian {
            position: Vec3::X * 1.8,
            ..sample()
        };
        let before = state.in_lights();
        let edit = SceneEdit {
            fixed: [lamp].into_iter().collect(),
            ..SceneEdit::nothing(3)
        };
        state.edit(&edit);
        let radiances = [vec![None], vec![Some(Vec3::splat(50.0))], vec![None]];
        state.light_last(&radiances, &before);
        assert_eq!((state.lights.current, state.num_fixed), (0, 1));
        let lit = state.in_lights();
        let of_lamp = lit.iter().map(|light| light.radiances[3].x.round());
        assert_eq!(of_lamp.collect::<Vec<_>>(), [3.0, 50.0, 22.0]);
        let emissions = lit.iter().map(|light| light.emissions[3] > 0.5);
        assert_eq!(emissions.collect::<Vec<_>>(), [false, true, false]);
        let gradients = [LocalGradient([1.0; 16]); 4];
        for light in 0..2 {
            state.show_light(light);
            let shown = state.gaussians();
            (state.step(&shown, Vec3::ZERO, &gradients, &everything())).unwrap();
        }
        let after = state.in_lights();
        assert_ne!(after[0].radiances[3], lit[0].radiances[3]);
        assert_eq!(after[1].radiances[3], lit[1].radiances[3]);
        assert_eq!(after[0].positions[3], lit[0].positions[3]);
        assert_eq!(after[0].emissions[3], lit[0].emissions[3]);
        assert_ne!(after[0].positions[2], lit[0].positions[2]);
    }
}
