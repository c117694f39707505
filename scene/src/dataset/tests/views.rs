use super::*;
use crate::testing::assert_error;
use eagpt_testkit::test_data;
use std::sync::Arc;

#[test]
fn a_written_dataset_reads_back_the_same() {
    let folder = Folder::new();
    let mut views = [some_view("10/a", 0.0), some_view("b", 0.0)];
    views[1].clipped = Some(views[1].radiance.map(|_| [0.0, 1.0, 0.0]));
    let points = PointCloud {
        positions: vec![glam::Vec3::new(0.1, 0.2, 0.3)],
        colors_srgb8: vec![[9, 8, 7]],
    };
    let info = DatasetInfo {
        up_axis: Some(UpAxis::NegX),
        metres_per_unit: Some(0.1),
        train_names: Some(vec!["b".to_owned()]),
        validation_names: Some(vec!["10/a".to_owned(), "b".to_owned()]),
        test_names: Some(vec!["10/a".to_owned()]),
        aligned_from_model: Some([
            [0.1, -1.0 / 3.0, 0.0, 4.0],
            [1.0 / 3.0, 0.1, 0.0, -5e-7],
            [0.0, 0.0, 0.348, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]),
    };
    let mut writer = DatasetWriter::create(folder.root(), Precision::Float).unwrap();
    for view in &views {
        writer.write_view(view).unwrap();
    }
    writer.write_points(&points).unwrap();
    assert_error(folder.open(), &["transforms.json: missing"]);
    writer.finish(&info).unwrap();

    let dataset = folder.open().unwrap();
    for (index, view) in views.iter().enumerate() {
        assert_eq!(dataset.load_view(index).unwrap(), *view);
    }
    assert_eq!(dataset.points().unwrap(), Some(points));
    assert_eq!(dataset.info(), info);
    let split = dataset.split(SplitRule::Listed).unwrap();
    assert_eq!((split.train, split.test), (vec![1], vec![0]));
}

#[test]
fn files_are_all_that_a_dataset_consists_of() {
    let folder = Folder::new();
    let mut view = some_view("10/a", 0.0);
    view.valid = view.alpha.clone();
    let mut writer = DatasetWriter::create(folder.root(), Precision::Float).unwrap();
    writer.write_view(&view).unwrap();
    writer.write_points(&PointCloud::default()).unwrap();
    writer.finish(&DatasetInfo::default()).unwrap();

    let mut written = Vec::new();
    let mut folders = vec![folder.root().to_owned()];
    while let Some(inner) = folders.pop() {
        for entry in std::fs::read_dir(inner).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                written.push(path);
            }
        }
    }
    let mut files = folder.open().unwrap().files();
    files.sort();
    written.sort();
    assert_eq!(files, written);
    assert_eq!(files.len(), 9);
}

#[test]
fn cameras_that_differ_are_written_each_with_its_own_intrinsics() {
    let folder = Folder::new();
    let mut views = [some_view("a", 0.0), some_view("b", 0.25)];
    for view in &mut views {
        (view.emission, view.normal, view.alpha) = (None, None, None);
        (view.depth, view.albedo) = (None, None);
    }
    let mut writer = DatasetWriter::create(folder.root(), Precision::Half).unwrap();
    for view in &views {
        writer.write_view(view).unwrap();
    }
    writer.finish(&DatasetInfo::default()).unwrap();
    let dataset = folder.open().unwrap();
    assert_eq!(dataset.info(), DatasetInfo::default());
    for (index, view) in views.iter().enumerate() {
        let back = dataset.load_view(index).unwrap();
        assert_eq!(back.camera, view.camera);
        // Half precision: 11 significant bits.
        for (a, b) in back.radiance.values().iter().zip(view.radiance.values()) {
            assert!((a - b).abs() <= b / 2048.0, "{a} {b}");
        }
        assert!(back.emission.is_none() && back.albedo.is_none());
    }
}

#[test]
fn datasets_that_could_not_be_read_are_not_written() {
    let folder = Folder::new();
    let mut writer = DatasetWriter::create(folder.root(), Precision::Float).unwrap();
    let outside = some_view("../a", 0.0);
    assert_error(
        writer.write_view(&outside),
        &["frames[0].file_name: `../a` is not"],
    );
    let path = folder.root().join(TRANSFORMS_FILE);
    let good = ("a".to_owned(), some_camera(0.0));
    let mut bad = good.clone();
    bad.0 = "b".to_owned();
    bad.1.world_from_camera.translation.x = f64::NAN;
    let info = DatasetInfo::default();
    let outcome = write_transforms(&path, &[good.clone(), bad], &info);
    assert_error(
        outcome,
        &["transforms.json: frames[1]: the camera of b is not finite"],
    );
    let outcome = write_transforms(&path, &[good.clone(), good], &info);
    assert_error(outcome, &["frames[1].file_name: `a` twice"]);
    assert!(!path.exists());
}

