//! A training that is watched.
#![cfg(unix)]

use crate::server::Server;
use crate::support::Workplace;
use serde_json::Value;

/// A page sees the scene and its losses while it trains, changes nothing, and no bit of the result
/// depends on it.
#[test]
fn a_training_is_watched_and_is_the_same() {
    let place = Workplace::new();
    let train = "train room --preset draft --gaussians 3000 --iterations 120 --albedo-iterations 8";
    let server = Server::start(&place, &format!("{train} --out watched --view"));
    let page = server.text("GET", "", "");
    let meta = page.split_once("id=\"meta\">").unwrap().1;
    let meta: Value = serde_json::from_str(meta.split_once("</script>").unwrap().0).unwrap();
    assert_eq!(meta["kind"], "training");
    assert_eq!(meta["title"], "watched");
    assert_eq!(meta["views"].as_array().unwrap().len(), 12);
    for place in ["act", "light", "still", "select"] {
        let told = server.ask("POST", place, "\"undo\"");
        assert_eq!(told["error"], "there is no such place");
    }
    assert_eq!(server.ask("POST", "state", "")["error"], "not this method");

    // Until it has ended, states follow each other; the last scene is that of the result.
    let mut shown = Value::Null;
    let mut last = server.ask("GET", "state", "");
    loop {
        if last["scene"] != 0 && last["scene"] != shown["id"] {
            let scene = server.ask("GET", &format!("scene?id={}", last["scene"]), "");
            // Another one may be there by now.
            if scene["error"].is_null() {
                shown = scene;
            }
        }
        if !last["end"].is_null() {
            break;
        }
        let after = format!("state?after={}", last["revision"]);
        last = server.ask("GET", &after, "");
    }
    assert_eq!(last["end"], "The training has ended.");
    let stages = last["stages"].as_array().unwrap();
    let ends: Vec<_> = stages
        .iter()
        .map(|s| (&s["name"], &s["iteration"]))
        .collect();
    assert_eq!(
        serde_json::json!(ends).to_string(),
        r#"[["radiance",120],["albedo",8]]"#
    );
    let points = stages[0]["points"].as_array().unwrap();
    assert_eq!(points.len(), 120);
    assert!(points[119][1].as_f64().unwrap() < points[0][1].as_f64().unwrap());
    assert_eq!(
        (&shown["id"], &shown["meta"]["num"]),
        (&last["scene"], &last["num"])
    );

    let (status, messages) = server.ended();
    assert!(status.success(), "{messages:?}");
    assert!(messages.iter().all(|message| message["message"] != "scene"));
    place.succeeds(&format!("{train} --out alone"));
    assert!(place.bytes("watched/scene.ply") == place.bytes("alone/scene.ply"));
    // Without the lamps beside it, of which the page of a training knows nothing.
    std::fs::copy(place.path("watched/scene.ply"), place.path("w.ply")).unwrap();
    place.succeeds("export w.ply --format html --out w.html");
    let whole = place.text("w.html");
    let data = whole.split_once("id=\"data\">").unwrap().1;
    assert!(data.split_once("</script>").unwrap().0 == shown["data"]);
}

#[test]
fn a_port_that_is_taken_is_told_before_the_training() {
    let place = Workplace::new();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    place.fails_cleanly(
        &format!("train room --out run --view --view-port {}", address.port()),
        &[&address.to_string()],
    );
    assert!(!place.path("run/log.jsonl").exists());
    let alone = place.run("train room --out run --view-port 80");
    assert_eq!(alone.status.code(), Some(2), "a port without a page");
}
