//! The plane of a mirror, once its outline is known: an error of 2 cm moves what it shows by 4 cm.

use super::{AT_PLANE, Compared, Hung, Sight, Wall};
use crate::plane::{fitted, moved};
use eagpt_scene::median::median_of;
use eagpt_scene::plane::Plane;
use eagpt_trace::{TraceError, Tracer};
use glam::Vec2;

/// Pixels by which a plane is moved, about.
const NUM_COMPARED: usize = 2000;
/// First steps by which a plane is moved, in widths of a cell, and turned, radians; each next one
/// is this part of the one before.
const FIRST_MOVE: f32 = 0.75;
const FIRST_TURN: f32 = 0.02;
const NEXT_STEP: f32 = 0.6;
const NUM_STEPS: usize = 6;
/// Median distance from a plane of the surfaces that tell where a mirror is, in their thicknesses,
/// at most.
const MOST_UNEVEN: f32 = 0.2;

impl Wall<'_> {
    /// The plane of a mirror: where the scene has most of it as an even surface that surface, else
    /// the plane whose mirror image differs least from the photographs.
    pub(super) fn refined(
        &self,
        plane: Plane,
        hung: &Hung,
        compared: &[Compared],
        tracer: &dyn Tracer,
    ) -> Result<Plane, TraceError> {
        let behind = -AT_PLANE * self.scale.near;
        let all: Vec<Sight> = (compared.iter().map(|pixel| pixel.sight))
            .filter(|sight| self.is_on(hung, sight))
            .collect();
        let on_wall = || all.iter().filter(|sight| sight.height.abs() < -behind);
        let points = || on_wall().map(|sight| self.seen[sight.seen].position());
        let surface = fitted(points(), plane);
        let unevenness = median_of(points().map(|point| surface.height(point).abs()));
        if 2 * on_wall().count() > all.len() && unevenness <= MOST_UNEVEN * self.scale.near {
            return Ok(surface);
        }
        let step = all.len().div_ceil(NUM_COMPARED).max(1);
        let some: Vec<usize> = all.iter().step_by(step).map(|sight| sight.seen).collect();
        let tint = hung.reflectance.map(f32::ln);
        let error = |plane: Plane| -> Result<f32, TraceError> {
            let sights = some.iter().filter_map(|index| self.sight(plane, *index));
            let compared = self.compare(plane, sights.collect(), tracer)?;
            let sum: f32 = compared.iter().map(|pixel| pixel.off(tint)).sum();
            // A pixel that does not see the plane any more is not explained.
            Ok(sum + (some.len() - compared.len()) as f32)
        };
        let (mut best, mut least) = (plane, error(plane)?);
        let (mut by, mut angle) = (FIRST_MOVE * self.scale.cell, FIRST_TURN);
        for _ in 0..NUM_STEPS {
            for change in [
                (by, Vec2::ZERO),
                (-by, Vec2::ZERO),
                (0.0, angle * Vec2::X),
                (0.0, angle * Vec2::NEG_X),
                (0.0, angle * Vec2::Y),
                (0.0, angle * Vec2::NEG_Y),
            ] {
                let about = hung.centre - best.normal * best.height(hung.centre);
                let tried = moved(best, change, self.axes, about);
                let error = error(tried)?;
                if error < least {
                    (best, least) = (tried, error);
                }
            }
            (by, angle) = (NEXT_STEP * by, NEXT_STEP * angle);
        }
        Ok(best)
    }
}
