//! The places of edits: steps, selections, stills.

use super::*;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;

/// The places of edits answer: a scene for a step, which Gaussians a selector selects.
#[test]
fn a_step_makes_another_scene() {
    let server = Running::new();
    let ball = json!({ "ball": { "centre": [0, 0, 3], "radius": 0.2, "radiance": 4 } });
    let told = server.act(&json!({ "step": { "insert": ball } }).to_string());
    // Without cameras there is no bake, and the state says so.
    assert_eq!(told["light"]["state"], "stale");
    let id = told["scene"].as_u64().unwrap();
    assert!(id > 0);
    let scene = server.told("GET", &format!("scene?id={id}"), "");
    assert_eq!(scene["id"], id);
    let num = scene["meta"]["num"].as_u64().unwrap();
    assert!(num > 300, "{num}");

    let near = json!({ "select": { "half_space": { "point": [0, 0, 2], "normal": "z" } } });
    let selected = server.told("POST", "select", &near.to_string());
    assert_eq!(selected["scene"], id);
    let bits = STANDARD.decode(selected["bits"].as_str().unwrap()).unwrap();
    let counted: u32 = bits.iter().map(|byte| byte.count_ones()).sum();
    assert!(counted > 5 && u64::from(counted) < num - 200);
    assert_eq!(selected["num"], counted);
    assert!(selected["bounds"][0][2].as_f64().unwrap() > 2.7);
    // Nothing was done with them.
    assert_eq!(server.told("GET", "state", "")["script"], told["script"]);

    let undone = server.act("\"undo\"");
    assert_eq!(
        (&undone["scene"], &undone["light"]["state"]),
        (&json!(0), &json!("fits"))
    );
    is(&server.own("GET", &format!("scene?id={id}"), ""), "404");
    let again = server.act("\"redo\"")["scene"].as_u64().unwrap();
    let redone = server.told("GET", &format!("scene?id={again}"), "");
    assert_eq!(
        (&redone["data"], &redone["meta"]),
        (&scene["data"], &scene["meta"])
    );
}

/// The camera of a still, as pages send it.
fn still(size: u32, samples: u32) -> Value {
    let pose = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 4, 0, 0, 0, 1];
    json!({
        "path": {
            "camera_type": "perspective",
            "render_width": size,
            "render_height": 8,
            "fps": 24,
            "camera_path": [{ "camera_to_world": pose, "fov": 50, "aspect": 1 }],
        },
        "samples": samples,
        "exposure": 0,
        "toneMap": "srgb",
    })
}

#[test]
fn stills_are_made_and_no_other_file_is_shown() {
    let server = Running::new();
    let told = server.told("POST", "still", &still(8, 4).to_string());
    let file = told["stills"][0]["file"].as_str().unwrap().to_owned();
    assert!(file.ends_with("stills/still-001.png"), "{file}");
    let end = std::time::Instant::now() + Duration::from_secs(60);
    while server.told("GET", "state", "")["stills"][0]["state"]["is"] != "done" {
        assert!(
            std::time::Instant::now() < end,
            "{}",
            server.told("GET", "state", "")
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    let answer = server.own("GET", "still?index=0", "");
    is(&answer, "200");
    assert!(answer.contains("image/png"));
    for extension in ["png", "exr", "json"] {
        let path = std::path::Path::new(&file).with_extension(extension);
        assert!(path.is_file(), "{}", path.display());
    }
    let place = |place: &str| server.own("GET", place, "");
    for wrong in [
        "still?index=1",
        "still",
        "scene?id=0",
        "scene",
        "scene?id=7",
    ] {
        is(&place(wrong), "404");
    }
    for wrong in [
        "still?index=../x",
        "still?index=-1",
        "scene?id=",
        "still?file=x",
    ] {
        is(&place(wrong), "400");
    }
    for wrong in [still(5000, 4), still(8, 0), still(8, 10_000), still(0, 4)] {
        is(&server.own("POST", "still", &wrong.to_string()), "422");
    }
    let mut other = still(8, 4);
    other["file"] = json!("/tmp/x.png");
    is(&server.own("POST", "still", &other.to_string()), "400");
    other = still(8, 4);
    other["toneMap"] = json!("x");
    is(&server.own("POST", "still", &other.to_string()), "422");
    assert_eq!(
        server.told("GET", "state", "")["stills"]
            .as_array()
            .unwrap()
            .len(),
        1
    );
}

#[test]
fn places_of_edits_are_for_those_who_know_the_token() {
    let server = Running::new();
    let host = server.address.to_string();
    let own = format!("/{}", server.token);
    let ask =
        |method: &str, path: &str, more: &str| server.request(method, path, &host, more, "{}");
    for (method, place) in [
        ("GET", "scene"),
        ("GET", "still"),
        ("POST", "select"),
        ("POST", "light"),
        ("POST", "still"),
    ] {
        is(
            &ask(method, &format!("/{}/{place}", "0".repeat(32)), ""),
            "403",
        );
        is(
            &ask(
                method,
                &format!("{own}/{place}"),
                "Origin: http://example.org\r\n",
            ),
            "403",
        );
        is(
            &server.request(method, &format!("{own}/{place}"), "example.org", "", ""),
            "403",
        );
        is(&ask("PUT", &format!("{own}/{place}"), ""), "405");
    }
    for place in ["select", "light", "still", "act"] {
        is(&server.own("POST", place, "{"), "400");
        is(
            &server.own("POST", place, "{\"file\":\"/etc/passwd\"}"),
            "400",
        );
    }
    let import = r#"{"step":{"import":{"file":"/etc/passwd"}}}"#;
    is(&server.own("POST", "act", import), "400");
    is(
        &server.own("POST", "select", r#"{"select":{"import":"x"}}"#),
        "422",
    );
    is(&server.own("GET", "stills/still-001.png", ""), "404");
    is(&server.own("GET", "../still-001.png", ""), "404");
}
