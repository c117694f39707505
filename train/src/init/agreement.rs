//! Points where the training views agree, for datasets without a point cloud.
//!
//! Random pixels of the views become points. Where a view has depth, that says how far away; else
//! the pixel's colours are looked for in neighbouring views along its ray (a plane sweep: Collins
//! 1996, "A Space-Sweep Approach to True Multi-Image Matching"), at distances uniform in their
//! inverse, first in coarse pictures and then in finer ones. A depth counts where it stands out
//! from all others. Of other pixels, those of bare walls, inverse depths are planes through the
//! nearest that count in the same view, which is exact for flat surfaces, if views agree there.

use super::seen::Seen;
use super::smooth::smooth;
use super::sweep::{Matcher, Surroundings};
use crate::error::{Result, TrainError};
use eagpt_scene::View;
use eagpt_scene::color::srgb8_from_linear;
use eagpt_scene::ply::PointCloud;
use eagpt_scene::rng::{Purpose, RandomKey};
use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;
use std::path::Path;

/// The iteration of the random numbers; [`super::choose`] has 0.
const ITERATION: u32 = 1;
/// Pixels of all views for each point, where the number of Gaussians is not given …
const PIXELS_PER_POINT: usize = 64;
/// … which stays within these.
const NUM_POINTS: (usize, usize) = (10_000, 100_000);
/// A depth counts whose disagreement is at most this …
const MAX_DISAGREEMENT: f32 = 0.03;
/// … and that of other depths at least this many times as much.
const MIN_CONTRAST: f32 = 1.6;
/// Disagreement that noise makes, PQ.
const NOISE: f32 = 0.004;
/// Neighbours in the picture through which a plane of inverse depths goes.
const PLANE_NEIGHBOURS: usize = 10;
/// Points of another view that tell what it sees somewhere.
const NUM_WITNESSES: usize = 6;
/// Relative difference of depths of one surface.
const SAME_DEPTH: f32 = 0.1;
/// Views that have to confirm a point.
const MIN_CONFIRMED: usize = 2;
/// Share of the points below which others are put at random depths …
const MIN_FOUND: f64 = 0.2;
/// … in at most so many tries for each.
const RANDOM_TRIES: usize = 50;

/// Number of points to look for in views of `num_pixels` pixels in total.
pub(crate) fn num_points(num_pixels: usize) -> usize {
    (num_pixels / PIXELS_PER_POINT).clamp(NUM_POINTS.0, NUM_POINTS.1)
}

/// Points that were found.
#[derive(Debug, Clone, Default)]
pub(crate) struct Agreed {
    pub(crate) cloud: PointCloud,
    /// Normals by the views' maps, zero where there are none, `[n]`.
    normals: Vec<Vec3>,
    /// Points whose depth a view told.
    pub(crate) num_from_depth: usize,
    /// Points whose depth stands out from others.
    pub(crate) num_distinct: usize,
    /// Points at random depths.
    pub(crate) num_random: usize,
}

impl Agreed {
    /// Tells of them.
    pub(crate) fn warning(&self) -> String {
        let num = self.cloud.len();
        let found = match (self.num_from_depth, self.num_random) {
            (0, 0) => format!(
                "{num} points where the training views agree, {} of them distinctly",
                self.num_distinct
            ),
            (0, random) => format!(
                "{num} points, {random} of them at random depths: the training views agree in few"
            ),
            (from_depth, _) => format!("{num} points, {from_depth} of them by the views' depth"),
        };
        format!("there is no points3d.ply: training starts from {found}")
    }

    fn retain(&mut self, keeps: impl Fn(Vec3) -> bool) {
        let kept: Vec<bool> = self.cloud.positions.iter().map(|p| keeps(*p)).collect();
        let flags = || kept.iter().copied();
        let mut flag = flags();
        let colors = &mut self.cloud.colors_srgb8;
        colors.retain(|_| flag.next().unwrap_or(false));
        let mut flag = flags();
        self.normals.retain(|_| flag.next().unwrap_or(false));
        let mut flag = flags();
        let positions = &mut self.cloud.positions;
        positions.retain(|_| flag.next().unwrap_or(false));
    }

    fn push(&mut self, seen: &Seen, pixel: usize, inverse_depth: f32) {
        let point = seen.point(pixel, inverse_depth);
        self.cloud.positions.push(point);
        let color = seen.light(pixel).map(srgb8_from_linear);
        self.cloud.colors_srgb8.push(color);
        self.normals.push(seen.normal(pixel));
    }
}

/// Collects views, and then finds points.
#[derive(Debug, Default)]
pub(crate) struct Agreement {
    views: Vec<Seen>,
}

