mod conditions;
mod selection;

use super::*;
use crate::error::Result;
use crate::evaluation::Evaluation;
use crate::metrics::METRICS;
use crate::view::ViewMetrics;
use eagpt_scene::dataset::{DatasetWriter, Subset};
use eagpt_scene::exr::Precision;
use eagpt_scene::{Camera, Image, View, exr};
use std::path::PathBuf;
use tempfile::TempDir;

const SIZE: (u32, u32) = (16, 12);
/// Of these, `every-8th` tests the first and the last.
const NUM_VIEWS: usize = 9;

fn name(index: usize) -> String {
    format!("cam_{}/img_{index}", index % 2)
}

fn radiance(index: usize) -> Image<3> {
    let pixels = (0..SIZE.0 * SIZE.1).map(|i| {
        let value = (i as usize * 31 + index * 17) % 97;
        [value as f32 / 50.0, 0.5, (i % 5) as f32]
    });
    Image::from_pixels(SIZE.0, SIZE.1, pixels.collect()).unwrap()
}

fn single(value: f32) -> Image<1> {
    Image::filled(SIZE.0, SIZE.1, [value])
}

fn view(index: usize) -> View {
    // The left half emits in view 0, nothing does in the others.
    let emission = (0..SIZE.0 * SIZE.1).map(|i| [f32::from(index == 0 && i % SIZE.0 < 8)]);
    View {
        name: name(index),
        camera: Camera {
            width: SIZE.0,
            height: SIZE.1,
            fx: 12.0,
            fy: 12.0,
            cx: 8.0,
            cy: 6.0,
            world_from_camera: glam::DAffine3::IDENTITY,
        },
        radiance: radiance(index),
        emission: Image::from_pixels(SIZE.0, SIZE.1, emission.collect()),
        normal: Some(Image::filled(SIZE.0, SIZE.1, [0.0, 0.0, 1.0])),
        alpha: None,
        depth: Some(single(2.0)),
        albedo: Some(Image::filled(SIZE.0, SIZE.1, [0.5, 0.4, 0.3])),
        specular: Some(Image::filled(SIZE.0, SIZE.1, [0.04; 3])),
        roughness: Some(Image::filled(SIZE.0, SIZE.1, [0.3])),
        clipped: None,
        valid: None,
    }
}

/// A dataset and a folder of renders: the references plus 0.1 in green, and the other channels of
/// view 0.
/// The evaluation of one condition.
fn evaluated(options: &EvalOptions, progress: &mut dyn FnMut(EvalProgress)) -> Result<Evaluation> {
    let options = ConditionsOptions::new(vec![options.clone()], &options.out)?;
    let mut found = evaluate(&options, progress)?;
    for (mean, own) in found.means.iter().zip(&found.conditions[0].means) {
        assert_eq!((mean.metric.key, mean.value), (own.metric.key, own.value));
    }
    Ok(found.conditions.remove(0))
}

struct Case {
    dir: TempDir,
    options: EvalOptions,
}

impl Case {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let (data, renders) = (dir.path().join("data"), dir.path().join("renders"));
        let mut writer = DatasetWriter::create(&data, Precision::Float).unwrap();
        for index in 0..NUM_VIEWS {
            writer.write_view(&view(index)).unwrap();
        }
        writer.finish(&Default::default()).unwrap();
        let case = Self {
            options: EvalOptions::new(&renders, &data, &dir.path().join("out")),
            dir,
        };
        for index in [0, 8] {
            let render = radiance(index).map(|[r, g, b]| [*r, g + 0.1, *b]);
            case.render_rgb("", index, &render);
        }
        case.render_rgb("normal", 0, &Image::filled(SIZE.0, SIZE.1, [0.0, 1.0, 1.0]));
        case.render_rgb(
            "albedo",
            0,
            &Image::filled(SIZE.0, SIZE.1, [0.25, 0.2, 0.15]),
        );
        case.render_single("depth", 0, &single(2.25));
        case.render_rgb("specular", 0, &Image::filled(SIZE.0, SIZE.1, [0.05; 3]));
        case.render_single("roughness", 0, &single(0.5));
        case.render_single("emission", 0, &single(1.0));
        case.render_single("emission", 8, &single(0.0));
        case
    }

    fn path(&self, channel: &str, index: usize) -> PathBuf {
        let folder = self.options.renders.join(channel);
        let path = folder.join(format!("{}.exr", name(index)));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn render_rgb(&self, channel: &str, index: usize, image: &Image<3>) {
        exr::write_rgb(&self.path(channel, index), image, Precision::Float).unwrap();
    }

    fn render_single(&self, channel: &str, index: usize, image: &Image<1>) {
        exr::write_single(&self.path(channel, index), image, Precision::Float).unwrap();
    }

    fn run(&self) -> Result<Evaluation> {
        evaluated(&self.options, &mut |_| {})
    }

    #[track_caller]
    fn assert_refused(&self, parts: &[&str]) {
        let message = self.run().unwrap_err().to_string();
        assert!(!message.contains('\n'), "{message}");
        for part in parts {
            assert!(message.contains(part), "no `{part}` in: {message}");
        }
    }

    fn output(&self, name: &str) -> String {
        std::fs::read_to_string(self.dir.path().join("out").join(name)).unwrap()
    }
}

