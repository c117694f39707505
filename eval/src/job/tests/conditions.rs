//! Exposure, regions, and several conditions at once.

use super::{Case, NUM_VIEWS, SIZE, name, radiance, view};
use crate::job::*;
use crate::regions::Region;
use crate::view::{EmittersFrom, ViewMetrics};
use eagpt_scene::dataset::DatasetWriter;
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Image, View};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn write_dataset(root: &Path, num_views: usize, change: impl Fn(&mut View)) {
    let mut writer = DatasetWriter::create(root, Precision::Float).unwrap();
    for index in 0..num_views {
        let mut view = view(index);
        change(&mut view);
        writer.write_view(&view).unwrap();
    }
    writer.finish(&Default::default()).unwrap();
}

fn json_of(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Writes the references of `case`, multiplied, as renders of both test views into another folder.
fn scaled_renders(case: &Case, folder: &str, factor: f32) -> PathBuf {
    let root = case.dir.path().join(folder);
    for index in [0, 8] {
        let path = root.join(format!("{}.exr", name(index)));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let image = radiance(index).map(|pixel| pixel.map(|v| v * factor));
        exr::write_rgb(&path, &image, Precision::Float).unwrap();
    }
    root
}

#[test]
fn renders_of_another_exposure_are_perfect_when_aligned() {
    let mut case = Case::new();
    case.options.renders = scaled_renders(&case, "half", 0.5);
    let found = case.run().unwrap();
    assert_eq!(found.exposure_scale, Some(2.0));
    assert!(found.mean("psnr_srgb_db").unwrap() < 30.0);
    assert_eq!(found.mean("psnr_srgb_aligned_db"), Some(f64::INFINITY));
    assert_eq!(found.mean("psnr_pq_aligned_db"), Some(f64::INFINITY));
    assert_eq!(found.mean("flip_hdr_aligned"), Some(0.0));
    let json: Value = serde_json::from_str(&case.output("metrics.json")).unwrap();
    assert_eq!(json["exposure_scale"], 2.0);
    assert_eq!(found.mean("exposure_scale"), Some(2.0));
    assert_eq!(json["mean"]["exposure_scale"], 2.0);
    assert_eq!(json["mean"]["psnr_srgb_aligned_db"], Value::Null);
    assert!(case.output("table.md").contains("multiplied by 2.0000"));

    // One scale for all views: of two views with different factors, none is perfect.
    let path = case.path("", 8);
    let image = radiance(8).map(|pixel| pixel.map(|v| v * 0.25));
    exr::write_rgb(&path, &image, Precision::Float).unwrap();
    let found = case.run().unwrap();
    assert!((2.01..3.99).contains(&found.exposure_scale.unwrap()));
    assert!(found.mean("psnr_pq_aligned_db").unwrap() < 60.0);
}

#[test]
fn black_renders_have_nothing_to_align() {
    let mut case = Case::new();
    case.options.renders = scaled_renders(&case, "black", 0.0);
    let found = case.run().unwrap();
    assert_eq!(found.exposure_scale, None);
    assert_eq!(found.mean("psnr_srgb_aligned_db"), None);
    assert_eq!(found.mean("exposure_scale"), None);
    let json: Value = serde_json::from_str(&case.output("metrics.json")).unwrap();
    assert_eq!(json["exposure_scale"], Value::Null);
    let back: Vec<ViewMetrics> = serde_json::from_value(json["views"].clone()).unwrap();
    assert_eq!(back, found.views);
}

#[test]
fn regions_come_from_masks_and_the_earlier_light() {
    let mut case = Case::new();
    // Without an earlier light: the left half of view 0 emits.
    let found = case.run().unwrap();
    let regions: Vec<Region> = found.regions.keys().copied().collect();
    assert_eq!(regions, [Region::Emitter, Region::Surface]);
    assert_eq!(found.regions[&Region::Emitter].share, 0.25);
    assert!((found.regions[&Region::Emitter].mse_linear[1] - 0.01).abs() < 1e-6);

    // Before, the upper half was black and nothing emitted: it is lit now, the rest is in shadow.
    let before = case.dir.path().join("before");
    write_dataset(&before, NUM_VIEWS, |view| {
        view.emission = None;
        let half = (SIZE.0 * SIZE.1 / 2) as usize;
        view.radiance.pixels_mut()[..half].fill([0.0; 3]);
    });
    case.options.before = Some(before);
    let found = case.run().unwrap();
    let shares: Vec<f64> = found
        .regions
        .values()
        .map(|metrics| metrics.share)
        .collect();
    assert_eq!(shares, [0.25, 0.375, 0.375]);
    assert!(found.light_change.unwrap() > 1.0);
    let json: Value = serde_json::from_str(&case.output("metrics.json")).unwrap();
    assert_eq!(json["regions"]["lit"]["num_pixels"], 144);
    assert_eq!(json["views"][1]["emitters_from"], "reference");
    assert_eq!(json["views"][1]["regions"]["shadow"]["num_pixels"], 96);
    let table = case.output("table.md");
    assert!(table.contains("| shadow | 37.50 | inf |"), "{table}");

    // The references' own light gives no change.
    case.options.before = Some(case.options.dataset.join("transforms.json"));
    let found = case.run().unwrap();
    assert!(found.regions.contains_key(&Region::Surface));
    assert_eq!(found.light_change, None);
}

#[test]
fn emitters_come_from_the_renders_for_want_of_masks() {
    let mut case = Case::new();
    let data = case.dir.path().join("unmasked");
    write_dataset(&data, NUM_VIEWS, |view| view.emission = None);
    case.options.before = Some(std::mem::replace(&mut case.options.dataset, data));
    let found = case.run().unwrap();
    // The render of view 0 emits everywhere, that of view 8 nowhere.
    assert_eq!(found.regions[&Region::Emitter].share, 0.5);
    assert_eq!(found.views[0].emitters_from, Some(EmittersFrom::Render));
    assert!(case.output("table.md").contains("in 2 of 2 views"));
    std::fs::remove_dir_all(case.options.renders.join("emission")).unwrap();
    let found = case.run().unwrap();
    assert!(!found.regions.contains_key(&Region::Emitter));
    let warned = found
        .warnings
        .iter()
        .any(|text| text.contains("not known in 2 of 2"));
    assert!(warned, "{:?}", found.warnings);
}

#[test]
fn an_earlier_light_of_other_views_is_refused() {
    let mut case = Case::new();
    let before = case.dir.path().join("before");
    case.options.before = Some(before.clone());
    write_dataset(&before, 3, |_| ());
    case.assert_refused(&["before/transforms.json: cam_0/img_8", "no such view"]);
    std::fs::remove_dir_all(&before).unwrap();
    write_dataset(&before, NUM_VIEWS, |view| {
        view.camera.width = 4;
        view.camera.height = 3;
        view.radiance = Image::filled(4, 3, [0.5; 3]);
        (view.emission, view.normal, view.depth, view.albedo) = (None, None, None, None);
    });
    case.assert_refused(&["before/transforms.json: cam_0/img_0", "4x3", "16x12"]);
    assert!(!case.options.out.exists());
}

/// The case's own condition, and one of 17 views that is black but for one factor.
fn two_conditions(case: &Case) -> ConditionsOptions {
    let relit = case.dir.path().join("relit");
    write_dataset(&relit, NUM_VIEWS, |view| {
        view.radiance = view.radiance.map(|pixel| pixel.map(|v| 0.5 * v));
        (view.normal, view.depth, view.albedo) = (None, None, None);
    });
    let mut second = EvalOptions::new(&case.options.renders, &relit, Path::new(""));
    second.before = Some(case.options.dataset.clone());
    let conditions = vec![case.options.clone(), second];
    ConditionsOptions::new(conditions, &case.options.out).unwrap()
}

#[test]
fn two_conditions_and_their_mean() {
    let case = Case::new();
    let record = json!({
        "command": "render",
        "options": {"integrator": {"mode": "1-bounce", "num_samples": 3}, "rays_per_axis": 2},
        "seconds": {format!("views/{}", name(0)): 1.0},
    });
    std::fs::write(case.options.renders.join("record.json"), record.to_string()).unwrap();
    let options = two_conditions(&case);
    let mut messages = Vec::new();
    let found = evaluate(&options, &mut |message| messages.push(message)).unwrap();
    assert!(messages.contains(&EvalProgress::Started { total: 4 }));
    let last = EvalProgress::View {
        name: "relit/cam_0/img_8".to_owned(),
        done: 4,
        total: 4,
    };
    assert_eq!(messages.last(), Some(&last));

    let each = |key| [0, 1].map(|i| found.conditions[i].mean(key));
    let [Some(a), Some(b)] = each("ssim_srgb") else {
        panic!("a condition has no SSIM")
    };
    assert!((found.mean("ssim_srgb").unwrap() - (a + b) / 2.0).abs() < 1e-12);
    assert_ne!(a, b);
    // Of one condition alone.
    assert_eq!(each("depth_mae")[1], None);
    assert_eq!(found.mean("depth_mae"), each("depth_mae")[0]);
    assert_eq!(found.mean("psnr_linear_db"), Some(f64::INFINITY));

    let json = json_of(&case.options.out.join("metrics.json"));
    assert_eq!(json["mean"]["ssim_srgb"].as_f64(), found.mean("ssim_srgb"));
    let [first, second] = json["conditions"].as_array().unwrap().as_slice() else {
        panic!("not two conditions")
    };
    assert_eq!(
        (&first["name"], &second["name"]),
        (&json!("data"), &json!("relit"))
    );
    assert_eq!(second["render"]["mode"], "1-bounce");
    assert_eq!(second["render"]["spp"], 12);
    assert_eq!(second["render"]["seconds_per_frame"], 1.0);
    assert_eq!(second["render"]["denoiser"], Value::Null);
    // Each condition is all that an evaluation of its own would say.
    assert_eq!(
        *second,
        json_of(&case.options.out.join("relit/metrics.json"))
    );
    assert_eq!(second["views"].as_array().unwrap().len(), 2);
    let csv = case.output("metrics.csv");
    assert_eq!(csv.lines().count(), 3);
    let table = case.output("table.md");
    assert!(table.contains("| relit | "), "{table}");
    assert!(table.contains("| **mean** | "), "{table}");
    assert!(
        case.options
            .out
            .join("relit/flip/cam_0/img_8.png")
            .is_file()
    );
}

#[test]
fn conditions_are_checked_before_any_work() {
    let case = Case::new();
    let options = two_conditions(&case);
    let missing = case.dir.path().join("relit/Radiance-exr/cam_0/img_8.exr");
    std::fs::remove_file(missing).unwrap();
    let message = evaluate(&options, &mut |_| {}).unwrap_err();
    assert!(
        message.to_string().contains("relit/transforms.json"),
        "{message}"
    );
    assert!(!case.options.out.exists());
}

#[test]
fn names_of_conditions_are_those_of_folders() {
    let refused = |names: [&str; 2]| {
        let conditions = names.map(|name| EvalOptions {
            name: Some(name.to_owned()),
            ..EvalOptions::new(Path::new("r"), Path::new("d"), Path::new("o"))
        });
        let refused = ConditionsOptions::new(conditions.into(), Path::new("out"));
        refused.unwrap_err().to_string()
    };
    assert_eq!(
        refused(["a", "a"]),
        "option name: a, must be another for each condition"
    );
    for bad in ["..", "a/b", "", ".", "/a", "a/"] {
        let message = refused(["a", bad]);
        assert!(message.contains("a name for a folder"), "{bad}: {message}");
    }
}
