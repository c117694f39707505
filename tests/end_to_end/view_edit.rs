//! Edits of a page at a server: what is shown is what the program makes of the saved script.
#![cfg(unix)]

use crate::light_basis;
use crate::support::Workplace;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// `eagpt view` under test; killed when it goes.
struct Server {
    child: Child,
    host: String,
    token: String,
}

impl Server {
    fn start(place: &Workplace, arguments: &str) -> Self {
        let mut command = place.command(&format!("view {arguments} --json"));
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut told = BufReader::new(child.stdout.take().unwrap());
        told.read_line(&mut line).unwrap();
        let first: Value = serde_json::from_str(&line).unwrap();
        let url = first["url"].as_str().unwrap();
        let (host, token) = url
            .strip_prefix("http://")
            .unwrap()
            .split_once('/')
            .unwrap();
        Self {
            child,
            host: host.to_owned(),
            token: token.to_owned(),
        }
    }

    fn ask(&self, method: &str, place: &str, body: &str) -> Value {
        let (host, token, length) = (&self.host, &self.token, body.len());
        let request = format!(
            "{method} /{token}{place} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n\r\n{body}"
        );
        let mut stream = TcpStream::connect(host).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap()
    }

    fn act(&self, act: &Value) -> Value {
        self.ask("POST", "act", &act.to_string())
    }

    /// The scene that is shown, once its light fits.
    fn baked(&self) -> Value {
        let end = Instant::now() + Duration::from_secs(120);
        loop {
            let state = self.ask("GET", "state", "");
            if state["light"]["state"] == "fits" {
                return self.ask("GET", &format!("scene?id={}", state["scene"]), "");
            }
            assert!(Instant::now() < end, "{state}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have been killed by the test.
        let _killed = self.child.kill().is_ok();
        let _ended = self.child.wait().is_ok();
    }
}

/// The script of a page's acts, edited and baked by the program, is the scene of the page.
#[test]
fn a_page_shows_what_the_program_makes_of_its_script() {
    let place = light_basis::workplace();
    std::fs::copy(place.path("edits/lamps.json"), place.path("lamps.json")).unwrap();
    let arguments = "baked.ply --dataset room --photograph-size 0 --samples 8 --script e.toml";
    let server = Server::start(&place, arguments);
    let insert =
        json!({ "ball": { "centre": [0.3, 0.3, 0.6], "radius": 0.1, "albedo": [0.8, 0.2, 0.1] } });
    server.act(&json!({ "step": { "insert": insert } }));
    // The bake that has begun is no longer wanted.
    server.act(&json!({ "set-light": { "name": "left", "factor": [0.5, 0.25, 1] } }));
    let select = json!({ "lamp": "right" });
    let told =
        server.act(&json!({ "step": { "select": select, "then": [{ "move": [0, 0.1, 0] }] } }));
    assert_eq!(told["light"]["state"], "waiting");
    let shown = server.baked();
    let script = place.text("e.toml");
    assert_eq!(told["script"], script);

    place.succeeds("edit baked.ply e.toml --out e.ply");
    place.succeeds("bake e.ply --cameras room --samples 8 --out e-baked.ply");
    place.succeeds("export e-baked.ply --format html --out e.html");
    let page = place.text("e.html");
    let data = page.split_once("id=\"data\">").unwrap().1;
    assert_eq!(data.split_once("</script>").unwrap().0, shown["data"]);

    // Killed in the middle of a bake, it goes on from the script.
    server.act(&json!({ "step": { "select": "everything", "then": [{ "scale_albedo": 0.5 }] } }));
    let saved = place.text("e.toml");
    drop(server);
    assert_eq!(place.text("e.toml"), saved);
    let server = Server::start(&place, arguments);
    assert_eq!(server.ask("GET", "state", "")["script"], saved);
    server.act(&json!("undo"));
    assert_eq!(server.baked()["data"], shown["data"]);
}

/// A bake can be stopped and begun again; its light stays that of before meanwhile.
#[test]
fn a_bake_is_stopped_and_begun_again() {
    let place = light_basis::workplace();
    let arguments = "baked.ply --dataset room --photograph-size 0 --samples 4096 --no-lights";
    let server = Server::start(&place, &format!("{arguments} --script s.toml"));
    let everything = json!({ "select": "everything", "then": [{ "scale_albedo": 0.5 }] });
    server.act(&json!({ "step": everything }));
    let stopped = server.ask("POST", "light", "\"stop\"");
    assert_eq!(stopped["light"]["state"], "stale");
    std::thread::sleep(Duration::from_millis(300));
    let state = server.ask("GET", "state", "");
    assert_eq!(state["light"]["problem"], "the bake was stopped");
    let again = server.ask("POST", "light", "\"bake\"");
    assert_ne!(again["light"]["state"], "stale");
    let undone = server.act(&json!("undo"));
    assert_eq!(
        (&undone["scene"], &undone["light"]["state"]),
        (&json!(0), &json!("fits"))
    );
}
