//! Light transport in scenes with gloss, against answers that are known.

#![allow(clippy::unwrap_used, reason = "a test ends with its first surprise")]

use eagpt_scene::rng::{Purpose, RandomKey};
use eagpt_scene::{Camera, Gaussian, Gaussians, Gloss};
use eagpt_testkit::gaussians::{look_at, material, rectangle, sphere};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::bsdf::Bsdf;
use eagpt_trace::transport::glossy::GlossyPoint;
use eagpt_trace::transport::start::Surface;
use eagpt_trace::transport::{Hits, Sampling};
use eagpt_trace::{Integrator, LightOptions, Ray, RenderedView, Tracer};
use glam::{DVec3, Vec3};

const PATH: Integrator = Integrator::Path {
    num_samples: 64,
    max_bounces: 6,
    roulette_from: None,
};

fn glossy(albedo: Vec3, specular: Vec3, roughness: f32) -> Gaussian {
    Gaussian {
        gloss: Gloss {
            specular,
            roughness,
        },
        ..material(Vec3::ZERO, 0.0, albedo)
    }
}

fn render(
    scene: &CpuScene,
    camera: &Camera,
    integrator: Integrator,
    sampling: Sampling,
) -> RenderedView {
    let options = LightOptions {
        sampling,
        hits: Hits::Blended,
        ..LightOptions::default()
    };
    scene.render(camera, &integrator, &options).unwrap()
}

/// A camera inside the unit sphere.
fn camera_in_furnace() -> Camera {
    look_at(
        DVec3::new(0.3, -0.5, 0.1),
        DVec3::new(0.2, 0.9, 0.3),
        24,
        16,
    )
}

fn mean(view: &RenderedView) -> Vec3 {
    let pixels = view.radiance.pixels();
    pixels.iter().map(|p| Vec3::from(*p)).sum::<Vec3>() / pixels.len() as f32
}

/// In a closed room whose walls carry the radiance 1, walls that reflect everything show 1 after
/// one bounce: head-on and at grazing angles, rough and smooth.
#[test]
fn one_bounce_in_a_furnace_is_white() {
    let camera = camera_in_furnace();
    for (specular, roughness) in [(0.04, 0.1), (0.9, 0.3), (0.5, 0.9)] {
        let wall = Gaussian {
            radiance: Vec3::ONE,
            ..glossy(
                Vec3::ONE,
                Vec3::new(specular, 0.5 * specular, 1.0),
                roughness,
            )
        };
        let scene = CpuScene::new(&sphere(1500, 1.0, |_| wall));
        let integrator = Integrator::OneBounce { num_samples: 64 };
        let view = render(&scene, &camera, integrator, Sampling::NextEvent);
        let light = mean(&view);
        // The discs let some rays through: as much as is missing without gloss.
        assert!((light - Vec3::ONE).abs().max_element() < 0.01, "{light}");
        assert_eq!(view.guides.len(), camera.num_pixels());
    }
}

/// A gather splits the radiance that walls carry into what they scatter, which it keeps, and what
/// they mirror, which it samples: together as much.
#[test]
fn a_gather_in_a_furnace_is_white() {
    let camera = camera_in_furnace();
    for (specular, roughness) in [(0.04, 0.1), (0.9, 0.3), (0.5, 0.9)] {
        let wall = Gaussian {
            radiance: Vec3::ONE,
            ..glossy(Vec3::ONE, Vec3::splat(specular), roughness)
        };
        let scene = CpuScene::new(&sphere(1500, 1.0, |_| wall));
        let integrator = Integrator::Gather { num_samples: 64 };
        let view = render(&scene, &camera, integrator, Sampling::NextEvent);
        let light = mean(&view);
        assert!((light - Vec3::ONE).abs().max_element() < 0.01, "{light}");
        let exact = view.guides.iter().map(|guide| guide.exact).sum::<Vec3>();
        let exact = exact / view.guides.len() as f32;
        assert!(exact.max_element() < 1.0 - 0.3 * specular, "{exact}");
        // The same light, told pixel by pixel.
        let options = LightOptions::default();
        let mirrored = scene.mirrored(&camera, &view.features, 64, &options);
        let sum = mirrored.iter().map(|pixel| pixel.light).sum::<Vec3>();
        let sum = sum / mirrored.len() as f32 + exact;
        assert!((sum - light).abs().max_element() < 0.01, "{sum} {light}");
    }
}

