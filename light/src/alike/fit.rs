//! Radiance of sources that makes albedos of one material alike.
//!
//! A receiver of radiance r, known irradiance over π e and shares mˢ of its light from sources s has
//! the albedo r / (e + Σ mˢ xˢ). Its logarithm should be the same for all receivers of a surface of
//! one material: x is the minimum of a robust sum of squares of differences from each surface's own
//! mean, and of a weight on the light by which x differs from what is expected: light that is the
//! same everywhere makes no difference. Where no albedo above 1 is allowed, what a logarithm has
//! above 0 counts by itself as well. Gauss–Newton steps; in each the bounds are kept by coordinate
//! descent (Franc, Hlaváč and Navara 2005).

use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Difference of logarithms of albedo from which on differences count linearly: noise is below.
const SCALE: f64 = 0.15;
/// Gauss–Newton steps, at most, the least part of the loss that one gains, and halvings of one.
const STEPS: u32 = 30;
const LEAST_GAIN: f64 = 1e-4;
const HALVINGS: u32 = 6;
/// Rounds of coordinate descent in a step, at most, and the change, in parts of the known light,
/// that ends them.
const ROUNDS: u32 = 300;
const CONVERGED: f64 = 1e-4;
/// Rounds in which weights and mean of a surface follow each other.
const MEAN_ROUNDS: u32 = 6;

/// Sources whose light a receiver gets, and its light for a source of 1, ascending by source.
pub(crate) type Row = Vec<(usize, f64)>;

/// Light that a source is expected to have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Expected {
    /// Its radiance.
    pub(crate) radiance: f64,
    /// Least and largest radiance that it may have.
    pub(crate) bounds: [f64; 2],
    /// Weight of light of it that is not expected, in parts of the median of what is known.
    pub(crate) weight: f64,
}

/// Light of receivers, in one colour channel, and the sources that they see.
pub(super) struct Equations<'a> {
    /// Light of sources, `[receivers]`.
    pub(super) rows: &'a [Row],
    /// Radiance, positive.
    pub(super) radiances: &'a [f64],
    /// Irradiance over π of all that is known, positive.
    pub(super) known: &'a [f64],
    /// Light that each source is expected to have.
    pub(super) expected: &'a BTreeMap<usize, Expected>,
    /// Number of the surface of one material that each is of.
    pub(super) segments: &'a [u32],
    /// Receivers of a surface that counts, at least.
    pub(super) least: usize,
    /// Whether no surface reflects more than it gets; some may shine of themselves.
    pub(super) reflects: bool,
}

/// Light of sources.
pub(crate) struct Fit {
    /// Radiance of each source.
    pub(crate) x: BTreeMap<usize, f64>,
    /// Share of all light of the receivers that sources bring beyond what is expected.
    pub(crate) share: f64,
    /// Part of the loss of the expected that it takes away.
    pub(crate) explained: f64,
}

impl Fit {
    /// Light of the sources that were fitted, at a receiver of this row.
    pub(crate) fn light(&self, row: &Row) -> f64 {
        row.iter().map(|(source, of)| of * self.x[source]).sum()
    }
}

/// Equations of the surfaces that count, and of the sources that are seen, in compact numbers.
struct Problem {
    rows: Vec<Row>,
    radiances: Vec<f64>,
    known: Vec<f64>,
    expected: DVector<f64>,
    /// Least and largest light of each source.
    bounds: Vec<[f64; 2]>,
    /// Receivers of each surface.
    members: Vec<Vec<usize>>,
    /// Derivative of the weight on light.
    prior: Vec<f64>,
    /// Median of the known light.
    usual: f64,
    reflects: bool,
}

/// Residuals of a receiver: its logarithm of albedo over the mean of its surface and, if that may
/// not be, over 0; and the weight of each.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Residual {
    pub(crate) off: f64,
    pub(crate) weight: f64,
    pub(crate) above: f64,
    pub(crate) weight_above: f64,
}

/// Robust square of a difference of logarithms, without its scale, and 1.
fn robust(off: f64) -> f64 {
    (1.0 + (off / SCALE).powi(2)).sqrt()
}

impl Residual {
    /// The loss of the receiver.
    pub(crate) fn loss(&self) -> f64 {
        SCALE * SCALE * (robust(self.off) + robust(self.above) - 2.0)
    }
}

