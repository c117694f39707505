//! Lamps that nobody has measured.

use eagpt_scene::{Lamp, LampShape};

/// A lamp called `name` of radiance and power 1, in an upright box around `centre` of edges `size`
/// (world space, scene units).
pub fn boxed(name: &str, centre: [f32; 3], size: [f32; 3]) -> Lamp {
    Lamp {
        name: name.to_owned(),
        shape: LampShape::Other,
        centre,
        rotation: [1.0, 0.0, 0.0, 0.0],
        size,
        one_sided: false,
        bars: false,
        area: 1.0,
        radiance: [1.0; 3],
        power: [1.0; 3],
        num_gaussians: 1,
        views: Vec::new(),
        num_pixels: 1,
        deviation: 0.0,
        factor: [1.0; 3],
    }
}