/// A lamp over a glossy floor, between walls.
fn lit_corner() -> Gaussians {
    let mut discs = Vec::new();
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let floor = glossy(Vec3::new(0.5, 0.3, 0.2), Vec3::splat(0.3), 0.35);
    discs.extend(rectangle(Vec3::ZERO, x, y, 0.1, floor));
    let wall = material(Vec3::ZERO, 0.0, Vec3::splat(0.7));
    discs.extend(rectangle(y + z, x, z, 0.1, wall));
    let metal = glossy(Vec3::ZERO, Vec3::new(0.9, 0.7, 0.4), 0.5);
    discs.extend(rectangle(x + z, y, z, 0.1, metal));
    let lamp = material(Vec3::splat(8.0), 1.0, Vec3::ZERO);
    discs.extend(rectangle(
        Vec3::new(0.2, 0.2, 1.6),
        0.25 * x,
        0.25 * y,
        0.05,
        lamp,
    ));
    discs.into_iter().collect()
}

/// Sampling of lamps changes the noise, not the mean.
#[test]
fn light_samples_keep_the_mean() {
    let scene = CpuScene::new(&lit_corner());
    let camera = look_at(
        DVec3::new(-1.2, -1.2, 0.9),
        DVec3::new(0.3, 0.3, 0.3),
        20,
        14,
    );
    let integrator = |num_samples| Integrator::Path {
        num_samples,
        max_bounces: 4,
        roulette_from: Some(2),
    };
    let both = render(&scene, &camera, integrator(128), Sampling::NextEvent);
    let bsdf_only = render(&scene, &camera, integrator(1024), Sampling::Cosine);
    let (a, b) = (mean(&both), mean(&bsdf_only));
    // The noise of the mean of 280 pixels with BSDF samples alone is about 1 %.
    assert!(
        (a - b).abs().max_element() < 0.03 * b.max_element(),
        "{a} {b}"
    );
}

/// A mirror on the floor below a ceiling that is red on one side and green on the other: a pixel
/// shows the half that its mirrored ray meets.
#[test]
fn a_mirror_shows_the_image_behind_it() {
    let (x, y) = (Vec3::X, Vec3::Y);
    let mirror = glossy(Vec3::ZERO, Vec3::ONE, 0.0);
    let lit = |radiance: Vec3| material(radiance, 1.0, Vec3::ZERO);
    let (red, green) = (Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 3.0, 0.0));
    let mut discs = rectangle(Vec3::ZERO, 2.0 * x, 2.0 * y, 0.1, mirror);
    let half = |side: f32, color: Vec3| {
        let middle = Vec3::new(4.0 * side, 0.0, 2.0);
        rectangle(middle, 4.0 * x, 8.0 * y, 0.2, lit(color))
    };
    discs.extend(half(-1.0, red));
    discs.extend(half(1.0, green));
    let scene = CpuScene::new(&discs.into_iter().collect());
    let camera = look_at(
        DVec3::new(0.2, -1.0, 1.0),
        DVec3::new(0.0, 0.0, 0.0),
        21,
        15,
    );
    // Half of the samples go to emitters: 256 are stratified into exactly as many.
    let baked = Integrator::OneBounce { num_samples: 256 };
    let gather = Integrator::Gather { num_samples: 256 };
    for (integrator, sampling) in [
        (Integrator::ZeroBounce, Sampling::NextEvent),
        (baked, Sampling::NextEvent),
        (gather, Sampling::NextEvent),
        (PATH, Sampling::NextEvent),
        (PATH, Sampling::Cosine),
    ] {
        let view = render(&scene, &camera, integrator, sampling);
        let frame = camera.ray_frame();
        let mut compared = 0;
        for (i, pixel) in view.radiance.pixels().iter().enumerate() {
            let (column, row) = (i as u32 % camera.width, i as u32 / camera.width);
            let d = frame.direction(column as f32 + 0.5, row as f32 + 0.5);
            // Down to the floor at z = 0, and up again to z = 2; discs are soft where colours meet.
            let floor = frame.origin - d * (frame.origin.z / d.z);
            let ceiling = floor.x + d.x * (2.0 / -d.z);
            if d.z > -0.2 || floor.x.abs().max(floor.y.abs()) > 1.7 || ceiling.abs() < 0.9 {
                continue;
            }
            let expected = if ceiling < 0.0 { red } else { green };
            let off = (Vec3::from(*pixel) - expected).abs().max_element();
            assert!(
                off < 0.03 * expected.max_element(),
                "{integrator:?} {pixel:?} at {ceiling}"
            );
            compared += 1;
        }
        assert!(compared > 100, "{compared}");
    }
}

