//! Pixels that a dataset says it does not know have no part in what is trained.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use eagpt_scene::dataset::{DatasetInfo, DatasetWriter};
use eagpt_scene::exr::Precision;
use eagpt_scene::{Dataset, Image, View};
use eagpt_testkit::room;
use eagpt_trace::Device;
use eagpt_train::job::{BadViews, Existing};
use eagpt_train::{Preset, TrainOptions, TrainRequest, train};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const SIZE: (u32, u32) = (40, 30);

/// Values of unknown pixels.
#[derive(Clone, Copy, PartialEq)]
enum Unknown {
    /// The truth.
    Truth,
    /// Anything, not even numbers.
    Garbage,
    /// The truth, and no mask.
    NoMask,
}

/// A column and a corner of every view.
fn is_unknown(index: usize) -> bool {
    let (x, y) = (index % SIZE.0 as usize, index / SIZE.0 as usize);
    x < 6 || (x > 30 && y < 4)
}

fn write(root: &Path, unknown: Unknown) {
    let options = room::RoomOptions {
        num_views: 9,
        width: SIZE.0,
        height: SIZE.1,
        num_samples: 4,
        num_points: 600,
        seed: 3,
    };
    let plain = root.join("plain");
    room::write(&plain, &options, |_| ()).unwrap();
    let dataset = Dataset::open(&plain).unwrap();
    let mut writer = DatasetWriter::create(root, Precision::Float).unwrap();
    for index in 0..dataset.len() {
        let mut view = dataset.load_view(index).unwrap();
        if unknown != Unknown::NoMask {
            let known = (0..view.camera.num_pixels()).map(|i| [f32::from(!is_unknown(i))]);
            view.valid = Image::from_pixels(SIZE.0, SIZE.1, known.collect());
        }
        if unknown == Unknown::Garbage {
            garble(&mut view);
        }
        writer.write_view(&view).unwrap();
    }
    writer
        .write_points(&dataset.points().unwrap().unwrap())
        .unwrap();
    writer.finish(&DatasetInfo::default()).unwrap();
}

fn garble(view: &mut View) {
    fn set<const C: usize>(image: &mut Image<C>, value: f32) {
        for (index, pixel) in image.pixels_mut().iter_mut().enumerate() {
            if is_unknown(index) {
                *pixel = [value; C];
            }
        }
    }
    set(&mut view.radiance, f32::NAN);
    for image in [&mut view.normal, &mut view.albedo].into_iter().flatten() {
        set(image, -3.0);
    }
    for image in [&mut view.emission, &mut view.depth].into_iter().flatten() {
        set(image, f32::INFINITY);
    }
}

fn trained(dir: &Path, unknown: Unknown) -> Vec<u8> {
    let dataset: PathBuf = dir.join(format!("dataset-{}", unknown as u8));
    write(&dataset, unknown);
    let mut options = TrainOptions::preset(Preset::Draft);
    options.num_gaussians = Some(700);
    options.radiance.iterations = 30;
    options.albedo.iterations = 4;
    options.albedo.num_samples = 4;
    let out = dir.join(format!("out-{}", unknown as u8));
    let request = TrainRequest {
        dataset,
        other_lights: Vec::new(),
        masks: None,
        normals: None,
        start: None,
        out,
        options,
        existing: Existing::Refuse,
        bad_views: BadViews::Refuse,
        image_budget: None,
        device: Device::Cpu,
        is_watched: false,
        stop: Arc::new(AtomicBool::new(false)),
    };
    let summary = train(&request, &mut |_| ()).unwrap();
    std::fs::read(summary.scene.unwrap()).unwrap()
}

#[test]
fn garbage_where_nothing_is_known_changes_no_bit_of_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let [truth, garbage, no_mask] = [Unknown::Truth, Unknown::Garbage, Unknown::NoMask]
        .map(|unknown| trained(dir.path(), unknown));
    assert!(truth == garbage);
    assert!(truth != no_mask);
}