#[test]
fn two_views_with_known_errors() {
    let case = Case::new();
    let mut messages = Vec::new();
    let found = evaluated(&case.options, &mut |message| messages.push(message)).unwrap();
    assert_eq!(messages.len(), 5 + 1 + 2, "{messages:?}");
    assert_eq!(messages[5], EvalProgress::Started { total: 2 });

    let names: Vec<&str> = found.views.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["cam_0/img_0", "cam_0/img_8"]);
    // Red and blue are equal, so the mean of the channels' decibels is infinite.
    assert_eq!(found.mean("psnr_linear_db"), Some(f64::INFINITY));
    let scene = &found.views[0].scene;
    assert!((scene.normal_mean_deg.unwrap() - 45.0).abs() < 1e-5);
    assert!((scene.depth_mae.unwrap() - 0.25).abs() < 1e-6);
    assert!((scene.specular_mae.unwrap() - 0.01).abs() < 1e-6);
    assert!((scene.roughness_mae.unwrap() - 0.2).abs() < 1e-6);
    assert_eq!(scene.false_gloss, Some(0.0));
    assert_eq!(scene.emission_iou, Some(0.5));
    assert!(scene.albedo_psnr_srgb_db.unwrap() < 20.0);
    assert!(scene.albedo_psnr_scaled_db.unwrap() > 100.0);
    // View 8 has nothing that emits and no other channels.
    assert_eq!(found.views[1].scene, crate::view::SceneMetrics::default());
    assert_eq!(found.mean("emission_iou"), Some(0.5));
    assert!(found.mean("flip_hdr").unwrap() > 0.0);
    assert_eq!(found.mean("no such metric"), None);
}

#[test]
fn what_the_reference_does_not_know_is_not_measured() {
    let case = Case::new();
    // The four columns on the left are not known.
    let known = (0..SIZE.0 * SIZE.1).map(|i| [f32::from(i % SIZE.0 >= 4)]);
    let known = Image::from_pixels(SIZE.0, SIZE.1, known.collect()).unwrap();
    let mut written = DatasetWriter::create(&case.options.dataset, Precision::Float).unwrap();
    for index in 0..NUM_VIEWS {
        let valid = Some(known.clone());
        let changed = View {
            valid,
            ..view(index)
        };
        written.write_view(&changed).unwrap();
    }
    written.finish(&Default::default()).unwrap();
    let render = |index, unknown: f32| {
        let mut image = radiance(index).map(|[r, g, b]| [r + 0.2, g + 0.1, b * 0.9]);
        let pairs = image.pixels_mut().iter_mut().zip(known.values());
        for (pixel, _) in pairs.filter(|(_, known)| **known == 0.0) {
            *pixel = [unknown; 3];
        }
        case.render_rgb("", index, &image);
        image
    };
    let (first, last) = (render(0, 0.0), render(8, 0.0));
    let found = case.run().unwrap();
    let told = |text: &String| text.contains("2 of 2 views are measured where Valid-exr");
    assert!(found.warnings.iter().any(told), "{:?}", found.warnings);
    render(0, 500.0);
    render(8, 3.0);
    let again = case.run().unwrap();
    assert_eq!(found.views, again.views);
    assert_eq!(found.exposure_scale, again.exposure_scale);

    for (index, render, view) in [(0, first, &found.views[0]), (8, last, &found.views[1])] {
        let right = |image: &Image<3>| {
            let columns = image.pixels().iter().zip(known.values());
            let columns = columns.filter(|(_, known)| **known > 0.0);
            Image::from_pixels(12, 12, columns.map(|(pixel, _)| *pixel).collect()).unwrap()
        };
        let (a, b) = (right(&radiance(index)), right(&render));
        // Sums of the same numbers, by other rows.
        for (own, expected) in [
            (view.image.psnr_srgb_db, crate::psnr_srgb(&a, &b)),
            (view.image.psnr_linear_db, crate::psnr_linear(&a, &b)),
            (view.image.psnr_pq_db, crate::psnr_pq(&a, &b)),
        ] {
            assert!((own - expected).abs() < 1e-9, "{own} {expected}");
        }
        let expected = crate::flip::FlipParameters::for_reference(&case.options.flip, &a).unwrap();
        assert_eq!(view.image.flip_hdr_parameters, expected);
        assert!(view.image.ssim_srgb < 1.0 && view.image.flip_hdr > 0.0);
    }
    // Of the 8 columns that emit in view 0, 4 are known; the render says that all 16 do.
    assert_eq!(found.views[0].scene.emission_iou, Some(4.0 / 12.0));
}

