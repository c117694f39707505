//! Light transport against closed forms.

mod closed_forms;
mod invariants;
mod sampling;

use eagpt_scene::{Camera, Gaussian, Gaussians, Image};
use eagpt_testkit::gaussians::{cube, look_at, material, rectangle};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::{Integrator, LightOptions, Tracer};
use glam::{DVec3, Vec3};

fn render(gaussians: &Gaussians, camera: &Camera, integrator: Integrator, seed: u64) -> Image<3> {
    let options = LightOptions {
        seed,
        ..LightOptions::default()
    };
    render_with(gaussians, camera, integrator, &options)
}

fn render_with(
    gaussians: &Gaussians,
    camera: &Camera,
    integrator: Integrator,
    options: &LightOptions,
) -> Image<3> {
    let scene = CpuScene::new(gaussians);
    scene
        .render(camera, &integrator, options)
        .expect("the CPU engine does not fail")
        .radiance
}

fn path(num_samples: u32, max_bounces: u32) -> Integrator {
    Integrator::Path {
        num_samples,
        max_bounces,
        roulette_from: None,
    }
}

/// Mean of the first channel and the standard error of that mean over pixels.
fn mean_and_error(image: &Image<3>) -> (f64, f64) {
    let n = image.pixels().len() as f64;
    let mean = image.pixels().iter().map(|p| f64::from(p[0])).sum::<f64>() / n;
    let variance = image
        .pixels()
        .iter()
        .map(|p| (f64::from(p[0]) - mean).powi(2))
        .sum::<f64>()
        / (n - 1.0);
    (mean, (variance / n).sqrt())
}

fn inside_view() -> Camera {
    look_at(DVec3::ZERO, DVec3::new(0.2, -1.0, -0.6), 24, 24)
}

fn lit_room(scale: f32) -> Gaussians {
    let room = cube(1.0, 0.08, |side| {
        let color = Vec3::new(0.6, 0.5 + 0.3 * side.x, 0.5 - 0.3 * side.y);
        material(Vec3::splat(0.3), 0.0, color)
    });
    let lamp = rectangle(
        Vec3::Z * 0.97,
        Vec3::X * 0.4,
        Vec3::Y * 0.4,
        0.06,
        material(Vec3::splat(5.0), 1.0, Vec3::ZERO),
    );
    room.into_iter()
        .chain(lamp)
        .map(|g| Gaussian {
            position: g.position * scale,
            scale: g.scale * scale,
            ..g
        })
        .collect()
}
