//! A dataset exported for another program is imported with the same cameras, points and light.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod common;

use eagpt_colmap::Model;
use eagpt_colmap::model::Observations;
use eagpt_convert::export::Images;
use eagpt_convert::{ExportFormat, ImportOptions, SourceDataset, export, import};
use eagpt_scene::dataset::{DatasetInfo, DatasetWriter, UpAxis};
use eagpt_scene::exr::Precision;
use eagpt_scene::{Dataset, Image};
use eagpt_testkit::room::{self, RoomOptions};
use glam::DAffine3;
use std::path::Path;

fn room(root: &Path) -> Dataset {
    let options = RoomOptions {
        num_views: 3,
        width: 24,
        height: 16,
        num_samples: 2,
        num_points: 100,
        seed: 5,
    };
    room::write(root, &options, |_| ()).unwrap();
    Dataset::open(root).unwrap()
}

#[track_caller]
fn assert_same(a: &Dataset, b: &Dataset) {
    assert_eq!(a.info(), b.info());
    assert_eq!(a.points().unwrap(), b.points().unwrap());
    for index in 0..a.len() {
        assert_eq!(a.load_view(index).unwrap(), b.load_view(index).unwrap());
    }
}

#[test]
fn nerfstudio_and_eagpt_keep_every_bit() {
    let dir = tempfile::tempdir().unwrap();
    let original = room(&dir.path().join("room"));
    for (format, name) in [
        (ExportFormat::Nerfstudio, "nerfstudio"),
        (ExportFormat::Eagpt, "eagpt"),
    ] {
        let out = dir.path().join(name);
        export(&original, format, Images::Copy, &out, &mut |_| ()).unwrap();
        assert_same(&original, &Dataset::open(&out).unwrap());
    }
    // By the importer as well.
    assert_same(&original, &imported(&dir.path().join("nerfstudio")));
}

fn imported(root: &Path) -> Dataset {
    let options = ImportOptions::default();
    let source = SourceDataset::open(root, None, &options).unwrap();
    let back = root.join("back");
    import(&source, &back, &options, &mut |_| ()).unwrap();
    Dataset::open(&back).unwrap()
}

/// All views in one folder, another axis up, a unit, a split, and pixels that are not known:
/// everything that names and keys must preserve.
#[test]
fn a_folder_that_all_views_share_stays_in_their_names() {
    let dir = tempfile::tempdir().unwrap();
    let plain = room(&dir.path().join("room"));
    let root = dir.path().join("original");
    let mut writer = DatasetWriter::create(&root, Precision::Half).unwrap();
    for index in 0..plain.len() {
        let mut view = plain.load_view(index).unwrap();
        view.name = format!("cam/{}", view.name);
        let mut valid = Image::filled(24, 16, [1.0]);
        valid.pixels_mut()[index] = [0.0];
        view.valid = Some(valid);
        writer.write_view(&view).unwrap();
    }
    writer
        .write_points(&plain.points().unwrap().unwrap())
        .unwrap();
    let info = DatasetInfo {
        up_axis: Some(UpAxis::NegY),
        metres_per_unit: Some(0.25),
        train_names: Some(vec!["cam/000".to_owned(), "cam/002".to_owned()]),
        validation_names: None,
        test_names: Some(vec!["cam/001".to_owned()]),
        aligned_from_model: Some([
            [2.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, -2.0, 0.5],
            [0.0, 2.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]),
    };
    writer.finish(&info).unwrap();
    let original = Dataset::open(&root).unwrap();
    let out = dir.path().join("nerfstudio");
    let format = ExportFormat::Nerfstudio;
    export(&original, format, Images::Copy, &out, &mut |_| ()).unwrap();
    assert_same(&original, &Dataset::open(&out).unwrap());
    assert_same(&original, &imported(&out));
}

#[test]
fn colmap_keeps_cameras_to_rounding() {
    let dir = tempfile::tempdir().unwrap();
    let original = room(&dir.path().join("room"));
    let out = dir.path().join("project");
    export(
        &original,
        ExportFormat::Colmap,
        Images::Copy,
        &out,
        &mut |_| (),
    )
    .unwrap();
    let model = Model::read(&out.join("sparse/0"), Observations::Keep).unwrap();
    assert_eq!(
        (model.cameras.len(), model.images.len(), model.points.len()),
        (1, 3, 100)
    );
    assert!(model.rigs.is_none() && model.frames.is_none());
    for (image, frame) in model.images.iter().zip(original.frames()) {
        assert!(out.join("images").join(&image.name).is_file());
        assert!(out.join("Normal-exr").join(&image.name).is_file());
        let lens = model.camera(image.camera).unwrap().lens;
        let back = lens
            .as_pinhole(image.camera_from_world.inverse().affine())
            .unwrap();
        let (a, b) = (back.world_from_camera, frame.camera.world_from_camera);
        // The rotations of the room are orthonormal to single precision; a quaternion makes them so
        // to double.
        let error = (a.matrix3 - b.matrix3).to_cols_array().map(f64::abs);
        assert!(error.iter().all(|e| *e < 1e-7), "{error:?}");
        assert!((a.translation - b.translation).length() < 1e-6);
        let pose = DAffine3::IDENTITY;
        let intrinsics = |camera: eagpt_scene::Camera| eagpt_scene::Camera {
            world_from_camera: pose,
            ..camera
        };
        assert_eq!(intrinsics(back), intrinsics(frame.camera));
    }
    let points = original.points().unwrap().unwrap();
    for (point, position) in model.points.iter().zip(&points.positions) {
        assert_eq!(point.position, position.as_dvec3());
    }
}

/// Imported without a change of world, a source's own poses are exported bit-identical.
#[test]
fn an_import_exports_to_the_cameras_it_came_from() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("source");
    common::instant_ngp(&root);
    let options = ImportOptions::default();
    let source = SourceDataset::open(&root, None, &options).unwrap();
    let (imported, exported) = (dir.path().join("ours"), dir.path().join("theirs"));
    import(&source, &imported, &options, &mut |_| ()).unwrap();
    let ours = Dataset::open(&imported).unwrap();
    export(
        &ours,
        ExportFormat::Nerfstudio,
        Images::Copy,
        &exported,
        &mut |_| (),
    )
    .unwrap();
    let again = SourceDataset::open(&exported, None, &options).unwrap();
    for (a, b) in source.frames.iter().zip(&again.frames) {
        assert_eq!(
            (&a.name, a.world_from_camera),
            (&b.name, b.world_from_camera)
        );
    }
}
