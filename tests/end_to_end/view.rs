//! A scene as a page for a browser. What the page shows is tested in a browser, by
//! `viewer/page/test`.

use crate::light_basis;
use crate::support::Workplace;
#[cfg(unix)]
use std::io::{BufRead, BufReader, Read, Write};
#[cfg(unix)]
use std::net::TcpStream;
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

/// A server that was interrupted.
#[cfg(unix)]
struct Served {
    /// The words of the page on itself.
    meta: serde_json::Value,
    warning: Option<String>,
    /// Standard error.
    told: String,
    /// The last message.
    last: serde_json::Value,
}

/// Serves, loads the page once, and interrupts.
#[cfg(unix)]
fn served(place: &Workplace, arguments: &str) -> Served {
    let mut command = place.command(&format!("{arguments} --json"));
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut server = command.spawn().unwrap();
    let mut messages = BufReader::new(server.stdout.take().unwrap())
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(&line.unwrap()).unwrap())
        .peekable();
    let warning = messages.next_if(|message| message["message"] == "warning");
    let first = messages.next().unwrap();
    let url = first["url"].as_str().unwrap();
    let (host, place) = url
        .strip_prefix("http://")
        .unwrap()
        .split_once('/')
        .unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    let request = format!("GET /{place} HTTP/1.1\r\nHost: {host}\r\n\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut page = String::new();
    stream.read_to_string(&mut page).unwrap();
    let id = server.id().to_string();
    let signal = Command::new("kill").args(["-INT", &id]).status().unwrap();
    assert!(signal.success());
    let last = messages.next().unwrap();
    let mut told = String::new();
    let mut stderr = server.stderr.take().unwrap();
    stderr.read_to_string(&mut told).unwrap();
    assert!(server.wait().unwrap().success(), "{told}");
    let meta = serde_json::from_str(part(&page, "meta")).unwrap();
    Served {
        meta,
        warning: warning.map(|message| message["text"].as_str().unwrap().to_owned()),
        told,
        last,
    }
}

#[cfg(unix)]
#[test]
fn a_server_that_stops_says_where_the_script_is() {
    let place = light_basis::workplace();
    let without = served(&place, "view baked.ply");
    assert!(
        without.told.contains("the server stops"),
        "{}",
        without.told
    );
    assert_eq!(without.last["script"], serde_json::Value::Null);
    place.write(
        "baked.view.toml",
        "[[step]]\nset_light = { left = [1, 2, 3] }\n",
    );
    let with = served(&place, "view baked.ply");
    assert_eq!(with.last["script"], "baked.view.toml");
}

/// The page of a run has the views of the dataset that the run's records name.
#[cfg(unix)]
#[test]
fn a_run_is_shown_with_its_dataset() {
    let place = Workplace::trained();
    let names = |served: &Served| {
        let views = served.meta["views"].as_array().unwrap();
        let names: Vec<_> = views.iter().map(|v| v["name"].to_string()).collect();
        names
    };
    let run = served(&place, "view run --photograph-size 0");
    assert_eq!(run.meta["title"], "run");
    let file = "view run/scene.ply --dataset room --photograph-size 0";
    assert_eq!(names(&run), names(&served(&place, file)));
    assert_eq!(names(&run).len(), 12);

    // That of a project, whose paths are relative to its own folder.
    std::fs::create_dir_all(place.path("runs/room")).unwrap();
    std::fs::rename(place.path("run"), place.path("runs/room/train")).unwrap();
    std::fs::create_dir(place.path("projects")).unwrap();
    std::fs::rename(place.path("room"), place.path("projects/room")).unwrap();
    let project = place.path("projects/p.toml");
    let record = serde_json::json!({ "version": "", "project": project, "steps": {} });
    place.write("runs/room/run.json", record.to_string());
    let run = served(&place, "view runs/room --max-views 3");
    assert_eq!(
        (run.meta["title"].as_str(), names(&run).len()),
        (Some("room"), 3)
    );
    place.write(
        "projects/p.toml",
        "out = \"../runs/room\"\ndataset = \"room\"\n",
    );
    let of_project = served(&place, "view projects/p.toml --max-views 3");
    assert_eq!(names(&of_project), names(&run));
    for (name, source) in [("r", "runs/room"), ("p", "projects/p.toml")] {
        place.succeeds(&format!(
            "export {source} --format html --max-views 3 --out {name}.html"
        ));
    }
    assert_eq!(place.text("r.html"), place.text("p.html"));
    let meta: serde_json::Value =
        serde_json::from_str(part(&place.text("r.html"), "meta")).unwrap();
    assert_eq!(meta["views"], of_project.meta["views"]);
    place.write(
        "given.toml",
        "dataset = \"projects/room\"\nscene = \"runs/room/train/scene.ply\"\n",
    );
    let given = served(&place, "view given.toml --max-views 3");
    assert_eq!(
        (given.meta["title"].as_str(), names(&given)),
        (Some("given"), names(&run))
    );
    place.write("new.toml", "dataset = \"projects/room\"\n");
    place.fails_cleanly("view new.toml", &["new.toml", "has not been run"]);

    // Not the dataset any more: shown without.
    let cameras = place.path("projects/room/transforms.json");
    let text = std::fs::read_to_string(&cameras).unwrap();
    std::fs::write(&cameras, text + "\n").unwrap();
    let run = served(&place, "view runs/room");
    assert_eq!(names(&run).len(), 0);
    let lost = "room/transforms.json: the dataset of the training is not there or has changed";
    assert!(
        run.warning.as_ref().unwrap().contains(lost),
        "{:?}",
        run.warning
    );
    let named = served(
        &place,
        "view runs/room --dataset projects/room --max-views 2",
    );
    assert_eq!(names(&named).len(), 2);
    assert_eq!(named.warning, None);
    place.fails_cleanly(
        "view runs/room --max-views 3",
        &["--max-views", "--dataset"],
    );
    place.fails_cleanly("view projects", &["projects", "no scene.ply"]);
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
