//! Imports of small captures through a distorted lens.

use super::*;
use crate::align::AlignOptions;
use crate::model::{CameraId, ImageId, ModelCamera, ModelImage, ModelPoint, PointId, Rigid};
use eagpt_scene::lens::{Field, LensModel};
use eagpt_scene::{Dataset, Image, Lens, exr};
use glam::{DQuat, DVec2, DVec3};
use tempfile::TempDir;

const SIZE: (u32, u32) = (64, 48);

/// A folder with a model of three images and, in `linear`, images of half its size that show
/// directions.
struct Capture {
    dir: TempDir,
    lens: Lens,
}

impl Capture {
    fn new() -> Self {
        let params = [60.0, 61.0, 31.0, 25.0, -0.15, 0.02, 1e-3, -1e-3];
        let lens = Lens::new(LensModel::OpenCv, SIZE, &params).unwrap();
        let images = ["b/two.jpg", "one.jpg", "three.v2.JPG"].iter().enumerate();
        let model = Model {
            cameras: vec![ModelCamera {
                id: CameraId(4),
                lens,
            }],
            images: images
                .map(|(i, name)| ModelImage {
                    id: ImageId(i as u32),
                    camera_from_world: Rigid {
                        rotation: DQuat::from_rotation_y(0.3 * i as f64),
                        translation: DVec3::new(i as f64, 0.0, 1.0),
                    },
                    camera: CameraId(4),
                    name: (*name).to_owned(),
                    observations: Vec::new(),
                })
                .collect(),
            points: [(0, 0.5), (0, 5.0)]
                .into_iter()
                .enumerate()
                .map(|(i, (track_length, error_px))| ModelPoint {
                    id: PointId(i as u64),
                    position: DVec3::new(1.0, 2.0, i as f64),
                    color_srgb8: [1, 2, 3],
                    error_px,
                    track_length,
                    track: Vec::new(),
                })
                .collect(),
            rigs: None,
            frames: None,
        };
        let dir = tempfile::tempdir().unwrap();
        model.write(&dir.path().join("model"), Form::Text).unwrap();
        let capture = Self { dir, lens };
        let half = lens.resized((SIZE.0 / 2, SIZE.1 / 2)).unwrap();
        for name in ["b/two", "one", "three.v2", "four"] {
            capture.write(&format!("linear/{name}.exr"), &picture(&half));
        }
        capture
    }

    fn path(&self, relative: &str) -> PathBuf {
        self.dir.path().join(relative)
    }

    fn write(&self, relative: &str, image: &Image<3>) {
        let path = self.path(relative);
        files::create_dir(path.parent().unwrap()).unwrap();
        exr::write_rgb(&path, image, Precision::Float).unwrap();
    }

    fn options(&self) -> ImportOptions {
        ImportOptions {
            images: Some(self.path("linear")),
            points: PointFilter {
                min_track: 0,
                max_error_px: 1.0,
            },
            align: AlignOptions {
                mode: Mode::None,
                ..AlignOptions::default()
            },
            precision: Depth::Float,
            ..ImportOptions::default()
        }
    }

    fn import(&self, options: &ImportOptions) -> Result<ImportReport> {
        import(&self.path("model"), &self.path("out"), options, &mut |_| ())
    }

    #[track_caller]
    fn refused(&self, options: &ImportOptions, parts: &[&str]) {
        let message = self.import(options).unwrap_err().to_string();
        for part in parts {
            assert!(message.contains(part), "no `{part}` in: {message}");
        }
        assert!(!message.contains('\n') && !self.path("out/transforms.json").exists());
    }
}

/// x and y of the direction that each pixel sees, and 1.
fn picture(lens: &Lens) -> Image<3> {
    let (width, height) = lens.size();
    let pixels = (0..height)
        .flat_map(|y| (0..width).map(move |x| DVec2::new(f64::from(x), f64::from(y)) + 0.5))
        .map(|pixel| lens.unproject(pixel).unwrap())
        .map(|ray| {
            [
                (1.0 + ray.x / ray.z) as f32,
                (1.0 + ray.y / ray.z) as f32,
                1.0,
            ]
        })
        .collect();
    Image::from_pixels(width, height, pixels).unwrap()
}

