//! Surfaces of one material: neighbours of like normal, colour and spread between views.
//!
//! Steel may be as bright as the painted wall beside it, but what it sends differs far more with
//! the direction.
//!
//! Graph-based segmentation (Felzenszwalb and Huttenlocher 2004): edges are taken in order of the
//! difference they bridge, and join two parts if it is no larger than what either has within, with
//! a bonus for small parts. Shading changes little from one Gaussian to the next, materials do;
//! where texture is strong within, strong edges do not divide.

use crate::irradiance::smooth::Smoothing;
use eagpt_scene::median::median_of;
use glam::{Vec3, Vec4};
use std::collections::BTreeMap;

/// Bonus for small parts: difference of the logarithm of colour times number of Gaussians.
const SCALE: f32 = 3.0;
/// Parts of fewer Gaussians join the neighbour they differ least from.
const LEAST: u32 = 12;
/// Colours are compared from this part of the median on: what is darker is noise.
const DARK: f32 = 0.02;
/// Weight of the logarithm of the spread beside that of colour, and the spread that is added to it:
/// less is noise.
const WEIGHT_OF_SPREAD: f32 = 0.5;
const LEAST_SPREAD: f32 = 0.05;

/// Surfaces of one material.
pub struct Segments {
    /// Surface of each receiver, `[receivers]`.
    pub of: Vec<u32>,
    /// Number of surfaces.
    pub num: usize,
}

impl Segments {
    /// Divides receivers by their `colors`, `[receivers]`.
    pub fn of_colors(colors: &[Vec3], smoothing: &Smoothing) -> Self {
        Self::new(colors, &vec![0.0; colors.len()], smoothing)
    }

    /// Divides receivers by their `colors` and `spreads`, `[receivers]`.
    pub fn new(colors: &[Vec3], spreads: &[f32], smoothing: &Smoothing) -> Self {
        let dark = DARK * median_of(colors.iter().map(|c| c.max_element()));
        let log = |(color, spread): (&Vec3, &f32)| {
            let spread = WEIGHT_OF_SPREAD * (spread + LEAST_SPREAD).ln();
            (*color + dark).map(f32::ln).extend(spread)
        };
        let logs: Vec<Vec4> = colors.iter().zip(spreads).map(log).collect();
        let num = logs.len();
        let mut edges = Vec::new();
        for i in 0..num {
            for &(j, _) in smoothing.neighbours(i) {
                if j as usize > i {
                    let difference = (logs[i] - logs[j as usize]).length();
                    edges.push((difference, i as u32, j));
                }
            }
        }
        edges.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut parts = Parts::new(num);
        for &(difference, i, j) in &edges {
            let (a, b) = (parts.root(i), parts.root(j));
            if a != b && difference <= parts.limit(a).min(parts.limit(b)) {
                parts.join(a, b, difference);
            }
        }
        for &(difference, i, j) in &edges {
            let (a, b) = (parts.root(i), parts.root(j));
            if a != b && parts.sizes[a as usize].min(parts.sizes[b as usize]) < LEAST {
                parts.join(a, b, difference);
            }
        }
        Self::numbered((0..num as u32).map(|i| parts.root(i)))
    }

    /// Surfaces by the names of those that receivers are of, numbered in order.
    fn numbered(names: impl Iterator<Item = u32>) -> Self {
        let mut numbers = BTreeMap::new();
        let number = |name| {
            let next = numbers.len() as u32;
            *numbers.entry(name).or_insert(next)
        };
        let of: Vec<u32> = names.map(number).collect();
        Self {
            num: numbers.len(),
            of,
        }
    }

    /// The surfaces where several became one: `names` of each, the same for those.
    pub fn joined(&self, names: &[u32]) -> Self {
        Self::numbered(self.of.iter().map(|&segment| names[segment as usize]))
    }

    /// The receivers of each surface.
    pub fn members(&self) -> Vec<Vec<usize>> {
        let mut members = vec![Vec::new(); self.num];
        for (r, &segment) in self.of.iter().enumerate() {
            members[segment as usize].push(r);
        }
        members
    }

    /// Number of neighbours across the borders between surfaces, both ways.
    pub fn borders(&self, smoothing: &Smoothing) -> BTreeMap<(usize, usize), usize> {
        let mut borders = BTreeMap::new();
        for i in 0..self.of.len() {
            for &(j, _) in smoothing.neighbours(i) {
                let (a, b) = (self.of[i] as usize, self.of[j as usize] as usize);
                if a != b {
                    *borders.entry((a, b)).or_default() += 1;
                }
            }
        }
        borders
    }
}

/// Disjoint sets.
struct Parts {
    parents: Vec<u32>,
    sizes: Vec<u32>,
    /// Largest difference within.
    within: Vec<f32>,
}

impl Parts {
    fn new(num: usize) -> Self {
        Self {
            parents: (0..num as u32).collect(),
            sizes: vec![1; num],
            within: vec![0.0; num],
        }
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.parents[i as usize] != i {
            let above = self.parents[self.parents[i as usize] as usize];
            self.parents[i as usize] = above;
            i = above;
        }
        i
    }

    /// Largest difference over which a part joins another.
    fn limit(&self, root: u32) -> f32 {
        self.within[root as usize] + SCALE / self.sizes[root as usize] as f32
    }

    fn join(&mut self, a: u32, b: u32, difference: f32) {
        let (a, b) = (a as usize, b as usize);
        self.parents[b] = a as u32;
        self.sizes[a] += self.sizes[b];
        self.within[a] = self.within[a].max(self.within[b]).max(difference);
    }
}
