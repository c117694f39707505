use super::*;
use eagpt_scene::dataset::{DatasetInfo, RADIANCE_DIR, TRANSFORMS_FILE, write_transforms};
use eagpt_scene::light_basis::{LightGroups, NO_LIGHT, lights_file_beside};
use eagpt_scene::{Camera, exr};
use eagpt_testkit::gaussians::{look_at, random_cloud};
use glam::Vec3;
use std::path::Path;

/// A cloud lit by three lights, as files; the third lights nothing and is nowhere to be seen.
fn write_scene(folder: &Path) -> (PathBuf, LightBasis) {
    let mut scene = random_cloud(400, 3);
    let mut of = vec![NO_LIGHT; scene.len()];
    for (i, emission) in scene.emissions.iter_mut().enumerate() {
        *emission = f32::from(u8::from(i < 40));
        if i < 40 {
            of[i] = (i % 2) as u32;
        }
    }
    // Out of all pictures.
    scene.positions[39] = Vec3::splat(500.0);
    of[39] = 2;
    let names = ["left", "right", "far"].map(str::to_owned).to_vec();
    let groups = LightGroups { names, of };
    let light = |i: usize| -> [Vec3; 3] {
        let t = i as f32;
        let colour =
            |t: f32| Vec3::new(1.0 + t.sin(), 1.5 + t.cos(), 1.0) * (0.2 + (2.0 * t).sin().abs());
        if i < 40 {
            [Vec3::ZERO; 3]
        } else {
            [colour(t), colour(1.7 * t), Vec3::ZERO]
        }
    };
    let reflected: Vec<[Vec3; 3]> = (0..scene.len()).map(light).collect();
    let basis = LightBasis::new(&scene, &groups, reflected.as_flattened());
    let path = folder.join("scene.ply");
    ply::write_gaussians(&path, &scene).unwrap();
    basis.write(&lights_file_beside(&path)).unwrap();
    (path, basis)
}

fn cameras() -> Vec<(String, Camera)> {
    let eyes = [[3.0, 0.5, 0.4], [-0.5, 3.0, -0.4], [0.3, -2.5, 1.5]];
    let camera = |eye: [f64; 3]| look_at(eye.into(), glam::DVec3::ZERO, 32, 24);
    (0..)
        .zip(eyes)
        .map(|(i, eye)| (format!("{i:03}"), camera(eye)))
        .collect()
}

/// A dataset of views of the scene with lights at these factors; `change` has a hand in each.
fn photograph(
    folder: &Path,
    scene: &Path,
    mut basis: LightBasis,
    factors: [[f32; 3]; 3],
    change: impl Fn(usize, &mut [f32; 3]),
) -> PathBuf {
    let mut gaussians = ply::read_gaussians(scene).unwrap();
    for (k, factor) in factors.into_iter().enumerate() {
        basis.set_factor(k, factor.into());
    }
    gaussians.radiances = basis.radiances();
    let tracer = Device::Cpu.scene(&gaussians).unwrap();
    let images = folder.join(RADIANCE_DIR);
    std::fs::create_dir_all(&images).unwrap();
    for (name, camera) in cameras() {
        let mut image = tracer.gbuffer(&camera).unwrap().radiance();
        for (i, pixel) in image.pixels_mut().iter_mut().enumerate() {
            change(i, pixel);
        }
        let path = images.join(format!("{name}.exr"));
        exr::write_rgb(&path, &image, exr::Precision::Float).unwrap();
    }
    let info = DatasetInfo::default();
    write_transforms(&folder.join(TRANSFORMS_FILE), &cameras(), &info).unwrap();
    folder.to_owned()
}

fn request(scene: &Path, reference: &Path) -> LightFitRequest {
    LightFitRequest {
        scene: scene.to_owned(),
        lights: lights_file_beside(scene),
        reference: reference.to_owned(),
        before: None,
        views: FitViews::Named(cameras().into_iter().map(|(name, _)| name).collect()),
        device: Device::Cpu,
    }
}