#[test]
fn the_files_say_what_was_found() {
    let case = Case::new();
    let found = case.run().unwrap();
    let json: serde_json::Value = serde_json::from_str(&case.output("metrics.json")).unwrap();
    assert_eq!(json["mean"]["psnr_linear_db"], serde_json::Value::Null);
    assert_eq!(json["mean"]["ssim_srgb"].as_f64(), found.mean("ssim_srgb"));
    assert_eq!(json["num_views"], 2);
    assert_eq!(json["num_rendered"], 2);
    assert_eq!(json["split"], serde_json::Value::Null);
    assert_eq!(json["subset"], serde_json::Value::Null);
    assert_eq!(json["warnings"].as_array().unwrap().len(), 5);
    for metric in &METRICS {
        assert!(json["definitions"][metric.key].as_str().unwrap().len() > 20);
    }
    let parameters = &json["views"][0]["flip_hdr_parameters"];
    assert_eq!(parameters["tonemapper"], "aces");
    let back: Vec<ViewMetrics> = serde_json::from_value(json["views"].clone()).unwrap();
    assert_eq!(back, found.views);
    assert!(json["views"][1].get("depth_mae").is_none());

    let csv = case.output("metrics.csv");
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 3);
    let num_columns = 1 + 18 + 5;
    assert!(
        lines
            .iter()
            .all(|line| line.split(',').count() == num_columns)
    );
    assert!(lines[1].starts_with("cam_0/img_0,inf,inf,inf,0."), "{csv}");
    assert!(lines[2].contains(",,,,,"), "{csv}");

    let markdown = case.output("table.md");
    assert!(
        markdown.contains("| cam_0/img_8 | inf | inf | inf | 0."),
        "{markdown}"
    );
    assert!(markdown.contains("| **mean** | **inf** |"), "{markdown}");
    assert!(markdown.contains("views: 2 of 2 rendered"), "{markdown}");
    assert!(
        markdown.contains("Depth MAE: mean over 1 of 2 views"),
        "{markdown}"
    );

    let latex = case.output("table.tex");
    assert!(latex.contains("cam\\_0/img\\_8 & inf"), "{latex}");
    for rule in ["\\toprule", "\\midrule", "\\bottomrule"] {
        assert!(latex.contains(rule), "{latex}");
    }
    let map = case.dir.path().join("out/flip/cam_0/img_8.png");
    assert!(std::fs::metadata(map).unwrap().len() > 50);
}

#[test]
fn missing_renders_are_listed_before_any_work() {
    let mut case = Case::new();
    case.options.subset = Some(Subset::All);
    case.assert_refused(&["no render for 7 of 9 views", "cam_1/img_1", "cam_1/img_7"]);
    assert!(!case.options.out.exists());
}

#[test]
fn bad_renders_are_named() {
    let case = Case::new();
    case.render_rgb("normal", 8, &Image::filled(3, 2, [0.0; 3]));
    case.assert_refused(&["normal/cam_0/img_8.exr", "3x2", "16x12"]);
    let case = Case::new();
    let mut render = radiance(8);
    render.pixels_mut()[17][2] = f32::NAN;
    case.render_rgb("", 8, &render);
    case.assert_refused(&["cam_0/img_8.exr", "pixel (1, 1)", "1 of 192"]);
    assert!(!case.options.out.join("metrics.json").exists());
    let mut case = Case::new();
    case.options.flip.ppd = -1.0;
    case.assert_refused(&["ppd", "-1"]);
}
