//! Edits of a scene while it is optimised: Gaussians go, move, and come to stay where they are.

use super::lights::light_rows;
use super::{ParameterState, RADIANCE, Raw, raw_from_gaussian};
use eagpt_scene::SceneEdit;
use eagpt_scene::harmonics::NUM_COEFFICIENTS;

impl ParameterState {
    /// Carries out an edit. Gaussians that stay keep their order, their values and their moments;
    /// those that are fixed already and stay come before the new ones.
    ///
    /// # Panics
    /// If the edit is one of another number of Gaussians.
    pub fn edit(&mut self, edit: &SceneEdit) {
        assert_eq!(
            edit.keep.len(),
            self.len(),
            "an edit is one of all Gaussians"
        );
        for (index, gaussian) in &edit.moved {
            let index = *index as usize;
            let new = raw_from_gaussian(gaussian);
            self.raw.values[index][..RADIANCE].copy_from_slice(&new[..RADIANCE]);
            self.raw.forget(index);
            if !self.harmonics.is_empty() {
                self.harmonics.forget(index);
            }
            (self.lights).for_each(|rows| rows.forget(index), |rows| rows.forget(index));
        }
        let fixed_before = &edit.keep[self.num_moving()..];
        let still_fixed = fixed_before.iter().filter(|stays| **stays).count();
        let fixed: Vec<Raw> = edit.fixed.iter().map(|g| raw_from_gaussian(&g)).collect();
        if !self.harmonics.is_empty() {
            self.harmonics.retain(edit);
            (self.harmonics).append(&vec![[0.0; NUM_COEFFICIENTS]; fixed.len()]);
        }
        self.raw.retain(edit);
        self.raw.append(&fixed);
        let light = light_rows(&fixed);
        let num = fixed.len();
        self.lights.for_each(
            |rows| {
                rows.retain(edit);
                rows.append(&light);
            },
            |rows| {
                rows.retain(edit);
                rows.append(&vec![[0.0; NUM_COEFFICIENTS]; num]);
            },
        );
        self.num_fixed = still_fixed + fixed.len();
    }

