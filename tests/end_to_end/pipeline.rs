//! From a dataset to tables.

use crate::support::{SHORT, Workplace};
use eagpt_scene::{Harmonics, exr, ply};
use glam::Vec3;
use serde_json::Value;

#[test]
fn train_render_eval() {
    let place = Workplace::new();
    let told = place.succeeds(&format!("train room --out run {SHORT} --json --threads 2"));
    check_messages(
        &told,
        &["reading_views", "stage_started", "iteration", "checkpoint"],
    );
    for name in ["scene.ply", "train.toml", "log.jsonl"] {
        assert!(place.path("run").join(name).is_file(), "{name}");
    }
    assert!(place.names("run/previews").len() >= 2);
    let record = place.json("run/record.json");
    for key in ["radiance", "albedo", "total"] {
        assert!(record["seconds"][key].as_f64().unwrap() > 0.0, "{key}");
    }
    assert_eq!(record["options"]["radiance"]["iterations"], 150);
    assert_eq!(record["options"]["init"]["scale_factor"], 0.9);
    assert_eq!(
        (&record["threads"], &record["seed"]),
        (&2.into(), &0.into())
    );
    assert_eq!(record["split"]["rule"], "every-8th");
    assert_eq!(
        (&record["split"]["num_train"], &record["split"]["num_test"]),
        (&10.into(), &2.into())
    );
    assert_eq!(record["complete"], true);
    if cfg!(target_os = "linux") {
        assert!(record["peak_memory_mib"].as_f64().unwrap() > 1.0);
    }

    for (mode, least_db) in [("0-bounce", 18.0), ("1-bounce", 14.0), ("path", 12.0)] {
        let aov = "--aov normal,depth,albedo,emission,alpha,specular,roughness";
        let render =
            format!("render run/scene.ply --cameras room --mode {mode} --spp 4 {aov} --out {mode}");
        let told = place.succeeds(&format!("{render} --json"));
        check_messages(&told, &["view"]);
        check_rendering(&place, mode);
        let told = place.succeeds(&format!(
            "eval {mode} --reference room --out eval-{mode} --json"
        ));
        check_messages(&told, &["started", "view"]);
        let mean = &place.json(&format!("eval-{mode}/metrics.json"))["mean"];
        // A black picture of this room has some 5 dB; these only say that the right pictures were
        // compared.
        assert!(
            mean["psnr_srgb_db"].as_f64().unwrap() > least_db,
            "{mode}: {mean}"
        );
        for key in [
            "ssim_srgb",
            "flip_hdr",
            "normal_mean_deg",
            "depth_mae",
            "emission_iou",
            "albedo_psnr_srgb_db",
        ] {
            assert!(mean[key].is_number(), "{mode}: {key} is missing in {mean}");
        }
        // Depth from ray distances taken for depths along the axis would be off by up to a third in
        // the corners.
        assert!(mean["depth_mae"].as_f64().unwrap() < 0.25, "{mode}: {mean}");
    }
    let names = place.names("eval-path");
    for name in [
        "flip/000.png",
        "flip/008.png",
        "metrics.csv",
        "record.json",
        "table.md",
        "table.tex",
    ] {
        assert!(
            names.iter().any(|found| found == name),
            "{name} is not in {names:?}"
        );
    }
}

/// Every line is a JSON object with a `message`; all of `wanted` come, and `done` comes last.
#[track_caller]
fn check_messages(told: &str, wanted: &[&str]) {
    let messages: Vec<String> = told
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap())
        .map(|message| message["message"].as_str().unwrap().to_owned())
        .collect();
    for name in wanted {
        assert!(
            messages.iter().any(|m| m == name),
            "no {name} in {messages:?}"
        );
    }
    assert_eq!(messages.last().unwrap(), "done");
}

fn check_rendering(place: &Workplace, mode: &str) {
    let mut expected = vec!["record.json".to_owned()];
    for view in ["000", "008"] {
        for dir in [
            "",
            "normal/",
            "depth/",
            "albedo/",
            "emission/",
            "alpha/",
            "specular/",
            "roughness/",
        ] {
            expected.push(format!("{dir}{view}.exr"));
            if !["depth/", "alpha/"].contains(&dir) {
                expected.push(format!("{dir}{view}.png"));
            }
        }
    }
    expected.sort();
    assert_eq!(place.names(mode), expected);
    let image = exr::read_rgb(&place.path(mode).join("000.exr")).unwrap();
    assert_eq!(image.size(), (48, 32));
    let record = place.json(&format!("{mode}/record.json"));
    assert_eq!(record["options"]["integrator"]["mode"], mode);
    assert!(record["seconds"]["views/008"].as_f64().is_some());
    assert_eq!(
        record["outputs"].as_array().unwrap().len(),
        expected.len() - 1
    );
    let digest = blake3::hash(&place.bytes("run/scene.ply"))
        .to_hex()
        .to_string();
    assert_eq!(record["inputs"][0]["blake3"], digest);
}

