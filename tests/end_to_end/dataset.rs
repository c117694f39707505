//! Datasets in and out, and what is in them.

use crate::support::Workplace;
use serde_json::{Value, json};

/// Exports the room for nerfstudio, takes it back in, and returns the report of the import.
fn there_and_back(place: &Workplace, import_options: &str) -> Value {
    place.succeeds("dataset export room --format nerfstudio --out theirs");
    place.succeeds(&format!(
        "dataset import theirs {import_options} --out ours"
    ));
    place.json("ours/import.json")
}

#[test]
fn a_dataset_goes_out_and_comes_back() {
    let place = Workplace::new();
    let report = there_and_back(&place, "");
    assert_eq!(report["format"], "nerfstudio");
    assert_eq!(report["views"].as_array().unwrap().len(), 12);
    assert_eq!(place.json("ours/record.json")["command"], "dataset import");
    let poses = |file: &str| {
        let frames = place.json(file)["frames"].clone();
        let frames = frames.as_array().unwrap().iter();
        let poses: Vec<Value> = frames.map(|f| f["transform_matrix"].clone()).collect();
        poses
    };
    assert_eq!(poses("room/transforms.json"), poses("ours/transforms.json"));
    assert_eq!(
        place.bytes("room/points3d.ply"),
        place.bytes("ours/points3d.ply")
    );
    // Earlier results stay unless told otherwise, and files of others stay at any rate.
    place.fails_cleanly("dataset import theirs --out ours", &["--force"]);
    place.succeeds("dataset import theirs --out ours --max-edge 24 --force");
    assert_eq!(place.json("ours/transforms.json")["w"], 24);
    place.fails_cleanly(
        "dataset import theirs --out room --force",
        &["no record of this program"],
    );
    place.fails_cleanly("dataset import theirs --out theirs --force", &["an input"]);
    // The imported dataset trains.
    place.succeeds("train ours --out run --preset draft --iterations 20 --albedo-iterations 5");
}

#[test]
fn colmap_projects_come_out() {
    let place = Workplace::new();
    place.succeeds("dataset export room --format colmap --images none --out project");
    let mut names = place.names("project");
    names.retain(|name| name != "record.json");
    assert_eq!(
        names,
        [
            "sparse/0/cameras.bin",
            "sparse/0/images.bin",
            "sparse/0/points3D.bin"
        ]
    );
}

#[test]
fn all_frames_that_cannot_be_used_are_told_at_once() {
    let place = Workplace::new();
    place.succeeds("dataset export room --format nerfstudio --out theirs");
    let mut file = place.json("theirs/transforms.json");
    file["frames"][2]["transform_matrix"][0][0] = json!(7.5);
    file["frames"][5]["camera_model"] = json!("EQUIRECTANGULAR");
    std::fs::remove_file(place.path("theirs/images/009.exr")).unwrap();
    place.write("theirs/transforms.json", file.to_string());
    let bad = [
        "3 of 12 frames",
        "002: ",
        "not a rotation",
        "005: ",
        "EQUIRECTANGULAR",
        "1 is missing, for --skip-bad to leave out: 009",
    ];
    place.fails_cleanly("dataset import theirs --out ours", &bad);
    place.succeeds("dataset import theirs --out ours --skip-bad");
    let report = place.json("ours/import.json");
    assert_eq!(report["left_out"].as_array().unwrap().len(), 3);
    assert_eq!(
        place.json("ours/transforms.json")["frames"]
            .as_array()
            .unwrap()
            .len(),
        9
    );
    place.fails_cleanly(
        "dataset import runs --out ours2",
        &["format auto", "cam.txt"],
    );
    place.fails_cleanly(
        "dataset import theirs --format fipt --out ours2",
        &["cam.txt"],
    );
    place.fails_cleanly(
        "dataset import theirs --radiance-scale 0 --out ours2",
        &["radiance_scale"],
    );
}

#[test]
fn a_check_prints_a_report_and_its_exit_code_tells() {
    let place = Workplace::new();
    let text = place.succeeds("dataset check room");
    assert!(
        text.contains("12 views") && text.contains("no errors"),
        "{text}"
    );
    let lines = place.succeeds("dataset check room --json");
    let last: Value = serde_json::from_str(lines.lines().last().unwrap()).unwrap();
    assert_eq!(last["report"]["num_views"], 12);
    std::fs::remove_file(place.path("room/Radiance-exr/003.exr")).unwrap();
    std::fs::write(place.path("room/Normal-exr/004.exr"), b"x").unwrap();
    let output = place.run("dataset check room");
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.contains("broken: 003: ") && text.contains("broken: 004: "),
        "{text}"
    );
}

#[test]
fn normals_of_an_estimator_come_in() {
    let place = Workplace::new();
    std::fs::rename(place.path("room/Normal-exr"), place.path("maps")).unwrap();
    place.succeeds("normals room --maps maps");
    let report = place.json("room/normals/report.json");
    assert_eq!(
        (&report["reading"]["space"], &report["reading"]["axes"]),
        (&json!("world"), &json!("x,y,z"))
    );
    assert_eq!(place.json("room/normals.record.json")["command"], "normals");
    assert!(place.path("room/normals/preview/000.png").is_file());
    place.succeeds("dataset check room");
    place.fails_cleanly("normals room --maps maps", &["--force"]);
    place.succeeds("normals room --maps maps --space world --axes opencv --force");
    place.fails_cleanly(
        "normals room --maps room --out elsewhere",
        &["no map is named like a view"],
    );
}