    /// Number of Gaussians that stage 0 moves: the first ones.
    pub fn num_moving(&self) -> usize {
        self.len() - self.num_fixed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::tests::sample;
    use crate::params::{ALBEDO, Learned, Lights, NUM_PARAMETERS, POSITION, StepSizes};
    use eagpt_scene::Gaussian;
    use eagpt_trace::blend::LocalGradient;
    use glam::Vec3;

    /// Numbers that tell Gaussians, arrays and parameters apart.
    fn learned<const K: usize>(n: usize) -> Learned<K> {
        let array = |salt: f32| -> Vec<[f32; K]> {
            let row = |i: usize| std::array::from_fn(|k| salt + i as f32 + 0.01 * k as f32);
            (0..n).map(row).collect()
        };
        Learned {
            values: array(0.0),
            first: array(100.0),
            second: array(200.0),
            num_steps: 9,
        }
    }

    fn state(n: usize) -> ParameterState {
        ParameterState {
            raw: learned(n),
            harmonics: learned(n),
            num_fixed: 0,
            lights: Lights::default(),
        }
    }

    fn at(x: f32) -> Gaussian {
        Gaussian {
            position: Vec3::splat(x),
            ..sample()
        }
    }

    #[test]
    fn what_stays_keeps_its_values_and_moments_and_what_is_new_has_none() {
        let before = state(4);
        let mut after = before.clone();
        after.edit(&SceneEdit {
            keep: vec![true, false, true, true],
            moved: vec![(2, at(7.0))],
            fixed: [at(8.0), at(9.0)].into_iter().collect(),
        });
        assert_eq!(
            (after.len(), after.num_fixed, after.num_moving()),
            (5, 2, 3)
        );
        let steps = (after.raw.num_steps, after.harmonics.num_steps);
        assert_eq!(steps, (9, 9));
        let pairs = before.raw.arrays().into_iter().zip(after.raw.arrays());
        for (old, new) in pairs {
            assert_eq!((new[0], new[2]), (old[0], old[3]));
        }
        let pairs = before
            .harmonics
            .arrays()
            .into_iter()
            .zip(after.harmonics.arrays());
        for (old, new) in pairs {
            assert_eq!((new[0], new[2]), (old[0], old[3]));
        }
        let wanted = raw_from_gaussian(&at(7.0));
        assert_eq!(after.raw.values[1][..RADIANCE], wanted[..RADIANCE]);
        assert_eq!(
            after.raw.values[1][RADIANCE..],
            before.raw.values[2][RADIANCE..]
        );
        assert_eq!(after.harmonics.values[1], before.harmonics.values[2]);
        for (k, x) in [(3, 8.0), (4, 9.0)] {
            assert_eq!(after.raw.values[k], raw_from_gaussian(&at(x)));
            assert_eq!(after.harmonics.values[k], [0.0; NUM_COEFFICIENTS]);
        }
        for k in [1, 3, 4] {
            assert_eq!(after.raw.first[k], [0.0; NUM_PARAMETERS]);
            assert_eq!(after.harmonics.first[k], [0.0; NUM_COEFFICIENTS]);
        }
        // Gaussians that move keep the moments they had.
        assert_eq!(after.raw.second[1], before.raw.second[2]);
        assert_eq!(after.harmonics.second[1], before.harmonics.second[2]);
        for k in [3, 4] {
            assert_eq!(after.raw.second[k], [0.0; NUM_PARAMETERS]);
            assert_eq!(after.harmonics.second[k], [0.0; NUM_COEFFICIENTS]);
        }
        // One that was fixed goes, another one comes.
        let mut later = after.clone();
        later.edit(&SceneEdit {
            keep: vec![true, true, true, false, true],
            moved: Vec::new(),
            fixed: [at(10.0)].into_iter().collect(),
        });
        assert_eq!((later.len(), later.num_fixed), (5, 2));
        assert_eq!(later.raw.values[3], raw_from_gaussian(&at(9.0)));
        assert_eq!(later.raw.values[4], raw_from_gaussian(&at(10.0)));
        let same = later.clone();
        later.edit(&SceneEdit::nothing(5));
        assert_eq!(later, same);
    }

    #[test]
    fn without_harmonics_there_are_none_afterwards() {
        let mut state = state(2);
        state.harmonics = Learned::default();
        state.edit(&SceneEdit {
            fixed: [at(8.0)].into_iter().collect(),
            ..SceneEdit::nothing(2)
        });
        assert!(state.harmonics.is_empty() && state.len() == 3);
    }

    #[test]
    fn what_is_fixed_stays_last_and_moves_by_its_albedo_alone() {
        let mut state = ParameterState::new(&[9.0, 3.0, 5.0].map(at).into_iter().collect());
        state.begin_harmonics();
        state.edit(&SceneEdit {
            // In another order than that of the curve.
            fixed: [6.0, 1.0].map(at).into_iter().collect(),
            ..SceneEdit::nothing(3)
        });
        let places = |state: &ParameterState| -> Vec<f32> {
            let rows = state.raw.values.iter();
            rows.map(|raw| raw[POSITION]).collect()
        };
        state.sort_in_space();
        assert_eq!(places(&state), [3.0, 5.0, 9.0, 6.0, 1.0]);
        state.split(1, 5, 0, Vec3::splat(0.5), 0.7);
        state.split(0, 6, 0, Vec3::splat(0.25), 0.7);
        state.put_fixed_last(3);
        assert_eq!(places(&state), [3.25, 5.5, 9.0, 4.5, 2.75, 6.0, 1.0]);

        let before = state.clone();
        let everywhere = vec![LocalGradient([1.0; 16]); 7];
        let mut sizes = StepSizes {
            raw: [0.1; NUM_PARAMETERS],
            ..StepSizes::albedo(0.1)
        };
        sizes.harmonics = [0.1; NUM_COEFFICIENTS];
        let gaussians = state.gaussians();
        (state.step(&gaussians, Vec3::ZERO, &everywhere, &sizes)).unwrap();
        for i in 0..7 {
            let has_moved = state.raw.values[i] != before.raw.values[i];
            assert_eq!(has_moved, i < 5, "{i}");
            let has_moved = state.harmonics.values[i] != before.harmonics.values[i];
            assert_eq!(has_moved, i < 5, "harmonics {i}");
            assert_eq!(state.raw.second[i] == [0.0; NUM_PARAMETERS], i >= 5, "{i}");
        }
        let before = state.clone();
        let gaussians = state.gaussians();
        let albedo = StepSizes::albedo(0.1);
        (state.step(&gaussians, Vec3::ZERO, &everywhere, &albedo)).unwrap();
        for (new, old) in state.raw.values.iter().zip(&before.raw.values) {
            assert_eq!(new[..ALBEDO], old[..ALBEDO]);
            assert!(new[ALBEDO] < old[ALBEDO]);
        }
    }
}