/// Writes a dataset of one view after `change`, and loads it.
fn load_changed(change: impl FnOnce(&mut View)) -> Result<View> {
    let folder = Folder::new();
    let mut view = some_view("a", 0.5);
    change(&mut view);
    let mut writer = DatasetWriter::create(folder.root(), Precision::Float).unwrap();
    writer.write_view(&view).unwrap();
    writer.finish(&DatasetInfo::default()).unwrap();
    folder.open()?.load_view(0)
}

fn set<const C: usize>(image: &mut Image<C>, index: usize, pixel: [f32; C]) {
    image.pixels_mut()[index] = pixel;
}

#[test]
fn what_is_not_known_is_zero_whatever_the_files_hold() {
    let mut mask = Image::filled(5, 3, [1.0]);
    // Half a pixel known shows something that is not there; rounding is forgiven.
    set(&mut mask, 4, [0.5]);
    set(&mut mask, 7, [0.0]);
    set(&mut mask, 8, [0.9995]);
    let loaded = load_changed(|view| {
        for index in [4, 7] {
            set(&mut view.radiance, index, [f32::NAN, -1.0, 2.0]);
            set(view.emission.as_mut().unwrap(), index, [9.0]);
            set(view.normal.as_mut().unwrap(), index, [f32::INFINITY; 3]);
            set(view.alpha.as_mut().unwrap(), index, [-1.0]);
            set(view.depth.as_mut().unwrap(), index, [-1.0]);
            set(view.albedo.as_mut().unwrap(), index, [f32::NAN; 3]);
        }
        view.valid = Some(mask);
    })
    .unwrap();
    let mut wanted = some_view("a", 0.5);
    let mut known = Image::filled(5, 3, [1.0]);
    for index in [4, 7] {
        set(&mut wanted.radiance, index, [0.0; 3]);
        set(wanted.normal.as_mut().unwrap(), index, [0.0; 3]);
        set(wanted.albedo.as_mut().unwrap(), index, [0.0; 3]);
        for image in [&mut wanted.emission, &mut wanted.alpha, &mut wanted.depth] {
            set(image.as_mut().unwrap(), index, [0.0]);
        }
        set(&mut known, index, [0.0]);
    }
    wanted.valid = Some(known);
    assert_eq!(loaded, wanted);
}

#[test]
fn a_mask_that_says_nothing_is_none_and_an_earlier_one_goes() {
    let all = Some(Image::filled(5, 3, [1.0]));
    assert_eq!(load_changed(|view| view.valid = all).unwrap().valid, None);
    let wrong = Some(Image::filled(5, 3, [1.5]));
    let outcome = load_changed(|view| view.valid = wrong);
    assert_error(outcome, &["Valid-exr", "1.5 is outside 0 to 1"]);

    let folder = Folder::new();
    let mut writer = DatasetWriter::create(folder.root(), Precision::Float).unwrap();
    let mut view = some_view("a", 0.0);
    view.valid = Some(Image::filled(5, 3, [0.0]));
    writer.write_images(&view).unwrap();
    view.valid = None;
    writer.write_view(&view).unwrap();
    writer.finish(&DatasetInfo::default()).unwrap();
    assert_eq!(folder.open().unwrap().load_view(0).unwrap(), view);
}

#[test]
fn pixels_that_cannot_be_are_named() {
    // Pixel 7 of 5x3 is column 2 of row 1.
    let outcome = load_changed(|v| set(&mut v.radiance, 7, [0.0, f32::NAN, 0.0]));
    let wanted =
        "Radiance-exr/a.exr: pixel (2, 1) channel G: NaN is not finite and at least 0; 1 of 15";
    assert_error(outcome, &[wanted]);
    let outcome = load_changed(|v| {
        set(&mut v.radiance, 7, [0.0, 0.0, -0.25]);
        set(&mut v.radiance, 8, [f32::INFINITY; 3]);
    });
    assert_error(
        outcome,
        &[
            "Radiance-exr/a.exr: pixel (2, 1) channel B: -0.25 ",
            "; 2 of 15",
        ],
    );
    let outcome = load_changed(|v| set(v.emission.as_mut().unwrap(), 0, [1.01]));
    assert_error(
        outcome,
        &["Emissive-exr/a.exr: pixel (0, 0): 1.01 is outside 0 to 1"],
    );
    let outcome = load_changed(|v| set(v.alpha.as_mut().unwrap(), 14, [f32::NAN]));
    assert_error(
        outcome,
        &["Alpha-exr/a.exr: pixel (4, 2): NaN is outside 0 to 1"],
    );
    let outcome = load_changed(|v| set(v.normal.as_mut().unwrap(), 1, [f32::NAN, 0.0, 0.0]));
    assert_error(
        outcome,
        &["Normal-exr/a.exr: pixel (1, 0) channel R: NaN is not finite"],
    );
    let outcome = load_changed(|v| set(v.depth.as_mut().unwrap(), 2, [-1.0]));
    assert_error(
        outcome,
        &["Depth-exr/a.exr: pixel (2, 0): -1.0 is not a depth"],
    );
    let outcome = load_changed(|v| set(v.albedo.as_mut().unwrap(), 3, [0.0, -1.0, 0.0]));
    assert_error(
        outcome,
        &["DiffCol/a.exr: pixel (3, 0) channel G: -1.0 is not finite"],
    );
}

