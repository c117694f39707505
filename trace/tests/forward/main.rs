//! Forward tracing against the brute-force oracle in double precision, and the fast searches
//! against each other.

mod draws;
mod pictures;
mod searches;

use eagpt_testkit::gaussians::look_at;
use glam::DVec3;

fn cameras() -> Vec<eagpt_scene::Camera> {
    [
        (DVec3::new(3.0, 0.2, 0.4), DVec3::ZERO),
        (DVec3::new(0.1, -0.2, 0.05), DVec3::new(1.0, 0.3, -0.4)),
        (DVec3::new(-1.5, -1.5, 1.5), DVec3::new(0.2, 0.0, -0.1)),
        (DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO),
    ]
    .map(|(origin, target)| look_at(origin, target, 37, 29))
    .to_vec()
}
