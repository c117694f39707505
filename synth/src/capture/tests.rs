//! Captures against their own truth, read by an independent decoder.

use crate::capture::Parts;
use crate::photograph::SampleNoise;
use crate::scenes::SCENES;
use crate::{SceneScript, SynthOptions, simulate};
use eagpt_colmap::model::{Model, Observations};
use eagpt_scene::Dataset;
use glam::{DQuat, DVec3};
use std::path::Path;

fn scene(name: &str) -> SceneScript {
    let scene = crate::scenes::embedded(name).unwrap();
    SceneScript::parse(Path::new(name), scene.toml.as_bytes()).unwrap()
}

#[test]
fn embedded_scenes_have_cameras_with_room_around_them() {
    for embedded in SCENES {
        let script = scene(embedded.name);
        let [low, high] = script.room.bounds();
        for (index, camera) in script.cameras.cameras().iter().enumerate() {
            let eye = camera.origin();
            assert!((eye - low).min_element() > 0.1 && (high - eye).min_element() > 0.1);
            let frame = camera.ray_frame();
            for (x, y) in [(0.1, 0.1), (0.5, 0.5), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9)] {
                let (width, height) = (camera.width as f32, camera.height as f32);
                let hit = script
                    .room
                    .meet(eye, frame.direction(x * width, y * height))
                    .unwrap();
                let name = embedded.name;
                assert!(
                    !hit.is_inside && hit.distance > 0.15,
                    "{name} {index}: {hit:?}"
                );
            }
        }
    }
}

#[test]
fn every_light_is_on_in_some_condition() {
    for embedded in SCENES {
        let script = scene(embedded.name);
        for light in script.room.lights() {
            let brightest = light.radiance.iter().map(|of| of.max_element());
            assert!(brightest.fold(0.0, f32::max) > 1.0, "{}", light.name);
        }
    }
}

/// Mean response of each filter over a picture, from the shots of a bracket and from the truth.
#[test]
fn brackets_hold_the_light_of_the_truth() {
    let dir = tempfile::tempdir().unwrap();
    let script = scene("small-room");
    let options = SynthOptions {
        size: Some([60, 40]),
        num_views: Some(2),
        num_samples: 16,
        num_points: 100,
        ..SynthOptions::default()
    };
    let mut num_told = 0;
    let summary = simulate(&script, dir.path(), &options, &mut |_| num_told += 1).unwrap();
    assert_eq!((summary.num_shots, num_told), (20, 3));
    for file in &summary.files {
        assert!(dir.path().join(file).is_file(), "{}", file.display());
    }
    let sensor = crate::rig::Sensor::new(&script.rig, script.room.brightest());
    let matrix = script.rig.camera_from_rec709();
    for condition in &script.conditions {
        let truth = Dataset::open(&dir.path().join("truth").join(condition)).unwrap();
        let view = truth.load_view(1).unwrap();
        let path = dir.path().join(condition).join("p001_0.dng");
        let shot = rawloader::decode_file(path).unwrap();
        let rawloader::RawImageData::Integer(samples) = shot.data else {
            panic!("float samples");
        };
        assert_eq!((shot.width, shot.height), (120, 80));
        let (mut found, mut wanted) = ([0.0; 3], [0.0; 3]);
        for (index, sample) in samples.iter().enumerate() {
            let (x, y) = (index % shot.width, index / shot.width);
            let color = shot.cfa.color_at(y, x);
            let (dx, dy) = (x as f64 + 0.5 - 60.0, y as f64 + 0.5 - 40.0);
            let falloff = script
                .rig
                .falloff((dx * dx + dy * dy) / (60.0_f64.powi(2) + 40.0_f64.powi(2)));
            let electrons = (f64::from(*sample) - 512.0) * sensor.electrons_of_step() / falloff;
            // Inverse of the exposure: light on a neutral surface from electrons.
            found[color] += electrons / 50_000.0 * sensor.clip_of_second() / 0.0025;
            let light = view.radiance.get(x as u32 / 2, y as u32 / 2);
            wanted[color] += (0..3)
                .map(|i| matrix[color][i] * f64::from(light[i]))
                .sum::<f64>();
        }
        for color in 0..3 {
            let ratio = found[color] / wanted[color];
            // Filters look at a quarter or a half of the pixels each: edges of the lamp fall on
            // them unevenly.
            assert!((ratio - 1.0).abs() < 0.03, "{condition} {color}: {ratio}");
        }
    }
}

