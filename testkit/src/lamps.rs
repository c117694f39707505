//! Lamps that nobody has measured.

use eagpt_scene::{Lamp, LampShape};
use glam::{Quat, Vec3};

/// A lamp called `name` of radiance and power 1, in an upright box around `centre` of edges `size`
/// (world space, scene units).
pub fn boxed(name: &str, centre: [f32; 3], size: [f32; 3]) -> Lamp {
    let frame = (centre.into(), Quat::IDENTITY, size.into());
    Lamp {
        name: name.to_owned(),
        power: [1.0; 3],
        num_gaussians: 1,
        num_pixels: 1,
        ..Lamp::unmeasured(LampShape::Other, frame, (1.0, Vec3::ONE))
    }
}
