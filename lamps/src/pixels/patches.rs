//! Pixels of the views that show a lamp, as fits of its shape compare them.

use crate::evidence::{Evidence, Lit, Pixel, Sight, rim};
use crate::group::Group;
use crate::shape::Shape;
use crate::shape::meet::{PixelRays, ShapeFrom};
use glam::Vec3;
use std::f32::consts::PI;

/// Views that a shape is fitted to and that measure its light: those with most pixels.
pub(crate) const MAX_VIEWS: usize = 16;
/// Share of its distance by which a pixel has to be nearer than the lamp to show what hides it.
const NEARER: f32 = 0.08;
/// A place farther than the scene by so many widths of a pixel, and by this share, is hidden.
const HIDDEN_PIXELS: f32 = 2.0;
const HIDDEN_SHARE: f32 = 0.01;
/// Pixels of a view whose distances are compared, about.
const MAX_DISTANCES: usize = 16;
/// Pixels of a view that a fit compares: at the border of a lamp, and others.
const MAX_TARGETS: [usize; 2] = [600, 500];

/// The same, of all views together, of a search that leads to where one by all begins.
const MAX_COARSE: [usize; 2] = [3000, 2500];

/// A pixel as a fit wants it.
#[derive(Clone)]
pub(crate) struct Target {
    /// Unit directions of its rays.
    pub(crate) rays: PixelRays,
    /// Part of it that the lamp covers, 0 to 1.
    pub(crate) cover: f32,
    /// Pixels that it stands for.
    pub(crate) weight: f32,
    /// Solid angle of these, sr.
    solid_angle: f32,
    /// Distance along its rays at which a lamp is behind what the scene has there.
    pub(crate) hidden_from: f32,
}

/// A view of a lamp.
pub(crate) struct Patch {
    pub(crate) origin: Vec3,
    pub(crate) targets: Vec<Target>,
    /// Unit directions of some pixels of the lamp, and distances at which the scene has it there.
    pub(crate) distances: Vec<(Vec3, f32)>,
}

impl Patch {
    /// Share of a `ball` that shows the lamp.
    pub(crate) fn share_shown(&self, ball: &Shape) -> f32 {
        let seen = ShapeFrom::new(ball, self.origin);
        let shown = self.targets.iter().map(|target| {
            let (cover, _) = seen.cover(&target.rays);
            target.solid_angle * cover.min(target.cover)
        });
        let radius = 0.5 * ball.size().x;
        let sine = (radius / ball.centre().distance(self.origin)).min(1.0);
        let whole = 2.0 * PI * (1.0 - (1.0 - sine * sine).sqrt());
        shown.sum::<f32>() / whole
    }
}

/// The views with most pixels of the lamp.
pub(crate) fn patches(evidence: &Evidence, group: &Group, centre: Vec3, extent: f32) -> Vec<Patch> {
    let bright = brightness(evidence, group);
    (group.best_views(MAX_VIEWS).into_iter())
        .map(|(view, own)| {
            let sight = &evidence.sights[view];
            let of_own = || own.iter().map(|&i| &sight.pixels[i as usize]);
            let is_thin = !of_own().any(|pixel| pixel.lit == Lit::Inside);
            let bounds = |of: fn(&Pixel) -> u32| {
                let values = of_own().map(of);
                (values.clone().min().unwrap_or(0), values.max().unwrap_or(0))
            };
            let ((x0, x1), (y0, y1)) = (bounds(|p| p.x), bounds(|p| p.y));
            let (rim_x, rim_y) = (rim(x1 - x0 + 1), rim(y1 - y0 + 1));
            let level = group.level(sight.light);
            let distance = centre.distance(sight.origin());
            let nearest = (distance - extent) * (1.0 - NEARER);
            let mut targets = Vec::new();
            for (i, pixel) in (0_u32..).zip(&sight.pixels) {
                let near = pixel.x + rim_x >= x0
                    && pixel.x <= x1 + rim_x
                    && pixel.y + rim_y >= y0
                    && pixel.y <= y1 + rim_y;
                if !near {
                    continue;
                }
                let is_own = own.contains(&i);
                let other = pixel.lit.is_lit() && !is_own;
                // Things before the lamp hide a part of it, and so may another one like it.
                let is_before = !is_own && pixel.distance < nearest;
                let is_like = || !level.is_unlike(&sight.level(pixel));
                if is_before || (other && is_like()) {
                    continue;
                }
                // The rest of the pixel is dark if it shows no other lamp.
                let rest = match other {
                    true => Some(sight.level(pixel)),
                    false => sight.level_beside(pixel),
                };
                let rest = rest.map_or(0.0, |level| level.radiance.max_element());
                let dimmer = if rest < bright { rest } else { 0.0 };
                let share = (pixel.radiance.max_element() - dimmer) / (bright - dimmer);
                let cover = match pixel.lit {
                    _ if other && rest >= bright => 0.0,
                    _ if other => share.clamp(0.0, 0.5),
                    Lit::Inside => 1.0,
                    Lit::Border | Lit::Beside if is_thin => share.clamp(0.0, 1.0),
                    Lit::Border => share.clamp(0.5, 1.0),
                    Lit::Beside => share.clamp(0.0, 0.5),
                    Lit::Dark => 0.0,
                };
                targets.push(Target {
                    rays: PixelRays::new(|[x, y]| sight.direction(pixel, x, y)),
                    cover,
                    weight: pixel.weight,
                    solid_angle: pixel.solid_angle,
                    hidden_from: hidden_from(sight, pixel),
                });
            }
            let mut distances: Vec<(u32, Vec3, f32)> = (own.iter())
                .map(|&i| (i, &sight.pixels[i as usize]))
                .map(|(i, pixel)| (i, pixel.direction, pixel.distance))
                .collect();
            distances.sort_unstable_by_key(|(i, ..)| *i);
            let step = distances.len().div_ceil(MAX_DISTANCES);
            let some = distances.into_iter().step_by(step.max(1));
            Patch {
                origin: sight.origin(),
                distances: some
                    .map(|(_, direction, distance)| (direction, distance))
                    .collect(),
                targets: thinned(targets, MAX_TARGETS),
            }
        })
        .collect()
}

