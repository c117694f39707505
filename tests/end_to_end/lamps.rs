//! Lamps by name: the selector of edit scripts, and `eagpt lamps`.

use crate::support::Workplace;
use eagpt_scene::{Gaussians, Lamp, LampShape, Lamps, lamps, ply};
use glam::Vec3;
use serde_json::json;

/// A lamp around everything that emits, of power 6.
fn lamp(scene: &Gaussians) -> Lamp {
    let emitting = scene.iter().filter(|g| g.emission > 0.1);
    let places: Vec<Vec3> = emitting.map(|g| g.position).collect();
    let low = places.iter().copied().reduce(Vec3::min).unwrap();
    let high = places.iter().copied().reduce(Vec3::max).unwrap();
    Lamp {
        name: "ceiling-1".to_owned(),
        shape: LampShape::Other,
        centre: (0.5 * (low + high)).into(),
        rotation: [1.0, 0.0, 0.0, 0.0],
        size: (high - low + 1e-3).into(),
        one_sided: false,
        bars: false,
        shade: 0.0,
        reach: 0.0,
        area: 1.0,
        radiance: [2.0; 3],
        power: [6.0; 3],
        num_gaussians: places.len(),
        views: vec!["000".to_owned()],
        num_pixels: 12,
        deviation: 0.25,
        factor: [1.0; 3],
    }
}

/// A trained room with `run/lamps.json`, in which all that emits is one lamp.
fn workplace() -> (Workplace, Gaussians) {
    let place = Workplace::trained();
    let scene = ply::read_gaussians(&place.path("run/scene.ply")).unwrap();
    let list = Lamps {
        lamps: vec![lamp(&scene)],
    };
    lamps::write_lamps(&place.path("run/lamps.json"), &list).unwrap();
    (place, scene)
}

#[test]
fn a_script_selects_lamps_by_name() {
    let (place, scene) = workplace();
    let script = |name: &str| {
        format!("[[step]]\nselect = {{ lamp = \"{name}\" }}\nthen = [\"lights_off\"]\n")
    };
    place.write("off.toml", script("ceiling-*"));
    place.succeeds("edit run/scene.ply off.toml --out off.ply");
    let off = ply::read_gaussians(&place.path("off.ply")).unwrap();
    assert_eq!(off.len(), scene.len());
    assert!(off.iter().all(|g| g.emission <= 0.1));
    let record = place.json("off.record.json");
    assert_eq!(record["options"]["lamps"], "run/lamps.json");
    assert_eq!(record["inputs"][2]["path"], "run/lamps.json");

    place.write("other.toml", script("wall-1"));
    let unknown = [
        "other.toml: line 2",
        "`wall-1` is no lamp: there are ceiling-1",
    ];
    place.fails_cleanly("edit run/scene.ply other.toml --out e.ply", &unknown);
    // A list of another name, which no result replaces.
    std::fs::rename(place.path("run/lamps.json"), place.path("mine.json")).unwrap();
    place.fails_cleanly(
        "edit run/scene.ply off.toml --out e.ply",
        &["off.toml: selects lamps: run/lamps.json: no such file"],
    );
    let given = "edit run/scene.ply off.toml --lamps mine.json";
    place.fails_cleanly(
        &format!("{given} --out mine.json --force"),
        &["mine.json", "an input"],
    );
    place.succeeds(&format!("{given} --out again.ply"));
    assert_eq!(place.bytes("again.ply"), place.bytes("off.ply"));
}

#[test]
fn lamps_are_listed_and_measured() {
    let (place, _) = workplace();
    let list = place.succeeds("lamps run");
    assert!(
        list.starts_with("lamp ") && list.contains("ceiling-1"),
        "{list}"
    );
    assert!(list.contains("25.0 %"), "{list}");
    let found = lamps::read_lamps(&place.path("run/lamps.json")).unwrap();
    let [low, high] = found.lamps[0].bounds();
    let truth = json!({
        "conditions": ["day", "night"],
        "lamps": [
            {"name": "panel", "bounds_m": [low, high], "power": {"day": [8, 8, 8], "night": [0, 0, 0]}},
            {"name": "bulb", "bounds_m": [[90, 0, 0], [91, 1, 1]], "power": {"day": [1, 1, 1], "night": [1, 1, 1]}},
        ],
    });
    place.write("synth.json", truth.to_string());
    let told = place.succeeds("lamps run/lamps.json --reference synth.json --out lamps.json");
    for part in [
        "0.750",
        "condition day: 1 of 2 lamps found (50.0 %); false: none",
        "error of the power: median 25.0 %, largest 25.0 %",
    ] {
        assert!(told.contains(part), "no `{part}` in:\n{told}");
    }
    let written = place.json("lamps.json");
    assert_eq!(written["lamps"][0]["name"], "ceiling-1");
    assert_eq!(
        written["comparison"]["lamps"][0]["found"],
        json!(["ceiling-1"])
    );
    place.fails_cleanly("lamps run --out lamps.json", &["lamps.json", "--force"]);
    place.fails_cleanly(
        "lamps run/lamps.json --out run/lamps.json --force",
        &["run/lamps.json", "an input"],
    );
    let night = place.succeeds("lamps run --reference . --condition night");
    assert!(
        night.contains("0 of 1 lamps found (0.0 %); false: ceiling-1"),
        "{night}"
    );
    place.fails_cleanly(
        "lamps run --reference . --condition dusk",
        &["condition `dusk`: there are day, night"],
    );
    place.fails_cleanly("lamps room", &["room/lamps.json: no such file"]);
    place.write("run/lamps.json", "{\"lamps\": [{\"name\": \"a\"}]}");
    place.fails_cleanly(
        "lamps run",
        &["run/lamps.json: JSON: missing field `shape`"],
    );
}