/// Filtered light is the light of many samples, less noisy than what it was filtered from.
#[test]
fn the_filter_takes_noise_and_leaves_light() {
    let script = scene("small-room");
    let take = |num_samples, noise, seed| {
        let dir = tempfile::tempdir().unwrap();
        let options = SynthOptions {
            parts: Parts::Truth,
            size: Some([60, 40]),
            num_views: Some(2),
            num_samples,
            noise,
            seed,
            ..SynthOptions::default()
        };
        simulate(&script, dir.path(), &options, &mut |_| ()).unwrap();
        let dataset = Dataset::open(&dir.path().join("truth/evening")).unwrap();
        let view = dataset.load_view(1).unwrap();
        let emission = view.emission.unwrap();
        let pixels = view.radiance.pixels().iter().zip(emission.pixels());
        let matt = pixels.filter(|(_, mask)| mask[0] == 0.0);
        matt.map(|(rgb, _)| f64::from(rgb[1])).collect::<Vec<f64>>()
    };
    let reference = take(256, SampleNoise::Kept, 1);
    // The median: at edges of the lamp and of patterns a pixel depends on where its rays fell,
    // whatever is filtered.
    let error = |values: &[f64]| {
        let pairs = values.iter().zip(&reference);
        let mut errors: Vec<f64> = pairs.map(|(a, b)| (a / b - 1.0).abs()).collect();
        errors.sort_by(f64::total_cmp);
        errors[errors.len() / 2]
    };
    let kept = take(16, SampleNoise::Kept, 2);
    let filtered = take(16, SampleNoise::Filtered, 2);
    let (before, after) = (error(&kept), error(&filtered));
    assert!(after < 0.75 * before, "{after} of {before}");
    let sum = |values: &[f64]| values.iter().sum::<f64>();
    let bias = sum(&filtered) / sum(&reference) - 1.0;
    assert!(bias.abs() < 0.02, "{bias}");
}

/// The model read back, moved into the world by the similarity that is told, against the true
/// cameras.
#[test]
fn the_colmap_model_is_the_capture_in_another_frame() {
    let dir = tempfile::tempdir().unwrap();
    let script = scene("furnished-room");
    let options = SynthOptions {
        parts: Parts::Capture,
        size: Some([48, 32]),
        num_views: Some(10),
        num_samples: 4,
        ..SynthOptions::default()
    };
    simulate(&script, dir.path(), &options, &mut |_| ()).unwrap();
    let model = Model::read(&dir.path().join("colmap/sparse/0"), Observations::Keep).unwrap();
    assert_eq!((model.cameras.len(), model.images.len()), (1, 10));
    let num_points = model.points.len();
    assert!(num_points > 200, "{num_points}");
    let text = std::fs::read(dir.path().join("synth.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_slice(&text).unwrap();
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let told = &truth["model_from_world"];
    let scale = number(&told["scale"]);
    let translation = [0, 1, 2].map(|i| number(&told["translation"][i]));
    let [w, x, y, z] = [0, 1, 2, 3].map(|i| number(&told["rotation"][i]));
    let rotation = DQuat::from_xyzw(x, y, z, w);
    let cameras = options.plan(&script).cameras();
    for (image, camera) in model.images.iter().zip(&cameras) {
        let centre = camera.world_from_camera.translation;
        let wanted = scale * (rotation * centre) + DVec3::from_array(translation);
        // Six standard deviations of 1 mm on three axes.
        let error = image.camera_from_world.centre().distance(wanted) / scale;
        assert!(error < 0.006, "{}: {error} m", image.name);
    }
    assert_eq!(model.images[3].name, "p003.png");
    let lens = &model.cameras[0].lens;
    let mut errors = Vec::new();
    for point in &model.points {
        for element in &point.track {
            let image = &model.images[element.image.0 as usize - 1];
            let feature = &image.observations[element.observation as usize];
            assert_eq!(feature.point, Some(point.id));
            let at = lens.project(image.camera_from_world.apply(point.position));
            errors.push(at.map_or(f64::INFINITY, |at| at.distance(feature.at)));
        }
    }
    errors.sort_by(f64::total_cmp);
    // Features 0.4 pixels off, points about a pixel: some 1.3 pixels of Rayleigh's distribution.
    let median = errors[errors.len() / 2];
    assert!((0.4..2.0).contains(&median), "{median}");
}
