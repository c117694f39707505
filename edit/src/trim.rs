//! Gaussians that cross the boundary of a selection.
//!
//! A Gaussian belongs to a region by its centre, and its disc may stick out of it: what is cut out
//! of a scene along a plane has fringes. Trimming mends them. A disc here is the
//! ellipse of three standard deviations that a ray tracer intersects.

use crate::select::Prepared;
use eagpt_scene::{Gaussian, Gaussians};
use glam::{Mat3, Vec2, Vec3};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::f32::consts::TAU;

/// Treatment of Gaussians that cross the boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Trim {
    /// Their discs are moved in their planes and shrunk until they lie on one side.
    Shrink,
    /// They are removed.
    Drop,
}

/// Radius of a disc, standard deviations.
const DISC_RADIUS: f32 = 3.0;
/// Points of the ellipse at which the boundary is searched for.
const NUM_RIM_POINTS: usize = 16;
/// Steps from the centre to the rim: a cut is found to this share of the radius.
const NUM_STEPS: u16 = 64;
/// A disc of which less than this share of its radius remains is removed.
const MIN_SHARE: f32 = 0.05;

/// The side of the boundary that discs have to keep to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    /// The side on which the selector holds.
    Inside,
    /// The side on which it does not.
    Outside,
}

/// Effects of trimming on the Gaussians of a scene.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Cuts {
    /// Gaussians that become smaller, by index, and what they become.
    pub(crate) shrunk: BTreeMap<usize, Gaussian>,
    /// Gaussians that have to go.
    pub(crate) dropped: BTreeSet<usize>,
}

impl Cuts {
    /// Trims the Gaussians that are flagged, all of which have their centres on `side`.
    pub(crate) fn find(
        prepared: &Prepared<'_>,
        gaussians: &Gaussians,
        flagged: &[bool],
        side: Side,
        how: Trim,
    ) -> Self {
        let mut cuts = Self::default();
        for index in (0..gaussians.len()).filter(|i| flagged[*i]) {
            match trim(prepared, index, &gaussians.get(index), side, how) {
                Trimmed::Kept => {}
                Trimmed::Shrunk(smaller) => {
                    cuts.shrunk.insert(index, smaller);
                }
                Trimmed::Dropped => {
                    cuts.dropped.insert(index);
                }
            }
        }
        cuts
    }

    /// The flagged Gaussians after trimming, in order.
    pub(crate) fn pick(&self, gaussians: &Gaussians, flagged: &[bool]) -> Gaussians {
        let left = (0..gaussians.len()).filter(|i| flagged[*i] && !self.dropped.contains(i));
        let after = |i| match self.shrunk.get(&i) {
            Some(smaller) => *smaller,
            None => gaussians.get(i),
        };
        left.map(after).collect()
    }
}

/// Effect of trimming on a Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Trimmed {
    /// It lies on one side.
    Kept,
    /// It was made smaller.
    Shrunk(Gaussian),
    /// It has to go.
    Dropped,
}

/// Trims Gaussian `index`, whose centre is on the right side.
fn trim(prepared: &Prepared<'_>, index: usize, g: &Gaussian, side: Side, how: Trim) -> Trimmed {
    let good = |point: Vec3| prepared.holds(index, point) == (side == Side::Inside);
    let frame = Mat3::from_quat(g.rotation);
    let axes = [frame.x_axis * g.scale.x, frame.y_axis * g.scale.y].map(|axis| axis * DISC_RADIUS);
    if rim(g.position, axes).all(good) {
        return Trimmed::Kept;
    }
    if how == Trim::Drop {
        return Trimmed::Dropped;
    }
    // First each axis by itself: a disc cut by a straight line keeps its width along it.
    let mut centre = g.position;
    let mut shares = Vec2::ONE;
    for (axis, share) in axes.into_iter().zip(shares.as_mut()) {
        let ahead = free_share(good, centre, axis);
        let behind = free_share(good, centre, -axis);
        centre += axis * (0.5 * (ahead - behind));
        *share = 0.5 * (ahead + behind);
    }
    // Then both, until the rim between the axes fits as well.
    let common = (1..=NUM_STEPS)
        .rev()
        .map(|step| f32::from(step) / f32::from(NUM_STEPS))
        .find(|&common| {
            let smaller = [axes[0] * (common * shares.x), axes[1] * (common * shares.y)];
            rim(centre, smaller).all(good)
        });
    let Some(common) = common else {
        return Trimmed::Dropped;
    };
    let shares = shares * common;
    if !good(centre) || shares.min_element() < MIN_SHARE {
        return Trimmed::Dropped;
    }
    Trimmed::Shrunk(Gaussian {
        position: centre,
        scale: g.scale * shares,
        ..*g
    })
}

fn rim(centre: Vec3, axes: [Vec3; 2]) -> impl Iterator<Item = Vec3> {
    (0..NUM_RIM_POINTS).map(move |i| {
        let (sin, cos) = (TAU * i as f32 / NUM_RIM_POINTS as f32).sin_cos();
        centre + axes[0] * cos + axes[1] * sin
    })
}

/// Distance from `centre` along `axis` up to which points are valid, as a share of the axis.
fn free_share(good: impl Fn(Vec3) -> bool, centre: Vec3, axis: Vec3) -> f32 {
    let first_bad = (1..=NUM_STEPS)
        .map(|step| f32::from(step) / f32::from(NUM_STEPS))
        .position(|share| !good(centre + axis * share));
    first_bad.map_or(1.0, |steps| steps as f32 / f32::from(NUM_STEPS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::select::{Definitions, Groups, Scope, Selector};
    use crate::shape::Shape;
    use crate::testing::disc;
    use eagpt_scene::Lamps;

    /// Trims a round disc of 3σ = 3 at height 0, centred at `x`, with the half-space x ≤ 0.
    fn trimmed(x: f32, side: Side, how: Trim) -> Trimmed {
        let g = Gaussian {
            scale: Vec2::ONE,
            ..disc(Vec3::new(x, 0.0, 0.0))
        };
        let gaussians: Gaussians = [g].into_iter().collect();
        let selector = Selector::Shape(Shape::HalfSpace {
            point: Vec3::ZERO,
            normal: Vec3::NEG_X,
        });
        let scope = Scope {
            gaussians: &gaussians,
            definitions: &Definitions::new(),
            groups: &Groups::new(),
            lamps: &Lamps::default(),
        };
        trim(&scope.prepare(&selector), 0, &g, side, how)
    }

    #[test]
    fn a_disc_that_crosses_is_cut_at_the_boundary() {
        for (x, side) in [(-1.5, Side::Inside), (1.5, Side::Outside)] {
            let Trimmed::Shrunk(g) = trimmed(x, side, Trim::Shrink) else {
                panic!("not shrunk")
            };
            // Of 3 + 3 along x, 3 + 1.5 remain; along y nothing was cut.
            let away = x.signum();
            assert!((g.position.x - away * 2.25).abs() < 0.05, "{g:?}");
            assert!((g.scale.x - 0.75).abs() < 0.02, "{g:?}");
            assert!(g.scale.y > 0.95, "{g:?}");
            assert!((g.position.x + away.signum() * -3.0 * g.scale.x) * away >= -1e-5);
            assert_eq!(trimmed(x, side, Trim::Drop), Trimmed::Dropped);
        }
    }

    #[test]
    fn a_disc_on_one_side_stays() {
        for how in [Trim::Shrink, Trim::Drop] {
            assert_eq!(trimmed(-3.01, Side::Inside, how), Trimmed::Kept);
            assert_eq!(trimmed(3.01, Side::Outside, how), Trimmed::Kept);
        }
    }
}
