//! Scenes for tests.

use crate::live::Original;
use eagpt_scene::gaussians::random_cloud;
use eagpt_scene::{Lamp, LampShape, Lamps, LightBasis, LightGroups};
use glam::Vec3;
use std::sync::Arc;

/// A lamp called `name` in a small box at `centre`.
pub(crate) fn lamp(name: &str, centre: [f32; 3], size: [f32; 3]) -> Lamp {
    Lamp {
        name: name.to_owned(),
        shape: LampShape::Other,
        centre,
        rotation: [1.0, 0.0, 0.0, 0.0],
        size,
        one_sided: false,
        area: 1.0,
        radiance: [1.0; 3],
        power: [1.0; 3],
        num_gaussians: 1,
        views: Vec::new(),
        num_pixels: 0,
        deviation: 0.0,
        factor: [1.0; 3],
    }
}

/// A cloud in a box of 2 units with lamps of these names side by side, and the light of each; what
/// emits elsewhere is `rest`.
pub(crate) fn lit_cloud(names: &[&str]) -> Original {
    let gaussians = random_cloud(300, 4);
    let place = |k: usize| [-0.7 + 0.5 * k as f32, 0.0, 0.0];
    let lamps = names.iter().enumerate();
    let lamps = Lamps {
        lamps: lamps
            .map(|(k, name)| lamp(name, place(k), [0.4, 2.0, 2.0]))
            .collect(),
    };
    let groups = LightGroups::new(&gaussians, &lamps).expect("names are different");
    let num = groups.names.len();
    let reflected: Vec<Vec3> = (0..num * gaussians.len())
        .map(|i| Vec3::new(0.5, 1.0, 2.0) * (i % 97) as f32)
        .collect();
    let basis = LightBasis::new(&gaussians, &groups, &reflected);
    Original {
        gaussians: Arc::new(gaussians),
        lamps,
        basis: Some(basis),
    }
}
