//! Scenes for tests.

use crate::live::Original;
use eagpt_scene::gaussians::random_cloud;
use eagpt_scene::{Lamps, LightBasis, LightGroups};
use eagpt_testkit::lamps::boxed;
use glam::Vec3;
use std::sync::Arc;

/// A cloud in a box of 2 units with lamps of these names side by side, and the light of each; what
/// emits elsewhere is `rest`.
pub(crate) fn lit_cloud(names: &[&str]) -> Original {
    let gaussians = random_cloud(300, 4);
    let place = |k: usize| [-0.7 + 0.5 * k as f32, 0.0, 0.0];
    let lamps = names.iter().enumerate();
    let lamps = Lamps {
        lamps: lamps
            .map(|(k, name)| boxed(name, place(k), [0.4, 2.0, 2.0]))
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
