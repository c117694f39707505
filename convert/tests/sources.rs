//! Cameras of small sources against an independent computation, `data/sources.py`.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

mod common;

use common::{expected, numbers};
use eagpt_convert::World;
use eagpt_convert::import::Ldr;
use eagpt_convert::{ImportOptions, SourceDataset, SourceFormat, import};
use eagpt_scene::dataset::{SplitRule, UpAxis};
use eagpt_scene::{Dataset, exr};
use glam::{DMat3, DVec2, DVec3};
use std::path::Path;

/// Both sides compute in double precision; the inverse of a 4×4 matrix costs some 1e-15.
const TOLERANCE: f64 = 1e-9;
/// `cam.txt` has six decimals: its axes are perpendicular to some 1e-6, and we make them so.
const FIPT_TOLERANCE: f64 = 3e-6;

fn open(root: &Path) -> SourceDataset {
    SourceDataset::open(root, None, &ImportOptions::default()).unwrap()
}

/// Asserts that poses are those expected, and that lenses project points where they should.
#[track_caller]
fn assert_cameras(source: &SourceDataset, name: &str, tolerance: f64) {
    let expected = expected(name);
    assert_eq!(source.frames.len(), expected.len(), "{:?}", source.problems);
    assert_eq!(source.problems, []);
    for (frame, expected) in source.frames.iter().zip(&expected) {
        assert_eq!(frame.name, expected["name"].as_str().unwrap());
        let size = numbers(&expected["size"]);
        assert_eq!(frame.lens.size(), (size[0] as u32, size[1] as u32));
        let pose = frame.world_from_camera;
        for (r, row) in expected["world_from_camera"].as_array().unwrap()[..3]
            .iter()
            .enumerate()
        {
            let row = numbers(row);
            for (c, expected) in row[..3].iter().enumerate() {
                let own = pose.matrix3.col(c)[r];
                assert!(
                    (own - expected).abs() < tolerance,
                    "{name} {r} {c}: {own} {expected}"
                );
            }
            assert!((pose.translation[r] - row[3]).abs() < tolerance);
        }
        let points = expected["points_camera"].as_array().unwrap().iter();
        for (point, pixel) in points.zip(expected["pixels"].as_array().unwrap()) {
            let own = frame
                .lens
                .project(DVec3::from_slice(&numbers(point)))
                .unwrap();
            let expected = DVec2::from_slice(&numbers(pixel));
            assert!(
                (own - expected).length() < TOLERANCE,
                "{name}: {own} {expected}"
            );
        }
    }
}

#[test]
fn fipt() {
    let dir = tempfile::tempdir().unwrap();
    common::fipt(dir.path());
    let source = open(dir.path());
    assert_eq!(source.format, SourceFormat::Fipt);
    assert_eq!(source.info.up_axis, Some(UpAxis::Y));
    assert_cameras(&source, "fipt", FIPT_TOLERANCE);
}

#[test]
fn fipt_synthetic_with_albedo_and_emission() {
    let dir = tempfile::tempdir().unwrap();
    common::fipt_synthetic(dir.path());
    let source = open(dir.path());
    assert_eq!(source.format, SourceFormat::FiptSynthetic);
    assert_cameras(&source, "fipt-synthetic", TOLERANCE);
    let out = dir.path().join("out");
    import(&source, &out, &ImportOptions::default(), &mut |_| ()).unwrap();
    let dataset = Dataset::open(&out).unwrap();
    let split = dataset.split(SplitRule::Listed).unwrap();
    assert_eq!((split.train, split.test), (vec![0, 1], vec![2]));
    let view = dataset.load_view(2).unwrap();
    assert_eq!(view.radiance, common::ramp(common::SIZE));
    assert_eq!(view.albedo.unwrap().get(3, 3), [0.25, 0.5, 0.75]);
    let emission = view.emission.unwrap();
    assert_eq!((emission.get(19, 5), emission.get(20, 5)), ([0.0], [1.0]));
}