/// The same views by fewer pixels, where they are many.
pub(crate) fn coarse(patches: &[Patch]) -> Vec<Patch> {
    let most = MAX_COARSE.map(|most| most.div_ceil(patches.len().max(1)));
    let coarse = patches.iter().map(|patch| Patch {
        origin: patch.origin,
        targets: thinned(patch.targets.clone(), most),
        distances: patch.distances.clone(),
    });
    coarse.collect()
}

/// Of many pixels, some that stand for all: of those that a lamp fills, or has nothing in, and of
/// those at its border, at most so many.
fn thinned(targets: Vec<Target>, most: [usize; 2]) -> Vec<Target> {
    let is_plain = |t: &Target| t.cover == 0.0 || t.cover == 1.0;
    let num_plain = targets.iter().filter(|t| is_plain(t)).count();
    let nums = [targets.len() - num_plain, num_plain];
    let steps = [0, 1].map(|kind| nums[kind].div_ceil(most[kind]).max(1));
    let mut at = [0; 2];
    (targets.into_iter())
        .filter_map(|mut target| {
            let kind = usize::from(is_plain(&target));
            target.weight *= steps[kind] as f32;
            target.solid_angle *= steps[kind] as f32;
            at[kind] += 1;
            (at[kind] % steps[kind] == 0).then_some(target)
        })
        .collect()
}

/// Distance along the ray of a pixel at which something is behind what the scene has there.
pub(crate) fn hidden_from(sight: &Sight, pixel: &Pixel) -> f32 {
    pixel.distance * (1.0 + depth_tolerance(sight.pixel_width()))
}

/// Share of its distance by which a place is farther than the scene and yet not hidden, where a
/// pixel is of this `width` at distance 1.
pub(crate) fn depth_tolerance(width: f32) -> f32 {
    (HIDDEN_PIXELS * width).max(HIDDEN_SHARE)
}

/// Radiance of the lamp where it fills a pixel: the brightest channel of most of the pixels that it
/// is alone in, or else of its brightest ones.
fn brightness(evidence: &Evidence, group: &Group) -> f32 {
    let values = |inside: bool| {
        let pixels = group.members.iter().map(|member| evidence.pixel(member).1);
        let mut values: Vec<f32> = pixels
            .filter(|p| !inside || p.lit == Lit::Inside)
            .map(|p| p.radiance.max_element())
            .collect();
        values.sort_unstable_by(f32::total_cmp);
        values
    };
    let inside = values(true);
    let of = |values: &[f32], share: f32| values[((values.len() - 1) as f32 * share) as usize];
    let value = if inside.is_empty() {
        of(&values(false), 0.98)
    } else {
        of(&inside, 0.5)
    };
    value.max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests;
