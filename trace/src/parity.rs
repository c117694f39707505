//! How far an engine is from the model: a scene that is known everywhere, traced by the engine and
//! by the oracle.

use crate::error::TraceError;
use crate::oracle::{self, OracleGaussian};
use crate::tracer::Tracer;
use eagpt_scene::{Camera, Gaussians, random_cloud};
use glam::DAffine3;
use serde::Serialize;
use std::time::{Duration, Instant};

/// Largest difference of an engine in single precision, relative to 1 plus the oracle's value: four
/// times the 6e-5 that were seen, on rays that graze thin Gaussians.
pub const PARITY_TOLERANCE: f64 = 2.5e-4;

/// Time for measuring a rate.
const RATE_BUDGET: Duration = Duration::from_secs(3);

/// Result of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parity {
    /// Compute device.
    pub device: String,
    /// Rays that were compared; those whose hits rounding may swap were not.
    pub num_compared: usize,
    /// Largest difference, relative to 1 plus the oracle's value.
    pub worst: f64,
    /// Whether one thread gives the bits of all threads.
    pub is_repeatable: bool,
    /// Camera rays a second through 50,000 Gaussians: of 240 by 160 pixels, or fewer where that
    /// would take seconds.
    pub rays_per_s: f64,
}

impl Parity {
    /// Whether the engine is right.
    pub fn is_good(&self) -> bool {
        self.is_repeatable && self.num_compared > 0 && self.worst <= PARITY_TOLERANCE
    }
}

/// Compares the engine that `new` makes; takes about a second, of engines that are slow some more.
///
/// # Errors
/// Those of the engine, or [`TraceError::Device`] if a pool of one thread cannot be made.
pub fn compare<T: Tracer>(
    new: impl Fn(&Gaussians) -> Result<T, TraceError> + Sync,
) -> Result<Parity, TraceError> {
    let cloud = random_cloud(700, 3);
    let camera = camera(48, 32);
    let engine = new(&cloud)?;
    let seen = engine.gbuffer(&camera)?;
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|error| TraceError::Device {
            device: engine.device().name(),
            problem: error.to_string(),
        })?;
    let alone = one.install(|| new(&cloud)?.gbuffer(&camera))?;

    let gaussians: Vec<OracleGaussian> = cloud.iter().map(|g| OracleGaussian::from(&g)).collect();
    let frame = camera.ray_frame();
    let origin = frame.origin.as_dvec3();
    let (mut num_compared, mut worst) = (0, 0.0_f64);
    for (pixel, features) in seen.pixels.iter().enumerate() {
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let direction = frame.direction(x as f32 + 0.5, y as f32 + 0.5).as_dvec3();
        if oracle::is_ambiguous(&oracle::hits(&gaussians, origin, direction)) {
            continue;
        }
        num_compared += 1;
        for (got, wanted) in features
            .0
            .iter()
            .zip(oracle::trace(&gaussians, origin, direction))
        {
            worst = worst.max((f64::from(*got) - wanted).abs() / (1.0 + wanted.abs()));
        }
    }

    let large = new(&random_cloud(50_000, 5))?;
    Ok(Parity {
        device: engine.device().name(),
        num_compared,
        worst,
        is_repeatable: alone == seen,
        rays_per_s: rays_per_s(&large)?,
    })
}

/// Camera rays a second, of more and more pixels up to 240 by 160, as long as time is left.
fn rays_per_s<T: Tracer>(engine: &T) -> Result<f64, TraceError> {
    let begun = Instant::now();
    let (mut rate, mut took) = (0.0, Duration::ZERO);
    for scale in [1, 2, 4] {
        // Four times as many rays as before, twice.
        if begun.elapsed() + 8 * took > RATE_BUDGET {
            break;
        }
        let camera = camera(60 * scale, 40 * scale);
        let timed = || {
            let started = Instant::now();
            engine.gbuffer(&camera)?;
            Ok::<_, TraceError>(started.elapsed())
        };
        // The first run allocates buffers and, on GPUs, builds kernels: it counts only where there
        // is no time for a second.
        took = timed()?;
        if begun.elapsed() + took <= RATE_BUDGET {
            took = timed()?;
        }
        rate = camera.num_pixels() as f64 / took.as_secs_f64();
    }
    Ok(rate)
}