#[test]
fn masks_are_clamped_normals_normalised_and_far_depths_unknown() {
    let view = load_changed(|view| {
        set(view.emission.as_mut().unwrap(), 0, [1.000_5]);
        set(view.alpha.as_mut().unwrap(), 0, [-0.000_5]);
        set(view.depth.as_mut().unwrap(), 0, [f32::INFINITY]);
        let normal = view.normal.as_mut().unwrap();
        set(normal, 0, [0.0, 3.0, -4.0]);
        set(normal, 1, [0.0, 0.000_1, 0.0]);
    })
    .unwrap();
    assert_eq!(view.emission.unwrap().get(0, 0), [1.0]);
    assert_eq!(view.alpha.unwrap().get(0, 0), [0.0]);
    assert_eq!(view.depth.unwrap().get(0, 0), [0.0]);
    let normal = view.normal.unwrap();
    assert_eq!(normal.get(0, 0), [0.0, 0.6, -0.8]);
    assert_eq!(normal.get(1, 0), [0.0; 3]);
}

#[test]
fn a_mask_of_another_size_is_named_with_both_sizes() {
    let outcome = load_changed(|view| view.emission = Some(Image::filled(6, 3, [0.0])));
    let wanted = "Emissive-exr/a.exr: size: 6x3, but the radiance is 5x3";
    assert_error(outcome, &[wanted]);

    let folder = folder_with(&["a"]);
    let dataset = folder.open().unwrap();
    let path = &dataset.frames()[0].files.radiance;
    exr::write_rgb(path, &Image::filled(2, 4, [1.0; 3]), Precision::Half).unwrap();
    let wanted = "Radiance-exr/a.exr: size: 2x4, but the dataset was opened with 4x2";
    assert_error(dataset.load_view(0), &[wanted]);
}

#[test]
fn the_cache_keeps_recent_views_within_its_budget() {
    let folder = folder_with(&["a", "b", "c"]);
    let dataset = Arc::new(folder.open().unwrap());
    // A view of 4x2 pixels takes 8 · 12 bytes.
    let cache = ViewCache::new(Arc::clone(&dataset), 2 * 96);
    let first = cache.get(0).unwrap();
    assert_eq!(cache.num_bytes(), 96);
    assert!(Arc::ptr_eq(&first, &cache.get(0).unwrap()));
    let second = cache.get(1).unwrap();
    cache.get(0).unwrap();
    // The third view takes the place of the second, which was used longer ago than the first.
    cache.get(2).unwrap();
    assert_eq!(cache.num_bytes(), 2 * 96);
    assert!(Arc::ptr_eq(&first, &cache.get(0).unwrap()));
    assert!(!Arc::ptr_eq(&second, &cache.get(1).unwrap()));
    assert_eq!(second.name, "b");

    let tiny = ViewCache::new(dataset, 1);
    for index in [0, 1, 2, 2] {
        tiny.get(index).unwrap();
        assert_eq!(tiny.num_bytes(), 96);
    }
}

#[test]
fn the_cache_serves_many_threads_and_forgets_failures() {
    let folder = folder_with(&["a", "b", "c", "d"]);
    let dataset = Arc::new(folder.open().unwrap());
    let cache = ViewCache::new(Arc::clone(&dataset), 3 * 96);
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (cache, dataset) = (&cache, &dataset);
            scope.spawn(move || {
                for step in 0..40 {
                    let index = (step * (thread + 1) + thread) % 4;
                    let view = cache.get(index).unwrap();
                    assert_eq!(view.name, dataset.frames()[index].name);
                    assert!(cache.num_bytes() <= 3 * 96);
                }
            });
        }
    });
    let path = &dataset.frames()[3].files.radiance;
    let good = std::fs::read(path).unwrap();
    let cache = ViewCache::new(Arc::clone(&dataset), 1000);
    std::fs::write(path, b"broken").unwrap();
    assert_error(cache.get(3), &["d.exr: content"]);
    std::fs::write(path, good).unwrap();
    assert_eq!(cache.get(3).unwrap().name, "d");
}

#[test]
fn kitchen_views_load() {
    let Some(root) = test_data("kitchen_views_load", "kitchen") else {
        return;
    };
    let dataset = Dataset::open(&root).unwrap();
    let mut brightest = 0.0_f32;
    for index in (0..dataset.len()).step_by(5) {
        let view = dataset.load_view(index).unwrap();
        assert_eq!(view.radiance.size(), (270, 180));
        let emission = view.emission.unwrap();
        for (light, [mask]) in view.radiance.pixels().iter().zip(emission.pixels()) {
            if *mask > 0.5 {
                brightest = light.iter().copied().fold(brightest, f32::max);
            }
        }
        assert!(view.normal.is_some() && view.depth.is_some() && view.albedo.is_some());
        assert!(view.alpha.is_none());
    }
    // The window light is 16.03 in half precision.
    assert!((brightest - 16.03).abs() < 0.02, "{brightest}");
}
