//! Receivers of light, for tests without cameras.

use eagpt_scene::Gaussians;
use eagpt_trace::transport::EMISSION_THRESHOLD;
use eagpt_trace::transport::matrix::Receiver;
use eagpt_trace::transport::start::Surface;
use glam::Mat3;

/// Gaussians that do not emit, each as its own plane, from the side that faces the origin.
pub(crate) fn receivers(scene: &Gaussians) -> Vec<Receiver> {
    (0..)
        .zip(scene.iter())
        .filter(|(_, g)| g.emission <= EMISSION_THRESHOLD)
        .map(|(i, g)| {
            let normal = Mat3::from_quat(g.rotation).z_axis;
            let surface = Surface {
                position: g.position,
                normal: -normal * normal.dot(g.position).signum(),
                offset: 0.5 * (g.scale.x * g.scale.y).sqrt(),
            };
            (i, surface)
        })
        .collect()
}
