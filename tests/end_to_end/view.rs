//! A scene as a page for a browser. What the page shows is tested in a browser, by
//! `viewer/page/test`.

use crate::light_basis;
use crate::support::Workplace;
#[cfg(unix)]
use std::io::{BufRead, BufReader, Read};
#[cfg(unix)]
use std::process::{Command, Stdio};

/// The value of an element of the page that holds data.
fn part<'a>(page: &'a str, id: &str) -> &'a str {
    let start = page.split_once(&format!("id=\"{id}\">")).unwrap().1;
    start.split_once("</script>").unwrap().0
}

#[test]
fn a_page_has_the_scene_and_its_views() {
    let place = Workplace::trained();
    let export = "export run/scene.ply --format html";
    let told = place.succeeds(&format!("{export} --dataset room --out room.html --json"));
    let done: serde_json::Value = serde_json::from_str(told.lines().last().unwrap()).unwrap();
    let error = &done["quantisation_error"];
    assert!(error["radiance"].as_f64().unwrap() < 0.0028, "{done}");
    assert!(error["position"].as_f64().unwrap() > 0.0, "{done}");
    let page = String::from_utf8(place.bytes("room.html")).unwrap();
    let meta: serde_json::Value = serde_json::from_str(part(&page, "meta")).unwrap();
    let views = meta["views"].as_array().unwrap();
    assert!(!views.is_empty());
    for view in views {
        let photograph = view["photograph"].as_str().unwrap();
        assert!(photograph.starts_with("data:image/jpeg;base64,"));
    }
    assert!(part(&page, "data").len() > 1000);

    place.fails_cleanly(
        &format!("{export} --out room.html"),
        &["room.html", "--force"],
    );
    place.fails_cleanly(
        &format!("{export} --dataset room --views 999 --out b.html"),
        &["--views", "there is no view `999`"],
    );
    place.fails_cleanly(
        "export run/scene.ply --format 3dgs --tone-map agx --out b.ply",
        &["--tone-map", "--format html"],
    );
    place.fails_cleanly(
        "export run/scene.ply --format 3dgs --no-lights --out b.ply",
        &["--no-lights", "--format html"],
    );
    let first = views[0]["name"].as_str().unwrap();
    place.succeeds(&format!(
        "{export} --dataset room --views {first} --photograph-size 0 --title Room --out c.html"
    ));
    let page = String::from_utf8(place.bytes("c.html")).unwrap();
    let meta: serde_json::Value = serde_json::from_str(part(&page, "meta")).unwrap();
    assert_eq!(meta["views"].as_array().unwrap().len(), 1);
    assert!(meta["views"][0]["photograph"].is_null() && meta["title"] == "Room");
}

/// Serves until the first message, then interrupts; what stands on standard error.
#[cfg(unix)]
fn interrupted(place: &Workplace, arguments: &str) -> String {
    let mut command = place.command(&format!("{arguments} --json"));
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut server = command.spawn().unwrap();
    let mut messages = BufReader::new(server.stdout.take().unwrap()).lines();
    let first = messages.next().unwrap().unwrap();
    assert!(first.contains("listening"), "{first}");
    let id = server.id().to_string();
    let signal = Command::new("kill").args(["-INT", &id]).status().unwrap();
    assert!(signal.success());
    let last = messages.next().unwrap().unwrap();
    let mut told = String::new();
    server
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut told)
        .unwrap();
    assert!(server.wait().unwrap().success(), "{told}");
    told + &last
}

#[cfg(unix)]
#[test]
fn a_server_that_stops_says_where_the_script_is() {
    let place = light_basis::workplace();
    let told = interrupted(&place, "view baked.ply");
    assert!(told.contains("the server stops"), "{told}");
    assert!(told.contains("\"script\":null"), "{told}");
    place.write(
        "baked.view.toml",
        "[[step]]\nset_light = { left = [1, 2, 3] }\n",
    );
    let told = interrupted(&place, "view baked.ply");
    assert!(told.contains("\"script\":\"baked.view.toml\""), "{told}");
}

#[test]
fn lights_of_another_scene_can_be_left_out() {
    let place = light_basis::workplace();
    std::fs::copy(place.path("baked.lights"), place.path("run/scene.lights")).unwrap();
    let export = "export run/scene.ply --format html --out run.html";
    let problem = ["run/scene.lights", "Gaussians", "--no-lights leaves it out"];
    place.fails_cleanly(export, &problem);
    place.fails_cleanly("view run/scene.ply", &problem);
    place.succeeds(&format!("{export} --no-lights"));
    let page = String::from_utf8(place.bytes("run.html")).unwrap();
    let meta: serde_json::Value = serde_json::from_str(part(&page, "meta")).unwrap();
    assert_eq!(meta["lights"], serde_json::json!([]));
    let export = "export baked.ply --format html --no-lights --out baked.html";
    place.succeeds(export);
    let page = String::from_utf8(place.bytes("baked.html")).unwrap();
    let meta: serde_json::Value = serde_json::from_str(part(&page, "meta")).unwrap();
    assert_eq!(meta["lights"], serde_json::json!([]));
}
