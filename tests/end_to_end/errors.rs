//! Bad input: one line that names the file, the field and the value; exit code 1; nothing
//! half-written.

use crate::support::{SHORT, Workplace};
use eagpt_scene::Image;
use eagpt_scene::exr::{self, Precision};
use serde_json::json;

const TRAIN: &str = "train room --out run --preset draft";

/// Asserts that training is refused, and that the folder holds at most the options.
#[track_caller]
fn train_fails(place: &Workplace, arguments: &str, parts: &[&str]) {
    place.fails(&format!("{TRAIN} {arguments}"), parts);
    let names = place.names("run");
    assert!(names.iter().all(|name| name == "train.toml"), "{names:?}");
}

fn truncate(place: &Workplace, file: &str) {
    let bytes = place.bytes(file);
    place.write(file, &bytes[..bytes.len() * 2 / 3]);
}

#[test]
fn truncated_exr() {
    let place = Workplace::new();
    truncate(&place, "room/Radiance-exr/003.exr");
    train_fails(&place, "", &["room/Radiance-exr/003.exr"]);
    // Said so, the run goes on without the view, and the record tells.
    place.succeeds(&format!("train room --out run {SHORT} --skip-bad"));
    let warnings = place.json("run/record.json")["warnings"].to_string();
    assert!(warnings.contains("003.exr"), "{warnings}");
}

#[test]
fn several_bad_views_are_all_named() {
    let place = Workplace::new();
    truncate(&place, "room/Radiance-exr/003.exr");
    truncate(&place, "room/Normal-exr/005.exr");
    train_fails(
        &place,
        "",
        &["Radiance-exr/003.exr", "Normal-exr/005.exr", "--skip-bad"],
    );
}

#[test]
fn light_that_cannot_be() {
    let place = Workplace::new();
    let path = place.path("room/Radiance-exr/004.exr");
    let mut image = exr::read_rgb(&path).unwrap();
    image.pixels_mut()[48 * 2 + 5][1] = f32::NAN;
    exr::write_rgb(&path, &image, Precision::Float).unwrap();
    train_fails(&place, "", &["Radiance-exr/004.exr", "pixel (5, 2)", "NaN"]);
    image.pixels_mut()[48 * 2 + 5][1] = -0.25;
    exr::write_rgb(&path, &image, Precision::Float).unwrap();
    train_fails(
        &place,
        "",
        &["Radiance-exr/004.exr", "pixel (5, 2)", "-0.25"],
    );
}

#[test]
fn singular_matrix() {
    let place = Workplace::new();
    let singular = json!([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]);
    place.edit_transforms(|t| t["frames"][2]["transform_matrix"] = singular);
    let parts = ["room/transforms.json", "frames[2].transform_matrix"];
    train_fails(&place, "", &parts);
    assert_eq!(place.names("run"), [""; 0]);
    place.fails_cleanly(
        "render none.ply --cameras room --mode path --out out",
        &parts,
    );
}

#[test]
fn missing_view() {
    let place = Workplace::new();
    std::fs::remove_file(place.path("room/Radiance-exr/005.exr")).unwrap();
    train_fails(
        &place,
        "",
        &["room/transforms.json", "frames[5].file_name", "005.exr"],
    );
}

#[test]
fn mask_of_the_wrong_size() {
    let place = Workplace::new();
    let mask = Image::filled(10, 9, [0.0]);
    exr::write_single(
        &place.path("room/Emissive-exr/002.exr"),
        &mask,
        Precision::Half,
    )
    .unwrap();
    train_fails(
        &place,
        "",
        &["room/Emissive-exr/002.exr", "size", "10x9", "48x32"],
    );
}

#[test]
fn empty_and_unlisted_splits() {
    let place = Workplace::new();
    train_fails(
        &place,
        "--split listed",
        &["transforms.json", "train_filenames", "missing"],
    );
    place.edit_transforms(|t| {
        t["train_filenames"] = json!(["001", "002"]);
        t["test_filenames"] = json!([]);
    });
    train_fails(
        &place,
        "--split listed",
        &["transforms.json", "split listed", "0 test views"],
    );
    place.edit_transforms(|t| t["test_filenames"] = json!(["0O1"]));
    train_fails(&place, "", &["transforms.json", "test_filenames[0]", "0O1"]);
}

