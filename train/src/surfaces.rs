//! The surface that each Gaussian is part of: where light arrives for it.
//!
//! A Gaussian's own centre and normal are noisy samples of the surface that its neighbours and it make up together. That surface is what
//! a camera ray blends; each Gaussian takes it from the pixel that sees it best.

use eagpt_scene::{Camera, Gaussian};
use eagpt_trace::Ray;
use eagpt_trace::cpu::CameraRecord;
use eagpt_trace::cpu::camera::{HitSearch, Keep};
use eagpt_trace::surfel::SurfelSet;
use eagpt_trace::transport::RayTracer;
use eagpt_trace::transport::start::Surface;
use glam::Mat3;

/// Half the slab of a lone Gaussian's surface, in its sizes: what is nearer is taken for the same wall.
const LONE_SLAB: f32 = 0.5;

/// The best-seen surfaces so far.
pub(crate) struct BestSeen {
    best: Vec<Option<(f32, Surface)>>,
    /// Of the last camera: memory for the next.
    record: CameraRecord,
}

impl BestSeen {
    /// Nothing seen of `num` Gaussians.
    pub(crate) fn new(num: usize) -> Self {
        Self {
            best: vec![None; num],
            record: CameraRecord::default(),
        }
    }

    /// Looks through every pixel of `camera`: what weighs more in one of them than anywhere before is seen better there.
    pub(crate) fn look(&mut self, set: &SurfelSet, camera: &Camera) {
        let sums = (self.record).trace(set, camera, HitSearch::Tiles, Keep::Record);
        let frame = camera.ray_frame();
        for found in self.record.contributions(|_| 0.0) {
            let best = &mut self.best[found.gaussian as usize];
            let (weight, pixel) = (found.largest_weight, found.pixel);
            if best.is_some_and(|(most, _)| weight <= most) {
                continue;
            }
            let (x, y) = (pixel % camera.width, pixel / camera.width);
            let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5);
            if let Some(surface) =
                Surface::at(frame.origin, direction, &sums.pixels[pixel as usize])
            {
                *best = Some((weight, surface));
            }
        }
    }

    /// The surface of each Gaussian; `None` where no camera saw it.
    pub(crate) fn finish(self) -> impl ExactSizeIterator<Item = Option<Surface>> {
        self.best.into_iter().map(|found| Some(found?.1))
    }
}

/// The surface of a Gaussian that no camera sees: its own plane, from the side with more room before it.
pub(crate) fn lone(scene: &impl RayTracer, gaussian: &Gaussian) -> Surface {
    let size = (gaussian.scale.x * gaussian.scale.y).sqrt();
    let normal = Mat3::from_quat(gaussian.rotation).z_axis;
    let sides = [normal, -normal].map(|normal| Surface {
        position: gaussian.position,
        normal,
        slab: LONE_SLAB * size,
    });
    let [front, back] = sides.map(|side| room_before(scene, &side.ray(side.normal)));
    if front >= back { sides[0] } else { sides[1] }
}

/// How far a ray gets before it meets something rather than nothing.
fn room_before(scene: &impl RayTracer, ray: &Ray) -> f32 {
    let met = scene.trace(ray);
    if met.alpha() > 0.5 {
        met.mean_distance()
    } else {
        f32::INFINITY
    }
}
