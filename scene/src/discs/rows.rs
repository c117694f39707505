//! Discs in rows, narrow at either end, and in rings.

use glam::Vec3;
use std::f32::consts::PI;

/// Spacing of the outermost rows of discs, in that of the others, and how much wider each row
/// further in is, until it has that.
const EDGE_SPACING: f32 = 0.125;
const GROWTH: f32 = 1.5;
/// Rows at either end that are narrower than the others: `1.5^6 > 8`.
const NUM_NARROW: usize = 6;
/// Distance of the outermost discs of a flat surface from its edge, in their spacings: with the
/// values above, what the soft border of the discs covers beyond the edge is what it leaves open
/// before it (integrated numerically; 1.13 where all rows are alike).
pub const INSET_IN_SPACINGS: f32 = 1.14;
/// Discs that touch a ball stick out of it and widen its shadow by this times (spacing / radius)²,
/// relative to the radius (measured by tracing parallel rays past balls of spacing 0.07 and 0.2
/// radii: 1.67 and 1.58). The discs are put that much further in.
pub(super) const BALL_EXCESS: f32 = 1.6;
/// Least number of discs along each edge of a flat surface, and around a tube.
const MIN_ROW_DISCS: usize = 2;
const MIN_RING_DISCS: usize = 12;

/// The rows of discs on a parallelogram.
pub(super) fn rows([u, v]: [Vec3; 2], spacing: f32) -> [Row; 2] {
    // Rows of a slanted one are nearer to each other than its edge is long.
    let height = u.cross(v).length() / u.length();
    [u.length(), height].map(|length| Row::new(length, spacing))
}

/// Discs around a tube.
pub(super) struct Ring {
    pub(super) num: usize,
    pub(super) spacing: f32,
    pub(super) radius: f32,
}

impl Ring {
    pub(super) fn new(radius: f32, wanted: f32) -> Self {
        let num = ((2.0 * PI * radius / wanted).round() as usize).max(MIN_RING_DISCS);
        // As on a ball, but curved in one direction alone.
        let angle = 2.0 * PI / num as f32;
        let radius = radius / (1.0 + 0.5 * BALL_EXCESS * angle * angle);
        Self {
            num,
            spacing: radius * angle,
            radius,
        }
    }
}

/// Discs along an edge, narrow at either end.
pub(super) struct Row {
    pub(super) num: usize,
    length: f32,
    /// That of the discs that are not narrow, scene units.
    spacing: f32,
}

impl Row {
    pub(super) fn new(length: f32, wanted: f32) -> Self {
        let most_narrow = 2 * NUM_NARROW + 1;
        let more = (length / wanted - spacings(most_narrow)).round();
        let off = |num: usize| (spacings(num) * wanted - length).abs();
        let few = || (MIN_ROW_DISCS..=most_narrow).min_by(|a, b| off(*a).total_cmp(&off(*b)));
        let num = match more >= 1.0 {
            true => most_narrow + more as usize,
            false => few().unwrap_or(MIN_ROW_DISCS),
        };
        Self {
            num,
            length,
            spacing: length / spacings(num),
        }
    }

    /// Place of each disc, as a share of the edge from its middle, −0.5 to 0.5, and its spacing,
    /// scene units.
    pub(super) fn discs(&self) -> impl Iterator<Item = (f32, f32)> {
        (0..self.num).map(|i| {
            let (before, behind) = (i, self.num - 1 - i);
            let nearest = before.min(behind);
            let from_middle = 0.5 - depth(nearest) * self.spacing / self.length;
            let place = if before < behind {
                -from_middle
            } else {
                from_middle
            };
            (place, width(nearest) * self.spacing)
        })
    }
}

/// Width of a disc, the `k`-th from an end of its row, in spacings.
fn width(k: usize) -> f32 {
    let grown = (0..k.min(NUM_NARROW)).fold(EDGE_SPACING, |width, _| GROWTH * width);
    grown.min(1.0)
}

/// Distance of its middle from the end, in spacings.
fn depth(k: usize) -> f32 {
    let narrow = k.min(NUM_NARROW);
    let gaps = (0..narrow).map(|i| 0.5 * (width(i) + width(i + 1)));
    INSET_IN_SPACINGS * EDGE_SPACING + gaps.sum::<f32>() + (k - narrow) as f32
}

/// Length of an edge with `num` discs, in spacings.
fn spacings(num: usize) -> f32 {
    let middle = (num - 1) / 2;
    // The two in the middle of an even number are as far from each other as they are wide.
    let between = if num.is_multiple_of(2) {
        width(middle)
    } else {
        0.0
    };
    2.0 * depth(middle) + between
}
