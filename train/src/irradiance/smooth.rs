//! Irradiance smoothed among receivers of one surface.
//!
//! Indirect light varies little from one Gaussian of a wall to the next; what differs is the noise
//! of few directions. The mean over neighbours, by Gaussian weights of their distance, takes most
//! of it. Neighbours are near in place, face the same way, and lie in each other's tangent planes:
//! no light goes around an edge, through a wall, or from a table to the floor below.

use eagpt_trace::transport::matrix::Receiver;
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// Cosine between the normals of neighbours, at least.
const MIN_COSINE: f32 = 0.9;
/// Height of a neighbour over the tangent plane, at most, in parts of its distance.
const MAX_SLOPE: f32 = 0.3;
/// Distance of the farthest neighbour, in standard deviations of the weights.
const REACH: f32 = 2.0;

/// Neighbours of receivers, with weights that add up to one.
#[derive(Debug, Clone, PartialEq)]
pub struct Smoothing {
    /// Of each receiver, the first of its neighbours, and the end.
    starts: Vec<usize>,
    neighbours: Vec<(u32, f32)>,
}

impl Smoothing {
    /// Chooses among the `num` nearest of each receiver, itself included.
    pub fn new(receivers: &[Receiver], num: usize) -> Self {
        let places: Vec<[f32; 3]> = (receivers.iter())
            .map(|(_, surface)| surface.position.to_array())
            .collect();
        let mut smoothing = Self {
            starts: vec![0],
            neighbours: Vec::new(),
        };
        let Some(num) = NonZero::new(num.min(places.len())) else {
            smoothing.starts.resize(receivers.len() + 1, 0);
            return smoothing;
        };
        let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&places);
        let rows: Vec<Vec<(u32, f32)>> = (0..receivers.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                let near = tree.nearest_n::<SquaredEuclidean>(&places[i], num);
                let mut near: Vec<(f32, u32)> = (near.iter())
                    .map(|found| (found.distance, found.item as u32))
                    .collect();
                near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                row(receivers, i, &near)
            })
            .collect();
        for row in rows {
            smoothing.neighbours.extend(row);
            smoothing.starts.push(smoothing.neighbours.len());
        }
        smoothing
    }

    /// The weighted means of `irradiance`, `[receivers]`.
    pub fn apply(&self, irradiance: &[Vec3]) -> Vec<Vec3> {
        (self.starts.par_windows(2).with_min_len(1024))
            .map(|range| {
                let row = &self.neighbours[range[0]..range[1]];
                row.iter()
                    .map(|&(i, weight)| irradiance[i as usize] * weight)
                    .sum()
            })
            .collect()
    }
}

fn row(receivers: &[Receiver], i: usize, near: &[(f32, u32)]) -> Vec<(u32, f32)> {
    let surface = receivers[i].1;
    let farthest2 = near.last().map_or(0.0, |(distance2, _)| *distance2);
    let mut row: Vec<(u32, f32)> = (near.iter())
        .filter_map(|&(distance2, j)| {
            let other = receivers[j as usize].1;
            let offset = other.position - surface.position;
            let height = offset.dot(surface.normal).abs().max(offset.dot(other.normal).abs());
            let thickness = surface.offset + other.offset;
            let is_one = j as usize == i
                || (surface.normal.dot(other.normal) > MIN_COSINE
                    && height <= MAX_SLOPE * distance2.sqrt() + thickness);
            let weight = if farthest2 > 0.0 {
                (-0.5 * REACH * REACH * distance2 / farthest2).exp()
            } else {
                1.0
            };
            is_one.then_some((j, weight))
        })
        .collect();
    let sum: f32 = row.iter().map(|(_, weight)| weight).sum();
    row.iter_mut().for_each(|(_, weight)| *weight /= sum);
    row
}
