//! Flat lamps behind bars and in recesses, as windows are: what a view does not show of their area
//! is hidden by what stands before it, too thin or too near for the depth of a trained scene to
//! tell. Another view shows it.

use crate::evidence::{Evidence, Pixel, Sight};
use crate::fit::shape_search::{Fit, refined_again};
use crate::group::Group;
use crate::pixels::patches::{MAX_VIEWS, Patch, hidden_from};
use crate::pixels::silhouette::{Gaps, Silhouette, residual};
use crate::shape::search;
use crate::shape::{Flat, Shape};
use glam::Vec3;
use rayon::prelude::*;

/// Pixels of a lamp in all views, at least, for these to tell what hides parts of it.
pub(crate) const LEAST_PIXELS: usize = 400;
/// Residual of a fit beyond which a lamp is not behind bars.
pub(crate) const MAX_RESIDUAL: f32 = 0.12;
/// Share of the area that views have to show in the mean; …
const MIN_SHOWN: f32 = 0.5;
/// … and share of its cells, so many along each side, that at least one view has to show.
const MIN_CELLS: f32 = 0.95;
const NUM_CELLS: usize = 12;
/// Share of what hides it that the lamp has to be behind, by the depth of the scene …
const BEHIND: f32 = 0.9;
/// … and most that it goes behind where its silhouettes have it, in shares of its narrow side.
const MAX_PUSH: f32 = 0.15;
/// Trials for its edges once its plane is known.
const NUM_TRIALS: usize = 200;

/// The lamp of `group`, which has many pixels, behind bars, about one of the `starts`, which may keep
/// their z axis; `None` where its residual is over `max_residual`, or views do not show that there
/// is one.
pub(crate) fn fit(
    evidence: &Evidence,
    group: &Group,
    starts: &[(Shape, bool)],
    patches: &[Patch],
    max_residual: f32,
) -> Option<Fit> {
    let fits = (starts.par_iter())
        .map(|(start, is_upright)| refined_again(start, *is_upright, patches, Gaps::Bars));
    let best = fits.min_by(|a, b| a.residual.total_cmp(&b.residual))?;
    if best.residual > MAX_RESIDUAL.min(max_residual) {
        return None;
    }
    let flat = behind_bars(evidence, group, best.shape.flat()?, patches)?;
    let shape = Shape::Rectangle(flat);
    Some(Fit { shape, ..best })
}

/// The lamp of `group`, whose silhouettes are those of `opening`, behind what hides it; `None`
/// where views do not show that there is one.
fn behind_bars(
    evidence: &Evidence,
    group: &Group,
    opening: &Flat,
    patches: &[Patch],
) -> Option<Flat> {
    let mut cells = [false; NUM_CELLS * NUM_CELLS];
    let (mut shown, mut hidden) = (0.0, 0.0);
    let mut heights = Vec::new();
    for (view, _) in group.best_views(MAX_VIEWS) {
        let sight = &evidence.sights[view];
        for pixel in &sight.pixels {
            let Some((distance, cell)) = inside(opening, sight, pixel) else {
                continue;
            };
            // Panes far from each other may be other groups.
            if pixel.lit.is_lit() {
                shown += pixel.weight;
                cells[cell] = true;
            } else if distance < hidden_from(sight, pixel) {
                hidden += pixel.weight;
                heights.push((sight.position(pixel) - opening.centre).dot(opening.normal()));
            }
        }
    }
    let num_shown = cells.iter().filter(|shown| **shown).count();
    if shown < MIN_SHOWN * (shown + hidden) || (num_shown as f32) < MIN_CELLS * (cells.len() as f32)
    {
        return None;
    }
    heights.sort_unstable_by(|a, b| b.total_cmp(a));
    let lowest = heights.get((heights.len() as f32 * BEHIND) as usize);
    let [width, height] = opening.size;
    let most = MAX_PUSH * width.min(height);
    let push = lowest.map_or(0.0, |height| (-height).clamp(0.0, most));
    let plane = Flat {
        centre: opening.centre - opening.normal() * push,
        ..*opening
    };
    let value = |by: &[f32]| {
        let shape = Shape::Rectangle(with_edges(&plane, by));
        residual(&[&Silhouette::new(&shape, patches)], patches, Gaps::Bars)
    };
    let (by, _) = search::minimum(value, &[0.1; 4], NUM_TRIALS);
    Some(with_edges(&plane, &by))
}

/// `flat` with its edges at −x, +x, −y, +y farther out, in shares of its sizes.
fn with_edges(flat: &Flat, by: &[f32]) -> Flat {
    let [width, height] = flat.size;
    let shift = Vec3::new((by[1] - by[0]) * width, (by[3] - by[2]) * height, 0.0);
    Flat {
        centre: flat.centre + flat.rotation * (0.5 * shift),
        size: [
            width * (1.0 + by[0] + by[1]).max(0.0),
            height * (1.0 + by[2] + by[3]).max(0.0),
        ],
        ..*flat
    }
}

/// Distance at which the ray of a pixel meets the rectangle, and the cell that it meets.
fn inside(flat: &Flat, sight: &Sight, pixel: &Pixel) -> Option<(f32, usize)> {
    let origin = sight.origin();
    let distance = Shape::Rectangle(*flat).meet(origin, pixel.direction)?;
    let at = flat.rotation.conjugate() * (origin + pixel.direction * distance - flat.centre);
    let cell = |at: f32, size: f32| {
        let cell = (at / size + 0.5) * NUM_CELLS as f32;
        (cell as usize).min(NUM_CELLS - 1)
    };
    let [width, height] = flat.size;
    Some((distance, cell(at.y, height) * NUM_CELLS + cell(at.x, width)))
}
