//! Cameras inside the room.

use super::shapes::HALF_FLOOR;
use eagpt_scene::Camera;
use glam::DVec3;
use std::f64::consts::TAU;

/// Horizontal field of view, degrees.
const FIELD_OF_VIEW_DEG: f64 = 75.0;
/// Cameras stand on an ellipse of this share of the floor.
const RING: f64 = 0.62;
/// Turn from one camera to the next, in turns: the golden ratio spreads any number of them evenly.
const GOLDEN_TURN: f64 = 0.618_033_988_749_895;

/// `num` cameras that stand around the room, above its furniture, and look across it: up, down and
/// level in turn.
pub(super) fn cameras(num: usize, width: u32, height: u32) -> Vec<Camera> {
    (0..num)
        .map(|i| {
            let angle = TAU * GOLDEN_TURN * i as f64;
            let half = DVec3::new(HALF_FLOOR.x.into(), HALF_FLOOR.y.into(), 0.0);
            let on_ring = |angle: f64| half * DVec3::new(angle.cos(), angle.sin(), 0.0);
            let eye = on_ring(angle) * RING + DVec3::Z * (1.45 + 0.25 * (1.7 * i as f64).sin());
            // Past the middle, so that opposite walls and corners are seen as well.
            let target_height = [0.3, 1.3, 2.1][i % 3];
            let target = on_ring(angle + 0.5 * TAU + 0.8) * 0.6 + DVec3::Z * target_height;
            let pose = Camera::level_pose(eye, (target - eye).normalize());
            Camera::centred([width, height], FIELD_OF_VIEW_DEG.to_radians(), pose)
        })
        .collect()
}
