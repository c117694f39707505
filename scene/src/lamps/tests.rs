use super::*;
use serde_json::{Value, json};
use std::f32::consts::FRAC_1_SQRT_2;

/// A panel of 1 by 0.4 units at x = 2 whose normal is -y and whose long edge is x.
fn panel() -> Lamp {
    Lamp {
        name: "wall-1".to_owned(),
        shape: LampShape::Panel,
        centre: [2.0, 0.0, 1.0],
        rotation: [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0, 0.0],
        size: [1.0, 0.4, 0.0],
        one_sided: true,
        bars: false,
        shade: 0.0,
        reach: 0.0,
        area: 0.4,
        radiance: [10.0, 9.0, 8.0],
        power: [12.57, 11.31, 10.05],
        num_gaussians: 40,
        views: vec!["p000".to_owned(), "p003".to_owned()],
        num_pixels: 900,
        deviation: 0.04,
        factor: [1.0; 3],
    }
}

fn ball(name: &str, x: f32, size: f32) -> Lamp {
    Lamp {
        name: name.to_owned(),
        shape: LampShape::Ball,
        centre: [x, 0.0, 0.0],
        rotation: [1.0, 0.0, 0.0, 0.0],
        size: [size; 3],
        one_sided: false,
        bars: false,
        shade: 0.0,
        reach: 0.0,
        ..panel()
    }
}

#[test]
fn the_box_of_a_lamp_is_turned_and_grown() {
    let lamp = panel();
    // The margin is 0.15; the panel stands upright: 1 along x, 0.4 along z, flat along y.
    for (offset, inside) in [
        ([0.0, 0.0, 0.0], true),
        ([0.64, 0.0, 0.0], true),
        ([0.66, 0.0, 0.0], false),
        ([0.0, 0.0, -0.34], true),
        ([0.0, 0.0, -0.36], false),
        ([0.0, 0.14, 0.0], true),
        ([0.0, -0.16, 0.0], false),
    ] {
        let position = lamp.centre() + Vec3::from(offset);
        assert_eq!(lamp.contains(position), inside, "{offset:?}");
    }
    let [low, high] = lamp.bounds();
    // Roundings of a rotation by a right angle.
    assert!((low - Vec3::new(1.5, 0.0, 0.8)).length() < 1e-6, "{low}");
    assert!((high - Vec3::new(2.5, 0.0, 1.2)).length() < 1e-6, "{high}");
    assert!(!lamp.contains(Vec3::NAN));
}

#[test]
fn a_place_in_no_box_belongs_to_a_lamp_that_reaches_it() {
    let reaching = |name: &str, x: f32, reach: f32| Lamp {
        reach,
        ..ball(name, x, 0.4)
    };
    let lamps = Lamps {
        lamps: vec![
            reaching("lamp-1", 0.0, 2.0),
            reaching("lamp-2", 1.5, 0.0),
            reaching("lamp-3", 3.0, 2.0),
        ],
    };
    let of = |x: f32| lamps.of(Vec3::new(x, 0.0, 0.0));
    assert_eq!(of(0.5), Some(0));
    // A box is before a reach.
    assert_eq!(of(1.5), Some(1));
    assert_eq!(of(1.2), Some(0));
    assert_eq!(of(1.9), Some(2));
    assert_eq!(of(-2.1), Some(0));
    assert_eq!(of(-2.3), None);
    let lamp = &lamps.lamps[0];
    assert_eq!(lamp.distance(Vec3::new(0.5, 0.6, 0.0)), 0.5);
    assert_eq!(lamp.distance(Vec3::splat(0.1)), 0.0);
}

#[test]
fn a_place_in_several_boxes_belongs_to_the_nearest_for_its_size() {
    // Boxes grown to half lengths of 1.3 and 0.325: from -1.3 to 1.3 and from 0.675 to 1.325.
    let lamps = Lamps {
        lamps: vec![ball("lamp-1", 0.0, 2.0), ball("lamp-2", 1.0, 0.5)],
    };
    let of = |x: f32| lamps.of(Vec3::new(x, 0.0, 0.0));
    assert_eq!(of(0.5), Some(0));
    // 0.54 of one box, 0.92 of the other.
    assert_eq!(of(0.7), Some(0));
    assert_eq!(of(0.9), Some(1));
    assert_eq!(of(1.32), Some(1));
    assert_eq!(of(1.4), None);
    let twice = Lamps {
        lamps: vec![ball("a", 0.0, 1.0), ball("b", 0.0, 1.0)],
    };
    assert_eq!(twice.of(Vec3::splat(0.1)), Some(0));
}

