//! The room's own normals, stored as estimators do, are recovered.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use eagpt_convert::normals::{
    Axes, NormalOptions, NormalReport, NormalRequest, Reference, Space, make_normals,
};
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Camera, Dataset, Image, files};
use eagpt_testkit::room::{self, RoomOptions};
use glam::{DMat3, DVec3, Vec3};
use std::path::Path;

/// A room without normals, and its true ones.
fn room(root: &Path) -> (Dataset, Vec<Image<3>>) {
    let options = RoomOptions {
        num_views: 4,
        width: 48,
        height: 32,
        num_samples: 1,
        num_points: 6000,
        seed: 2,
    };
    room::write(root, &options, |_| ()).unwrap();
    let dataset = Dataset::open(root).unwrap();
    let normals = (0..dataset.len()).map(|i| dataset.load_view(i).unwrap().normal.unwrap());
    let normals = normals.collect();
    files::remove_if_there(&root.join("Normal-exr")).unwrap();
    (Dataset::open(root).unwrap(), normals)
}

fn stored(normals: &Image<3>, stored_from_world: DMat3) -> Image<3> {
    normals.map(|n| {
        (stored_from_world * Vec3::from(*n).as_dvec3())
            .as_vec3()
            .to_array()
    })
}

fn write_exr(folder: &Path, name: &str, map: &Image<3>) {
    files::create_dir(folder).unwrap();
    exr::write_rgb(&folder.join(format!("{name}.exr")), map, Precision::Float).unwrap();
}

/// 16 bits, twice the size, as networks write it.
fn write_png(folder: &Path, name: &str, map: &Image<3>) {
    files::create_dir(folder).unwrap();
    let (width, height) = map.size();
    let picture = image::ImageBuffer::from_fn(2 * width, 2 * height, |x, y| {
        let packed = map
            .get(x / 2, y / 2)
            .map(|v| ((0.5 * v + 0.5) * 65_535.0).round() as u16);
        image::Rgb(packed)
    });
    picture
        .save(folder.join(format!("{name}_normal.png")))
        .unwrap();
}

#[track_caller]
fn make(dataset: &Dataset, maps: &Path, out: &Path, options: NormalOptions) -> NormalReport {
    let request = NormalRequest {
        dataset,
        maps: maps.to_owned(),
        out: out.to_owned(),
        options,
    };
    make_normals(&request, &mut |_| ()).unwrap().report
}

/// Mean angle between written and true normals, degrees.
fn mean_angle(out: &Path, name: &str, truth: &Image<3>) -> f64 {
    let written = exr::read_rgb(&out.join(format!("Normal-exr/{name}.exr"))).unwrap();
    let pairs = written.pixels().iter().zip(truth.pixels());
    let angles: Vec<f64> = pairs
        .filter(|(a, _)| **a != [0.0; 3])
        .map(|(a, b)| f64::from(Vec3::from(*a).dot(Vec3::from(*b)).clamp(-1.0, 1.0)).acos())
        .collect();
    assert!(
        angles.len() * 10 > written.pixels().len() * 9,
        "{name}: too few are known"
    );
    angles.iter().sum::<f64>().to_degrees() / angles.len() as f64
}