#[test]
fn views_by_name_subset_and_force() {
    let place = Workplace::trained();
    let render = "render run/scene.ply --cameras room --mode 0-bounce --out out";
    place.succeeds(&format!("{render} --views 003,001"));
    assert_eq!(
        place.names("out"),
        ["001.exr", "001.png", "003.exr", "003.png", "record.json"]
    );
    place.fails_cleanly(render, &["out", "record.json", "--force"]);
    // Files of the earlier record go; others stay.
    place.write("out/notes.txt", "mine");
    place.succeeds(&format!("{render} --force --split-rule all --split all"));
    let names = place.names("out");
    assert_eq!(names.len(), 2 * 12 + 2);
    place.succeeds(&format!("{render} --force"));
    let left = [
        "000.exr",
        "000.png",
        "008.exr",
        "008.png",
        "notes.txt",
        "record.json",
    ];
    assert_eq!(place.names("out"), left);
}

#[test]
fn names_with_folders_keep_them() {
    let place = Workplace::trained();
    std::fs::create_dir(place.path("room/Radiance-exr/10")).unwrap();
    let from = place.path("room/Radiance-exr/002.exr");
    std::fs::rename(from, place.path("room/Radiance-exr/10/b.2.exr")).unwrap();
    place.edit_transforms(|t| t["frames"][2]["file_name"] = "10/b.2".into());
    place.succeeds(
        "render run/scene.ply --cameras room --mode 0-bounce --views 10/b.2 --aov depth --out out",
    );
    let names = [
        "10/b.2.exr",
        "10/b.2.png",
        "depth/10/b.2.exr",
        "record.json",
    ];
    assert_eq!(place.names("out"), names);
}

#[test]
fn export_writes_previews_and_the_scene_itself() {
    let place = Workplace::trained();
    for format in ["2dgs", "3dgs", "eagpt"] {
        place.succeeds(&format!(
            "export run/scene.ply --format {format} --out sub/{format}.ply"
        ));
    }
    assert_eq!(place.bytes("sub/eagpt.ply"), place.bytes("run/scene.ply"));
    let mut scene = ply::read_gaussians(&place.path("run/scene.ply")).unwrap();
    let points = scene.len();
    scene.albedos[0] = Vec3::new(2.5, 0.5, 1.0);
    ply::write_gaussians(&place.path("bright.ply"), &scene).unwrap();
    place.succeeds("export bright.ply --format eag-pt --out sub/eag-pt.ply");
    let plain = ply::read_gaussians(&place.path("sub/eag-pt.ply")).unwrap();
    assert_eq!(plain.albedos[0], Vec3::new(1.0, 0.5, 1.0));
    let cut = scene.albedos.iter().map(|albedo| albedo.min(Vec3::ONE));
    assert!(plain.albedos.iter().copied().eq(cut));
    assert_eq!(plain.radiances, scene.radiances);
    assert!(plain.harmonics.iter().all(|h| *h == Harmonics::NONE));
    for (format, num_properties) in [("2dgs", 16), ("3dgs", 17)] {
        let bytes = place.bytes(&format!("sub/{format}.ply"));
        let header_end = bytes
            .windows(11)
            .position(|w| w == b"end_header\n")
            .unwrap()
            + 11;
        assert_eq!(
            bytes.len() - header_end,
            4 * num_properties * points,
            "{format}"
        );
    }
    place.fails_cleanly(
        "export run/scene.ply --format 2dgs --out sub/2dgs.ply",
        &["sub/2dgs.ply", "--force"],
    );
    place.fails_cleanly(
        "export run/scene.ply --format eagpt --out run/scene.ply --force",
        &["an input"],
    );
}

#[test]
fn pair_prints_the_metrics_of_two_images() {
    let place = Workplace::new();
    let image = |i: u32| format!("room/Radiance-exr/{i:03}.exr");
    let pair = |arguments: &str| -> Value {
        let told = place.succeeds(&format!("eval pair {arguments} --json"));
        assert_eq!(told.lines().count(), 1);
        serde_json::from_str(&told).unwrap()
    };
    let equal = pair(&format!("{0} {0}", image(1)));
    assert_eq!(
        (&equal["psnr_srgb_db"], &equal["flip_hdr"]),
        (&Value::Null, &0.0.into())
    );
    let other = pair(&format!(
        "{} {} --start-exposure -2 --stop-exposure 1 --num-exposures 3 --tonemapper hable",
        image(1),
        image(2)
    ));
    assert!(other["flip_hdr"].as_f64().unwrap() > 0.05);
    let parameters = &other["flip_hdr_parameters"];
    assert_eq!(
        (&parameters["num_exposures"], &parameters["tonemapper"]),
        (&3.into(), &"hable".into())
    );
    let text = place.succeeds(&format!("eval pair {} {}", image(1), image(2)));
    assert!(text.contains("psnr_srgb_db"), "{text}");
}