/// A pixel whose depth is looked for.
#[derive(Debug, Clone, Copy)]
struct Sample {
    /// Index into the pixels of the finer picture.
    pixel: usize,
    inverse_depth: f32,
    disagreement: f32,
    rank: Rank,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rank {
    Depth,
    Distinct,
    Vague,
}

impl Agreement {
    /// Adds a training view.
    pub(crate) fn add(&mut self, view: &View) {
        self.views.push(Seen::new(view));
    }

    /// About `num` points.
    ///
    /// # Errors
    /// [`TrainError::Dataset`] if the cameras all stand in one place, or no pixel may be used.
    pub(crate) fn points(self, num: usize, seed: u64, dataset: &Path) -> Result<Agreed> {
        let problem = |problem: &str| TrainError::Dataset {
            path: dataset.to_owned(),
            problem: format!("there is no points3d.ply to start from, and {problem}"),
        };
        let around = Surroundings::of(&self.views);
        let has_depth = |seen: &Seen| seen.depth.is_some();
        if !around.is_wide() && !self.views.iter().all(has_depth) {
            return Err(problem(
                "without depth points are found by views from several places: these cameras all \
                 stand in one",
            ));
        }
        let usable: Vec<Vec<usize>> = self.views.iter().map(Seen::usable).collect();
        let total: usize = usable.iter().map(Vec::len).sum();
        if total == 0 {
            return Err(problem("no pixel of the views is known and opaque"));
        }
        let key = RandomKey::new(seed, Purpose::Initialise, ITERATION);
        let views = self.views.iter().enumerate();
        let matchers: Vec<Matcher<'_>> = views
            .map(|(index, _)| Matcher::new(index, &self.views, &around))
            .collect();
        let samples: Vec<Vec<Sample>> = matchers
            .iter()
            .zip(&usable)
            .enumerate()
            .map(|(index, (matcher, usable))| {
                let share = (num as f64 * usable.len() as f64 / total as f64).round() as usize;
                let samples = (0..share).into_par_iter().filter_map(|i| {
                    let [at, offset, ..] = key.stream(i as u32, index as u32).next_uniforms();
                    // One from each part of the picture.
                    let at = (i as f64 + f64::from(at)) / share as f64 * usable.len() as f64;
                    let pixel = usable[(at as usize).min(usable.len() - 1)];
                    sample(&self.views[index], matcher, pixel, offset)
                });
                let mut samples = samples.collect();
                complete(&self.views[index], matcher, &mut samples);
                samples
            })
            .collect();
        let mut found = Agreed::default();
        for (index, seen) in self.views.iter().enumerate() {
            let kept: Vec<bool> = samples[index]
                .par_iter()
                .map(|sample| self.confirm(&samples, &matchers[index], seen, sample))
                .collect();
            for (sample, _) in samples[index].iter().zip(kept).filter(|(_, kept)| *kept) {
                found.num_from_depth += usize::from(sample.rank == Rank::Depth);
                found.num_distinct += usize::from(sample.rank == Rank::Distinct);
                found.push(seen, sample.pixel, sample.inverse_depth);
            }
        }
        if found.num_from_depth == 0 {
            smooth(&mut found.cloud.positions, &found.normals);
            found.retain(|point| !self.views.iter().any(|view| view.sees_through(point)));
        }
        self.fill(&mut found, (num, &usable), &around, key);
        Ok(found)
    }

    /// Whether other views confirm a sample: nothing is transparent there, and more of them have
    /// found a surface there than see through to one behind.
    fn confirm(
        &self,
        samples: &[Vec<Sample>],
        matcher: &Matcher<'_>,
        seen: &Seen,
        sample: &Sample,
    ) -> bool {
        if sample.rank == Rank::Depth {
            return true;
        }
        let point = seen.point(sample.pixel, sample.inverse_depth);
        if self.views.iter().any(|view| view.sees_through(point)) {
            return false;
        }
        let (mut num_for, mut num_against) = (0, 0);
        for &index in matcher.others() {
            let Some((at, depth)) = self.views[index].see(point) else {
                continue;
            };
            let other = &self.views[index];
            let near = nearest(other, &samples[index], at, NUM_WITNESSES);
            let ratio = |(_, i): &(f32, usize)| depth * samples[index][*i].inverse_depth;
            if near.iter().map(ratio).any(|r| (r - 1.0).abs() < SAME_DEPTH) {
                num_for += 1;
            } else if !near.is_empty() && near.iter().map(ratio).all(|r| r < 1.0) {
                num_against += 1;
            }
        }
        num_for >= MIN_CONFIRMED && num_for > num_against
    }

