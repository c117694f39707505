use super::*;
use eagpt_testkit::lamps::boxed;
use serde_json::{Value, json};

/// Three lamps: a panel of 1 by 1 in the ceiling, a tube along y, a bulb that only `night` has on.
fn room() -> Value {
    let lamp = |name: &str, bounds: [[f32; 3]; 2], day: [f32; 3], night: [f32; 3]| {
        json!({
            "name": name, "bounds_m": bounds, "area_m2": 1.0, "direction": [0.0, 0.0, -1.0],
            "power": {"day": day, "night": night},
        })
    };
    let grey = |value: f32| [value; 3];
    json!({
        "conditions": ["day", "night"],
        "lamps": [
            lamp("panel", [[-0.5, -0.5, 2.5], [0.5, 0.5, 2.5]], grey(10.0), grey(10.0)),
            lamp("tube", [[1.9, -0.5, 1.0], [1.95, 0.5, 1.05]], [4.0, 2.0, 0.0], grey(1.0)),
            lamp("bulb", [[-1.0, 0.0, 1.0], [-0.9, 0.1, 1.1]], grey(0.0), grey(2.0)),
        ],
        "rig": {},
    })
}

fn truth() -> TrueLamps {
    serde_json::from_value(room()).unwrap()
}

fn found(name: &str, centre: [f32; 3], size: [f32; 3], power: [f32; 3]) -> Lamp {
    Lamp {
        power,
        ..boxed(name, centre, size)
    }
}

#[test]
fn parts_of_a_lamp_add_and_what_is_none_is_false() {
    let lamps = vec![
        found("a", [-0.25, 0.0, 2.48], [0.5, 1.0, 0.0], [4.0; 3]),
        found("b", [0.25, 0.0, 2.48], [0.5, 1.0, 0.0], [5.0; 3]),
        // Its centre is beside the tube's box, which it contains.
        found("c", [1.7, 0.0, 1.0], [0.8, 1.4, 0.6], [5.0, 2.5, 1.0]),
        found("mirror", [0.0, 3.0, 1.0], [0.5; 3], [1.0; 3]),
        found("bulb", [-0.95, 0.05, 1.05], [0.1; 3], [3.0; 3]),
    ];
    let lamps = Lamps { lamps };
    let day = compare_lamps(&lamps, &truth(), None).unwrap();
    assert_eq!(day.condition, "day");
    let names: Vec<&str> = day.lamps.iter().map(|lamp| lamp.name.as_str()).collect();
    assert_eq!(names, ["panel", "tube"]);
    assert_eq!(day.lamps[0].found, ["a", "b"]);
    assert_eq!(day.lamps[0].found_power, [9.0; 3]);
    let near = |a: Option<f64>, b: f64| (a.unwrap() - b).abs() < 1e-6;
    assert!(near(day.lamps[0].ratio, 0.9), "{:?}", day.lamps[0]);
    assert_eq!(day.lamps[1].found, ["c"]);
    assert_eq!(day.lamps[1].ratio_rgb, [Some(1.25), Some(1.25), None]);
    // The bulb is off by day.
    assert_eq!(day.false_lamps, ["mirror", "bulb"]);
    assert_eq!((day.num_found, day.recall), (2, Some(1.0)));
    // Luminances of 2.9232 and 2.2808.
    let tube = (0.2126 * 5.0 + 0.7152 * 2.5 + 0.0722) / (0.2126 * 4.0 + 0.7152 * 2.0) - 1.0;
    assert!(near(day.largest_error, tube), "{day:?}");
    assert!(near(day.median_error, 0.5 * (tube + 0.1)), "{day:?}");

    let night = compare_lamps(&lamps, &truth(), Some("night")).unwrap();
    assert_eq!(night.false_lamps, ["mirror"]);
    assert_eq!(night.lamps[2].ratio, Some(1.5));
    assert!(near(
        night.total_ratio,
        (4.0 + 5.0 + 1.0 + 3.0 + 2.9232) / 13.0
    ));
}

#[test]
fn lamps_that_were_not_found_have_no_ratio() {
    let none = compare_lamps(&Lamps::default(), &truth(), None).unwrap();
    assert_eq!((none.recall, none.median_error), (Some(0.0), None));
    assert_eq!(none.lamps[0].ratio_rgb, [None; 3]);
    assert_eq!(none.total_ratio, Some(0.0));
    // Beyond the panel's edge, and within its margin.
    let lamps = vec![found("a", [0.55, 0.0, 2.5], [0.2, 0.2, 0.0], [1.0; 3])];
    let one = compare_lamps(&Lamps { lamps }, &truth(), None).unwrap();
    assert_eq!((one.recall, one.num_found), (Some(0.5), 1));
    let problem = compare_lamps(&Lamps::default(), &truth(), Some("dusk")).unwrap_err();
    assert_eq!(
        problem.to_string(),
        "condition `dusk`: there are day, night"
    );
}

#[test]
fn damaged_truth_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("synth.json");
    let refusal = |value: &Value| {
        std::fs::write(&path, value.to_string()).unwrap();
        TrueLamps::read(&path).unwrap_err().to_string()
    };
    std::fs::write(&path, room().to_string()).unwrap();
    assert_eq!(TrueLamps::read(&path).unwrap(), truth());
    let change = |key: &str, value: Value| {
        let mut damaged = room();
        damaged["lamps"][1][key] = value;
        refusal(&damaged)
    };
    for (message, expected) in [
        (
            refusal(&json!({"lamps": []})),
            "JSON: missing field `conditions`",
        ),
        (
            refusal(&json!({"lamps": [], "conditions": []})),
            "conditions: empty",
        ),
        (
            change("power", json!({"day": [1, 1, 1]})),
            "lamps[1].power.night: missing",
        ),
        (
            change("power", json!({"day": [1, 1, 1], "night": [1, -1, 1]})),
            "lamps[1].power.night: -1.0 is negative",
        ),
        (
            change("bounds_m", json!([[1, 0, 0], [0, 1, 1]])),
            "lamps[1].bounds_m: [1.0, 0.0, 0.0] is above",
        ),
    ] {
        assert!(
            message.contains("synth.json: ") && message.contains(expected),
            "{message}"
        );
    }
}

/// The box of a long lamp, grown, contains smaller lamps beside it.
#[test]
fn a_globe_beside_a_strip_is_itself() {
    let globe = |name: &str, x: f32| {
        json!({
            "name": name, "bounds_m": [[x, -0.12, 1.4], [x + 0.12, 0.0, 1.52]],
            "power": {"day": [5.0, 5.0, 5.0]},
        })
    };
    let strip = json!({
        "name": "strip", "bounds_m": [[-1.0, 0.0, 1.2], [1.0, 0.03, 1.23]],
        "power": {"day": [9.0, 9.0, 9.0]},
    });
    let room =
        json!({"conditions": ["day"], "lamps": [strip, globe("left", -1.2), globe("right", 1.1)]});
    let truth: TrueLamps = serde_json::from_value(room).unwrap();
    let lamps = vec![
        found("a", [0.0, 0.015, 1.215], [2.0, 0.03, 0.03], [9.0; 3]),
        found("b", [1.16, -0.06, 1.46], [0.12; 3], [5.0; 3]),
        found("c", [-1.14, -0.06, 1.46], [0.12; 3], [5.0; 3]),
    ];
    let compared = compare_lamps(&Lamps { lamps }, &truth, None).unwrap();
    let of = |index: usize| compared.lamps[index].found.as_slice();
    assert_eq!([of(0), of(1), of(2)], [["a"], ["c"], ["b"]]);
}
