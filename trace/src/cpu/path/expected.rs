//! Light that surfaces are expected to receive, as a few paths of the view have found it.
//!
//! Paths end at random, and what is expected of the rest of a path stands in for it where it ends
//! ([`Expected::goes_on`]). The mean of an image does not depend on what is expected, its noise
//! does: the better it is known, the less a path that ends leaves open, and the earlier it may.
//!
//! Of some starts one path each is followed. Its vertices are divided into cells of as many
//! vertices each by a balanced tree over places and normals. A cell receives the mean of what
//! emitters gave its vertices, and of what the surfaces reflect that their paths met next: light
//! of many bounces from paths of few.

use super::{Path, Paths, Start};
use crate::transport::start::Surface;
use crate::transport::vertex::Vertex;
use glam::Vec3;
use rayon::prelude::*;

/// Paths of an image for each one that is followed beforehand.
const PATHS_FOR_ONE: u64 = 64;
/// Fewest paths that are followed beforehand.
const MIN_PATHS: u64 = 2048;
/// Bounces of each.
const BOUNCES: u32 = 4;
/// Vertices of a cell, at most.
const VERTICES_OF_A_CELL: usize = 32;
/// A unit of normals over the standard deviation of places: discs of one surface differ in tilt.
const NORMAL_WEIGHT: f32 = 0.3;
/// Least light that is expected, of the mean over all cells: where few vertices have found none,
/// there may be some.
const LEAST: f32 = 0.1;

/// Place and normal of a surface as coordinates of the tree.
type Coordinates = [f32; 6];

/// Light that is expected, by cells of places and normals.
#[derive(Debug, Clone)]
pub(super) struct Expected {
    /// Of the tree, `[2^depth − 1]`, the children of i at 2i + 1 and 2i + 2: coordinate, and the
    /// least value of the second half.
    splits: Vec<(u32, f32)>,
    scale: f32,
    /// Irradiance over π, `[2^depth]`.
    light: Vec<Vec3>,
    /// Least light by which chances are taken.
    least: f32,
}

/// Light that a path has found at a vertex.
#[derive(Debug, Clone, Copy)]
struct Found {
    at: Coordinates,
    /// Light of emitters over the reflectance.
    direct: Vec3,
    /// The next vertex, and how much of the light there comes here.
    next: Option<(Coordinates, Vec3)>,
}

impl Paths<'_> {
    /// The light that paths of `starts` are to expect.
    pub(super) fn expected(&self, starts: &[Start]) -> Expected {
        let num_paths = starts.len() as u64 * u64::from(self.num_samples);
        let num = (num_paths / PATHS_FOR_ONE).max(MIN_PATHS).min(num_paths) as u32;
        let before = Self {
            key: self.key_of_expected,
            num_samples: 1,
            ..*self
        };
        let start = |number: u32| {
            let index = u64::from(number) * starts.len() as u64 / u64::from(num);
            Path::new(number, 0, number, starts[index as usize].vertex)
        };
        let mut paths: Vec<Path> = (0..num).map(start).collect();
        let scale = scale_of(&paths);
        let mut found = Vec::new();
        for bounce in 0..BOUNCES.min(self.max_bounces) {
            before.put_in_order(&mut paths, bounce);
            let advance = |path: &mut Path| before.look(path, bounce, scale);
            found.par_extend(paths.par_iter_mut().with_min_len(256).map(advance));
            paths.retain(|path| path.is_alive);
        }
        Expected::new(&found, scale, self.max_bounces)
    }

    /// Follows a path for a bounce, off a white surface.
    fn look(&self, path: &mut Path, bounce: u32, scale: f32) -> Found {
        let at = coordinates(&path.vertex.surface, scale);
        path.vertex = path.vertex.white();
        path.throughput = Vec3::ONE;
        path.brought.light = Vec3::ZERO;
        let importances = self.importances(&path.vertex.surface);
        self.advance(path, bounce, importances.as_ref(), None);
        let met = &path.vertex;
        let next = || {
            (
                coordinates(&met.surface, scale),
                path.throughput * met.reflectance(),
            )
        };
        Found {
            at,
            direct: path.brought.light,
            next: path.is_alive.then(next),
        }
    }
}

/// One over the standard deviation of the places where paths start.
fn scale_of(paths: &[Path]) -> f32 {
    let num = paths.len().max(1) as f32;
    let places = || paths.iter().map(|path| path.vertex.surface.position);
    let mean = places().sum::<Vec3>() / num;
    let variance = places()
        .map(|place| place.distance_squared(mean))
        .sum::<f32>()
        / num;
    1.0 / variance.sqrt().max(f32::MIN_POSITIVE)
}

