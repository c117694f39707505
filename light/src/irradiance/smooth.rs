//! Irradiance smoothed among receivers of one surface, as far as its noise says.
//!
//! Light varies little from one Gaussian of a wall to the next; what differs is mostly the noise of
//! few directions. Neighbours exchange part of their difference (a bilateral filter: Tomasi and
//! Manduchi 1998). They are near in place, face the same way and lie in each other's tangent
//! planes: no light goes around an edge, through a wall, or from a table to the floor below.
//! Differences far beyond the standard errors of both are shadows or lamps nearby, and stay. What
//! one gets the other gives, so that the sum over all receivers is kept.

use eagpt_scene::color::luminance;
use eagpt_trace::transport::matrix::Receiver;
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Nearest receivers of each, itself included, that may be neighbours. The farthest has no weight:
/// it makes no difference which of several at the same distance it is.
const NUM_NEAREST: usize = 32;
/// Cosine between the normals of neighbours, at least.
const MIN_COSINE: f32 = 0.9;
/// Height of a neighbour over the tangent plane, at most, in parts of its distance.
const MAX_SLOPE: f32 = 0.3;
/// Standard deviation of the weights by difference, in standard errors of the difference.
/// Stratified directions have about half the error that their spread tells.
const NOISE_REACH: f32 = 2.0;

/// Neighbours of receivers, with weights that are the same both ways.
#[derive(Debug, Clone, PartialEq)]
pub struct Smoothing {
    /// Of each receiver, the first of its neighbours, and the end.
    starts: Vec<usize>,
    neighbours: Vec<(u32, f32)>,
}

/// The nearest of a receiver.
struct Nearest {
    indices: Vec<u32>,
    /// Squared distance of the farthest.
    farthest2: f32,
}

impl Nearest {
    /// Weight of what is at a squared distance: 1 to 0.
    fn weight(&self, distance2: f32) -> f32 {
        (1.0 - distance2 / self.farthest2.max(f32::MIN_POSITIVE)).max(0.0)
    }
}

impl Smoothing {
    /// Looks for the neighbours of all.
    pub fn new(receivers: &[Receiver]) -> Self {
        let places: Vec<[f32; 3]> = (receivers.iter())
            .map(|(_, surface)| surface.position.to_array())
            .collect();
        let mut smoothing = Self {
            starts: vec![0],
            neighbours: Vec::new(),
        };
        let Some(num) = NonZero::new(NUM_NEAREST.min(places.len())) else {
            return smoothing;
        };
        let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&places);
        let nearest: Vec<Nearest> = (places.par_iter().with_min_len(256))
            .map(|place| {
                let found = tree.nearest_n::<SquaredEuclidean>(place, num);
                let distances = found.iter().map(|one| one.distance);
                Nearest {
                    indices: found.iter().map(|one| one.item as u32).collect(),
                    farthest2: distances.fold(0.0, f32::max),
                }
            })
            .collect();
        let rows: Vec<Vec<(u32, f32)>> = (0..receivers.len() as u32)
            .into_par_iter()
            .with_min_len(256)
            .map(|i| row(receivers, &nearest, i))
            .collect();
        // Both ways alike, and to all others together no more than is there.
        let sums: Vec<f32> = (rows.iter())
            .map(|row| 1.0 + row.iter().map(|(_, weight)| weight).sum::<f32>())
            .collect();
        for (row, sum) in rows.iter().zip(&sums) {
            let weights = row
                .iter()
                .map(|&(j, weight)| (j, weight / sum.max(sums[j as usize])));
            smoothing.neighbours.extend(weights);
            smoothing.starts.push(smoothing.neighbours.len());
        }
        smoothing
    }

    /// Neighbours of a receiver on its surface, ascending, with weights.
    pub fn neighbours(&self, receiver: usize) -> &[(u32, f32)] {
        &self.neighbours[self.starts[receiver]..self.starts[receiver + 1]]
    }

    /// `irradiance` smoothed, `[receivers]`; `variances` are those of its luminance.
    pub fn apply(&self, irradiance: &[Vec3], variances: &[f32]) -> Vec<Vec3> {
        let all = (self.starts.par_windows(2), irradiance, variances).into_par_iter();
        all.with_min_len(1024)
            .map(|(range, own, variance)| {
                let mut smoothed = *own;
                for &(j, weight) in &self.neighbours[range[0]..range[1]] {
                    let difference = irradiance[j as usize] - *own;
                    let error2 = variance + variances[j as usize];
                    if let Some(weight) = weight_by_noise(weight, difference, error2) {
                        smoothed += difference * weight;
                    }
                }
                smoothed
            })
            .collect()
    }

    /// The parts of light that make up `irradiance`, `[receivers, num]`, smoothed as
    /// [`Self::apply`] smooths their sum: linear in the parts, which stay parts of the whole.
    pub fn apply_to_parts(
        &self,
        irradiance: &[Vec3],
        variances: &[f32],
        parts: &[Vec3],
        num: usize,
    ) -> Vec<Vec3> {
        let mut smoothed = parts.to_vec();
        let all = (
            smoothed.par_chunks_exact_mut(num.max(1)),
            self.starts.par_windows(2),
            irradiance,
            variances,
        );
        (all.into_par_iter().with_min_len(256)).for_each(|(row, range, own, variance)| {
            let mine = row.to_vec();
            for &(j, weight) in &self.neighbours[range[0]..range[1]] {
                let difference = irradiance[j as usize] - *own;
                let error2 = variance + variances[j as usize];
                if let Some(weight) = weight_by_noise(weight, difference, error2) {
                    let theirs = &parts[j as usize * num..][..num];
                    for ((part, mine), theirs) in row.iter_mut().zip(&mine).zip(theirs) {
                        *part += (*theirs - *mine) * weight;
                    }
                }
            }
        });
        smoothed
    }
}

/// The weight of a neighbour, that by distance times that by a `difference` of irradiance with this
/// variance; `None` where that is certain.
fn weight_by_noise(by_distance: f32, difference: Vec3, variance: f32) -> Option<f32> {
    let error2 = NOISE_REACH * NOISE_REACH * variance;
    let apart = luminance(difference.to_array());
    (error2 > 0.0).then(|| by_distance * (-0.5 * apart * apart / error2).exp())
}

/// Neighbours of a receiver, and their weights by distance.
fn row(receivers: &[Receiver], nearest: &[Nearest], i: u32) -> Vec<(u32, f32)> {
    let surface = receivers[i as usize].1;
    let own = &nearest[i as usize];
    let weight = |&j: &u32| {
        let (theirs, other) = (&nearest[j as usize], receivers[j as usize].1);
        let offset = other.position - surface.position;
        let distance2 = offset.length_squared();
        let along = |normal: Vec3| offset.dot(normal).abs();
        let height = along(surface.normal).max(along(other.normal));
        let is_neighbour = j != i
            && surface.normal.dot(other.normal) > MIN_COSINE
            && height <= MAX_SLOPE * distance2.sqrt() + surface.offset + other.offset;
        // Nothing if either is not among the nearest of the other.
        let weight = own.weight(distance2) * theirs.weight(distance2);
        (is_neighbour && weight > 0.0).then_some((j, weight))
    };
    let mut row: Vec<(u32, f32)> = own.indices.iter().filter_map(weight).collect();
    row.sort_by_key(|(j, _)| *j);
    row
}

#[cfg(test)]
mod tests;