impl Equations<'_> {
    /// The light of sources that explains the differences and is nearest to the expected.
    pub(super) fn fit(&self) -> Fit {
        let (problem, sources) = self.problem(&self.members());
        let (x, before, after) = problem.solve();
        let expected = self.expected.iter().map(|(at, of)| (*at, of.radiance));
        let mut all: BTreeMap<usize, f64> = expected.collect();
        all.extend(sources.into_iter().zip(x.iter().copied()));
        let beyond = (&x - &problem.expected).map(|more| more.max(0.0));
        let receivers = 0..problem.rows.len();
        let light = |x: &DVector<f64>| receivers.clone().map(|i| problem.light(i, x)).sum::<f64>();
        let known: f64 = problem.known.iter().sum();
        let of = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
        Fit {
            share: of(light(&beyond), light(&x) + known),
            x: all,
            explained: of(before - after, before),
        }
    }

    /// Residuals where all sources have the expected light, `[receivers]`; zeros where a receiver
    /// is of no surface that counts.
    pub(super) fn residuals(&self) -> Vec<Residual> {
        let members = self.members();
        let (problem, _) = self.problem(&members);
        let (residuals, _) = problem.residuals(&problem.expected);
        let mut all = vec![Residual::default(); self.rows.len()];
        for (i, residual) in members.values().flatten().zip(residuals) {
            all[*i] = residual;
        }
        all
    }

    /// Receivers of each surface that counts.
    fn members(&self) -> BTreeMap<u32, Vec<usize>> {
        let mut members: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (i, segment) in self.segments.iter().enumerate() {
            members.entry(*segment).or_default().push(i);
        }
        members.retain(|_, members| members.len() >= self.least);
        members
    }

    fn problem(&self, members: &BTreeMap<u32, Vec<usize>>) -> (Problem, Vec<usize>) {
        let mut numbers = BTreeMap::new();
        let kept: Vec<usize> = members.values().flatten().copied().collect();
        for (source, _) in kept.iter().flat_map(|&i| &self.rows[i]) {
            numbers.insert(*source, 0);
        }
        for (number, of) in numbers.values_mut().enumerate() {
            *of = number;
        }
        let row = |&i: &usize| {
            let row = self.rows[i].iter();
            row.map(|(source, share)| (numbers[source], *share))
                .collect()
        };
        let rows: Vec<Row> = kept.iter().map(row).collect();
        let known: Vec<f64> = kept.iter().map(|&i| self.known[i]).collect();
        let mut sorted = known.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
        let mut prior = vec![0.0; numbers.len()];
        for (source, share) in rows.iter().flatten() {
            prior[*source] += share / usual;
        }
        for (prior, source) in prior.iter_mut().zip(numbers.keys()) {
            *prior *= self.expected[source].weight;
        }
        let mut first = 0;
        let in_order = members.values().map(|members| {
            first += members.len();
            (first - members.len()..first).collect()
        });
        let problem = Problem {
            members: in_order.collect(),
            radiances: kept.iter().map(|&i| self.radiances[i]).collect(),
            expected: DVector::from_iterator(
                numbers.len(),
                numbers.keys().map(|source| self.expected[source].radiance),
            ),
            bounds: (numbers.keys())
                .map(|source| self.expected[source].bounds)
                .collect(),
            rows,
            known,
            prior,
            usual,
            reflects: self.reflects,
        };
        (problem, numbers.into_keys().collect())
    }
}

impl Problem {
    /// Light of the sources at a receiver.
    fn light(&self, receiver: usize, x: &DVector<f64>) -> f64 {
        let row = self.rows[receiver].iter();
        row.map(|(source, share)| share * x[*source]).sum()
    }