#[test]
fn eyeful_rig_of_perspective_cameras() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("kitchen");
    common::eyeful(&root, 2);
    let source = open(&root);
    assert_eq!(source.format, SourceFormat::Eyeful);
    assert_eq!(source.info.up_axis, Some(UpAxis::Y));
    assert_eq!(source.info.metres_per_unit, Some(1.0));
    assert_cameras(&source, "eyeful-2", TOLERANCE);
    // One entry has no image; the split no longer names it.
    assert!(
        source.warnings[0].contains("1 of 4 cameras") && source.warnings[0].contains("31_DSC0009")
    );
    assert_eq!(source.info.train_names.unwrap().len(), 2);
    assert_eq!(source.info.test_names.unwrap(), ["12/12_DSC0003"]);
}

#[test]
fn eyeful_rig_of_fisheye_cameras() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("office1a");
    common::eyeful(&root, 1);
    assert_cameras(&open(&root), "eyeful-1", TOLERANCE);
}

#[test]
fn light_of_eyeful_tower() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("any-name");
    common::eyeful(&root, 2);
    let error = SourceDataset::open(&root, None, &ImportOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("`any-name`") && error.contains("--white-balance"),
        "{error}"
    );
    // The reconstruction report names the scene, whatever the folder's name.
    std::fs::write(root.join("kitchen-final.pdf"), "").unwrap();
    let color = open(&root).color;
    let bytes = std::fs::read(common::data("expected.json")).unwrap();
    let all: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    let light = &all["eyeful-kitchen-light"];
    let stored = light["stored"].as_array().unwrap().iter();
    for (stored, expected) in stored.zip(light["rec709"].as_array().unwrap()) {
        let own = color.matrix() * DVec3::from_slice(&numbers(stored));
        let expected = DVec3::from_slice(&numbers(expected));
        assert!((own - expected).length() < 1e-12, "{own} {expected}");
    }
    let options = ImportOptions {
        white_balance: Some([2.0, 1.0, 0.5]),
        ..ImportOptions::default()
    };
    assert_eq!(
        SourceDataset::open(&root, None, &options)
            .unwrap()
            .color
            .gains,
        [2.0, 1.0, 0.5]
    );
}

#[test]
fn nerfstudio_with_every_kind_of_lens() {
    let dir = tempfile::tempdir().unwrap();
    common::nerfstudio(dir.path());
    let source = open(dir.path());
    assert_eq!(source.format, SourceFormat::Nerfstudio);
    assert_eq!(source.info.up_axis, Some(UpAxis::Z));
    assert_cameras(&source, "nerfstudio", TOLERANCE);
    assert_eq!(source.info.validation_names.as_ref().unwrap().len(), 2);
    assert!(source.points.is_some());
    assert!(
        source.notes[0].contains("applied_transform"),
        "{:?}",
        source.notes
    );
}

#[test]
fn instant_ngp_with_an_angle_and_names_without_extension() {
    let dir = tempfile::tempdir().unwrap();
    common::instant_ngp(dir.path());
    let source = open(dir.path());
    assert_eq!(source.format, SourceFormat::InstantNgp);
    assert_cameras(&source, "instant-ngp", TOLERANCE);
}

/// Where the imported pinhole camera looks, the source's lens saw what the imported image shows.
#[test]
fn undistorted_images_show_what_the_lens_saw() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("source");
    common::nerfstudio(&root);
    let out = dir.path().join("out");
    let source = open(&root);
    let summary = import(&source, &out, &ImportOptions::default(), &mut |_| ()).unwrap();
    let dataset = Dataset::open(&out).unwrap();
    let mut worst = 0.0_f64;
    for (index, frame) in source.frames.iter().enumerate() {
        let view = dataset.load_view(index).unwrap();
        let camera = view.camera;
        for y in 0..camera.height {
            for x in 0..camera.width {
                let centre = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
                let plane =
                    (centre - DVec2::new(camera.cx, camera.cy)) / DVec2::new(camera.fx, camera.fy);
                let saw = frame.lens.project(plane.extend(1.0)).unwrap();
                let [r, g, b] = view.radiance.get(x, y);
                let shown = DVec2::new(f64::from(r), f64::from(g));
                assert!((b - 1.0).abs() < 1e-5);
                // The cubic reaches over two pixels, which the border does not have.
                let inner =
                    saw.cmpge(DVec2::splat(1.5)).all() && saw.cmple(DVec2::new(22.5, 14.5)).all();
                if inner {
                    worst = worst.max((shown - saw).length());
                }
            }
        }
    }
    // A cubic reproduces a ramp; single precision of values up to 24, measured 6e-6.
    assert!(worst < 2e-5, "{worst}");
    let kept: Vec<bool> = summary.report.lenses.iter().map(|lens| lens.kept).collect();
    assert_eq!(kept, [false, false, true, false, false]);
    assert!(!out.join("Valid-exr").exists(), "all pixels are known");
}

