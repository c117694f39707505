//! Tests of camera paths: what curves keep, what files say, what is refused.

mod files;
mod fly;
mod turntable;

use super::rotation::step;
use super::*;
use crate::camera::Camera;
use crate::dataset::{DatasetInfo, TRANSFORMS_FILE, UpAxis, write_transforms};
use glam::{DAffine3, DQuat, DVec3};

fn camera(position: DVec3, turn: DVec3, fx: f64) -> Camera {
    Camera {
        width: 40,
        height: 30,
        fx,
        fy: 1.1 * fx,
        cx: 19.0,
        cy: 16.0,
        world_from_camera: DAffine3::from_rotation_translation(
            DQuat::from_scaled_axis(turn),
            position,
        ),
    }
}

/// Five views at uneven distances, turned unevenly; the last has other intrinsics.
fn views() -> Vec<Camera> {
    let v = DVec3::new;
    vec![
        camera(v(0.0, 0.0, 1.0), v(0.0, 0.0, 0.0), 35.0),
        camera(v(2.0, 0.3, 1.2), v(0.3, 0.9, -0.2), 35.0),
        camera(v(2.2, 0.9, 1.1), v(0.2, 1.6, 0.1), 35.0),
        camera(v(1.0, 3.0, 1.5), v(-0.4, 2.6, 0.3), 35.0),
        camera(v(-1.5, 2.0, 0.9), v(-0.2, -2.4, 0.4), 60.0),
    ]
}

/// A dataset of cameras alone, in a folder that lives as long as the test.
fn dataset_of(cameras: &[Camera]) -> (tempfile::TempDir, Dataset) {
    let dir = tempfile::tempdir().unwrap();
    let named: Vec<_> = (0..)
        .map(|i| format!("v{i}"))
        .zip(cameras.to_vec())
        .collect();
    let info = DatasetInfo {
        up_axis: Some(UpAxis::Z),
        ..DatasetInfo::default()
    };
    write_transforms(&dir.path().join(TRANSFORMS_FILE), &named, &info).unwrap();
    let dataset = Dataset::open_cameras(dir.path()).unwrap();
    (dir, dataset)
}

fn dataset() -> (tempfile::TempDir, Dataset) {
    dataset_of(&views())
}

fn path_of(text: &str) -> Result<CameraPath> {
    named("path.toml", text)
}

fn named(name: &str, text: &str) -> Result<CameraPath> {
    let (dir, dataset) = dataset();
    let file = dir.path().join(name);
    std::fs::write(&file, text).unwrap();
    CameraPath::read(file.to_str().unwrap(), &dataset, &PathOverrides::default())
}

fn shorthand(argument: &str) -> Result<CameraPath> {
    let (_dir, dataset) = dataset();
    CameraPath::read(argument, &dataset, &PathOverrides::default())
}

fn position(camera: &Camera) -> DVec3 {
    camera.world_from_camera.translation
}

fn turn(camera: &Camera) -> DQuat {
    DQuat::from_mat3(&camera.world_from_camera.matrix3)
}

/// Angle between two rotations, radians.
fn angle(a: &Camera, b: &Camera) -> f64 {
    step(turn(a), turn(b)).length()
}

#[track_caller]
fn assert_same(found: &Camera, wanted: &Camera) {
    assert!(
        position(found).distance(position(wanted)) < 1e-12 && angle(found, wanted) < 1e-7,
        "{found:?}\n{wanted:?}"
    );
    let lens = |c: &Camera| [c.fx, c.fy, c.cx, c.cy];
    for (found, wanted) in lens(found).into_iter().zip(lens(wanted)) {
        assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
    }
}
