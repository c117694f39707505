//! Rows of numbers that Adam moves (Kingma and Ba 2015), with what it remembers of each.

use eagpt_scene::SceneEdit;
use multiversion::multiversion;
use rayon::prelude::*;

/// Adam's moment decays and divisor guard (Kingma and Ba 2015; the guard is that of 3DGS).
pub(crate) const BETA_1: f32 = 0.9;
pub(crate) const BETA_2: f32 = 0.999;
pub(crate) const EPSILON: f32 = 1e-15;

/// A row of `K` numbers for each Gaussian, and their moments.
#[derive(Debug, Clone, PartialEq)]
pub struct Learned<const K: usize> {
    /// The numbers, `[n]`.
    pub values: Vec<[f32; K]>,
    /// First moments, `[n]`.
    pub first: Vec<[f32; K]>,
    /// Second moments, `[n]`.
    pub second: Vec<[f32; K]>,
    /// Steps taken since the moments were zero.
    pub num_steps: u32,
}

impl<const K: usize> Default for Learned<K> {
    fn default() -> Self {
        Self::new(Vec::new())
    }
}

impl<const K: usize> Learned<K> {
    /// Numbers that have not been moved yet.
    pub fn new(values: Vec<[f32; K]>) -> Self {
        let zeros = vec![[0.0; K]; values.len()];
        Self {
            values,
            first: zeros.clone(),
            second: zeros,
            num_steps: 0,
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Values and moments.
    pub fn arrays(&self) -> [&[[f32; K]]; 3] {
        [&self.values, &self.first, &self.second]
    }

    /// Forgets the moments.
    pub fn reset_moments(&mut self) {
        self.first.fill([0.0; K]);
        self.second.fill([0.0; K]);
        self.num_steps = 0;
    }

    /// Puts one half of a row at its place and the other at `place`, which is another row or the
    /// end. Both know the second moments.
    pub(super) fn split(&mut self, parent: usize, place: usize, [one, other]: [[f32; K]; 2]) {
        let second = self.second[parent];
        if place == self.len() {
            self.values.push(other);
            self.first.push([0.0; K]);
            self.second.push(second);
        } else {
            self.values[place] = other;
            self.first[place] = [0.0; K];
            self.second[place] = second;
        }
        self.values[parent] = one;
        self.first[parent] = [0.0; K];
    }

    /// Forgets where a row was going; how far its steps went stays, or the next ones would be long.
    pub(super) fn forget(&mut self, row: usize) {
        self.first[row] = [0.0; K];
    }

    /// Leaves the rows of Gaussians that stay in an edit.
    pub(super) fn retain(&mut self, edit: &SceneEdit) {
        for of in [&mut self.values, &mut self.first, &mut self.second] {
            edit.retain(of);
        }
    }

    /// Puts rows without moments at the end.
    pub(super) fn append(&mut self, values: &[[f32; K]]) {
        self.values.extend_from_slice(values);
        self.first.resize(self.values.len(), [0.0; K]);
        self.second.resize(self.values.len(), [0.0; K]);
    }

    /// Puts the rows in another order.
    pub(super) fn reorder(&mut self, order: &[u32]) {
        for of in [&mut self.values, &mut self.first, &mut self.second] {
            *of = order.iter().map(|&i| of[i as usize]).collect();
        }
    }

    /// One step of the first `num_moving` rows, each along its gradient. `decay`: see
    /// [`super::StepSizes::harmonics_decay`].
    pub(super) fn step(
        &mut self,
        num_moving: usize,
        (sizes, decay): (&[f32; K], f32),
        gradient: impl Fn(usize) -> [f32; K] + Sync,
    ) {
        self.num_steps += 1;
        let adam = Adam::new(self.num_steps);
        let kept = sizes.map(|size| 1.0 - size * decay);
        self.values[..num_moving]
            .par_chunks_mut(CHUNK)
            .zip(self.first[..num_moving].par_chunks_mut(CHUNK))
            .zip(self.second[..num_moving].par_chunks_mut(CHUNK))
            .enumerate()
            .for_each(|(chunk, ((values, first), second))| {
                // Next to the processor: gradients of all rows are as long as the rows.
                let mut gradients = [[0.0; K]; CHUNK];
                for (i, row) in gradients.iter_mut().enumerate().take(values.len()) {
                    *row = gradient(chunk * CHUNK + i);
                }
                adam_step(&adam, (sizes, &kept), values, first, second, &gradients);
            });
    }
}

/// Gaussians updated at once by a thread.
const CHUNK: usize = 128;

/// One step's constants.
pub(crate) struct Adam {
    /// Factor of first moments …
    pub(crate) correction_1: f32,
    /// … and second ones, since both started at zero.
    pub(crate) correction_2: f32,
}

impl Adam {
    /// Those of step `num_steps`, counted from 1.
    pub(crate) fn new(num_steps: u32) -> Self {
        Self {
            correction_1: 1.0 / (1.0 - BETA_1.powi(num_steps as i32)),
            correction_2: 1.0 / (1.0 - BETA_2.powi(num_steps as i32)),
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2", "aarch64+neon"))]
fn adam_step<const K: usize>(
    adam: &Adam,
    (sizes, kept): (&[f32; K], &[f32; K]),
    values: &mut [[f32; K]],
    first: &mut [[f32; K]],
    second: &mut [[f32; K]],
    gradients: &[[f32; K]],
) {
    let moments = first.iter_mut().zip(second);
    for ((value, gradient), (first, second)) in values.iter_mut().zip(gradients).zip(moments) {
        for k in 0..K {
            let g = gradient[k];
            first[k] = BETA_1 * first[k] + (1.0 - BETA_1) * g;
            second[k] = BETA_2 * second[k] + (1.0 - BETA_2) * g * g;
            let root = (second[k] * adam.correction_2).sqrt() + EPSILON;
            value[k] = kept[k] * value[k] - sizes[k] * first[k] * adam.correction_1 / root;
        }
    }
}