    /// Where views agree in next to nothing, adds points at random depths along random pixels,
    /// within what no view sees through.
    fn fill(
        &self,
        found: &mut Agreed,
        (num, usable): (usize, &[Vec<usize>]),
        around: &Surroundings,
        key: RandomKey,
    ) {
        let few = (MIN_FOUND * num as f64) as usize;
        if found.cloud.len() >= few || found.num_from_depth > 0 {
            return;
        }
        let num_before = found.cloud.len();
        for i in 0..RANDOM_TRIES * num {
            if found.cloud.len() >= num {
                break;
            }
            let index = i % self.views.len();
            let seen = &self.views[index];
            let [at, depth, ..] = key.stream(i as u32, u32::MAX).next_uniforms();
            let Some(&pixel) = usable[index].get((at * usable[index].len() as f32) as usize) else {
                continue;
            };
            let inverse_depth = around.random_inverse_depth(depth);
            let point = seen.point(pixel, inverse_depth);
            if !self.views.iter().any(|view| view.sees_through(point)) {
                found.push(seen, pixel, inverse_depth);
            }
        }
        found.num_random = found.cloud.len() - num_before;
    }
}

fn sample(seen: &Seen, matcher: &Matcher<'_>, pixel: usize, offset: f32) -> Option<Sample> {
    if let Some(depth) = &seen.depth {
        // Nothing was hit there: no surface, no point.
        return (depth[pixel] > 0.0).then(|| Sample {
            pixel,
            inverse_depth: 1.0 / depth[pixel],
            disagreement: 0.0,
            rank: Rank::Depth,
        });
    }
    let best = matcher.sweep(pixel, offset)?;
    let stands_out = best.next >= MIN_CONTRAST * best.disagreement + NOISE;
    Some(Sample {
        pixel,
        inverse_depth: best.inverse_depth,
        disagreement: best.disagreement,
        rank: if best.disagreement <= MAX_DISAGREEMENT && stands_out {
            Rank::Distinct
        } else {
            Rank::Vague
        },
    })
}

/// Puts vague samples on planes through distinct ones; they are left out where views do not agree
/// there.
fn complete(seen: &Seen, matcher: &Matcher<'_>, samples: &mut Vec<Sample>) {
    let distinct: Vec<Sample> = samples
        .iter()
        .filter(|sample| sample.rank == Rank::Distinct)
        .copied()
        .collect();
    if distinct.len() < PLANE_NEIGHBOURS {
        samples.retain(|sample| sample.rank != Rank::Vague);
        return;
    }
    samples
        .par_iter_mut()
        .filter(|sample| sample.rank == Rank::Vague)
        .for_each(|sample| {
            sample.inverse_depth = plane_at(seen, &distinct, sample.pixel);
            let disagreement = matcher.disagreement(sample.pixel, sample.inverse_depth);
            sample.disagreement = disagreement.unwrap_or(f32::MAX);
        });
    samples.retain(|sample| sample.disagreement <= MAX_DISAGREEMENT);
}

/// Inverse depth at a pixel of the plane through the nearest `distinct` samples; within theirs.
fn plane_at(seen: &Seen, distinct: &[Sample], pixel: usize) -> f32 {
    let at = seen.place(pixel);
    let near = nearest(seen, distinct, at, PLANE_NEIGHBOURS);
    let mut normal = Mat3::ZERO;
    let mut right = Vec3::ZERO;
    let (mut least, mut most) = (f32::MAX, 0.0_f32);
    for (distance, i) in near {
        let other = &distinct[i];
        let offset = seen.place(other.pixel) - at;
        let row = Vec3::new(1.0, offset.x, offset.y);
        let weight = 1.0 / (1.0 + distance);
        normal += Mat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
        right += row * (other.inverse_depth * weight);
        least = least.min(other.inverse_depth);
        most = most.max(other.inverse_depth);
    }
    // Samples on a line leave the slope across it open: level then.
    let slack = Mat3::from_diagonal(Vec3::new(0.0, 1.0, 1.0) * 1e-3);
    let solution = (normal + slack).inverse() * right;
    let value = solution.x;
    if value.is_finite() {
        value.clamp(least, most)
    } else {
        least
    }
}

/// Square of the distance in the picture, and index, of the `num` samples nearest to a place.
fn nearest(seen: &Seen, samples: &[Sample], at: Vec2, num: usize) -> Vec<(f32, usize)> {
    let mut near: Vec<(f32, usize)> = samples
        .iter()
        .enumerate()
        .map(|(i, sample)| (seen.place(sample.pixel).distance_squared(at), i))
        .collect();
    let order = |a: &(f32, usize), b: &(f32, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    if near.len() > num {
        near.select_nth_unstable_by(num - 1, order);
        near.truncate(num);
    }
    near.sort_unstable_by(order);
    near
}

#[cfg(test)]
mod tests;
