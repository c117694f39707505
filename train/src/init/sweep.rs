//! The matching of a pixel with other views along its ray.

use super::seen::{Level, Seen};
use eagpt_scene::Camera;
use glam::{Vec2, Vec3};

/// Views that a pixel is looked for in.
const NUM_NEIGHBOURS: usize = 8;
/// Views that have to show a place.
const MIN_VIEWS: usize = 2;
/// Distance of a good neighbour as a share of the spread of the cameras.
const BASELINE: f32 = 0.35;
/// Cosine of the largest angle between the axes of neighbours.
const MIN_COSINE: f32 = 0.3;
/// Nearest and farthest depth, as multiples of the spread of the cameras.
const DEPTHS: (f32, f32) = (0.12, 40.0);
/// Nearest and farthest depth of random points, as such multiples.
const RANDOM_DEPTHS: (f32, f32) = (0.4, 4.0);
/// Depths that are tried in coarse pictures.
const NUM_DEPTHS: usize = 256;
/// Steps of depths on either side that belong to the same minimum.
const SAME: usize = 6;
/// Finer steps for one of these.
const REFINEMENT: i32 = 10;
/// Half of the edge of a patch of nine, pixels.
const PATCH: f32 = 1.5;
/// No difference counts more than this: another surface is another surface.
const MOST: f32 = 0.2;

/// Where cameras stand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surroundings {
    /// Root mean square distance of the cameras from their middle, scene units.
    spread: f32,
    /// Largest coordinate.
    far: f32,
}

impl Surroundings {
    pub(super) fn of(views: &[Seen]) -> Self {
        let num = views.len().max(1) as f32;
        let middle = views.iter().map(|v| v.camera.origin()).sum::<Vec3>() / num;
        let off = |v: &Seen| v.camera.origin().distance_squared(middle);
        let far = |v: &Seen| v.camera.origin().abs().max_element();
        Self {
            spread: (views.iter().map(off).sum::<f32>() / num).sqrt(),
            far: views.iter().map(far).fold(0.0, f32::max),
        }
    }

    /// The inverse depth for a random number, 0 to 1.
    pub(super) fn random_inverse_depth(&self, random: f32) -> f32 {
        let (near, far) = RANDOM_DEPTHS;
        (1.0 / far + random * (1.0 / near - 1.0 / far)) / self.spread
    }

    /// Whether cameras stand in more than one place, beyond rounding.
    pub(super) fn is_wide(&self) -> bool {
        self.spread > 1e-5 * self.far
    }
}

/// The best depth along a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Best {
    pub(super) inverse_depth: f32,
    /// Mean difference of PQ values in the views that agree most.
    pub(super) disagreement: f32,
    /// That of the best depth elsewhere.
    pub(super) next: f32,
}

/// A view and the views its pixels are looked for in.
pub(super) struct Matcher<'a> {
    own: &'a Seen,
    others: Vec<&'a Seen>,
    /// Indices of `others`.
    indices: Vec<usize>,
    /// Inverse depths of the farthest and the nearest place.
    inverse: (f32, f32),
}

/// A ray in the pixels of another picture: homogeneous, linear in the inverse depth.
#[derive(Debug, Clone, Copy)]
struct Track {
    origin: Vec3,
    direction: Vec3,
}

impl<'a> Matcher<'a> {
    pub(super) fn new(index: usize, views: &'a [Seen], around: &Surroundings) -> Self {
        let own = &views[index];
        let wanted = BASELINE * around.spread;
        let mut others: Vec<(f32, usize)> = views
            .iter()
            .enumerate()
            .filter_map(|(i, other)| {
                let distance = own.camera.origin().distance(other.camera.origin());
                let cosine = own.camera.forward().dot(other.camera.forward());
                let is_near = cosine > MIN_COSINE && distance > 0.02 * around.spread;
                let cost = (distance / wanted).ln().abs() + 2.0 * (1.0 - cosine);
                (i != index && is_near).then_some((cost, i))
            })
            .collect();
        others.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        others.truncate(NUM_NEIGHBOURS);
        let indices: Vec<usize> = others.into_iter().map(|(_, i)| i).collect();
        Self {
            own,
            others: indices.iter().map(|i| &views[*i]).collect(),
            indices,
            inverse: (
                1.0 / (DEPTHS.1 * around.spread),
                1.0 / (DEPTHS.0 * around.spread),
            ),
        }
    }

    /// Indices of the views that pixels are looked for in.
    pub(super) fn others(&self) -> &[usize] {
        &self.indices
    }

