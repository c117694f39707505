//! `eagpt synth`: scenes in, captures out.

use crate::support::Workplace;
use eagpt_scene::Dataset;
use std::collections::BTreeMap;

/// A capture of a second: three positions in two conditions.
const TINY: &str = "--size 48x32 --views 3 --spp 4 --points 300";

/// All files of a capture but its record, which holds times.
fn results(place: &Workplace, dir: &str) -> BTreeMap<String, Vec<u8>> {
    let mut files = place.contents(dir);
    assert!(files.remove("record.json").is_some(), "{dir}");
    files
}

#[test]
fn a_capture_has_brackets_and_their_truth() {
    let place = Workplace::new();
    place.succeeds(&format!("synth small-room --out capture {TINY}"));
    let record = place.json("capture/record.json");
    let mut listed: Vec<String> = record["outputs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|name| name.as_str().unwrap().to_owned())
        .collect();
    listed.sort();
    let written: Vec<String> = results(&place, "capture").into_keys().collect();
    assert_eq!(listed, written);
    let num_raw = written.iter().filter(|name| name.ends_with(".dng")).count();
    assert_eq!(num_raw, 3 * 2 * 5);
    let manifest = String::from_utf8(place.bytes("capture/capture.toml")).unwrap();
    assert_eq!(manifest.matches("[[stack]]").count(), 3 * 2);
    assert!(manifest.contains(
        "position = \"p001\"\ncondition = \"evening\"\nfiles = [\"evening/p001_0.dng\","
    ));
    let truth = place.json("capture/synth.json");
    assert_eq!(truth["sensor_size"], serde_json::json!([96, 64]));
    for condition in ["day", "evening"] {
        let root = place.path("capture/truth").join(condition);
        let dataset = Dataset::open(&root).unwrap();
        assert_eq!((dataset.len(), dataset.metres_per_unit()), (3, Some(1.0)));
        assert_eq!(dataset.points().unwrap().unwrap().len(), 300);
        let view = dataset.load_view(1).unwrap();
        assert!(
            view.depth
                .unwrap()
                .values()
                .iter()
                .all(|depth| *depth > 0.0)
        );
        assert!(view.radiance.values().iter().sum::<f32>() > 0.0);
    }
}

#[test]
fn the_same_bits_for_any_number_of_threads_and_from_a_printed_scene() {
    let place = Workplace::new();
    place.succeeds(&format!("synth small-room --out a {TINY} --threads 1"));
    let text = place.succeeds("synth small-room --print");
    place.write("room.toml", &text);
    place.succeeds(&format!("synth room.toml --out b {TINY} --threads 3"));
    let (mut a, mut b) = (results(&place, "a"), results(&place, "b"));
    // Which file a scene came from is told, and differs here.
    a.remove("synth.json");
    b.remove("synth.json");
    assert_eq!(a, b);
    place.succeeds(&format!(
        "synth small-room --out c {TINY} --seed 1 --parts capture"
    ));
    let c = results(&place, "c");
    assert!(!c.contains_key("truth/day/transforms.json"));
    assert_ne!(a["day/p000_2.dng"], c["day/p000_2.dng"]);
}

#[test]
fn parts_sizes_and_scenes_are_as_asked_for() {
    let place = Workplace::new();
    let list = place.succeeds("synth --list");
    assert!(
        list.contains("furnished-room") && list.contains("small-room"),
        "{list}"
    );
    place.succeeds("synth furnished-room --out truth --parts truth --size 24x16 --views 2 --spp 4 --light paths --unfiltered");
    let names = results(&place, "truth");
    assert!(names.contains_key("truth/evening/Radiance-exr/p001.exr"));
    assert!(
        !names
            .keys()
            .any(|name| name.ends_with(".dng") || name == "capture.toml")
    );
    place.fails_cleanly(
        &format!("synth small-room --out truth {TINY}"),
        &["--force"],
    );
    place.succeeds(&format!("synth small-room --out truth {TINY} --force"));
    // The earlier result goes whole.
    assert!(
        !place
            .path("truth/truth/evening/Radiance-exr/p003.exr")
            .exists()
    );
    assert_eq!(place.run("synth small-room").status.code(), Some(2));
    assert_eq!(
        place
            .run("synth small-room --out x --size 4x4")
            .status
            .code(),
        Some(2)
    );
}

#[test]
fn scenes_that_cannot_be_are_told_by_line_and_key() {
    let place = Workplace::new();
    let scene = place.succeeds("synth small-room --print");
    for (old, new, parts) in [
        (
            "radius = 0.22",
            "radios = 0.22",
            ["object[4].ball.radios", "unknown field `radios`"],
        ),
        (
            "radius = 0.22",
            "radius = -1",
            ["object[4].ball.radius", "-1 is not above 0"],
        ),
        (
            "floor = \"boards\"",
            "floor = \"lava\"",
            ["object[0].room.floor", "no material `lava`"],
        ),
        (
            "light = \"lamp\"",
            "light = \"sun\"",
            ["object[6].lamp.light", "no light `sun`"],
        ),
        (
            "lights = { lamp = 1 }",
            "lights = { sun = 1 }",
            ["condition[1].lights.sun", "no light `sun`"],
        ),
        (
            "name = \"evening\"",
            "name = \"day\"",
            ["condition[1].name", "`day` is there already"],
        ),
        (
            "name = \"evening\"",
            "name = \"../x\"",
            ["condition[1].name", "is no name"],
        ),
        (
            "fov_x = 75",
            "fov_x = 180",
            ["cameras.fov_x", "180 is not from 1 to 150"],
        ),
        (
            "\"#c9a878\"",
            "\"#c9a87\"",
            ["materials.boards.wood.colors[0]", "is no colour"],
        ),
        (
            "views = 16",
            "views = 0",
            ["cameras.views", "0 is not a whole number"],
        ),
    ] {
        let wrong = scene.replacen(old, new, 1);
        assert_ne!(wrong, scene, "{old}");
        place.write("room.toml", wrong);
        let parts = ["room.toml: line ", parts[0], parts[1]];
        place.fails_cleanly("synth room.toml --out capture", &parts);
    }
    place.fails_cleanly("synth no-room --out capture", &["no-room"]);
}
