//! Surfaces of one material: neighbours of like normal and colour.
//!
//! Graph-based segmentation (Felzenszwalb and Huttenlocher 2004): edges are taken in order of the
//! difference they bridge, and join two parts if it is no larger than what either has within, with
//! a bonus for small parts. Shading changes little from one Gaussian to the next, materials do;
//! where texture is strong within, strong edges do not divide.

use crate::irradiance::smooth::Smoothing;
use eagpt_scene::median::median_of;
use eagpt_trace::transport::matrix::Receiver;
use glam::Vec3;

/// Bonus for small parts: difference of the logarithm of colour times number of Gaussians.
const SCALE: f32 = 6.0;
/// Parts of fewer Gaussians join the neighbour they differ least from.
const LEAST: u32 = 12;
/// Colours are compared from this part of the median on: what is darker is noise.
const DARK: f32 = 0.02;

/// Surfaces of one material.
pub(super) struct Segments {
    /// Surface of each receiver, `[receivers]`.
    pub(super) of: Vec<u32>,
    /// Number of surfaces.
    pub(super) num: usize,
}

impl Segments {
    /// Divides `receivers`, whose `colors` are linear.
    pub(super) fn new(receivers: &[Receiver], smoothing: &Smoothing, colors: &[Vec3]) -> Self {
        let dark = DARK * median_of(colors.iter().map(|c| c.max_element()));
        let logs: Vec<Vec3> = colors.iter().map(|c| (*c + dark).map(f32::ln)).collect();
        let mut edges = Vec::new();
        for i in 0..receivers.len() {
            for &(j, _) in smoothing.neighbours(i) {
                if j as usize > i {
                    let difference = (logs[i] - logs[j as usize]).length();
                    edges.push((difference, i as u32, j));
                }
            }
        }
        edges.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut parts = Parts::new(receivers.len());
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
        let mut numbers = vec![u32::MAX; receivers.len()];
        let mut num = 0;
        let of: Vec<u32> = (0..receivers.len() as u32)
            .map(|i| {
                let number = &mut numbers[parts.root(i) as usize];
                if *number == u32::MAX {
                    *number = num;
                    num += 1;
                }
                *number
            })
            .collect();
        Self {
            of,
            num: num as usize,
        }
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