#[test]
fn the_whole_field_comes_with_masks_of_known_pixels() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("office1a");
    common::eyeful(&root, 1);
    let mut options = ImportOptions::default();
    options.undistort.field = eagpt_scene::lens::Field::All;
    let out = dir.path().join("out");
    let summary = import(&open(&root), &out, &options, &mut |_| ()).unwrap();
    let view = &summary.report.views[0];
    let mask = exr::read_single(&out.join("Valid-exr/10/10_DSC0001.exr")).unwrap();
    let num_unknown = mask.values().iter().filter(|v| **v == 0.0).count();
    assert!(num_unknown > 0 && num_unknown == view.num_unknown);
    assert!(
        summary
            .report
            .warnings
            .iter()
            .any(|text| text.contains("Valid-exr"))
    );
}

#[test]
fn turning_the_world_turns_poses_points_and_normals_alike() {
    let dir = tempfile::tempdir().unwrap();
    let room = dir.path().join("room");
    let options = eagpt_testkit::room::RoomOptions {
        num_views: 2,
        width: 12,
        height: 8,
        num_samples: 1,
        num_points: 20,
        seed: 1,
    };
    eagpt_testkit::room::write(&room, &options, |_| ()).unwrap();
    let turned = dir.path().join("turned");
    let options = ImportOptions {
        world: World::ZUp,
        up_axis: Some(UpAxis::Y),
        ..ImportOptions::default()
    };
    let source = SourceDataset::open(&room, None, &options).unwrap();
    import(&source, &turned, &options, &mut |_| ()).unwrap();
    let (before, after) = (
        Dataset::open(&room).unwrap(),
        Dataset::open(&turned).unwrap(),
    );
    assert_eq!(after.up_axis(), Some(UpAxis::Z));
    let turn = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
    for index in 0..2 {
        let (old, new) = (
            before.load_view(index).unwrap(),
            after.load_view(index).unwrap(),
        );
        let pose = old.camera.world_from_camera;
        assert_eq!(new.camera.world_from_camera.matrix3, turn * pose.matrix3);
        assert_eq!(
            new.camera.world_from_camera.translation,
            turn * pose.translation
        );
        assert_eq!((new.radiance, new.depth), (old.radiance, old.depth));
        let normals = old.normal.unwrap().map(|[x, y, z]| [*z, *x, *y]);
        assert_eq!(new.normal.unwrap(), normals);
    }
    let (old, new) = (
        before.points().unwrap().unwrap(),
        after.points().unwrap().unwrap(),
    );
    for (old, new) in old.positions.iter().zip(&new.positions) {
        assert_eq!([new.x, new.y, new.z], [old.z, old.x, old.y]);
    }
}

#[test]
fn eight_bits_come_in_only_when_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    common::instant_ngp(dir.path());
    for index in 0..2 {
        let path = dir.path().join(format!("images/{index:04}.exr"));
        std::fs::remove_file(&path).unwrap();
        let picture = image::RgbImage::from_pixel(24, 16, image::Rgb([128, 0, 255]));
        picture.save(path.with_extension("png")).unwrap();
    }
    let error = SourceDataset::open(dir.path(), None, &ImportOptions::default()).unwrap_err();
    assert!(
        error.to_string().contains("2 of 2 frames") && error.to_string().contains("--ldr srgb")
    );
    let options = ImportOptions {
        ldr: Ldr::Srgb,
        ..ImportOptions::default()
    };
    let source = SourceDataset::open(dir.path(), None, &options).unwrap();
    assert!(source.warnings[0].contains("no measurement"));
    let out = dir.path().join("out");
    import(&source, &out, &options, &mut |_| ()).unwrap();
    let view = Dataset::open(&out).unwrap().load_view(0).unwrap();
    assert_eq!(view.clipped.as_ref().unwrap().get(5, 5), [0.0, 0.0, 1.0]);
    // ((128/255 + 0.055) / 1.055)^2.4 = 0.215861.
    assert!((view.radiance.get(5, 5)[0] - 0.215_861).abs() < 1e-5);
}
