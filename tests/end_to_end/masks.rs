//! Emission masks of the room.

use crate::support::{SHORT, Workplace};
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::png;
use serde_json::{Value, json};

/// Pixels in both masks over pixels in either.
fn overlap(place: &Workplace, one: &str, other: &str) -> f64 {
    let [one, other] = [one, other].map(|path| exr::read_single(&place.path(path)).unwrap());
    let pairs = one.values().iter().zip(other.values());
    let (mut both, mut either) = (0.0, 0.0);
    for (a, b) in pairs.map(|(a, b)| (*a > 0.5, *b > 0.5)) {
        both += f64::from(u8::from(a && b));
        either += f64::from(u8::from(a || b));
    }
    if either == 0.0 { 1.0 } else { both / either }
}

fn view<'a>(report: &'a Value, name: &str) -> &'a Value {
    let views = report["views"].as_array().unwrap();
    views.iter().find(|view| view["name"] == name).unwrap()
}

/// Writes a label of half the size of the room's views with its upper left quarter marked.
fn write_label(place: &Workplace, path: &str) {
    let bytes: Vec<u8> = (0..24 * 16)
        .flat_map(|i| [u8::from(i % 24 < 12 && i / 24 < 8); 3])
        .collect();
    std::fs::create_dir_all(place.path(path).parent().unwrap()).unwrap();
    png::write_rgb8(&place.path(path), 24, 16, &bytes).unwrap();
}

#[test]
fn the_threshold_is_found_and_reflections_are_told_from_lights() {
    let place = Workplace::new();
    // A glint on the floor that only one view shows, as bright as the light.
    let radiance = "room/Radiance-exr/004.exr";
    let mut image = exr::read_rgb(&place.path(radiance)).unwrap();
    let brightest = (0..12).fold(0.0, |most: f32, index| {
        let path = place.path(&format!("room/Radiance-exr/{index:03}.exr"));
        let view = exr::read_rgb(&path).unwrap();
        view.values().iter().copied().fold(most, f32::max)
    });
    for (x, y) in (20..26).flat_map(|x| (24..29).map(move |y| (x, y))) {
        image.pixels_mut()[(y * 48 + x) as usize] = [brightest; 3];
    }
    exr::write_rgb(&place.path(radiance), &image, Precision::Half).unwrap();

    place.succeeds("masks room --out kept");
    let report = place.json("kept/masks/report.json");
    let level = report["threshold"].as_f64().unwrap();
    assert!(level > 1.0 && level < f64::from(brightest), "{level}");
    for index in (0..12).filter(|index| *index != 4) {
        let name = format!("{index:03}");
        let file = format!("Emissive-exr/{name}.exr");
        let found = overlap(&place, &format!("kept/{file}"), &format!("room/{file}"));
        // The room's masks are those of pixel centres, its radiance has soft edges: a border pixel
        // may go either way.
        assert!(found >= 0.9, "view {name}: {found}");
    }
    assert_eq!(view(&report, "004")["verdict"], "inconsistent");
    assert_eq!(view(&report, "004")["num_inconsistent"], 1);
    let regions = report["regions"].as_array().unwrap();
    let odd: Vec<&Value> = regions
        .iter()
        .filter(|region| region["verdict"] == "inconsistent")
        .collect();
    assert_eq!(odd.len(), 1, "{odd:?}");
    assert_eq!(odd[0]["centre"], json!([23.0, 26.5]));
    assert!(place.path("kept/masks/overlay/004.png").exists());
    let table = String::from_utf8(place.bytes("kept/masks/table.md")).unwrap();
    assert!(table.contains("| 004 | 23, 26 | 30 |"), "{table}");
    assert_eq!(place.json("kept/masks.record.json")["command"], "masks");

    place.succeeds("masks room --out dropped --inconsistent drop");
    let file = "Emissive-exr/004.exr";
    let kept = overlap(&place, &format!("kept/{file}"), &format!("room/{file}"));
    let dropped = overlap(&place, &format!("dropped/{file}"), &format!("room/{file}"));
    assert!(dropped >= 0.9 && kept < dropped, "{kept} {dropped}");
    // The same bits again, on one thread.
    place.succeeds("masks room --out again --inconsistent drop --threads 1");
    let files = |dir: &str| {
        let mut all = place.contents(dir);
        all.remove("masks.record.json");
        all
    };
    assert!(files("again") == files("dropped"));
}

#[test]
fn labels_mark_some_views_and_say_nothing_about_others() {
    let place = Workplace::new();
    write_label(&place, "labels/003.png");
    write_label(&place, "labels/stranger.png");
    let output = place.run("masks room --threshold none --labels labels --out m");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(stderr.contains("labels/stranger.png"), "{stderr}");
    let masks: Vec<String> = place.names("m/Emissive-exr");
    assert_eq!(masks, ["003.exr"]);
    let mask = exr::read_single(&place.path("m/Emissive-exr/003.exr")).unwrap();
    assert_eq!(mask.values().iter().sum::<f32>(), 24.0 * 16.0);
    let report = place.json("m/masks/report.json");
    assert_eq!(view(&report, "002")["verdict"], "unknown");
    assert_eq!(view(&report, "002")["coverage"], Value::Null);
    assert_eq!(view(&report, "003")["labelled"], true);

    // A region labelled as a reflection goes, whatever says that it emits.
    place.succeeds("masks room --threshold 0.001 --subtract labels --out none");
    let mask = exr::read_single(&place.path("none/Emissive-exr/003.exr")).unwrap();
    assert_eq!(mask.get(3, 3), [0.0]);
    assert_eq!(mask.get(30, 20), [1.0]);
}

#[test]
fn masks_go_where_training_looks_and_replace_nothing_unasked() {
    let place = Workplace::new();
    place.fails_cleanly("masks room", &["Emissive-exr", "--force"]);
    place.succeeds("masks room --force");
    place.succeeds(&format!("train room --out run {SHORT}"));
    place.succeeds("masks room --from-scene run/scene.ply --out scene");
    let pooled: f64 = (0..12)
        .map(|index| {
            let file = format!("Emissive-exr/{index:03}.exr");
            overlap(&place, &format!("scene/{file}"), &format!("room/{file}"))
        })
        .sum();
    // A scene of 150 iterations knows roughly where the light is.
    assert!(pooled / 12.0 > 0.5, "{pooled}");
}

#[test]
fn what_cannot_be_is_said_in_one_line() {
    let place = Workplace::new();
    std::fs::create_dir(place.path("empty")).unwrap();
    place.fails_cleanly(
        "masks room --out m --labels empty",
        &["empty", "no label image", "000.png"],
    );
    place.fails_cleanly("masks room --out m --threshold none", &["--labels"]);
    place.fails_cleanly(
        "masks room --out m --min-support 2",
        &["min_support", "2", "from 0 to 1"],
    );
    let usage = place.run("masks room --threshold bright");
    assert_eq!(usage.status.code(), Some(2));
    // Without the light there is no gap.
    for (name, _) in place.contents("room/Radiance-exr") {
        let path = place.path(&format!("room/Radiance-exr/{name}"));
        let image = exr::read_rgb(&path).unwrap();
        let dim = image.map(|rgb| rgb.map(|value| value.min(0.4)));
        exr::write_rgb(&path, &dim, Precision::Half).unwrap();
    }
    place.fails("masks room --out m", &["room", "threshold auto", "no gap"]);
}