#[test]
fn patterns_match_names() {
    let names = ["ceiling-1", "ceiling-2", "wall-1", "lamp-12"];
    let lamps = Lamps {
        lamps: names.map(|name| ball(name, 0.0, 1.0)).into(),
    };
    for (pattern, expected) in [
        ("ceiling-2", vec![1]),
        ("ceiling", vec![]),
        ("ceiling-*", vec![0, 1]),
        ("*", vec![0, 1, 2, 3]),
        ("*-1", vec![0, 2]),
        ("*l*-1*", vec![0, 2, 3]),
        ("wall-1*1", vec![]),
        ("**2", vec![1, 3]),
        ("", vec![]),
    ] {
        assert_eq!(lamps.matching(pattern), expected, "{pattern}");
    }
    assert_eq!(lamps.named("wall-1"), Some(&lamps.lamps[2]));
    assert_eq!(lamps.named("wall-*"), None);
}

#[test]
fn lamps_come_back_from_their_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = lamps_file_beside(&dir.path().join("scene.ply"));
    assert_eq!(path, dir.path().join("lamps.json"));
    for lamps in [vec![], vec![panel(), ball("lamp-1", -1.5, 0.25)]] {
        let lamps = Lamps { lamps };
        write_lamps(&path, &lamps).unwrap();
        assert_eq!(read_lamps(&path).unwrap(), lamps);
    }
    let json: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    assert_eq!(json["lamps"][0]["shape"], "panel");
    assert_eq!(json["lamps"][1]["size"], json!([0.25, 0.25, 0.25]));
}

#[test]
fn damaged_files_are_refused_by_file_field_and_value() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(LAMPS_FILE);
    let two = serde_json::to_value(Lamps {
        lamps: vec![panel(), ball("lamp-1", 0.0, 0.3)],
    });
    let two = two.unwrap();
    let refusal = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        read_lamps(&path).unwrap_err().to_string()
    };
    for (field, value, expected) in [
        ("name", json!("wall-1"), "name: `wall-1` is the name of"),
        ("name", json!("a*"), "name: `a*`: empty, or with a *"),
        ("name", json!(""), "name: ``"),
        ("size", json!([0.1, -0.2, 0.0]), "size: -0.2 is not"),
        ("size", json!([0.0, 0.0, 0.0]), "size: all three"),
        ("rotation", json!([2.0, 0.0, 0.0, 0.0]), "the length 2.0"),
        ("area", json!(0.0), "area: 0.0 is not a positive"),
        ("power", json!([1.0, 1.0, -1.0]), "power: -1.0 is not"),
        ("deviation", json!(-0.5), "deviation: -0.5"),
        (
            "centre",
            json!([1e39, 0.0, 0.0]),
            "JSON: number out of range",
        ),
        ("shape", json!("cube"), "JSON: unknown variant `cube`"),
        ("radiance", json!([1.0, null, 1.0]), "JSON: invalid type"),
        ("views", json!(3), "JSON: invalid type: integer `3`"),
    ] {
        let mut damaged = two.clone();
        damaged["lamps"][1][field] = value;
        let message = refusal(damaged.to_string().as_bytes());
        assert!(
            message.contains("lamps.json: ") && message.contains(expected),
            "{message}"
        );
        assert!(
            message.contains("JSON") || message.contains("lamps[1]."),
            "{message}"
        );
    }
    let whole = two.to_string();
    let half = refusal(&whole.as_bytes()[..whole.len() / 2]);
    assert!(half.contains("lamps.json: JSON: EOF"), "{half}");
    let missing = refusal(b"{\"lamps\": [{\"name\": \"a\"}]}");
    assert!(missing.contains("missing field `shape`"), "{missing}");
    let more = refusal(&[b"[", whole.as_bytes(), b"]"].concat());
    assert!(more.contains("lamps.json: JSON: "), "{more}");

    // Lamps that could not be read are not written, and an earlier file stays.
    std::fs::write(&path, &whole).unwrap();
    let mut lamps = read_lamps(&path).unwrap();
    lamps.lamps[0].deviation = f32::NAN;
    let message = write_lamps(&path, &lamps).unwrap_err().to_string();
    assert!(
        message.ends_with("lamps[0].deviation: NaN is not a number of at least 0"),
        "{message}"
    );
    assert_eq!(std::fs::read_to_string(&path).unwrap(), whole);
    let gone = read_lamps(&dir.path().join("x.json")).unwrap_err();
    assert!(gone.to_string().ends_with("x.json: no such file"));
}

#[test]
fn joined_lists_are_numbered_by_power() {
    let of = |name: &str, power: f32| Lamp {
        power: [power; 3],
        ..ball(name, 0.0, 0.1)
    };
    let list = |lamps: &[Lamp]| Lamps {
        lamps: lamps.to_vec(),
    };
    let found = list(&[of("wall-1", 5.0), of("ball-1", 2.0)]);
    let bare = list(&[of("ball-1", 3.0), of("tube-1", 1.0)]);
    let joined = found.joined(bare);
    let all: Vec<_> = (joined.lamps.iter())
        .map(|lamp| (lamp.name.as_str(), lamp.power[0]))
        .collect();
    let expected = [
        ("wall-1", 5.0),
        ("ball-1", 3.0),
        ("ball-2", 2.0),
        ("tube-1", 1.0),
    ];
    assert_eq!(all, expected);
}