#[test]
fn any_axes_are_found_out_by_depth_or_by_points() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("room");
    let (dataset, truth) = room(&root);
    let camera_from_world = |camera: &Camera| camera.world_from_camera.matrix3.transpose();
    let turned_world = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
    type Stored<'a> = dyn Fn(&Camera) -> DMat3 + 'a;
    let cases: [(&str, Space, &Stored<'_>); 4] = [
        ("opengl", Space::Camera, &|c| {
            DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * camera_from_world(c)
        }),
        ("-x,-y,z", Space::Camera, &|c| {
            DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0)) * camera_from_world(c)
        }),
        ("x,y,z", Space::World, &|_| DMat3::IDENTITY),
        // The world turned by x → y → z: its y is our x.
        ("y,z,x", Space::World, &|_| turned_world),
    ];
    for (case, (axes, space, stored_from_world)) in cases.iter().enumerate() {
        let maps = dir.path().join(format!("maps{case}"));
        for (frame, normals) in dataset.frames().iter().zip(&truth) {
            let map = stored(normals, stored_from_world(&frame.camera));
            write_exr(&maps, &frame.name, &map);
            write_png(&maps, &frame.name, &map);
        }
        for suffix in ["", "_normal"] {
            let out = dir.path().join(format!("out{case}{suffix}"));
            let options = NormalOptions {
                suffix: suffix.to_owned(),
                ..NormalOptions::default()
            };
            let report = make(&dataset, &maps, &out, options);
            let reading = report.reading;
            assert_eq!(
                (reading.axes.to_string().as_str(), reading.space),
                (*axes, *space)
            );
            assert_eq!(reading.reference, Reference::Depth);
            assert!(reading.mean_cosine.unwrap() > 0.95, "{reading:?}");
            for (frame, normals) in dataset.frames().iter().zip(&truth) {
                let angle = mean_angle(&out, &frame.name, normals);
                // Half precision: 2⁻¹¹ of a component is 0.03°; the cosine near 1 in single
                // precision rounds to as much.
                assert!(angle < 0.1, "{axes} {}: {angle}", frame.name);
            }
        }
    }
    // Without depths, by the points, which are some 5 mm off their surface.
    files::remove_if_there(&root.join("Depth-exr")).unwrap();
    let dataset = Dataset::open(&root).unwrap();
    let out = dir.path().join("by-points");
    let report = make(
        &dataset,
        &dir.path().join("maps0"),
        &out,
        NormalOptions::default(),
    );
    assert_eq!(report.reading.reference, Reference::Points);
    assert_eq!(report.reading.axes, "opengl".parse::<Axes>().unwrap());
}

#[test]
fn what_is_not_clear_or_contradicts_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("room");
    let (dataset, truth) = room(&root);
    let maps = dir.path().join("maps");
    for (frame, normals) in dataset.frames().iter().zip(&truth).skip(1) {
        write_exr(&maps, &frame.name, &stored(normals, DMat3::IDENTITY));
    }
    let out = dir.path().join("out");
    let refuse = |dataset: &Dataset, options: NormalOptions, parts: &[&str]| {
        let request = NormalRequest {
            dataset,
            maps: maps.clone(),
            out: out.clone(),
            options,
        };
        let message = make_normals(&request, &mut |_| ()).unwrap_err().to_string();
        for part in parts {
            assert!(message.contains(part), "no `{part}` in {message}");
        }
        assert!(!out.exists());
    };
    let given = |space, axes: &str| NormalOptions {
        space: Some(space),
        axes: Some(axes.parse().unwrap()),
        ..NormalOptions::default()
    };
    let mirrored = given(Space::World, "-x,-y,-z");
    refuse(
        &dataset,
        mirrored.clone(),
        &["contradict", "best as world x,y,z"],
    );
    let suffix = NormalOptions {
        suffix: "-n".to_owned(),
        ..NormalOptions::default()
    };
    refuse(&dataset, suffix, &["`000`", "`000-n.exr`"]);
    for gone in ["Depth-exr", "points3d.ply"] {
        files::remove_if_there(&root.join(gone)).unwrap();
    }
    let bare = Dataset::open(&root).unwrap();
    refuse(
        &bare,
        NormalOptions::default(),
        &["neither depths nor enough points", "--space"],
    );
    refuse(&bare, mirrored, &["turned away"]);
    let report = make(&bare, &maps, &out, given(Space::World, "opencv"));
    assert_eq!(
        (report.reading.reference, report.views.len()),
        (Reference::None, 3)
    );
    assert_eq!(report.missing, ["000"]);
}
