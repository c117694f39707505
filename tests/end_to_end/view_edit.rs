//! Edits of a page at a server: what is shown is what the program makes of the saved script.
#![cfg(unix)]

use crate::light_basis;
use crate::server::Server;
use serde_json::json;
use std::time::Duration;

/// The script of a page's acts, edited and baked by the program, is the scene of the page.
#[test]
fn a_page_shows_what_the_program_makes_of_its_script() {
    let place = light_basis::workplace();
    std::fs::copy(place.path("edits/lamps.json"), place.path("lamps.json")).unwrap();
    let arguments = "baked.ply --dataset room --photograph-size 0 --samples 8 --script e.toml";
    let server = Server::start(&place, &format!("view {arguments}"));
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
    let server = Server::start(&place, &format!("view {arguments}"));
    assert_eq!(server.ask("GET", "state", "")["script"], saved);
    server.act(&json!("undo"));
    assert_eq!(server.baked()["data"], shown["data"]);
}

/// A bake can be stopped and begun again; its light stays that of before meanwhile.
#[test]
fn a_bake_is_stopped_and_begun_again() {
    let place = light_basis::workplace();
    let arguments = "baked.ply --dataset room --photograph-size 0 --samples 4096 --no-lights";
    let server = Server::start(&place, &format!("view {arguments} --script s.toml"));
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