#[test]
fn images_are_undistorted_whatever_their_size() {
    let capture = Capture::new();
    let report = capture.import(&capture.options()).unwrap();
    assert_eq!(report.conditions[0].unregistered, ["four"]);
    assert_eq!(report.points.num_kept, 1);
    assert_eq!(report.cameras[0].image_size, [32, 24]);
    let dataset = Dataset::open(&capture.path("out")).unwrap();
    let names: Vec<_> = dataset
        .frames()
        .iter()
        .map(|frame| frame.name.as_str())
        .collect();
    assert_eq!(names, ["b/two", "one", "three.v2"]);
    assert_eq!(dataset.up_axis(), None);
    assert!(dataset.aligned_from_model().is_some());
    for index in 0..dataset.len() {
        let view = dataset.load_view(index).unwrap();
        let camera = view.camera;
        for y in 1..camera.height - 1 {
            for x in 1..camera.width - 1 {
                let [u, v, one] = view.radiance.get(x, y);
                let expected = [
                    1.0 + (f64::from(x) + 0.5 - camera.cx) / camera.fx,
                    1.0 + (f64::from(y) + 0.5 - camera.cy) / camera.fy,
                ];
                // A nearly linear picture through Catmull-Rom: curvature of 0.3 over pixels of
                // 1/30.
                assert!(
                    (f64::from(u) - expected[0]).abs() < 2e-3,
                    "{u} {expected:?}"
                );
                assert!(
                    (f64::from(v) - expected[1]).abs() < 2e-3,
                    "{v} {expected:?}"
                );
                assert!((one - 1.0).abs() < 1e-6);
            }
        }
    }
    // Poses: the model's, inverted.
    let one = dataset.frames()[1].camera.world_from_camera;
    let expected = Rigid {
        rotation: DQuat::from_rotation_y(0.3),
        translation: DVec3::new(1.0, 0.0, 1.0),
    };
    assert!((one.translation - expected.centre()).length() < 1e-12);
}

#[test]
fn unknown_pixels_are_told_apart_from_black_ones() {
    let capture = Capture::new();
    let mut options = capture.options();
    options.undistort.field = Field::All;
    let report = capture.import(&options).unwrap();
    let num_unknown = report.conditions[0].num_unknown_pixels;
    assert!(num_unknown > 0);
    let valid = exr::read_single(&capture.path("out/Valid-exr/b/two.exr")).unwrap();
    let zeros = valid.values().iter().filter(|v| **v == 0.0).count() as u64;
    assert_eq!(3 * zeros, num_unknown);
    assert!(
        report
            .warnings
            .iter()
            .any(|text| text.contains("Valid-exr"))
    );
}

#[test]
fn everything_wrong_with_the_images_comes_at_once() {
    let capture = Capture::new();
    std::fs::remove_file(capture.path("linear/one.exr")).unwrap();
    capture.write("linear/three.v2.exr", &Image::filled(30, 30, [1.0; 3]));
    let mut options = capture.options();
    let parts = [
        "1 of 3 registered images",
        "one",
        "three.v2 is 30x30",
        "64x48",
    ];
    capture.refused(&options, &parts);
    capture.write(
        "linear/three.v2.exr",
        &Image::filled(32, 24, [1.0, f32::NAN, 0.0]),
    );
    options.missing = Missing::Skip;
    capture.refused(&options, &["three.v2.exr", "pixel (0, 0)", "not finite"]);
    capture.write(
        "linear/three.v2.exr",
        &Image::filled(32, 24, [1.0, -1e-4, 0.0]),
    );
    let report = capture.import(&options).unwrap();
    assert_eq!(report.conditions[0].missing, ["one"]);
    assert_eq!(report.conditions[0].num_negative_pixels, 32 * 24);
}

#[test]
fn pictures_are_decoded_only_if_told() {
    let capture = Capture::new();
    let mut options = capture.options();
    options.images = Some(capture.path("pictures"));
    std::fs::create_dir_all(capture.path("pictures")).unwrap();
    for name in ["two", "one", "three.v2"] {
        let path = capture.path(&format!("pictures/{name}.png"));
        eagpt_scene::png::write_rgb8(&path, SIZE.0, SIZE.1, &[128; 64 * 48 * 3]).unwrap();
    }
    capture.refused(&options, &["3 8-bit pictures"]);
    options.srgb8 = Srgb8::Decode;
    let report = capture.import(&options).unwrap();
    assert!(report.warnings[0].contains("8-bit"));
    let dataset = Dataset::open(&capture.path("out")).unwrap();
    // `b/two` is found by the last part of its name. ((128/255 + 0.055) / 1.055)^2.4 = 0.215861.
    let [red, ..] = dataset.load_view(0).unwrap().radiance.get(20, 20);
    assert!((red - 0.215_861).abs() < 1e-5, "{red}");
    assert!(capture.lens.as_pinhole(glam::DAffine3::IDENTITY).is_none());
}

#[test]
fn names_that_leave_the_folder_are_refused() {
    let capture = Capture::new();
    let path = capture.path("model/images.txt");
    let text = std::fs::read_to_string(&path).unwrap();
    for (name, part) in [
        ("../one.jpg", "cannot name a view"),
        ("b/two.png", "would be one view"),
    ] {
        std::fs::write(&path, text.replace(" one.jpg", &format!(" {name}"))).unwrap();
        capture.refused(&capture.options(), &["images.txt", part]);
    }
    let mut options = capture.options();
    for conditions in [
        vec!["../x".to_owned()],
        vec!["a".to_owned(), "a".to_owned()],
    ] {
        options.conditions = conditions;
        assert!(options.validate().is_err());
    }
}
