//! Gain of a bulb at a place: the part of the loss that it would explain.

use super::places::{HALF, side};
use crate::alike::{Residual, Row};
use crate::segments::Segments;
use std::collections::BTreeMap;

/// Receivers that a cone lights, at least.
const LEAST_LIT: usize = 12;
/// Weight of light that no view shows.
pub(super) const WEIGHT: f64 = 0.01;

/// A receiver that a bulb of intensity 1 lights.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lit {
    pub(super) receiver: usize,
    pub(super) ring: usize,
    /// Irradiance over π.
    pub(super) light: f32,
}

/// Part of the loss that a bulb at a place would explain, by its best cones.
pub(super) struct Gain {
    pub(super) number: usize,
    pub(super) gain: f64,
    pub(super) cones: [usize; 2],
}

/// Light of receivers, `[receivers]`.
pub(super) struct State {
    pub(super) radiances: Vec<f64>,
    pub(super) known: Vec<f64>,
    /// Median of that.
    pub(super) usual: f64,
    /// Light of bulbs that were found.
    pub(super) more: Vec<f64>,
    /// It, of intensity 1, by twice the number of a place, and one more for the cone downwards.
    pub(super) rows: Vec<Row>,
}

/// The loss about the known light.
struct Loss<'a> {
    residuals: &'a [Residual],
    light: &'a [f64],
    segments: &'a Segments,
    /// Sum of the weights of each surface's receivers that places are compared by.
    weights: &'a [f64],
    /// Median of the known light.
    usual: f64,
}

impl State {
    /// All light that is known, and that of bulbs that were found.
    pub(super) fn light(&self) -> Vec<f64> {
        let both = self.known.iter().zip(&self.more);
        both.map(|(known, more)| known + more).collect()
    }

    /// The gain of each place where receivers get this `light`, which leaves these `residuals`; by
    /// every so many-th receiver.
    pub(super) fn gains(
        &self,
        lit: &[Vec<Lit>],
        (light, residuals): (&[f64], &[Residual]),
        segments: &Segments,
        step: usize,
    ) -> Vec<Gain> {
        let mut weights = vec![0.0; segments.num];
        for (i, of) in residuals.iter().enumerate().step_by(step) {
            weights[segments.of[i] as usize] += of.weight;
        }
        let loss = Loss {
            residuals,
            light,
            segments,
            weights: &weights,
            usual: self.usual,
        };
        let gain = |(number, lit): (usize, &Vec<Lit>)| {
            let [above, below] = [0, 1].map(|half| loss.cone(lit, half));
            Gain {
                number,
                gain: above.0 + below.0,
                cones: [above.1, below.1],
            }
        };
        lit.iter().enumerate().map(gain).collect()
    }
}

impl Loss<'_> {
    /// Gain of the best cone in one half, and its rings.
    fn cone(&self, lit: &[Lit], half: usize) -> (f64, usize) {
        let mut rings: [Vec<&Lit>; HALF] = Default::default();
        for of in lit {
            let (side, order) = side(of.ring);
            if side == half && self.residuals[of.receiver].weight > 0.0 {
                rings[order].push(of);
            }
        }
        let (mut slope, mut curvature, mut num) = (0.0, 0.0, 0);
        let mut sums: BTreeMap<usize, f64> = BTreeMap::new();
        let mut best = (0.0, 0);
        for (order, lit) in rings.iter().enumerate() {
            for of in lit {
                let left = &self.residuals[of.receiver];
                let part = f64::from(of.light) / self.light[of.receiver];
                let pull = left.weight * left.off + left.weight_above * left.above;
                slope += part * pull - WEIGHT * f64::from(of.light) / self.usual;
                curvature += (left.weight + left.weight_above) * part * part;
                let segment = self.segments.of[of.receiver] as usize;
                *sums.entry(segment).or_default() += left.weight * part;
            }
            num += lit.len();
            // The mean of each surface follows.
            let mean = |(segment, sum): (&usize, &f64)| sum * sum / self.weights[*segment];
            let curvature = curvature - sums.iter().map(mean).sum::<f64>();
            if num >= LEAST_LIT && slope > 0.0 && curvature > 0.0 {
                let gain = slope * slope / curvature;
                if gain > best.0 {
                    best = (gain, order + 1);
                }
            }
        }
        best
    }
}
