//! `eagpt edit`: scripts in, scenes and records out.

use crate::support::Workplace;
use eagpt_scene::ply;
use serde_json::Value;
use std::path::Path;

/// The example that the README shows, which fits any room: lamps out, a ball light in.
const BALL: &str = "kitchen-light-ball.toml";

/// A room with a trained scene `run/scene.ply` and the example scripts in `scripts`.
fn workplace() -> Workplace {
    let place = Workplace::trained();
    std::fs::create_dir(place.path("scripts")).unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("edit/examples");
    for entry in std::fs::read_dir(examples).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        std::fs::copy(&path, place.path("scripts").join(name)).unwrap();
    }
    place
}

#[test]
fn examples_that_fit_any_room_run() {
    let place = workplace();
    // The lamp first: another script imports it.
    place.succeeds("edit run/scene.ply scripts/make-lamp.toml --out scripts/lamp.ply");
    for name in [
        "kitchen-light-ball",
        "kitchen-light-balls",
        "kitchen-insert-planes",
        "kitchen-diffuse-ball",
        "kitchen-imported-lamp",
    ] {
        place.succeeds(&format!(
            "edit run/scene.ply scripts/{name}.toml --out edits/{name}.ply"
        ));
        let edited = ply::read_gaussians(&place.path(&format!("edits/{name}.ply"))).unwrap();
        let record = place.json(&format!("edits/{name}.record.json"));
        let steps = record["options"]["steps"].as_array().unwrap();
        assert_eq!(steps.last().unwrap()["num_gaussians"], edited.len());
        assert_eq!(record["outputs"][0], format!("{name}.ply"));
    }
    place.succeeds("render edits/kitchen-light-ball.ply --cameras room --mode path --spp 4 --views 000 --out out");
}

#[test]
fn the_record_tells_what_went_in_and_a_replay_gives_the_same_bits() {
    let place = workplace();
    let edit = format!("edit run/scene.ply scripts/{BALL}");
    place.succeeds(&format!("{edit} --out a.ply --threads 1"));
    place.succeeds(&format!("{edit} --out b.ply --threads 2"));
    assert_eq!(place.bytes("a.ply"), place.bytes("b.ply"));
    let record = place.json("a.record.json");
    assert_eq!(record["command"], "edit");
    let inputs = record["inputs"].as_array().unwrap();
    for (input, file) in inputs
        .iter()
        .zip(["run/scene.ply", "scripts/kitchen-light-ball.toml"])
    {
        assert_eq!(input["path"], file);
        let digest = blake3::hash(&place.bytes(file)).to_hex().to_string();
        assert_eq!(input["blake3"], digest);
    }
    // Only the ball emits: 12 everywhere.
    let edited = ply::read_gaussians(&place.path("a.ply")).unwrap();
    let lit: Vec<_> = edited.iter().filter(|g| g.emission >= 0.1).collect();
    assert!(lit.len() == 2500 && lit.iter().all(|g| g.radiance.x == 12.0));
}

#[test]
fn a_dry_run_tells_everything_and_writes_nothing() {
    let place = workplace();
    let before = place.contents("");
    let edit = format!("edit run/scene.ply scripts/{BALL} --dry-run");
    let text = place.succeeds(&edit);
    for part in [
        "step[0], line 13 (Window and lamps out): select ",
        "then gone",
        "insert 2500 Gaussians at [0.75",
    ] {
        assert!(text.contains(part), "no `{part}` in:\n{text}");
    }
    let lines = place.succeeds(&format!("{edit} --json"));
    let messages: Vec<Value> = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(messages.len(), 2);
    assert_eq!(messages[1]["message"], "step");
    assert_eq!(messages[1]["num_selected"], 2500);
    place.succeeds(&format!("{edit} --out a.ply"));
    assert_eq!(place.contents(""), before);
    assert_eq!(
        place.run("edit run/scene.ply a.toml").status.code(),
        Some(2)
    );
}

#[test]
fn scripts_that_cannot_be_change_nothing() {
    let place = workplace();
    let insert = "[[step]]\ninsert.ball = { centre = [0, 0, 1], radius = 0.1, albedo = 0.5 }\n";
    for (second, parts) in [
        (
            "[[step]]\nselect = \"everything\"\nthem = [\"remove\"]\n",
            ["line 5", "step[1].them", "unknown field"],
        ),
        (
            "[[step]]\nselect.sphere = { centre = [99, 0, 0], radius = 1 }\nthen = [\"remove\"]\n",
            ["line 4", "step[1].select", "selects nothing"],
        ),
        (
            "[[step]]\nimport.file = \"nowhere/lamp.ply\"\n",
            ["line 4", "step[1].import.file", "nowhere/lamp.ply"],
        ),
        (
            "[[step]]\nselect = \"everything\"\nthen = [{ scale = { factor = -1 } }]\n",
            [
                "line 5",
                "step[1].then[0].scale.factor",
                "-1 is not above 0",
            ],
        ),
        (
            "[[step]]\nselect = \"lamps\"\nthen = [\"remove\"]\n",
            ["line 4", "step[1].select", "`lamps`"],
        ),
    ] {
        place.write("scripts/a.toml", format!("{insert}{second}"));
        let mut parts = parts.to_vec();
        parts.push("scripts/a.toml");
        for how in ["--out out/e.ply", "--dry-run"] {
            place.fails_cleanly(&format!("edit run/scene.ply scripts/a.toml {how}"), &parts);
        }
    }
    place.fails_cleanly(
        "edit none.ply scripts/make-lamp.toml --out e.ply",
        &["none.ply"],
    );
    // Twice the largest number there is.
    place.write(
        "scripts/a.toml",
        "[[step]]\nselect = \"everything\"\nthen = [{ set_radiance = 3e38 }, { scale_light = 2 }]\n",
    );
    place.fails_cleanly(
        "edit run/scene.ply scripts/a.toml --out e.ply",
        &["e.ply", "radiances_0", "inf"],
    );
}

#[test]
fn nothing_is_replaced_that_no_edit_made() {
    let place = workplace();
    let edit = format!("edit run/scene.ply scripts/{BALL}");
    place.fails_cleanly(
        &format!("{edit} --out run/scene.ply --force"),
        &["run/scene.ply", "an input"],
    );
    place.fails_cleanly(
        &format!("{edit} --out scripts/{BALL} --force"),
        &[BALL, "an input"],
    );
    place.succeeds(&format!("{edit} --out e.ply"));
    place.fails_cleanly(&format!("{edit} --out e.ply"), &["e.ply", "--force"]);
    place.succeeds(&format!("{edit} --out e.ply --force"));
    place.write("other.ply", place.bytes("run/scene.ply"));
    place.fails_cleanly(
        &format!("{edit} --out other.ply --force"),
        &["other.record.json", "no record of this program"],
    );
    place.write("other.record.json", place.bytes("run/record.json"));
    place.fails_cleanly(
        &format!("{edit} --out other.ply --force"),
        &["other.record.json", "`train`"],
    );
}
