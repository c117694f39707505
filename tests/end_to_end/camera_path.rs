//! `eagpt render --camera-path`: frames, their cameras, and how they are shown.

use crate::support::Workplace;
use serde_json::Value;

const RENDER: &str = "render run/scene.ply --cameras room --mode 0-bounce";

fn workplace() -> Workplace {
    Workplace::trained()
}

#[test]
fn frames_are_pictures_whose_cameras_can_be_used_again() {
    let place = workplace();
    place.succeeds(&format!(
        "{RENDER} --camera-path fly:000,003,006 --frames 3 --size 30x20 --out fly"
    ));
    let expected = [
        "frame_0000.png",
        "frame_0001.png",
        "frame_0002.png",
        "record.json",
        "transforms.json",
    ];
    assert_eq!(place.names("fly"), expected);
    let record = place.json("fly/record.json");
    let path = &record["options"]["camera_path"];
    assert_eq!(path["route"]["fly"]["views"][2], "006");
    assert_eq!(
        (&path["fps"], &record["split"]),
        (&24.0.into(), &Value::Null)
    );
    let frames = path["frames"].as_array().unwrap();
    assert_eq!(
        (frames.len(), &frames[2]["name"]),
        (3, &"frame_0002".into())
    );
    assert_eq!(frames[1]["camera"]["width"], 30);
    assert_eq!(record["outputs"].as_array().unwrap().len(), 4);
    // The first frame stands where its view does.
    let view = &place.json("room/transforms.json")["frames"][0]["transform_matrix"];
    let frame = &place.json("fly/transforms.json")["frames"][0]["transform_matrix"];
    for row in 0..3 {
        for column in 0..4 {
            let [a, b] = [view, frame].map(|m| m[row][column].as_f64().unwrap());
            assert!((a - b).abs() < 1e-9, "{view} {frame}");
        }
    }
    // There are no images beside the cameras, and the same camera gives the same bits.
    place.succeeds(
        "render run/scene.ply --cameras fly/transforms.json --mode 0-bounce --views frame_0001 --out again",
    );
    assert_eq!(
        place.bytes("again/frame_0001.png"),
        place.bytes("fly/frame_0001.png")
    );
    // Training on them is another matter.
    place.fails_cleanly("train fly --out run2", &["frames[0].file_name", "no image"]);
}

#[test]
fn files_give_paths_and_exrs_come_on_demand() {
    let place = workplace();
    place.write(
        "orbit.toml",
        "frames = 4\nfps = 12\nsize = [15, 11]\n[turntable]\ndegrees = 90\n",
    );
    let told = place.run(&format!(
        "{RENDER} --camera-path orbit.toml --frames 2 --exr --aov depth --out orbit"
    ));
    // Odd sizes are padded for players.
    let stderr = String::from_utf8(told.stderr).unwrap();
    assert!(told.status.success(), "{stderr}");
    assert!(
        stderr.contains("ffmpeg -framerate 12 -i orbit/frame_%04d.png -vf pad"),
        "{stderr}"
    );
    let expected = [
        "depth/frame_0000.exr",
        "depth/frame_0001.exr",
        "frame_0000.exr",
        "frame_0000.png",
        "frame_0001.exr",
        "frame_0001.png",
        "record.json",
        "transforms.json",
    ];
    assert_eq!(place.names("orbit"), expected);
    let record = place.json("orbit/record.json");
    assert_eq!(record["inputs"][2]["path"], "orbit.toml");
    assert_eq!(
        record["options"]["camera_path"]["route"]["turntable"]["degrees"],
        90.0
    );
    // Each frame of a path has noise of its own; the first has that of the seed.
    let noisy = "render run/scene.ply --mode path --spp 4 --seed 5 --quiet";
    place.succeeds(&format!(
        "{noisy} --cameras room --camera-path orbit.toml --frames 2 --out noisy"
    ));
    let again = "--cameras noisy/transforms.json --views";
    place.succeeds(&format!("{noisy} {again} frame_0000,frame_0001 --out a"));
    place
        .succeeds(&format!("{noisy} {again} frame_0001 --out b --seed 6").replace("--seed 5 ", ""));
    let same = |a: &str, b: &str| place.bytes(a) == place.bytes(b);
    assert!(same("noisy/frame_0000.png", "a/frame_0000.png"));
    assert!(!same("noisy/frame_0001.png", "a/frame_0001.png"));
    assert!(same("noisy/frame_0001.png", "b/frame_0001.png"));
}

#[test]
fn exposure_and_tone_map_change_pictures_alone() {
    let place = workplace();
    place.succeeds(&format!("{RENDER} --out plain"));
    place.succeeds(&format!("{RENDER} --exposure 0 --tone-map srgb --out same"));
    place.succeeds(&format!(
        "{RENDER} --exposure=-1.5 --tone-map agx --out shown"
    ));
    place.succeeds(&format!("{RENDER} --exposure auto --out auto"));
    for view in ["000", "008"] {
        let file = |dir: &str, kind: &str| place.bytes(&format!("{dir}/{view}.{kind}"));
        assert_eq!(file("plain", "exr"), file("shown", "exr"));
        assert_eq!(file("plain", "png"), file("same", "png"));
        assert_ne!(file("plain", "png"), file("shown", "png"));
    }
    let display = place.json("shown/record.json")["options"]["display"].clone();
    assert_eq!(display["exposure_stops"], -1.5);
    assert_eq!(display["tone_map"], "agx");
    // An exposure that was found can be stated, and is the same for all views.
    let found = place.json("auto/record.json")["options"]["display"]["exposure_stops"].clone();
    assert!(found.as_f64().unwrap().abs() < 8.0, "{found}");
    place.succeeds(&format!("{RENDER} --exposure={found} --out stated"));
    for view in ["000.png", "008.png"] {
        let [a, b] = ["auto", "stated"].map(|dir| place.bytes(&format!("{dir}/{view}")));
        assert_eq!(a, b);
    }
}

#[test]
fn paths_that_cannot_be_are_refused_before_any_work() {
    let place = workplace();
    place.write("a.toml", "frames = 3\n[fly]\nviews = [\"000\", \"099\"]\n");
    let path = |path: &str| format!("{RENDER} --camera-path {path} --out out");
    for (arguments, parts) in [
        (path("a.toml"), ["a.toml: line 3: fly.views[1]", "`099`"]),
        (path("fly:000,x"), ["transforms.json: fly:000,x", "`x`"]),
        (path("none.toml"), ["none.toml", "no such file"]),
        (path("turntable --frames 0"), ["frames", "0"]),
        (path("turntable --size 9x99999"), ["size", "9x99999"]),
        (
            format!("{RENDER} --camera-path a.toml --out . --force"),
            ["a.toml", "099"],
        ),
    ] {
        place.fails_cleanly(&arguments, &parts);
    }
    for wrong in [
        "--frames 3",
        "--exr",
        "--camera-path turntable --views 000",
        "--camera-path turntable --split all",
        "--views 000 --size 30x20",
        "--camera-path turntable --size 10",
        "--exposure bright",
        "--exposure 99",
        "--tone-map vivid",
    ] {
        let output = place.run(&format!("{RENDER} {wrong} --out out"));
        assert_eq!(output.status.code(), Some(2), "{wrong}");
    }
    assert_eq!(place.names("out"), [""; 0]);
}