    /// The depth at which other views agree most with a fine pixel; `offset`, 0 to 1, moves the
    /// depths that are tried. `None` if there are no other views.
    pub(super) fn sweep(&self, pixel: usize, offset: f32) -> Option<Best> {
        let (far, near) = self.inverse;
        let step = (near - far) / NUM_DEPTHS as f32;
        let patch = Patch::new(self, pixel, 0);
        let costs: Vec<f32> = (0..NUM_DEPTHS)
            .map(|i| patch.disagreement(far + (i as f32 + offset) * step))
            .map(|cost| cost.unwrap_or(f32::MAX))
            .collect();
        let least = |from: usize, to: usize| {
            let costs = costs[from..to].iter().copied().enumerate();
            costs.min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let (best, cost) = least(0, NUM_DEPTHS)?;
        if cost == f32::MAX {
            return None;
        }
        let before = least(0, best.saturating_sub(SAME));
        let after = least((best + SAME + 1).min(NUM_DEPTHS), NUM_DEPTHS);
        let elsewhere = [before, after].into_iter().flatten();
        let next = elsewhere.map(|(_, cost)| cost).fold(f32::MAX, f32::min);
        let fine = Patch::new(self, pixel, 1);
        let middle = far + (best as f32 + offset) * step;
        let refined = (-REFINEMENT..=REFINEMENT)
            .filter_map(|i| {
                let inverse = middle + 1.25 * i as f32 / REFINEMENT as f32 * step;
                Some((inverse, fine.disagreement(inverse.max(far))?))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let (inverse_depth, refined) = refined.unwrap_or((middle, cost));
        Some(Best {
            inverse_depth: inverse_depth.max(far),
            disagreement: refined.max(cost),
            next,
        })
    }

    /// How much other views disagree with a fine pixel at an inverse depth.
    pub(super) fn disagreement(&self, pixel: usize, inverse_depth: f32) -> Option<f32> {
        Patch::new(self, pixel, 0).disagreement(inverse_depth)
    }
}

/// The surroundings of a pixel, and where other views see them.
struct Patch<'a> {
    wanted: Vec<[f32; 4]>,
    /// For each other view a track of each place.
    tracks: Vec<(&'a Level, Vec<Track>)>,
}

impl<'a> Patch<'a> {
    fn new(matcher: &Matcher<'a>, pixel: usize, level: usize) -> Self {
        let own = matcher.own;
        let ratio = own.fine().factor / own.levels[level].factor;
        let mut wanted = Vec::with_capacity(9);
        let mut directions = Vec::with_capacity(9);
        for i in 0..9 {
            let offset = Vec2::new((i % 3) as f32 - 1.0, (i / 3) as f32 - 1.0) * PATCH;
            let place = own.place(pixel) * ratio + offset;
            if let Some(value) = own.levels[level].at(place) {
                wanted.push(value);
                directions.push(own.direction(place / ratio));
            }
        }
        let tracks = matcher.others.iter().map(|other| {
            let level = &other.levels[level];
            let tracks = directions.iter().map(|direction| {
                let track =
                    |v: Vec3| pixels_of(&other.camera, v) / Vec2::splat(level.factor).extend(1.0);
                Track {
                    origin: track(own.camera.origin() - other.camera.origin()),
                    direction: track(*direction),
                }
            });
            (level, tracks.collect())
        });
        let tracks = tracks.collect();
        Self { wanted, tracks }
    }

    /// Mean difference over the better half of the views that show the patch.
    fn disagreement(&self, inverse_depth: f32) -> Option<f32> {
        let mut costs = [f32::MAX; NUM_NEIGHBOURS];
        let mut num = 0;
        for (level, tracks) in &self.tracks {
            if let Some(cost) = self.difference(level, tracks, inverse_depth) {
                costs[num] = cost;
                num += 1;
            }
        }
        if num < MIN_VIEWS {
            return None;
        }
        costs[..num].sort_unstable_by(f32::total_cmp);
        let half = num.div_ceil(2).max(MIN_VIEWS);
        Some(costs[..half].iter().sum::<f32>() / half as f32)
    }

    fn difference(&self, level: &Level, tracks: &[Track], inverse_depth: f32) -> Option<f32> {
        let mut sum = 0.0;
        for (wanted, track) in self.wanted.iter().zip(tracks) {
            let at = track.origin * inverse_depth + track.direction;
            if at.z <= 0.0 {
                return None;
            }
            let shown = level.at(at.truncate() / at.z)?;
            let difference: f32 = (0..4)
                .map(|c| (shown[c] - wanted[c]).abs() * if c < 3 { 1.0 / 3.0 } else { 0.5 })
                .sum();
            sum += difference.min(MOST);
        }
        Some(sum / self.wanted.len() as f32)
    }
}

/// Homogeneous pixels of a vector from a camera's origin.
fn pixels_of(camera: &Camera, vector: Vec3) -> Vec3 {
    let local = camera.world_from_camera.matrix3.transpose() * vector.as_dvec3();
    let (fx, fy) = (camera.fx, camera.fy);
    glam::DVec3::new(
        fx * local.x + camera.cx * local.z,
        fy * local.y + camera.cy * local.z,
        local.z,
    )
    .as_vec3()
}