fn assert_factors(found: &LightFit, expected: [[f64; 3]; 2], within: f64) {
    for (light, expected) in found.lights.iter().zip(expected) {
        for (found, expected) in light.factor.iter().zip(expected) {
            assert!(
                (found - expected).abs() < within,
                "{light:?}, not {expected:?}"
            );
        }
    }
}

#[test]
fn an_unseen_mix_is_found() {
    let root = tempfile::tempdir().unwrap();
    let (scene, basis) = write_scene(root.path());
    let mix = [[0.5, 1.5, 2.0], [0.0, 0.25, 3.0], [1.0; 3]];
    let expected = [[0.5, 1.5, 2.0], [0.0, 0.25, 3.0]];
    let reference = photograph(
        &root.path().join("mix"),
        &scene,
        basis.clone(),
        mix,
        |_, _| (),
    );
    let mut request = request(&scene, &reference);
    let mut told = Vec::new();
    let found = fit_lights(&request, &mut |progress| told.push(progress)).unwrap();
    assert_eq!(told.len(), 4);
    assert_factors(&found, expected, 1e-5);
    assert!(found.unexplained < 1e-5 && found.num_values == 3 * 3 * 32 * 24);
    assert!(
        found
            .lights
            .iter()
            .flat_map(|light| light.error)
            .all(|error| error < 1e-5)
    );
    let seen: Vec<bool> = found.lights.iter().map(|light| light.is_seen).collect();
    assert_eq!(seen, [true, true, false]);
    assert_eq!(found.lights[2].factor, [0.0; 3]);

    // Three views are all there are, and two tell nearly as much.
    request.views = FitViews::Best(3);
    assert_eq!(fit_lights(&request, &mut |_| ()).unwrap(), found);
    request.views = FitViews::Best(2);
    let some = fit_lights(&request, &mut |_| ()).unwrap();
    assert_eq!(some.views.len(), 2);
    assert_factors(&some, expected, 1e-5);
    request.views = FitViews::Best(4);
    let error = fit_lights(&request, &mut |_| ()).unwrap_err().to_string();
    assert!(
        error.contains("4 views are asked for, there are 3"),
        "{error}"
    );
    request.views = FitViews::Best(3);

    // A photograph of the scene reflects other than the scene does. The same photographs in the
    // light of the bake say by how much.
    let other = |i: usize, pixel: &mut [f32; 3]| {
        for value in pixel {
            *value *= 1.3 + 0.1 * (i as f32 / 40.0).sin();
        }
    };
    let wrong = photograph(
        &root.path().join("wrong"),
        &scene,
        basis.clone(),
        mix,
        other,
    );
    let before = root.path().join("before");
    let before = photograph(&before, &scene, basis.clone(), [[1.0; 3]; 3], other);
    request.reference = wrong;
    let alone = fit_lights(&request, &mut |_| ()).unwrap();
    let factor = alone.lights[0].factor[2];
    assert!((2.4..2.8).contains(&factor), "{factor}");
    assert!(alone.unexplained > 0.01);
    request.before = Some(before.clone());
    let relative = fit_lights(&request, &mut |_| ()).unwrap();
    assert_factors(&relative, expected, 0.06);
    for light in &relative.lights[..2] {
        let before = light.before.unwrap();
        assert!(
            before.iter().all(|one| (1.15..1.45).contains(one)),
            "{before:?}"
        );
    }
    // Together they are surer.
    assert!(relative.lights[0].error[2] < alone.lights[0].error[2]);

    request.views = FitViews::Named(vec!["009".to_owned()]);
    let error = fit_lights(&request, &mut |_| ()).unwrap_err().to_string();
    assert!(
        error.contains("transforms.json") && error.contains("no view `009`"),
        "{error}"
    );
    request.views = FitViews::Named(vec!["000".to_owned()]);
    request.reference = photograph(
        &root.path().join("dark"),
        &scene,
        basis,
        [[0.0; 3]; 3],
        |_, _| (),
    );
    let error = fit_lights(&request, &mut |_| ()).unwrap_err().to_string();
    assert!(error.contains("nothing is known and bright"), "{error}");
}