/// In the middle of the cloud, looking along z, 60° across.
fn camera(width: u32, height: u32) -> Camera {
    Camera::centred([width, height], 60.0_f64.to_radians(), DAffine3::IDENTITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blend::{Contribution, GradientMask, LocalGradient, PixelValue};
    use crate::camera_rays::CameraRays;
    use crate::cpu::CpuScene;
    use crate::device::Device;
    use crate::features::{Features, GBuffer};
    use crate::ray::Ray;
    use crate::transport::glossy::{GlossyPoint, Mirrored};
    use crate::transport::matrix::{Directions, Receiver, TransportMatrix};
    use crate::transport::{Integrator, LightOptions};
    use crate::view::RenderedView;
    use crate::weights::BlendWeights;
    use eagpt_scene::Gloss;
    use eagpt_scene::rng::RandomKey;
    use glam::Vec3;

    #[test]
    fn the_cpu_engine_is_right() {
        let found = compare(|gaussians| Ok(CpuScene::new(gaussians))).unwrap();
        assert!(found.is_good(), "{found:?}");
        assert!(
            found.num_compared > 500 && found.rays_per_s > 0.0,
            "{found:?}"
        );
    }

    /// An engine with an error of one part in a thousand.
    struct Wrong(CpuScene);

    impl Tracer for Wrong {
        fn device(&self) -> Device {
            self.0.device()
        }

        fn update(&mut self, gaussians: &Gaussians) -> Result<(), TraceError> {
            self.0.update(gaussians)
        }

        fn set_albedos(&mut self, albedos: &[Vec3]) -> Result<(), TraceError> {
            self.0.set_albedos(albedos)
        }

        fn record(&mut self, rays: &CameraRays) -> Result<GBuffer, TraceError> {
            self.0.record(rays)
        }

        fn adjoint(
            &mut self,
            rays: &CameraRays,
            d_features: &[Features],
            mask: GradientMask,
        ) -> Result<Vec<LocalGradient>, TraceError> {
            self.0.adjoint(rays, d_features, mask)
        }

        fn weights(
            &mut self,
            camera: &Camera,
            least: f32,
        ) -> Result<Option<BlendWeights>, TraceError> {
            self.0.weights(camera, least)
        }

        fn gbuffer(&self, camera: &Camera) -> Result<GBuffer, TraceError> {
            let mut features = self.0.gbuffer(camera)?;
            for pixel in &mut features.pixels {
                pixel.0 = pixel.0.map(|lane| 1.001 * lane);
            }
            Ok(features)
        }

        fn contributions(
            &self,
            camera: &Camera,
            value: PixelValue<'_>,
        ) -> Result<(GBuffer, Vec<Contribution>), TraceError> {
            self.0.contributions(camera, value)
        }

        fn trace_rays(&self, rays: &[Ray]) -> Result<Vec<Features>, TraceError> {
            self.0.trace_rays(rays)
        }

        fn are_free(&self, rays: &[Ray], distances: &[f32]) -> Result<Vec<bool>, TraceError> {
            self.0.are_free(rays, distances)
        }

        fn render(
            &self,
            camera: &Camera,
            integrator: &Integrator,
            options: &LightOptions,
        ) -> Result<RenderedView, TraceError> {
            self.0.render(camera, integrator, options)
        }

        fn trace_transport(
            &self,
            receivers: &[Receiver],
            directions: Directions,
            key: RandomKey,
        ) -> Result<TransportMatrix, TraceError> {
            self.0.trace_transport(receivers, directions, key)
        }

        fn pixel_gloss(&self, camera: &Camera) -> Result<Vec<Gloss>, TraceError> {
            self.0.pixel_gloss(camera)
        }

        fn mirrored_towards(
            &self,
            points: &[GlossyPoint],
            num_samples: u32,
            key: RandomKey,
        ) -> Result<Vec<Vec<Option<Mirrored>>>, TraceError> {
            self.0.mirrored_towards(points, num_samples, key)
        }
    }

    #[test]
    fn an_engine_that_is_off_is_found_out() {
        let found = compare(|gaussians| Ok(Wrong(CpuScene::new(gaussians)))).unwrap();
        assert!(!found.is_good() && found.is_repeatable, "{found:?}");
    }
}