#[test]
fn damaged_transforms_and_points() {
    let place = Workplace::new();
    truncate(&place, "room/points3d.ply");
    train_fails(&place, "", &["room/points3d.ply"]);
    std::fs::remove_file(place.path("room/points3d.ply")).unwrap();
    // Then points are found by the views, but not from one place.
    std::fs::remove_dir_all(place.path("room/Depth-exr")).unwrap();
    place.edit_transforms(|t| {
        for frame in t["frames"].as_array_mut().unwrap() {
            let rows = frame["transform_matrix"].as_array_mut().unwrap();
            for row in &mut rows[..3] {
                row[3] = json!(0.5);
            }
        }
    });
    let one_place = ["room", "no points3d.ply", "all stand in one"];
    train_fails(&place, "", &one_place);
    truncate(&place, "room/transforms.json");
    train_fails(&place, "", &["room/transforms.json", "JSON"]);
    place.fails_cleanly("train nowhere --out run", &["nowhere"]);
}

#[test]
fn gaussians_that_cannot_be() {
    let place = Workplace::new();
    let ascii = |scale: &str| {
        let names = [
            "x",
            "y",
            "z",
            "scales_0",
            "scales_1",
            "quaternions_0",
            "quaternions_1",
            "quaternions_2",
            "quaternions_3",
            "opacities",
            "radiances_0",
            "radiances_1",
            "radiances_2",
            "emissives",
            "albedos_0",
            "albedos_1",
            "albedos_2",
        ];
        let properties = names
            .map(|name| format!("property float {name}\n"))
            .concat();
        format!(
            "ply\nformat ascii 1.0\nelement vertex 2\n{properties}end_header\n\
             0 0 1 0.1 0.1 1 0 0 0 0.5 1 1 1 0 0.5 0.5 0.5\n0 0 1 0.1 {scale} 1 0 0 0 0.5 1 1 1 0 0.5 0.5 0.5\n"
        )
    };
    let render = "render bad.ply --cameras room --mode 0-bounce --out out";
    for (scale, shown) in [("nan", "NaN"), ("-1", "-1"), ("0", "0")] {
        place.write("bad.ply", ascii(scale));
        place.fails_cleanly(render, &["bad.ply", "vertex[1].scales_1", shown]);
        place.fails_cleanly(
            "export bad.ply --format 3dgs --out e.ply",
            &["bad.ply", "vertex[1]"],
        );
    }
    place.write("bad.ply", ascii("0.1"));
    truncate(&place, "bad.ply");
    place.fails_cleanly(render, &["bad.ply"]);
    place.write("bad.ply", "no ply at all");
    place.fails_cleanly(render, &["bad.ply"]);
}

#[test]
fn unwritable_output() {
    let place = Workplace::trained();
    let scene = "render run/scene.ply --cameras room --mode 0-bounce";
    place.succeeds(&format!("{scene} --out renders"));
    place.write("file", "");
    // Permissions do not stop root; a folder below a regular file stops everybody.
    place.fails_cleanly(&format!("train room --out file/run {SHORT}"), &["file/run"]);
    place.fails_cleanly(&format!("{scene} --out file/out"), &["file/out"]);
    place.fails_cleanly(
        "eval renders --reference room --out file/out",
        &["file/out"],
    );
    place.fails_cleanly(
        "export run/scene.ply --format 2dgs --out file/out/a.ply",
        &["file/out"],
    );
}

#[test]
fn renderings_that_do_not_fit() {
    let place = Workplace::trained();
    place.succeeds("render run/scene.ply --cameras room --mode 0-bounce --views 000 --out out");
    let eval = "eval out --reference room --out eval";
    place.fails_cleanly(&format!("{eval} --split test"), &["out", "008"]);
    std::fs::create_dir(place.path("empty")).unwrap();
    place.fails_cleanly(
        "eval empty --reference room --out eval",
        &["empty", "0 EXR files", "room/transforms.json", "`000`"],
    );
    exr::write_rgb(
        &place.path("out/008.exr"),
        &Image::filled(8, 8, [0.5; 3]),
        Precision::Half,
    )
    .unwrap();
    place.fails_cleanly(eval, &["out/008.exr", "8x8", "48x32"]);
    let pair = "eval pair room/Radiance-exr/000.exr";
    place.fails_cleanly(
        &format!("{pair} out/008.exr"),
        &["out/008.exr", "8x8", "48x32"],
    );
    let mut image = Image::filled(48, 32, [0.5; 3]);
    image.pixels_mut()[50][0] = f32::INFINITY;
    exr::write_rgb(&place.path("inf.exr"), &image, Precision::Half).unwrap();
    place.fails_cleanly(
        &format!("{pair} inf.exr"),
        &["inf.exr", "pixel (2, 1)", "inf"],
    );
}