/// Lobes of several eyes that are sampled together give each eye the integral of its own, taken
/// over a grid of directions with blended rays; an eye behind a wall sees nothing.
#[test]
fn lobes_towards_several_eyes_are_integrals() {
    let mut scene = lit_corner();
    scene.radiances = (scene.iter())
        .map(|g| match g.emission > 0.0 {
            true => g.radiance,
            false => Vec3::new(0.4, 0.8, 0.6),
        })
        .collect();
    let scene = CpuScene::new(&scene);
    let surface = Surface {
        position: Vec3::new(0.1, 0.0, 0.0),
        normal: Vec3::Z,
        offset: 0.05,
    };
    let point = GlossyPoint {
        surface,
        gloss: Gloss {
            specular: Vec3::new(0.8, 0.5, 0.3),
            roughness: 0.45,
        },
        eyes: vec![
            Vec3::new(-0.9, -1.5, 1.4),
            Vec3::new(0.0, 3.0, 0.5),
            Vec3::new(-0.6, -1.5, 1.2),
            Vec3::new(-2.0, 0.3, 0.4),
        ],
    };
    let key = RandomKey::new(5, Purpose::Bake, 2);
    let points = std::slice::from_ref(&point);
    let found = scene.mirrored_towards(points, 4096, key).unwrap();
    // Steps of equal solid angle.
    const STEPS: (u32, u32) = (128, 256);
    let direction = |i: u32| {
        let z = ((i / STEPS.1) as f32 + 0.5) / STEPS.0 as f32;
        let angle = ((i % STEPS.1) as f32 + 0.5) / STEPS.1 as f32 * std::f32::consts::TAU;
        Vec3::new(angle.cos(), angle.sin(), 0.0) * (1.0 - z * z).sqrt() + z * Vec3::Z
    };
    let directions: Vec<Vec3> = (0..STEPS.0 * STEPS.1).map(direction).collect();
    let rays: Vec<Ray> = directions.iter().map(|&d| surface.ray(d)).collect();
    let met = scene.trace_rays(&rays).unwrap();
    let solid_angle = std::f32::consts::TAU / directions.len() as f32;
    for (eye, found) in point.eyes.iter().zip(&found[0]) {
        if eye.y > 1.0 {
            assert_eq!(*found, None);
            continue;
        }
        let to_eye = (*eye - surface.position).normalize();
        let lobe = Bsdf::new(surface.normal, to_eye, Vec3::ZERO, point.gloss);
        let of = directions.iter().zip(&met);
        let light: Vec3 = of
            .map(|(&d, met)| lobe.evaluate(d).0 * met.radiance())
            .sum();
        let (light, found) = (light * solid_angle, found.unwrap());
        assert_eq!(found.reflectance, lobe.albedo());
        // Noise of 16,384 samples; edges of discs are hit or missed in place of blended.
        let off = (found.light - light).abs().max_element();
        assert!(off < 0.03 * light.max_element(), "{} {light}", found.light);
    }
}

/// Without gloss a gather is the radiance that Gaussians carry, and where there is some, of those
/// without it.
#[test]
fn a_gather_keeps_diffuse_surfaces() {
    let mut scene: Gaussians = lit_corner();
    scene.radiances = (0..scene.len())
        .map(|i| Vec3::new(0.1 * (i % 7) as f32, 0.5, 0.3))
        .collect();
    let camera = look_at(
        DVec3::new(-1.2, -1.2, 0.9),
        DVec3::new(0.3, 0.3, 0.3),
        20,
        14,
    );
    let gather = Integrator::Gather { num_samples: 4 };
    let view = |scene: &Gaussians, integrator| {
        render(
            &CpuScene::new(scene),
            &camera,
            integrator,
            Sampling::NextEvent,
        )
    };
    let (glossy, plain) = (view(&scene, gather), view(&scene, Integrator::ZeroBounce));
    let same = (glossy.radiance.pixels().iter()).zip(plain.radiance.pixels());
    let num_same = same.filter(|(a, b)| a == b).count();
    assert!(num_same > 40 && num_same < 250, "{num_same}");
    scene.gloss.clear();
    assert_eq!(view(&scene, gather), view(&scene, Integrator::ZeroBounce));
}

/// Gloss of no Gaussian is no gloss: the same bits as of a scene that says nothing of it.
#[test]
fn scenes_without_gloss_render_as_before() {
    let mut plain: Gaussians = lit_corner()
        .iter()
        .map(|g| Gaussian {
            gloss: Gloss::NONE,
            ..g
        })
        .collect();
    assert!(plain.gloss.is_empty());
    let camera = look_at(
        DVec3::new(-1.2, -1.2, 0.9),
        DVec3::new(0.3, 0.3, 0.3),
        12,
        8,
    );
    let before = render(&CpuScene::new(&plain), &camera, PATH, Sampling::NextEvent);
    plain.gloss = vec![
        Gloss {
            specular: Vec3::ZERO,
            roughness: 0.1
        };
        plain.len()
    ];
    let after = render(&CpuScene::new(&plain), &camera, PATH, Sampling::NextEvent);
    assert_eq!(before, after);
    assert!(after.guides.is_empty());
}