    /// Residuals of each receiver, and the loss.
    fn residuals(&self, x: &DVector<f64>) -> (Vec<Residual>, f64) {
        let mut all = vec![Residual::default(); self.rows.len()];
        let off = (x - &self.expected).abs();
        let mut loss: f64 = self
            .prior
            .iter()
            .zip(off.iter())
            .map(|(a, off)| a * off)
            .sum();
        for members in &self.members {
            let log = |&i: &usize| (self.radiances[i] / (self.known[i] + self.light(i, x))).ln();
            let logs: Vec<f64> = members.iter().map(log).collect();
            let weight = |off: f64| 1.0 / robust(off);
            let mut mean = logs.iter().sum::<f64>() / logs.len() as f64;
            for _ in 0..MEAN_ROUNDS {
                let weighted = logs.iter().map(|log| (weight(log - mean), log));
                let (sum, total) = weighted.fold((0.0, 0.0), |(sum, total), (weight, log)| {
                    (sum + weight * log, total + weight)
                });
                mean = sum / total;
            }
            for (&i, log) in members.iter().zip(&logs) {
                let off = log - mean;
                let above = if self.reflects { log.max(0.0) } else { 0.0 };
                all[i] = Residual {
                    off,
                    weight: weight(off),
                    above,
                    weight_above: if above > 0.0 { weight(above) } else { 0.0 },
                };
                loss += all[i].loss();
            }
        }
        (all, loss)
    }

    /// The light of sources, and the loss of the expected light and of this.
    fn solve(&self) -> (DVector<f64>, f64, f64) {
        let mut x = self.expected.clone();
        let (mut residuals, before) = self.residuals(&x);
        let mut loss = before;
        for _ in 0..STEPS {
            let (squares, slope) = self.normal_equations(&x, &residuals);
            let goal = self.descended(&squares, &slope, &x);
            let mut step = &goal - &x;
            let mut next = None;
            for _ in 0..HALVINGS {
                let tried = &x + &step;
                let (there, lower) = self.residuals(&tried);
                if lower < loss {
                    next = Some((tried, there, lower));
                    break;
                }
                step *= 0.5;
            }
            let Some((tried, there, lower)) = next else {
                break;
            };
            let gain = loss - lower;
            (x, residuals, loss) = (tried, there, lower);
            if gain < LEAST_GAIN * before {
                break;
            }
        }
        (x, before, loss)
    }

    /// Second derivatives of the sum of squares and its negative slope at `x`, of which each surface's
    /// mean is eliminated.
    fn normal_equations(
        &self,
        x: &DVector<f64>,
        residuals: &[Residual],
    ) -> (DMatrix<f64>, DVector<f64>) {
        let num = x.len();
        let mut squares = DMatrix::zeros(num, num);
        let mut slope = DVector::<f64>::zeros(num);
        for members in &self.members {
            let mut sum = DVector::<f64>::zeros(num);
            let mut total = 0.0;
            for &i in members {
                let of = residuals[i];
                let light = self.known[i] + self.light(i, x);
                let weight = of.weight + of.weight_above;
                total += of.weight;
                for &(a, share_a) in &self.rows[i] {
                    let by_a = share_a / light;
                    sum[a] += of.weight * by_a;
                    slope[a] += by_a * (of.weight * of.off + of.weight_above * of.above);
                    for &(b, share_b) in &self.rows[i] {
                        squares[(a, b)] += weight * by_a * share_b / light;
                    }
                }
            }
            squares.ger(-1.0 / total, &sum, &sum, 1.0);
        }
        (squares, slope)
    }

    /// The minimum, within the bounds, of the loss whose sum of squares has this slope at `x`.
    fn descended(
        &self,
        squares: &DMatrix<f64>,
        slope: &DVector<f64>,
        x: &DVector<f64>,
    ) -> DVector<f64> {
        let (mut goal, mut slope) = (x.clone(), slope.clone());
        for _ in 0..ROUNDS {
            let mut largest = 0.0_f64;
            for source in 0..goal.len() {
                let curvature = squares[(source, source)];
                if curvature <= 0.0 {
                    continue;
                }
                let free = goal[source] + slope[source] / curvature;
                let (expected, pull) = (self.expected[source], self.prior[source] / curvature);
                // The weight pulls to the expected, and no farther.
                let pulled = if free > expected {
                    (free - pull).max(expected)
                } else {
                    (free + pull).min(expected)
                };
                let [least, most] = self.bounds[source];
                let moved = pulled.clamp(least, most);
                let change = moved - goal[source];
                if change != 0.0 {
                    slope.axpy(-change, &squares.column(source), 1.0);
                    goal[source] = moved;
                    largest = largest.max(change.abs());
                }
            }
            if largest < CONVERGED * self.usual {
                break;
            }
        }
        goal
    }
}

#[cfg(test)]
mod tests;
