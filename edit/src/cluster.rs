//! Gaussians that hang together: everything reached from a seed point in short steps.

use crate::quantity::Quantity;
use eagpt_scene::Gaussians;
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// A connected cluster.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cluster {
    /// Number of this cluster in its script.
    pub id: usize,
    /// A point on the thing, scene units.
    pub seed: Vec3,
    /// Longest step.
    pub reach: Reach,
}

/// The longest step from one Gaussian of a cluster to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Reach {
    /// Scene units, positive.
    Fixed(f32),
    /// Multiples of the size of the Gaussian that the step starts from, positive: long on coarse
    /// surfaces, short on fine ones.
    Sizes(f32),
}

impl Reach {
    fn length(self, gaussians: &Gaussians, index: usize) -> f32 {
        match self {
            Self::Fixed(length) => length,
            Self::Sizes(sizes) => sizes * Quantity::Size.of(gaussians, index),
        }
    }
}

impl Cluster {
    /// Whether each Gaussian belongs: the one of the `candidates` next to the seed, if the seed is
    /// within a step of it, and all that can be reached from there. The set does not depend on the
    /// order of the search.
    pub(crate) fn members(&self, gaussians: &Gaussians, candidates: &[bool]) -> Vec<bool> {
        let mut members = vec![false; gaussians.len()];
        let indices: Vec<usize> = (0..gaussians.len()).filter(|i| candidates[*i]).collect();
        if indices.is_empty() {
            return members;
        }
        let points: Vec<[f32; 3]> = indices
            .iter()
            .map(|&index| gaussians.positions[index].to_array())
            .collect();
        let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&points);
        let nearest = tree.nearest_one::<SquaredEuclidean>(&self.seed.to_array());
        let first = nearest.item as usize;
        let reach = self.reach.length(gaussians, indices[first]);
        if nearest.distance > reach * reach {
            return members;
        }
        let mut reached = vec![first];
        members[indices[first]] = true;
        while let Some(place) = reached.pop() {
            let reach = self.reach.length(gaussians, indices[place]);
            for near in tree.within_unsorted::<SquaredEuclidean>(&points[place], reach * reach) {
                let next = near.item as usize;
                if !members[indices[next]] {
                    members[indices[next]] = true;
                    reached.push(next);
                }
            }
        }
        members
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::disc;
    use eagpt_scene::Gaussian;
    use glam::Vec2;

    /// Discs of size 0.1 at x = 0, 0.3, 0.6, then one of size 0.4 at 1.1, and one of size 0.1 at
    /// 2.5.
    fn row() -> Gaussians {
        let sizes = [(0.0, 0.1), (0.3, 0.1), (0.6, 0.1), (1.1, 0.4), (2.5, 0.1)];
        let disc = |(x, size): (f32, f32)| Gaussian {
            scale: Vec2::splat(size),
            ..disc(Vec3::new(x, 0.0, 0.0))
        };
        sizes.into_iter().map(disc).collect()
    }

    fn members(seed: f32, step: Reach, candidates: [bool; 5]) -> Vec<usize> {
        let cluster = Cluster {
            id: 0,
            seed: Vec3::new(seed, 0.0, 0.0),
            reach: step,
        };
        let mask = cluster.members(&row(), &candidates);
        (0..5).filter(|i| mask[*i]).collect()
    }

    #[test]
    fn steps_are_as_long_as_they_say() {
        let all = [true; 5];
        for (seed, step, expected) in [
            (0.05, Reach::Fixed(0.31), vec![0, 1, 2]),
            (0.05, Reach::Fixed(0.55), vec![0, 1, 2, 3]),
            (2.4, Reach::Fixed(0.31), vec![4]),
            // 4 sizes: 0.4 from the small ones, 1.6 from the large one.
            (0.05, Reach::Sizes(4.0), vec![0, 1, 2]),
            (1.2, Reach::Sizes(4.0), vec![0, 1, 2, 3, 4]),
            // Nothing is near.
            (1.8, Reach::Fixed(0.31), vec![]),
        ] {
            assert_eq!(members(seed, step, all), expected, "{seed} {step:?}");
        }
    }

    #[test]
    fn only_candidates_are_stepped_on() {
        let candidates = [true, false, true, true, true];
        assert_eq!(members(0.05, Reach::Fixed(0.31), candidates), [0]);
        assert_eq!(members(0.05, Reach::Fixed(0.31), [false; 5]), [0; 0]);
    }
}