fn coordinates(surface: &Surface, scale: f32) -> Coordinates {
    let [x, y, z] = (surface.position * scale).to_array();
    let [u, v, w] = (surface.normal * NORMAL_WEIGHT).to_array();
    [x, y, z, u, v, w]
}

impl Expected {
    fn new(found: &[Found], scale: f32, max_bounces: u32) -> Self {
        let depth = (found.len() / VERTICES_OF_A_CELL)
            .checked_ilog2()
            .unwrap_or(0);
        let mut order: Vec<Coordinates> = found.iter().map(|vertex| vertex.at).collect();
        let mut splits = vec![(0, 0.0); (1 << depth) - 1];
        divide(&mut order, &mut splits, 0);
        let mut expected = Self {
            splits,
            scale,
            light: vec![Vec3::ZERO; 1 << depth],
            least: 0.0,
        };
        let cells: Vec<(usize, Option<(usize, Vec3)>)> = (found.par_iter())
            .map(|vertex| {
                let next = vertex.next.map(|(at, share)| (expected.cell(&at), share));
                (expected.cell(&vertex.at), next)
            })
            .collect();
        let mut nums = vec![0.0_f32; expected.light.len()];
        cells.iter().for_each(|&(cell, _)| nums[cell] += 1.0);
        for _ in 0..max_bounces {
            let mut sums = vec![Vec3::ZERO; nums.len()];
            for (vertex, &(cell, next)) in found.iter().zip(&cells) {
                let reflected =
                    next.map_or(Vec3::ZERO, |(next, share)| share * expected.light[next]);
                sums[cell] += vertex.direct + reflected;
            }
            let means = sums.iter().zip(&nums);
            expected.light = means.map(|(sum, num)| sum / num.max(1.0)).collect();
        }
        let num = found.len().max(1) as f32;
        let all = expected.light.iter().zip(&nums);
        let mean = all
            .map(|(light, num)| light.max_element() * num)
            .sum::<f32>()
            / num;
        expected.least = LEAST * mean;
        expected
    }

    fn cell(&self, at: &Coordinates) -> usize {
        let mut node = 0;
        while let Some(&(axis, value)) = self.splits.get(node) {
            node = 2 * node + if at[axis as usize] < value { 1 } else { 2 };
        }
        node - self.splits.len()
    }

    /// Irradiance over π that `surface` is expected to receive.
    pub(super) fn light(&self, surface: &Surface) -> Vec3 {
        self.light[self.cell(&coordinates(surface, self.scale))]
    }

    /// The same, for chances: never zero where there is any light.
    pub(super) fn worth(&self, light: Vec3, factor: Vec3) -> f32 {
        (factor * light.max(Vec3::splat(self.least))).max_element()
    }

    /// Whether a path that has met `next` goes on, by a `number` in [0, 1): by the chance that is
    /// what it may still bring, over what its start receives of all (Vorba and Křivánek 2016,
    /// "Adjoint-driven Russian roulette and splitting in light transport simulation").
    ///
    /// Where a path ends, what is expected stands in for the rest; where it goes on by the chance
    /// p, (1/p − 1) times that is taken off. The mean of both is nothing, whatever is expected: it
    /// is no more than what a path has brought so far pays for, as light is never negative.
    pub(super) fn goes_on(&self, path: &mut Path, next: &Vertex, number: f32) -> bool {
        let factor = path.throughput * next.reflectance();
        let light = self.light(&next.surface);
        let chance = (self.worth(light, factor) / path.worth).min(1.0);
        if chance >= 1.0 {
            return true;
        }
        let odds = chance / (1.0 - chance);
        let rest = (factor * light).min(path.brought.light * odds);
        if number >= chance {
            path.brought.light += rest;
            return false;
        }
        path.brought.light = (path.brought.light - rest / odds).max(Vec3::ZERO);
        path.throughput /= chance;
        true
    }
}

/// Divides vertices in two halves, and each again, along the coordinate that differs most.
fn divide(vertices: &mut [Coordinates], splits: &mut [(u32, f32)], node: usize) {
    if node >= splits.len() {
        return;
    }
    let num = vertices.len() as f64;
    let variance = |axis: usize| {
        let sum = |of: fn(f64) -> f64| vertices.iter().map(|v| of(f64::from(v[axis]))).sum::<f64>();
        sum(|x| x * x) - sum(|x| x).powi(2) / num
    };
    let (axis, _) = (1..6).fold((0, variance(0)), |(best, most), axis| {
        let own = variance(axis);
        if own > most {
            (axis, own)
        } else {
            (best, most)
        }
    });
    let middle = vertices.len() / 2;
    let (first, at, _) =
        vertices.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
    splits[node] = (axis as u32, at[axis]);
    let split_at = first.len();
    let (first, second) = vertices.split_at_mut(split_at);
    divide(first, splits, 2 * node + 1);
    divide(second, splits, 2 * node + 2);
}
